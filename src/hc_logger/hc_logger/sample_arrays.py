"""Samples of a bag that were recorded in messages of many (hc_msgs/IndenterSamples)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hc_logger.bag import Bag
from hc_logger.decoder import decoder
from hc_logger.errors import BagError
from hc_msgs_py.units import NANOSECONDS

STAMP, SEQUENCE, DISPLACEMENT, FORCE = "stamp", "sequence", "displacement", "force"
TABLE = np.dtype(
    [(STAMP, np.int64), (SEQUENCE, np.uint64), (DISPLACEMENT, np.float64), (FORCE, np.float64)]
)
"""Stamp [ns], number, displacement [m] and force [N] of a sample."""
_BLOCK = 65_536


def sample_blocks(bag: Bag, topic: str) -> Iterator[NDArray[np.void]]:
    """Yield the samples of a topic of this type in pieces of at least some ten thousand.

    Args:
        bag: has the topic.
        topic: name of a topic of type hc_msgs/IndenterSamples.

    Raises:
        BagError: if a message is none, or its arrays differ in length.
    """
    decode = decoder(bag.topics[topic].definition)
    pieces: list[NDArray[np.void]] = []
    count = 0
    for message in bag.messages({topic}):
        samples = decode(message.data)
        try:
            stamp = samples.header.stamp
            piece = np.empty(len(samples.time_offset), TABLE)
            first = int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)
            piece[STAMP] = first + np.asarray(samples.time_offset, np.int64)
            piece[SEQUENCE] = int(samples.sequence) + np.arange(len(piece), dtype=np.uint64)
            piece[DISPLACEMENT] = samples.displacement
            piece[FORCE] = samples.force
        except (AttributeError, TypeError, ValueError, OverflowError) as error:
            name = bag.topics[topic].definition.name
            raise BagError(f"{bag.path}: a message on {topic} is no {name}: {error}") from error
        pieces.append(piece)
        count += len(piece)
        if count >= _BLOCK:
            yield np.concatenate(pieces)
            pieces, count = [], 0
    if pieces:
        yield np.concatenate(pieces)


def all_samples(bag: Bag, topic: str) -> NDArray[np.void]:
    """Return the samples of a topic as one table.

    Raises:
        BagError: as `sample_blocks`.
    """
    return np.concatenate([np.empty(0, TABLE), *sample_blocks(bag, topic)])
