"""Estimates that travel many in a message (hc_msgs/HuntCrossleyEstimates), as records of one each.

The records are those of hc_msgs/HuntCrossleyEstimate without frame_id, so that who reads estimates
need not know how they travelled: bags (`estimates_of_bag`) and live messages (hc_bringup).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_logger.bag import Bag, Columns
from hc_logger.definitions import TypeDefinition, damaged_definition, installed_definition
from hc_logger.errors import BagError
from hc_logger.layout import LENGTH, record_dtype
from hc_logger.type_names import ESTIMATE_TYPE
from hc_msgs_py.cdr import FRAME_LENGTH_OFFSET, FRAME_OFFSET, LITTLE_ENDIAN
from hc_msgs_py.units import NANOSECONDS

_OFFSETS: Final = "time_offset"
_SECONDS, _NANOSECONDS = "header.stamp.sec", "header.stamp.nanosec"
_OF_ALL: Final = ("configuration_revision", "computation_time", "latency")
_NEEDED: Final = (_SECONDS, _NANOSECONDS, _OFFSETS, "sequence", *_OF_ALL)


def dtype_of_bytes(definition: TypeDefinition, data: NDArray[np.uint8]) -> np.dtype[Any]:
    """Return the dtype of a message of arrays, from what its bytes say of their lengths.

    Args:
        definition: of a type like hc_msgs/HuntCrossleyEstimates.
        data: the message, shape (length,).

    Raises:
        BagError: if the bytes are no such message, or the definition is none.
    """
    not_one = BagError(f"a message is not little-endian CDR of type {definition.name}")
    if len(data) < FRAME_OFFSET or tuple(data[:2]) != tuple(LITTLE_ENDIAN):
        raise not_one
    frame = _number(data, FRAME_LENGTH_OFFSET)
    if not 0 < frame <= len(data):
        raise not_one
    shortest = record_dtype(definition, frame, 1)
    if any(name not in (shortest.names or ()) for name in _NEEDED):
        raise BagError(f"{definition.name} of this bag lacks one of {', '.join(_NEEDED)}")
    place = shortest.fields[LENGTH + _OFFSETS][1]  # type: ignore[index]
    if len(data) < place + 4:
        raise not_one
    count = _number(data, place)
    # The count is believed only where so many elements fit, before anything is made of it.
    if not 0 < count <= len(data):
        raise not_one
    dtype = record_dtype(definition, frame, count)
    if len(data) < dtype.itemsize:
        raise not_one
    return dtype


def _number(data: NDArray[np.uint8], place: int) -> int:
    return int.from_bytes(data[place : place + 4].tobytes(), "little")


def each_estimate(messages: NDArray[Any]) -> NDArray[Any]:
    """Return a record for every estimate of messages that hold equally many.

    Args:
        messages: shape (m,), of a dtype that `dtype_of_bytes` gave.

    Returns:
        Records with the fields of hc_msgs/HuntCrossleyEstimate that the messages have, without
        frame_id, shape (m * count,): stamp, latency and computation time are those of each sample.

    Raises:
        BagError: if the arrays of a message differ in length.
    """
    names = messages.dtype.names or ()
    count = messages[_OFFSETS].shape[1]
    for name in names:
        if name.startswith(LENGTH):
            expected = messages[name.removeprefix(LENGTH)].shape[1]
            if (messages[name] != expected).any():
                raise BagError("a message of estimates has arrays that differ in length")
    single = record_dtype(installed_definition(ESTIMATE_TYPE), 1)
    kept = [name for name in single.names or () if name in names and name != "header.frame_id"]
    out = np.empty((len(messages), count), np.dtype([(name, single[name]) for name in kept]))
    offsets = messages[_OFFSETS]
    first = messages[_SECONDS].astype(np.int64) * NANOSECONDS + messages[_NANOSECONDS]
    for name in kept:
        if name not in _OF_ALL and name not in (_SECONDS, _NANOSECONDS):
            out[name] = messages[name].reshape(out[name].shape)
    out[_SECONDS], out[_NANOSECONDS] = np.divmod(first[:, None] + offsets, NANOSECONDS)
    out["configuration_revision"] = messages["configuration_revision"][:, None]
    out["computation_time"] = messages["computation_time"][:, None] / count
    since_last_s = (offsets[:, -1:] - offsets) * 1e-9
    out["latency"] = messages["latency"][:, None] + since_last_s
    return out.reshape(-1)


def estimates_of_bag(bag: Bag, topic: str) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Return the estimates on a topic of arrays, and when each was recorded (log time, ns).

    Raises:
        BagError: if the topic's type is none of estimates, or a message is damaged.
    """
    definition = bag.topics[topic].definition
    pieces: list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[Any]]] = []
    for block in bag.columns(topic):
        for rows, messages in _alike(definition, block):
            try:
                table = each_estimate(messages)
            except (KeyError, TypeError, ValueError, IndexError) as error:
                raise BagError(damaged_definition(definition)) from error
            count = len(table) // len(messages)
            pieces.append(
                (
                    np.repeat(block.order[rows], count),
                    np.repeat(block.log_time[rows], count),
                    table,
                )
            )
    if not pieces:
        return np.empty(0, [("sequence", "<u8")]), np.empty(0, np.int64)
    order, log_time, table = (np.concatenate(part) for part in zip(*pieces, strict=True))
    places = np.argsort(order, kind="stable")
    return table[places], log_time[places]


