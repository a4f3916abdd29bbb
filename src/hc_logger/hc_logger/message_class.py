"""Python classes of message types by their names."""

from __future__ import annotations

import importlib
from typing import Any

from hc_logger.errors import UnknownTypeError


def message_class(type_name: str) -> Any:
    """Return the Python class of a message type.

    Args:
        type_name: for example "hc_msgs/msg/IndenterSample".

    Raises:
        UnknownTypeError: if it is not installed.
    """
    package, _, name = type_name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        raise UnknownTypeError(
            f"message type {type_name} is not installed here; install the package {package}"
        ) from None
