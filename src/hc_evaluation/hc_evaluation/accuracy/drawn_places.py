"""A tissue palpated place by place: presses and taps, each place as it is, the air in between.

Every place has one or two presses of its own depth and speed. From place to place the stiffness
may be another, the exponent, and the height of the surface. A plant of its own, in plain numpy,
with the ranges of `drawn_contact`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from hc_evaluation.accuracy.drawn_contact import (
    DAMPING_SHARE,
    DISPLACEMENT_NOISE_MM,
    EXPONENT,
    FORCE_NOISE,
    RATES_HZ,
    SLOWEST_FASTEST_MM_S,
    STIFFNESS,
    VELOCITY_EXPONENT,
    minimum_jerk,
)
from hc_evaluation.accuracy.scenarios import log_uniform

FloatArray = NDArray[np.float64]
Draw = np.random.Generator

DURATION_S = 40.0
STIFFER, STEEPER, HIGHER_MM = 0.4, 0.1, 0.2  # deviations of ln K, n and height of a place
CLEARANCE_MM = 0.5  # of the tool over the highest place, at least
SLOPE_MM = 0.15  # by which each place is higher than the one before, at most
KINDS: dict[str, tuple[bool, bool, bool]] = {
    "nothing": (False, False, False),
    "stiffness": (True, False, False),
    "exponent": (False, True, False),
    "height": (False, False, True),
    "stiffness, exponent": (True, True, False),
    "all": (True, True, True),
}
"""What differs from place to place: stiffness, exponent, height of the surface."""


@dataclass
class DrawnPlaces:
    """Readings beside the truth; arrays of shape (N,), parameters (N, 4).

    Attributes:
        time_s: stamps.
        displacement_mm: readings.
        force_n: readings.
        parameters: K, B, n, p.
        surface_mm: displacement at which the contact begins.
        depth_mm: true depth below that, negative in the air.
        place: number of the place that the tool is at or over, from 0 on.
    """

    time_s: FloatArray
    displacement_mm: FloatArray
    force_n: FloatArray
    parameters: FloatArray
    surface_mm: FloatArray
    depth_mm: FloatArray
    place: NDArray[np.int64]


def drawn_places(kind: str, seed: int) -> DrawnPlaces:
    """Draw the places, motion and readings of a seed.

    Args:
        kind: of `KINDS`.
        seed: of everything; what differs by kind is drawn for all of them.

    Raises:
        KeyError: no such kind.
    """
    stiffer, steeper, higher = KINDS[kind]
    draw = np.random.default_rng([seed, 781])
    rate_hz = float(draw.choice(RATES_HZ))
    time = np.arange(0.0, DURATION_S, 1.0 / rate_hz)
    home = -float(draw.uniform(1.0, 3.0))
    tool, surface = np.full(time.size, home), np.zeros(time.size)
    log_factor, exponent = np.zeros(time.size), np.zeros(time.size)
    place = np.zeros(time.size, np.int64)
    slope = float(draw.uniform(-SLOPE_MM, SLOPE_MM))
    usual = float(draw.uniform(*EXPONENT))
    now, count = 0.5, 0
    while now < DURATION_S - 2.0:
        here = time >= now if count else np.ones(time.size, np.bool_)
        height = count * slope + float(draw.normal(0.0, HIGHER_MM))
        # The tool clears every place on its way to the next.
        surface[here] = max(height, home + CLEARANCE_MM) if higher and count else 0.0
        log_factor[here] = float(draw.normal(0.0, STIFFER)) if stiffer else 0.0 * draw.normal()
        exponent[here] = usual + float(draw.normal(0.0, STEEPER)) * float(steeper)
        place[here] = count
        count += 1
        goal = float(draw.uniform(2.0, 5.0)) + surface[-1]
        for _ in range(int(draw.integers(1, 3))):
            for begin, end in ((home, goal), (goal, home)):
                takes = max(1.9 * (goal - home) / float(draw.uniform(4.0, 30.0)), 0.1)
                way = minimum_jerk(np.clip((time - now) / takes, 0.0, 1.0))
                tool = np.where(time >= now, begin + (end - begin) * way, tool)
                now += takes + float(draw.uniform(0.05, 0.5))
        now += float(draw.uniform(0.3, 1.0))
    depth = tool - surface
    velocity = CubicSpline(time, tool)(time, 1)  # between two readings it goes on smoothly
    fastest = max(float(np.max(np.abs(velocity))), SLOWEST_FASTEST_MM_S)
    stiffness = log_uniform(draw, *STIFFNESS) * np.exp(log_factor)
    velocity_exponent = float(draw.uniform(*VELOCITY_EXPONENT))
    share = log_uniform(draw, *DAMPING_SHARE)
    damping = stiffness * share / fastest**velocity_exponent
    drag = damping * np.sign(velocity) * np.abs(velocity) ** velocity_exponent
    # Tissue cannot pull.
    force = np.maximum(depth, 0.0) ** exponent * np.maximum(stiffness + drag, 0.0)
    noise = log_uniform(draw, *FORCE_NOISE) * float(np.max(force))
    displacement_noise = log_uniform(draw, *DISPLACEMENT_NOISE_MM)
    return DrawnPlaces(
        time,
        tool + displacement_noise * draw.standard_normal(time.size),
        force + noise * draw.standard_normal(time.size),
        np.column_stack([stiffness, damping, exponent, np.full(time.size, velocity_exponent)]),
        surface,
        depth,
        place,
    )
