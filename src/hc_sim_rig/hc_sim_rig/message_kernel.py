"""Rows of the compiled rig into the numbers of its messages: one call for all topics.

A block of samples is made once in some milliseconds, and finds cold caches: what counts then is how
much code it runs through, and that is little here. The layouts are handed in as records
(hc_msgs_py.wire_many), whose constant parts are filled already. Messages are in SI, but for
the parameters.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_msgs_py.units import METRE_IN_MM, NANOSECONDS
from hc_sim_rig.compilation import compiled
from hc_sim_rig.layout import (
    OUT_CONTACT,
    OUT_DISPLACEMENT,
    OUT_FORCE,
    OUT_LATERAL,
    OUT_MASTER,
    OUT_PARAMETERS,
    OUT_SLAVE,
    OUT_TRUE_DISPLACEMENT,
    OUT_TRUE_FORCE,
    OUT_TRUE_VELOCITY,
)


@compiled
def fill_messages(
    rows: NDArray[np.float64],
    stamps_ns: NDArray[np.int64],
    first_sequence: int,
    samples: Any,
    truths: Any,
    wrenches: Any,
    joints: Any,
) -> None:
    """Fill the messages of some samples.

    Args:
        rows: of the rig, shape (n, OUT_COLUMNS).
        stamps_ns: of the samples [ns], shape (n,).
        first_sequence: sequence of the first one.
        samples: records of IndenterSample, shape (n,), or (0,) where nobody wants them; so are all
            others.
        truths: of IndenterTruth.
        wrenches: of WrenchStamped, with one place: the force.
        joints: of JointState, with six places: both positions, both velocities, both efforts.
    """
    for i in range(rows.shape[0]):
        sec = stamps_ns[i] // NANOSECONDS
        nanosec = stamps_ns[i] - sec * NANOSECONDS
        if len(samples) > 0:
            samples[i]["sec"] = sec
            samples[i]["nanosec"] = nanosec
            samples[i]["sequence"] = first_sequence + i
            samples[i]["displacement"] = rows[i, OUT_DISPLACEMENT] / METRE_IN_MM
            samples[i]["force"] = rows[i, OUT_FORCE]
        if len(truths) > 0:
            truths[i]["sec"] = sec
            truths[i]["nanosec"] = nanosec
            truths[i]["sequence"] = first_sequence + i
            truths[i]["displacement"] = rows[i, OUT_TRUE_DISPLACEMENT] / METRE_IN_MM
            truths[i]["velocity"] = rows[i, OUT_TRUE_VELOCITY] / METRE_IN_MM
            truths[i]["force"] = rows[i, OUT_TRUE_FORCE]
            truths[i]["stiffness"] = rows[i, OUT_PARAMETERS]
            truths[i]["damping"] = rows[i, OUT_PARAMETERS + 1]
            truths[i]["displacement_exponent"] = rows[i, OUT_PARAMETERS + 2]
            truths[i]["velocity_exponent"] = rows[i, OUT_PARAMETERS + 3]
            truths[i]["contact"] = rows[i, OUT_CONTACT] > 0.0
        if len(wrenches) > 0:
            wrenches[i]["sec"] = sec
            wrenches[i]["nanosec"] = nanosec
            wrenches[i]["0"] = rows[i, OUT_FORCE]
        if len(joints) > 0:
            joints[i]["sec"] = sec
            joints[i]["nanosec"] = nanosec
            joints[i]["0"] = rows[i, OUT_MASTER] / METRE_IN_MM
            joints[i]["1"] = rows[i, OUT_SLAVE] / METRE_IN_MM
            joints[i]["2"] = rows[i, OUT_MASTER + 1] / METRE_IN_MM
            joints[i]["3"] = rows[i, OUT_SLAVE + 1] / METRE_IN_MM
            joints[i]["4"] = rows[i, OUT_MASTER + 2]
            joints[i]["5"] = rows[i, OUT_SLAVE + 2]


@compiled
def fill_tips(
    rows: NDArray[np.float64],
    stamps_ns: NDArray[np.int64],
    first: int,
    every: int,
    tips: Any,
    places: NDArray[np.int64],
) -> int:
    """Fill the positions of the tip, one in some samples; x sideways, penetration negative.

    Args:
        rows: as in `fill_messages`.
        stamps_ns: of the samples [ns], shape (n,).
        first: number of the first sample among all of the rig.
        every: samples between two positions.
        tips: records of PointStamped, shape (n,), with two places: x and z.
        places: takes the index of the sample of each, shape (n,).

    Returns:
        How many there are.
    """
    count = 0
    for i in range(rows.shape[0]):
        if (first + i) % every == 0:
            sec = stamps_ns[i] // NANOSECONDS
            tips[count]["sec"] = sec
            tips[count]["nanosec"] = stamps_ns[i] - sec * NANOSECONDS
            tips[count]["0"] = rows[i, OUT_LATERAL] / METRE_IN_MM
            tips[count]["1"] = -rows[i, OUT_SLAVE] / METRE_IN_MM
            places[count] = i
            count += 1
    return count
