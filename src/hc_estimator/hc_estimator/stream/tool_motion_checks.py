"""Does the force free of contact follow the tool's speed, or its acceleration?

What drags on a tool, and its mass, the sensor shows in the air as in the tissue. There, where no
tissue is, the force is fitted as zero + drift + friction by the direction + drag by the speed +
mass by the acceleration; the air reaches as far in as that explains the force. What is found has
to be there in both halves of a recording, on the ways in alone, and whether or not the force may
depend on the place: a tissue, a drift, a slow sensor or a cable are not all of that.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.free_motion import BINS, FLAT_SHARE, RISE_SHARE, in_bins
from hc_estimator.stream.local_cubic import HALF_NS, LEAST, less_spikes
from hc_estimator.stream.readings import (
    LEAST_SAMPLES,
    Check,
    FloatArray,
    Parts,
    Readings,
    Suspicion,
    noise,
    robust_range,
)
from hc_estimator.stream.tool_motion import TONNES
from hc_msgs_py.units import NANOSECONDS

LEAST_SHARE = 0.003
"""Of the force's range: what is less than that, a sensor's own errors may be."""
FEW, FEW_SHARE = 4, 0.03
"""With fewer passages through the air it has to be so much: the force may drift, or creep."""
CLEAR = 6.0
"""Deviations."""
PART = (0.6, 1.5)
"""Times what is found, which each half and the ways in alone have to show."""
BESIDE_PLACE = (0.75, 1.25)
"""The same of a fit in which the force may depend on the place, too."""
DEPENDS = 3.0
"""Deviations, from which on the force does depend on the place."""
LEAST_OF = 0.35
"""Of what is found: so much that may be."""
PLACE_SHARE = 0.01
"""Of the force's range: so much it may depend on the place in the air; more is tissue."""
MOVES_SHARE = 0.1
"""Of the fastest: what is slower may rest, and of a rest no friction is known."""
SEEN = 5.0
"""Deviations of the speed: what is slower goes either way."""
FASTEST = 0.95
"""Quantile of speed and acceleration that counts as the most."""
NOISE_TIMES = 1.5
"""What a fit may leave in the air beside the flatness of free motion."""
GLITCH = 3.0
"""Times what a fit may leave: a reading that is further off counts as so far off."""
LEAST_BINS = 5
MOST_ROWS = 200_000
"""Of the end of a recording."""
OUTLIER = 5.0
_RIDGE = 1e-9
_DIRECTION, _SPEED, _ACCELERATION, _PLACE = 2, 3, 4, 5
_TERMS = 6


class FoundMotion(NamedTuple):
    """What moving the tool takes, of what it takes enough.

    Attributes:
        damping: of what drags on it [N s/mm]; 0 if nothing is seen of it.
        drag_n: what that takes at the most [N].
        mass_kg: what moves with it; 0 as above.
        inertia_n: what that takes at the most [N].
        speed_mm_s: the most, but for spikes.
        zero_n: force of a tool at rest [N].
        zero_std_n: its standard deviation [N].
    """

    damping: float
    drag_n: float
    mass_kg: float
    inertia_n: float
    speed_mm_s: float
    zero_n: float
    zero_std_n: float


class _Rows(NamedTuple):
    """Readings of a tool that moves, shape (n,) each."""

    row: NDArray[np.int64]
    time_s: FloatArray
    depth: FloatArray
    newtons: FloatArray
    speed: FloatArray
    acceleration: FloatArray


class _Motion(NamedTuple):
    """Of a tool at even times [s], shape (n,) each; NaN at the ends.

    Attributes:
        even_s: times [s].
        place: penetration, spikes left out [mm].
        speed: velocity [mm/s].
        acceleration: [mm/s^2].
        speed_noise: standard deviation of the velocity [mm/s].
    """

    even_s: FloatArray
    place: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    speed_noise: float


def find_tool_motion(displacement: Readings, force: Readings) -> Parts[FoundMotion | None]:
    """Look for drag and mass in the force free of contact.

    Args:
        displacement: penetration [mm].
        force: contact force [N].

    Returns:
        In parts: what is there of them; None if neither is.
    """
    rows = yield from _moving(displacement, force)
    if rows is None:
        return None
    fast, hard = (
        float(np.quantile(np.abs(values), FASTEST)) for values in (rows.speed, rows.acceleration)
    )
    if not (fast > 0.0 and hard > 0.0 and np.ptp(rows.time_s) > 0.0):
        return None
    low, high = robust_range(rows.depth)
    range_n = float(np.subtract(*robust_range(rows.newtons)[::-1]))
    terms = np.empty((len(rows.row), _TERMS))
    terms[:, 0] = 1.0
    terms[:, 1] = (rows.time_s - np.mean(rows.time_s)) / np.ptp(rows.time_s)
    terms[:, _DIRECTION] = np.sign(rows.speed)
    terms[:, _SPEED] = rows.speed / fast
    terms[:, _ACCELERATION] = rows.acceleration / hard
    terms[:, _PLACE] = 0.0
    _, place = in_bins(rows.depth)
    yield
    bins = yield from _air(terms, rows.newtons, place, range_n)
    air = place < bins
    if bins < LEAST_BINS or air.all():
        return None
    rises = float(np.quantile(rows.newtons, 0.995) - np.median(rows.newtons[air]))
    if rises < RISE_SHARE * range_n:
        return None  # no contact beside the air
    yield
    found = yield from _found(
        terms[air],
        rows.newtons[air],
        _passages(rows.row[air], rows.speed[air]),
        (rows.depth[air] - low) / (high - low),
        range_n,
    )
    if found is None:
        return None
    drag_n, inertia_n, *zero = found
    if drag_n == inertia_n == 0.0:
        return None
    return FoundMotion(drag_n / fast, drag_n, inertia_n / hard / TONNES, inertia_n, fast, *zero)