def _alike(
    definition: TypeDefinition, block: Columns
) -> Iterator[tuple[NDArray[np.int64], NDArray[Any]]]:
    """Yield the messages of one length in groups with one layout: rows, and records."""
    left = np.arange(len(block.data))
    while len(left):
        dtype = dtype_of_bytes(definition, block.data[left[0]])
        place = dtype.fields[LENGTH + _OFFSETS][1]  # type: ignore[index]
        head = [*range(FRAME_LENGTH_OFFSET, FRAME_OFFSET), *range(place, place + 4)]
        numbers = block.data[left][:, head]
        same = (numbers == numbers[0]).all(axis=1)
        rows = left[same]
        data = np.ascontiguousarray(block.data[rows][:, : dtype.itemsize])
        yield rows, data.view(dtype).reshape(-1)
        left = left[~same]


def log_times(columns: Sequence[Columns]) -> NDArray[np.int64]:
    """Return when each message of a topic was recorded [ns], in their order."""
    out = np.empty(sum(len(block.order) for block in columns), np.int64)
    for block in columns:
        out[block.order] = block.log_time
    return out


def merged(tables: Sequence[tuple[NDArray[Any], NDArray[np.int64]]]) -> NDArray[Any]:
    """Return the estimates of several topics in the order in which they were recorded, each once.

    Args:
        tables: of each topic records of hc_msgs/HuntCrossleyEstimate, and their log times [ns]. A
            stream may go over from one topic to the other, or be told on both.

    Returns:
        Records with the fields that all tables have.
    """
    filled = [(table, times) for table, times in tables if len(table)]
    if not filled:
        return np.empty(0, [("sequence", "<u8")])
    first = filled[0][0]
    if len(filled) == 1:
        return first
    names = first.dtype.names or ()
    common = [n for n in names if all(n in (t.dtype.names or ()) for t, _ in filled)]
    dtype = np.dtype([(name, first.dtype[name]) for name in common])
    table = np.concatenate([_fields(t, dtype) for t, _ in filled])
    columns = (table[name].tolist() for name in (_SECONDS, _NANOSECONDS, "sequence"))
    keys = list(zip(*columns, strict=True))
    known = set(keys[: len(first)])
    once = np.array([i < len(first) or key not in known for i, key in enumerate(keys)])
    order = np.argsort(np.concatenate([times for _, times in filled]), kind="stable")
    result: NDArray[Any] = table[order][once[order]]
    return result


def _fields(table: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    out = np.empty(len(table), dtype)
    for name in dtype.names or ():
        out[name] = table[name]
    return out
