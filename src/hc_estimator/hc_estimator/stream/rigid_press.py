"""The compliance of a robot's frame from presses on something rigid, a block of steel.

All that moves there is the robot: d = d_0 + C F. The force is the variable that is known, the
contact point d_0 is not. It may differ from branch to branch (a way in, a way out), for friction,
play and drift shift them: least squares with one slope and an offset for each. Noise of the force
would make the slope too small by its share of the spread of the forces, and is taken out of that.
The first part of a press is left out: there surfaces settle, and gears close their play.

The deviation holds what noise leaves open (with the correlation of the residuals) or the scatter of
the branches' own slopes, whichever is larger, and how far the slope itself changes with the force:
a frame gives way in proportion to it, and what is soft does not, if it is not thin and linear.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.readings import LEAST_SAMPLES, FloatArray, noise, robust_range

LEFT_OUT = 0.2
"""Share of the force's range below which nothing is used, where nobody says from where on."""
NO_NOISE = 8.0
"""Deviations of the force's noise: in the air none of them may pass for a press."""
LEAST_RANGE = 30.0
"""Deviations of the force's noise, over which a press goes."""
TURNS = 0.2
"""Share of the force's range by which it turns back where a branch ends."""
LEAST_SPAN, LEAST_OF_A_BRANCH = 0.4, 10
"""Share of the used forces, and readings, that a branch holds at least."""
BENT = 0.15
"""Of the slope: what bends more is no frame that gives way in proportion to the force."""
LOOP = 0.2
"""Of what gave way: where a way out is further off a way in, the slope may be anything."""
CLEARLY = 3.0
"""Deviations."""
KNOWN = 0.1
"""Of the compliance: a deviation beyond is no knowledge of it."""


class FrameEstimate(NamedTuple):
    """What presses on something rigid show.

    Attributes:
        mm_per_n: the compliance.
        mm_per_n_std: its standard deviation.
        from_n: least force that was used [N].
        to_n: largest force [N].
        ways_in: branches in which the force rose.
        ways_out: branches in which it fell.
        loop_mm: displacement on a way out less that on a way in at the same force [mm]; NaN without
            both.
    """

    mm_per_n: float
    mm_per_n_std: float
    from_n: float
    to_n: float
    ways_in: int
    ways_out: int
    loop_mm: float


class _Branch(NamedTuple):
    """Readings from one turn of the force to the next, and whether it rises."""

    displacement_mm: FloatArray
    force_n: FloatArray
    rises: bool


def estimate_frame(
    displacement_mm: FloatArray, force_n: FloatArray, from_n: float | None = None
) -> FrameEstimate:
    """Find the compliance of a frame.

    Args:
        displacement_mm: penetration as it was read [mm], shape (n,), in the order of time.
        force_n: force at the same stamps [N], compression positive.
        from_n: forces below are left out; None leaves out a fifth of their range.

    Raises:
        ValueError: if the presses do not show it; the message says why and what would.
    """
    usable = np.isfinite(displacement_mm) & np.isfinite(force_n)
    depth, force = displacement_mm[usable], force_n[usable]
    if len(depth) < LEAST_SAMPLES:
        raise ValueError(f"{len(depth)} readings of force with displacement are too few")
    low, high = robust_range(force)
    noise_n = noise(force)
    if high - low < LEAST_RANGE * max(noise_n, 1e-9):
        raise ValueError(
            f"the force changes by {high - low:.2g} N only, and its noise is {noise_n:.2g} N: "
            "press harder"
        )
    usual = force <= high + 0.1 * (high - low)  # no spikes
    depth, force = depth[usual], force[usual]
    begin = from_n
    if begin is None:
        begin = low + max(LEFT_OUT * (high - low), NO_NOISE * noise_n)
    if high - begin < NO_NOISE * noise_n:
        raise ValueError(f"of forces up to {high:.3g} N none are left above {begin:.3g} N")
    branches = _branches(depth, force, begin, high, TURNS * (high - low))
    if not branches:
        raise ValueError(
            f"no press in it goes through the forces from {begin:.3g} to {high:.3g} N in ten "
            "readings or more: press slower"
        )
    return _fit(branches, noise_n, begin, high)