def takes_force(found: FoundMotion) -> list[Suspicion]:
    """Return the doubts about a force of which moving the tool takes a part."""
    result = []
    if found.mass_kg:
        result.append(
            Suspicion(
                Check.INERTIA,
                "force",
                f"free of contact the force follows the acceleration, by up to "
                f"{found.inertia_n:.2g} N: {found.mass_kg:.2g} kg move between sensor and tissue, "
                "which the law takes for tissue: take that off (force.moving_mass)",
                found.mass_kg,
            )
        )
    if found.damping:
        result.append(
            Suspicion(
                Check.DAMPING,
                "force",
                f"free of contact the force follows the speed, by {found.drag_n:.2g} N at "
                f"{found.speed_mm_s:.2g} mm/s: something drags on the tool between sensor and "
                "tissue, which the law takes for tissue: take that off (force.damping)",
                found.damping,
            )
        )
    return result


def less_motion(found: FoundMotion, displacement: Readings, force: Readings) -> Parts[Readings]:
    """Return the forces less what was found, where the motion is known."""
    motion = _motion(displacement)
    yield
    assert motion is not None  # or nothing would have been found
    speed = np.interp(force.time_s, motion.even_s, motion.speed)
    yield
    acceleration = np.interp(force.time_s, motion.even_s, motion.acceleration)
    newtons = force.values - found.damping * speed - TONNES * found.mass_kg * acceleration
    known = np.isfinite(newtons)
    return force._replace(time_s=force.time_s[known], values=newtons[known])


def _moving(displacement: Readings, force: Readings) -> Parts[_Rows | None]:
    """Return the readings of the force while the tool moves; None if there are too few."""
    motion = _motion(displacement)
    yield
    if motion is None:
        return None
    even_s = motion.even_s
    inside = (force.time_s >= even_s[0]) & (force.time_s <= even_s[-1])
    time_s, newtons = force.time_s[inside], force.values[inside]
    columns = []
    for values in (motion.place, motion.speed, motion.acceleration):
        columns.append(np.interp(time_s, even_s, values))
        yield
    depth, speed, acceleration = columns
    moves = np.isfinite(speed) & np.isfinite(acceleration)
    if np.count_nonzero(moves) < LEAST_SAMPLES:
        return None
    fast = float(np.quantile(np.abs(speed[moves]), FASTEST))
    moves &= np.abs(speed) > max(MOVES_SHARE * fast, SEEN * motion.speed_noise)
    row = np.flatnonzero(moves)
    if len(row) < LEAST_SAMPLES:
        return None
    return _Rows(row, *(c[row] for c in (time_s, depth, newtons, speed, acceleration)))


def _motion(displacement: Readings) -> _Motion | None:
    """Return the motion of the newest readings; None of readings that are too uneven, or too few.

    By the cubic of `LocalCubic`, which for even times is a filter.
    """
    time_s = displacement.time_s[-MOST_ROWS:]
    steps = np.diff(time_s)
    step_s = float(np.median(steps)) if len(steps) else 0.0
    if not (step_s > 0.0 and (steps > 0.0).all()):
        return None
    time_s, places = less_spikes(time_s, displacement.values[-MOST_ROWS:])
    count = round(float(time_s[-1] - time_s[0]) / step_s) + 1
    half = max(round(HALF_NS / NANOSECONDS / step_s), LEAST)
    if count > 4 * len(time_s) or count < 8 * half:
        return None
    even_s = time_s[0] + step_s * np.arange(count)
    even = np.interp(even_s, time_s, places)
    away = np.arange(-half, half + 1.0)
    square = away * away
    second, fourth, sixth = (float(np.sum(square**power)) for power in (1, 2, 3))
    slope = away * (sixth - fourth * square) / (second * sixth - fourth**2) / step_s
    bend = square - np.mean(square)
    curve = 2.0 * bend / np.sum(bend**2) / step_s**2
    unknown = np.full(half, np.nan)
    speed, acceleration = (
        np.concatenate([unknown, np.convolve(even, weights[::-1], "valid"), unknown])
        for weights in (slope, curve)
    )
    deviation = noise(places) * math.sqrt(float(np.sum(slope**2)))
    return _Motion(even_s, even, speed, acceleration, deviation)


