"""Any recorded message as an object, by the definition that the bag itself carries.

For the few messages with strings and lists (configurations, joint states); layout.py is the way
for streams. mcap-ros2-support does the decoding.
"""

from __future__ import annotations

import contextlib
import functools
import io
from collections.abc import Callable
from typing import Any

from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from hc_logger.definitions import TypeDefinition, damaged_definition
from hc_logger.errors import BagError


@functools.lru_cache(maxsize=64)
def decoder(definition: TypeDefinition) -> Callable[[bytes], Any]:
    """Return a function that turns the CDR bytes of a message of this type into an object.

    The object has the message's fields as attributes; lists are Python lists. The function raises
    BagError for bytes that are no such message.

    Raises:
        BagError: if the definition cannot be understood.
    """
    schema = Schema(id=1, name=definition.name, encoding="ros2msg", data=definition.text.encode())
    try:
        with contextlib.redirect_stderr(io.StringIO()):  # its parser prints what it cannot read
            decode: Callable[[bytes], Any] | None = DecoderFactory().decoder_for("cdr", schema)
    except Exception as error:  # its errors over a damaged text are of many kinds
        raise BagError(damaged_definition(definition)) from error
    if decode is None:
        raise BagError(damaged_definition(definition))

    def checked(data: bytes) -> Any:
        try:
            return decode(data)
        except Exception as error:  # as above, over damaged bytes
            raise BagError(f"a message is no {definition.name}, as its definition says") from error

    return checked
