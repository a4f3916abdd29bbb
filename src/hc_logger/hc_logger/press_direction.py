"""Along what the force of a press changes, and whether that is what is read of it.

A sensor that sits turned in its mount, or a tool that presses along another axis, shows part of the
force along the axis that is read: K comes out too small by that, and nothing else looks wrong.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hc_estimator.stream.readings import CLEAR, LEAST_SAMPLES, noise, robust_range
from hc_estimator.stream.sensor_setup import AXIS_ALIGNED, main_direction

OFF_DEG: Final = 15.0
"""Less costs 3 % of the force, and friction of a tool that slides leans it as far."""
ONE_DIRECTION: Final = 0.05
"""Of the force's variance, what may lie across the direction of the press: more is a tool that
turns with a weight, or slides to and fro."""


def off_axis_line(topic: str, forces: ArrayLike, read: Sequence[float], sign: int = 1) -> str:
    """Say that a force changes along another direction than that which is read; empty if not.

    Args:
        topic: of the forces.
        forces: readings [N], three components each, shape (n, 3) or (3 n,).
        read: unit vector along which they are read, before the sign.
        sign: 1 or -1, of the reading.
    """
    values: NDArray[np.float64] = np.asarray(forces, np.float64).reshape(-1, 3)
    values = values[np.isfinite(values).all(axis=1)]
    if len(values) < LEAST_SAMPLES:
        return ""
    press = main_direction(values)
    along = values @ press
    low, high = robust_range(along)
    if high - low < CLEAR * max(noise(along), 1e-9):
        return ""
    across = values - np.outer(along, press)
    if float(np.var(across, axis=0).sum()) > ONE_DIRECTION * float(np.var(along)):
        return ""
    share = float(press @ np.asarray(read, np.float64))
    off_deg = math.degrees(math.acos(min(abs(share), 1.0)))
    if off_deg < OFF_DEG:
        return ""
    largest = int(np.argmax(np.abs(press)))
    if abs(press[largest]) > AXIS_ALIGNED:
        words, option = "xyz"[largest], f"--input force.axis={'xyz'[largest]}"
    else:
        # The sign stays as it was given, right or wrong: it has a sentence of its own. Of a
        # direction across that which was read it is the press that tells.
        middle = float(np.median(along))
        across_it = abs(share) < math.cos(math.radians(90.0 - OFF_DEG))
        pulls = sign * (high - middle) < sign * (middle - low)
        backward = pulls if across_it else share < 0.0
        numbers = ",".join(f"{-x + 0.0 if backward else x:.3f}" for x in press)
        words = numbers.replace(",", ", ")
        option = f"--input force.axis=direction --input force.direction={numbers}"
    return (
        f"the force of {topic} changes along {words}, {off_deg:.0f} degrees off the axis that is "
        f"read, which shows {100.0 * abs(share):.0f} % of it: {option}, and the position along the "
        "direction of the press as well (of a tool that slides, friction leans the force)"
    )