def _air(
    terms: FloatArray, newtons: FloatArray, place: NDArray[np.int64], range_n: float
) -> Parts[int]:
    """Return how many bins of the depth the fit explains, the last of them left away."""
    order = np.argsort(place, kind="stable")
    terms, newtons = terms[order], newtons[order]
    ends = np.cumsum(np.bincount(place, minlength=BINS))
    allowed_n = math.hypot(NOISE_TIMES * noise(newtons[np.argsort(order)]), FLAT_SHARE * range_n)
    yield
    squares, products = np.zeros((_TERMS, _TERMS)), np.zeros(_TERMS)
    begin = good = 0
    for bins, end in enumerate(ends.tolist(), 1):
        mine, pushes = terms[begin:end], newtons[begin:end]
        squares, products = squares + mine.T @ mine, products + mine.T @ pushes
        count, begin = end - begin, end
        if end < LEAST_SAMPLES // 2:
            continue
        rest = np.abs(pushes - mine @ _solved(squares, products))
        rest = np.minimum(rest, GLITCH * allowed_n)
        if count and bins >= LEAST_BINS and float(np.mean(rest * rest)) > allowed_n**2:
            break
        good = bins
        if bins % 4 == 0:
            yield
    return good - 1


def _found(
    terms: FloatArray,
    newtons: FloatArray,
    passage: NDArray[np.int64],
    place: FloatArray,
    range_n: float,
) -> Parts[tuple[float, float, float, float] | None]:
    """Return what drag and mass take at the most [N], 0 for what is not there; None of no air.

    And the zero with its deviation [N].
    """
    count = int(passage[-1]) + 1
    whole, deviations = _fit(terms, newtons, passage)
    yield
    # Of a few passages, or of one way alone, nothing tells what the direction does from the rest.
    sliding = newtons - whole[_DIRECTION] * terms[:, _DIRECTION]
    without = terms.copy()
    without[:, _DIRECTION] = 0.0
    parts = []
    for chosen in (passage < count // 2, passage >= count // 2, terms[:, _DIRECTION] > 0.0):
        if np.count_nonzero(chosen) < 2 * _TERMS:
            return None
        parts.append(_fit(without[chosen], sliding[chosen], passage[chosen])[0])
        yield
    with_place = terms.copy()
    with_place[:, _PLACE] = place
    beside, beside_deviations = _fit(with_place, newtons, passage)
    rise_n = abs(beside[_PLACE]) * float(np.ptp(place))
    if rise_n > PLACE_SHARE * range_n:
        return None
    depends = abs(beside[_PLACE]) > DEPENDS * beside_deviations[_PLACE]
    least_n = (LEAST_SHARE if count >= FEW else FEW_SHARE) * range_n
    result = []
    for term in (_SPEED, _ACCELERATION):
        size = float(whole[term])
        shown = [part[term] for part in parts]
        there = size > max(CLEAR * deviations[term], least_n) and _within(shown, size, PART)
        if depends:
            there = there and rise_n < LEAST_OF * size
            there = there and _within([beside[term]], size, BESIDE_PLACE)
        result.append(size if there else 0.0)
    return result[0], result[1], float(whole[0]), float(deviations[0])


def _within(shown: list[float], size: float, limits: tuple[float, float]) -> bool:
    return all(limits[0] * size < part < limits[1] * size for part in shown)


def _passages(row: NDArray[np.int64], speed: FloatArray) -> NDArray[np.int64]:
    """Return for each reading in the air the number of its way in or out."""
    begins = (np.diff(row) > 1) | (np.diff(np.sign(speed)) != 0.0)
    return np.concatenate(([0], np.cumsum(begins)))


def _solved(squares: FloatArray, products: FloatArray) -> FloatArray:
    """Solve normal equations; what has no part in them becomes 0."""
    ridge = _RIDGE * max(float(squares[0, 0]), 1.0)
    result = np.linalg.solve(squares + ridge * np.eye(_TERMS), products)
    return np.asarray(result, np.float64)


def _fit(
    terms: FloatArray, newtons: FloatArray, passage: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray]:
    """Fit the force, outliers left out.

    Returns:
        Coefficients [N] and their deviations, of errors that are alike within a passage (White,
        Asymptotic Theory for Econometricians, 1984, section 6.3), shape (terms,) each.
    """
    rest = newtons - terms @ _solved(terms.T @ terms, terms.T @ newtons)
    usual = np.abs(rest) <= OUTLIER * 1.4826 * np.median(np.abs(rest))
    if np.count_nonzero(usual) > _TERMS:
        terms, newtons, passage = terms[usual], newtons[usual], passage[usual]
    squares = terms.T @ terms
    fitted = _solved(squares, terms.T @ newtons)
    scores = terms * (newtons - terms @ fitted)[:, None]
    begins = np.flatnonzero(np.concatenate(([True], passage[1:] != passage[:-1])))
    of_passages: FloatArray = np.add.reduceat(scores, begins, axis=0)
    inverse = np.linalg.pinv(squares, hermitian=True)
    covariance = inverse @ (of_passages.T @ of_passages) @ inverse
    return fitted, np.sqrt(np.maximum(np.diag(covariance), 0.0))
