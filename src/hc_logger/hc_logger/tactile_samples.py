"""One taxel of a bag with samples of a tactile array (hc_msgs/TactileSample), as a recording."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from hc_logger.bag import Bag
from hc_logger.decoder import decoder
from hc_logger.errors import BagError, WrongOptionError
from hc_logger.recorded import only_topic
from hc_logger.type_names import TACTILE_TYPE
from hc_msgs_py.topics import TACTILE_SAMPLE
from hc_msgs_py.units import METRE_IN_MM, NANOSECONDS

_BLOCK = 16_384
NOT_VERIFIED = (
    "estimates of an array are not verified, for no bag says with which settings they were made: "
    "hc estimate taxel.csv --filter ukf (or what array_estimator was told) computes one taxel's "
    "anew"
)
"""Why there is no --verify, and what there is in its place."""


def tactile_topic(bag: Bag) -> str | None:
    """Return the topic of the samples of an array; None if there is none.

    Raises:
        BagError: if there are several and none is the usual one.
    """
    return only_topic(bag, TACTILE_TYPE, TACTILE_SAMPLE)


def taxels_of(bag: Bag, topic: str) -> int:
    """Return how many taxels the first sample has; 0 without any.

    Raises:
        BagError: if that message is damaged.
    """
    return next((len(force) for _ns, _depth, force in islice(_samples(bag, topic), 1)), 0)


def rows_of_taxel(bag: Bag, topic: str, taxel: int) -> Iterator[NDArray[np.float64]]:
    """Yield time since the first sample [s], displacement [mm] and force [N], (rows, 3) a block.

    Samples of another size, which have no such taxel, are left out.

    Args:
        bag: has the topic.
        topic: of type hc_msgs/TactileSample.
        taxel: which one, counted row by row from 0.

    Raises:
        WrongOptionError: if no sample has such a taxel.
        BagError: if a message is damaged.
    """
    first_ns, most, block = None, 0, []
    for stamp_ns, depths_m, forces_n in _samples(bag, topic):
        most = max(most, len(forces_n))
        if taxel >= len(forces_n):
            continue
        first_ns = stamp_ns if first_ns is None else first_ns
        time_s = (stamp_ns - first_ns) * 1e-9
        block.append((time_s, depths_m[taxel] * METRE_IN_MM, forces_n[taxel]))
        if len(block) == _BLOCK:
            yield np.array(block)
            block = []
    if first_ns is None:
        has = f"taxels 0 to {most - 1}" if most else "no sample"
        raise WrongOptionError(f"{bag.path} has no taxel {taxel} on {topic}: it has {has}")
    if block:
        yield np.array(block)


def how_to_read_taxels(bag: Bag) -> str:
    """Return what to type for a bag that has but an array's samples; empty for any other."""
    topic = tactile_topic(bag)
    if topic is None or not (taxels := taxels_of(bag, topic)):
        return ""
    return (
        f"; {topic} is of an array of {taxels} taxels: hc bag convert {shlex.quote(str(bag.path))} "
        f"taxel.csv --taxel N (0 to {taxels - 1}, row by row) makes a table of one, which all "
        "commands take"
    )


def _samples(
    bag: Bag, topic: str
) -> Iterator[tuple[int, NDArray[np.float64], NDArray[np.float64]]]:
    """Yield stamp [ns], displacements [m] and forces [N] of each sample with as many of both."""
    decode = decoder(bag.topics[topic].definition)
    for message in bag.messages({topic}):
        try:
            sample = decode(message.data)
            stamp = sample.header.stamp
            stamp_ns = int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)
            depths_m = np.asarray(sample.displacement, np.float64)
            forces_n = np.asarray(sample.force, np.float64)
        except (AttributeError, TypeError, ValueError, OverflowError) as error:
            raise BagError(f"{bag.path}: a message on {topic} is damaged: {error}") from error
        if len(depths_m) == len(forces_n):
            yield stamp_ns, depths_m, forces_n
