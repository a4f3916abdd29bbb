"""Python classes of message and service types by their names; loads ROS when one is asked for."""

from __future__ import annotations

import difflib
import importlib
import importlib.util
from pathlib import Path
from typing import Any, Final

_EXAMPLES: Final = {
    "msg": "message type like std_msgs/msg/Header",
    "srv": "service type like std_srvs/srv/Trigger",
}


class UnknownInterfaceError(Exception):
    """There is no such type here; one line for the user.

    Attributes:
        misnamed: True if the text is no name of a type at all.
    """

    misnamed = False


def _is_of_types(package: str, kind: str) -> bool:
    """Whether a package has types, without running any of its code.

    Names come from bags and from whoever speaks in the same domain: no other module is imported.
    """
    if not package.isidentifier():
        return False
    try:
        found = importlib.util.find_spec(package)
    except (ImportError, ValueError):  # ValueError: a module without a specification
        return False
    places = (found.submodule_search_locations if found is not None else None) or ()
    return any(Path(place, kind, "__init__.py").is_file() for place in places)


def interface_class(type_name: str, kind: str = "msg") -> Any:
    """Return the Python class of a type.

    Args:
        type_name: for example "hc_msgs/msg/IndenterSample"; its middle may be left out.
        kind: "msg" or "srv".

    Raises:
        UnknownInterfaceError: if the name is not of that form or the type is not installed.
    """
    parts = type_name.split("/")
    if len(parts) == 2:
        parts.insert(1, kind)
    if len(parts) != 3 or parts[1] != kind or not all(parts):
        error = UnknownInterfaceError(f"{type_name!r} is not a {_EXAMPLES[kind]}")
        error.misnamed = True
        raise error
    what = _EXAMPLES[kind].split()[0]
    missing = UnknownInterfaceError(
        f"{what} type {'/'.join(parts)} is not installed here; install the package {parts[0]}"
    )
    if not _is_of_types(parts[0], kind):
        raise missing
    try:
        module = importlib.import_module(f"{parts[0]}.{kind}")
    except ImportError:
        raise missing from None
    found = getattr(module, parts[2], None)
    if found is None:
        names = [name for name in dir(module) if name[0].isupper()]
        close = difflib.get_close_matches(parts[2], names, n=1)
        hint = f"; did you mean {parts[0]}/{kind}/{close[0]}?" if close else ""
        raise UnknownInterfaceError(f"there is no {what} type {'/'.join(parts)}{hint}")
    return found