def _fit(branches: list[_Branch], noise_n: float, begin: float, end: float) -> FrameEstimate:
    pushed = np.concatenate([b.force_n - b.force_n.mean() for b in branches])
    moved = np.concatenate([b.displacement_mm - b.displacement_mm.mean() for b in branches])
    spread = float(pushed @ pushed) - len(pushed) * noise_n**2
    slope = float(pushed @ moved) / spread
    residual = moved - slope * pushed
    white = _deviation(residual, len(branches) + 1) / math.sqrt(spread)
    scatter = 0.0
    if len(branches) > 1:
        own = [_slope(b, noise_n) for b in branches]
        scatter = float(np.std(own, ddof=1)) / math.sqrt(len(own))
    bent, bent_std = _bend(branches, residual, pushed, end - begin)
    known = max(white, scatter)
    if slope < -CLEARLY * known:
        raise ValueError(
            "the force falls as the tool goes deeper: turn the sign of force or displacement"
        )
    if slope < CLEARLY * known:
        raise ValueError(
            f"what gives way is {slope:.2g} ± {known:.2g} mm/N, which is nothing for certain: "
            f"it is less than {max(slope, 0.0) + 2.0 * known:.2g} mm/N, or press harder and slower"
        )
    if abs(bent) > max(BENT * slope, CLEARLY * bent_std):
        raise ValueError(
            f"what gives way is {slope - 0.5 * bent:.2g} mm/N at {begin:.3g} N and "
            f"{slope + 0.5 * bent:.2g} at {end:.3g} N: "
            + (
                "still soft; press on steel, and harder, or leave more out (--from)"
                if bent < 0.0
                else "something slips or bends; press straight on, and softer"
            )
        )
    loop = _loop(branches, slope)
    loop_std = _deviation(residual, len(branches) + 1) * math.sqrt(len(branches) / len(residual))
    gave_way = slope * (end - begin)
    if abs(loop) > max(LOOP * gave_way, CLEARLY * loop_std):
        raise ValueError(
            f"on the way out the position is {loop:+.2g} mm off that of the way in at the same "
            f"force, and {gave_way:.2g} mm gave way: friction, play, slip or a late sensor; press "
            "slower and straight on"
        )
    if abs(bent) > CLEARLY * bent_std:
        known = math.hypot(known, bent)
    if known > KNOWN * slope:
        raise ValueError(
            f"what gives way is {slope:.2g} mm/N, known to {100.0 * known / slope:.0f} % only: "
            "press harder, slower and more often"
        )
    rising = sum(branch.rises for branch in branches)
    return FrameEstimate(slope, known, begin, end, rising, len(branches) - rising, loop)


def _branches(
    depth: FloatArray, force: FloatArray, begin: float, end: float, turn_n: float
) -> list[_Branch]:
    """Return the branches that go through enough of the forces from the begin on."""
    turns = _turns(force, turn_n)
    result = []
    for first, last in itertools.pairwise(turns):
        part = slice(first, last + 1)
        used = force[part] >= begin
        d, f = depth[part][used], force[part][used]
        if len(f) >= LEAST_OF_A_BRANCH and np.ptp(f) >= LEAST_SPAN * (end - begin):
            result.append(_Branch(d, f, bool(force[last] > force[first])))
    return result


def _turns(force: FloatArray, turn_n: float) -> list[int]:
    """Return where a force turns back by so much, with its begin and end."""
    turns, values = [0], force.tolist()
    least = most = 0  # since the last turn
    way = 0
    for i, value in enumerate(values):
        if value > values[most]:
            most = i
        if value < values[least]:
            least = i
        if way >= 0 and value < values[most] - turn_n:
            turns.append(most)
            way, least = -1, i
        elif way <= 0 and value > values[least] + turn_n:
            turns.append(least)
            way, most = 1, i
    return sorted({*turns, len(values) - 1})


def _slope(branch: _Branch, noise_n: float) -> float:
    pushed = branch.force_n - branch.force_n.mean()
    return float(pushed @ branch.displacement_mm) / (
        float(pushed @ pushed) - len(pushed) * noise_n**2
    )


def _deviation(residual: FloatArray, solved: int) -> float:
    """Return the deviation of the residuals as if they were so much fewer that none correlate."""
    freedom = max(len(residual) - solved, 1)
    square = float(residual @ residual)
    if square == 0.0:
        return 0.0
    correlation = min(max(float(residual[1:] @ residual[:-1]) / square, 0.0), 0.999)
    return math.sqrt(square / freedom * (1.0 + correlation) / (1.0 - correlation))


def _bend(
    branches: list[_Branch], residual: FloatArray, pushed: FloatArray, span_n: float
) -> tuple[float, float]:
    """Return by how much the slope changes over the forces [mm/N], and its deviation."""
    square = np.concatenate(
        [(s := (b.force_n - b.force_n.mean()) ** 2) - s.mean() for b in branches]
    )
    square = square - pushed * float(square @ pushed) / float(pushed @ pushed)
    size = float(square @ square)
    if size == 0.0:
        return 0.0, math.inf
    curvature = float(square @ residual) / size
    deviation = _deviation(residual - curvature * square, len(branches) + 2) / math.sqrt(size)
    return 2.0 * curvature * span_n, 2.0 * deviation * span_n


def _loop(branches: list[_Branch], slope: float) -> float:
    """Return by how much a way out lies beside the way in before or after it [mm]."""
    offsets: NDArray[np.float64] = np.array(
        [b.displacement_mm.mean() - slope * b.force_n.mean() for b in branches]
    )
    apart = [
        (offsets[i + 1] - offsets[i]) * (1.0 if branches[i].rises else -1.0)
        for i in range(len(branches) - 1)
        if branches[i].rises != branches[i + 1].rises
    ]
    return float(np.median(apart)) if apart else math.nan
