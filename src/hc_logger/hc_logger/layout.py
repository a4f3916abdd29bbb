"""Messages of fixed size after their header as numpy records: millions of them at once.

What is where says hc_msgs_py.cdr. Only strings and unbounded sequences make the places of later
fields vary. The messages of this suite (and wrenches and poses) have one string, frame_id, which
hardly ever changes within a recording; so for each length of frame_id there is one numpy dtype.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg

from hc_logger.bag import Columns
from hc_logger.definitions import TypeDefinition, damaged_definition
from hc_logger.errors import BagError
from hc_msgs_py.cdr import (
    ENCAPSULATION,
    FRAME_LENGTH_OFFSET,
    FRAME_OFFSET,
    HEAD,
    LITTLE_ENDIAN,
    NUMBERS,
    aligned,
)

LONGEST_RECORD = 65536
"""Bytes; the longest message of the suite that holds one sample has a few hundred."""
LONGEST_ARRAYS = 1 << 22
"""Bytes of a message that holds many."""
LENGTH = "length of "
"""Before the name of a sequence: no field of a message is called so."""


@functools.lru_cache(maxsize=64)
def record_dtype(definition: TypeDefinition, frame_bytes: int, elements: int = 0) -> np.dtype[Any]:
    """Return the dtype of a message that has no variable part but its header's frame_id.

    Fields have the names of the message's fields, nested ones joined by dots; the header gives
    header.stamp.sec, header.stamp.nanosec and header.frame_id (fixed bytes). Of a sequence
    LENGTH + its name stands before it.

    Args:
        definition: the message type.
        frame_bytes: length of frame_id with its closing zero byte.
        elements: of every bounded sequence with the smallest bound, where there are sequences; one
            whose bound is a multiple of that has so many times the elements. 0: there are none.

    Raises:
        BagError: if the type has other variable parts, or its definition is damaged.
    """
    try:
        return _record_dtype(definition, frame_bytes, elements)
    except BagError:
        raise
    except Exception as error:  # rosbags and numpy over a damaged definition
        raise BagError(damaged_definition(definition)) from error


def _record_dtype(definition: TypeDefinition, frame_bytes: int, elements: int) -> np.dtype[Any]:
    types = get_types_from_msg(definition.text, definition.name)
    smallest = _smallest_bound(types[definition.name][1]) if elements else 0
    longest = LONGEST_ARRAYS if elements else LONGEST_RECORD
    names: list[str] = []
    formats: list[Any] = []
    offsets: list[int] = []
    position = HEAD

    def place(name: str, kind: str, count: int | None) -> None:
        nonlocal position
        dtype = np.dtype(f"<{NUMBERS[kind]}")
        position = aligned(position, dtype.itemsize)
        names.append(name)
        formats.append(dtype if count is None else (dtype, (count,)))
        offsets.append(position)
        position += dtype.itemsize * (1 if count is None else count)
        if position > HEAD + longest:
            raise BagError(damaged_definition(definition))

    def walk(type_name: str, prefix: str) -> None:
        nonlocal position
        for name, (node, detail) in types[type_name][1]:
            full = prefix + name
            if node == Nodetype.NAME:
                walk(detail, full + ".")
            elif node == Nodetype.BASE and detail[0] in NUMBERS:
                place(full, detail[0], None)
            elif (
                node == Nodetype.ARRAY
                and detail[0][0] == Nodetype.BASE
                and detail[0][1][0] in NUMBERS
            ):
                place(full, detail[0][1][0], detail[1])
            elif (
                node == Nodetype.SEQUENCE
                and smallest
                and detail[0][0] == Nodetype.BASE
                and detail[0][1][0] in NUMBERS
                and detail[1] % smallest == 0
            ):
                place(LENGTH + full, "uint32", None)
                place(full, detail[0][1][0], elements * (detail[1] // smallest))
            elif node == Nodetype.BASE and full == "header.frame_id":
                position = aligned(position, 4) + 4
                names.append(full)
                formats.append(f"S{frame_bytes}")
                offsets.append(position)
                position += frame_bytes
            else:
                raise BagError(f"{definition.name}: field {full} has no fixed size")

    walk(definition.name, "")
    return np.dtype(
        {
            "names": names,
            "formats": formats,
            "offsets": offsets,
            "itemsize": position,
        }
    )


def _smallest_bound(fields: Any) -> int:
    """Return the smallest bound of a message's sequences, 0 if one has none or there are none."""
    return min((d[1] for _, (node, d) in fields if node == Nodetype.SEQUENCE), default=0)


