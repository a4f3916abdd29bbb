"""Any recorded message as an object, by the definition that the bag itself carries.

For the few messages with strings and lists (configurations, joint states); layout.py is the way
for streams. rosbags does the decoding.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from hc_logger.definitions import TypeDefinition


@functools.lru_cache(maxsize=64)
def decoder(definition: TypeDefinition) -> Callable[[bytes], Any]:
    """Return a function that turns the CDR bytes of a message of this type into an object.

    The object has the message's fields as attributes; number lists are numpy arrays.
    """
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition.text, definition.name))

    def decode(data: bytes) -> Any:
        return store.deserialize_cdr(data, definition.name)

    return decode
