"""Readings of a sensor with several components, and those of them that count, when they were taken.

Topics repeat readings, and stamp them on arrival: what is to be found of a sensor (`sensor_setup`)
is of what it measured, when it did.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hc_estimator.stream.arrival_stamps import find_even_times
from hc_estimator.stream.channel_checks import held
from hc_estimator.stream.readings import FloatArray, Readings, noise
from hc_estimator.stream.repeats import new_readings
from hc_msgs_py.units import NANOSECONDS


class VectorReadings(NamedTuple):
    """Readings of a sensor: times [s], shape (n,), and components, shape (n, k).

    Attributes:
        time_s: when each was measured.
        values: in N or mm; one column a component.
        names: of the components: x, y, z, or names of joints.
        of_joints: whether they are joints, which may be called x, y and z as well.
    """

    time_s: FloatArray
    values: FloatArray
    names: tuple[str, ...]
    of_joints: bool = False


def at_even_times(readings: VectorReadings) -> tuple[VectorReadings, float]:
    """Return the readings at the even times at which they were taken, if their stamps are others.

    Returns:
        Beside them by how much the stamps are off [s]; 0 where they are not.
    """
    stamps_ns = np.round(readings.time_s * NANOSECONDS).astype(np.int64)
    swings = np.ptp(readings.values, axis=0) / np.maximum(
        [noise(column) for column in readings.values.T], 1e-12
    )
    found = find_even_times(stamps_ns, readings.values[:, int(np.argmax(swings))])
    if found is None:
        return readings, 0.0
    return readings._replace(time_s=found.stamps_ns / NANOSECONDS), found.late_s


def each_once(readings: VectorReadings) -> tuple[VectorReadings, bool]:
    """Return the readings without those that a topic only repeats, and whether it does.

    The component that changes most often tells: others may stand still, as joints at rest do.
    """
    changing = int(np.argmax(np.count_nonzero(np.diff(readings.values, axis=0), axis=0)))
    _sentence, repeats = held(Readings("", "", readings.time_s, readings.values[:, changing]))
    if math.isnan(repeats):
        return readings, False
    stamps_ns = np.round(readings.time_s * NANOSECONDS).astype(np.int64)
    new = new_readings(stamps_ns, readings.values)
    return readings._replace(time_s=readings.time_s[new], values=readings.values[new]), True