INTEGER, REAL, FLAG = "iu", "f", "biu"
"""Kinds of numbers, as numpy's dtype.kind has them."""
_STAMP = {"header.stamp.sec": INTEGER, "header.stamp.nanosec": INTEGER}


def records(
    definition: TypeDefinition, columns: list[Columns], needed: Mapping[str, str] | None = None
) -> NDArray[Any]:
    """Return all messages of a topic as one array of records, in the order of their log times.

    The frame_id is left out of the records (its length may differ between messages).

    Args:
        definition: the topic's type, with a header and of fixed size after it.
        columns: what Bag.columns() gives.
        needed: fields that are to be there beside the header's stamp, and their kinds.

    Raises:
        BagError: if the type has other variable parts, or lacks a field that is needed: a bag
            carries its own definitions, and says of a type whatever it says.
    """
    total = sum(len(block.order) for block in columns)
    empty = record_dtype(definition, 1)
    for name, kinds in (_STAMP | dict(needed or {})).items():
        if name not in (empty.names or ()) or empty[name].kind not in kinds:
            raise BagError(f"{definition.name} has no field {name} in this bag, or of another kind")
    kept = [name for name in empty.names or () if name != "header.frame_id"]
    target = np.dtype([(name, empty[name]) for name in kept])
    out = np.empty(total, target)
    for block in columns:
        if block.data.shape[1] < FRAME_OFFSET:
            raise BagError(f"a message of type {definition.name} is cut off")
        frame_bytes = (
            np.ascontiguousarray(block.data[:, FRAME_LENGTH_OFFSET:FRAME_OFFSET])
            .view("<u4")
            .reshape(-1)
        )
        if int(frame_bytes.max(initial=0)) > block.data.shape[1]:
            raise BagError(f"a message of type {definition.name} is damaged")
        for frame in np.unique(frame_bytes).tolist():
            dtype = record_dtype(definition, frame)
            rows = block.data if np.all(frame_bytes == frame) else block.data[frame_bytes == frame]
            order = (
                block.order if len(rows) == len(block.order) else block.order[frame_bytes == frame]
            )
            if rows.shape[1] < dtype.itemsize or not np.all(rows[:, :2] == tuple(LITTLE_ENDIAN)):
                raise BagError(
                    f"a message is not little-endian CDR of type {definition.name}, "
                    "as its definition says"
                )
            view = np.ascontiguousarray(rows[:, : dtype.itemsize]).view(dtype).reshape(-1)
            for name in kept:
                out[name][order] = view[name]
    return out


def stamps(table: NDArray[Any]) -> NDArray[np.int64]:
    """Return the header stamps of records in ns, (n,) int64."""
    seconds = table["header.stamp.sec"].astype(np.int64)
    nanoseconds: NDArray[np.int64] = seconds * 1_000_000_000 + table["header.stamp.nanosec"]
    return nanoseconds


def encode(definition: TypeDefinition, frame_id: str, **fields: Any) -> NDArray[np.uint8]:
    """Return messages as a matrix of bytes, (n, length): row.tobytes() is one CDR message.

    Args:
        definition: a type with a header and of fixed size after it.
        frame_id: frame of all messages.
        **fields: (n,) array for each field, dots replaced by two underscores.

    Raises:
        BagError: if the type has other variable parts.
    """
    frame = frame_id.encode() + b"\0"
    dtype = record_dtype(definition, len(frame))
    count = len(next(iter(fields.values())))
    data = np.zeros((count, dtype.itemsize), np.uint8)
    data[:, :HEAD] = np.frombuffer(ENCAPSULATION, np.uint8)
    data[:, FRAME_LENGTH_OFFSET:FRAME_OFFSET] = np.frombuffer(
        len(frame).to_bytes(4, "little"), np.uint8
    )
    table = data.view(dtype).reshape(-1)
    table["header.frame_id"] = frame
    for name, values in fields.items():
        table[name.replace("__", ".")] = values
    return data
