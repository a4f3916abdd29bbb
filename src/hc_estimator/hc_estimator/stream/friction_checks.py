"""Is the tool held back on its way? The force free of contact tells, by the way that it goes.

In the tissue friction looks like damping. In the air nothing else depends on the direction: a tare
that is off, a weight, a force that drifts are the same on the way in and on the way out. So the
force of each passage through the air is compared with those of the passages before and after it,
which go the other way, at the same places.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.dry_friction import SHORTEST, DryFriction
from hc_estimator.stream.free_motion import (
    BINS,
    FLAT_SHARE,
    RISE_SHARE,
    directions,
    in_bins,
    medians_of,
)
from hc_estimator.stream.readings import (
    Check,
    FloatArray,
    Parts,
    Suspicion,
    noise,
    robust_range,
)
from hc_msgs_py.units import NANOSECONDS

LEAST_SHARE = 0.002
"""Of the force's range: what is less than that, a sensor's own errors may be."""
ONE_PRESS_SHARE = 0.03
"""The same where the tool came and went once: the force may have drifted, or crept, meanwhile."""
ENOUGH_TURNS = 2
MANY, FEW_SHARE = 4, 0.5
"""Of fewer passages friction that drifts looks like a zero that steps: they have to show so much
of it as they are."""
LASTING_SHARE = 0.6
"""Of what is found in the air: so much is there still in the outer half of it."""
CLEAR = 6.0
"""Deviations of the mean."""
FEWEST = 10
"""Readings in a passage, and of those in the air."""
TOP_SHARE = 0.1
"""Of the whole way: its outermost part, which is in the air if any is."""
FLAT_BINS = 4
WIDEST_SHARE, FINEST_SHARE, TRIED = 0.3, 1e-3, 25
"""Of the way through the air: the presliding displacements that are tried, and how many."""
MOST_ROWS = 40_000
"""Of the end of a recording, in which they are tried: some seconds' work."""


class Friction(NamedTuple):
    """What holds a tool back.

    Attributes:
        newtons: dry friction [N].
        deviation_n: its standard deviation [N].
        zero_n: force in the middle between the ways in and out [N].
        surface_mm: where the air ends on the way in [mm].
    """

    newtons: float
    deviation_n: float
    zero_n: float
    surface_mm: float


def find_friction(depth: FloatArray, newtons: FloatArray) -> Parts[Friction | None]:
    """Compare the force of the ways in and out, free of contact.

    Args:
        depth: penetration [mm] in the order of time, shape (n,).
        newtons: force [N] of the same instants, shape (n,).

    Returns:
        In parts: the friction; None where none is to be seen.
    """
    low, high = robust_range(depth)
    range_n = float(np.subtract(*robust_range(newtons)[::-1]))
    least_mm = TOP_SHARE * (high - low)
    passages = _passages(depth, low + least_mm, least_mm)
    if {passage.sign for passage in passages} != {1, -1}:
        return None
    yield
    begun, drift_n = _drift(passages, depth, newtons, low + least_mm)
    if len(begun) == 0:
        return None
    steady = newtons - np.interp(np.arange(len(newtons)), begun, drift_n)
    yield
    edges, place = in_bins(depth)
    noise_n, allowed_n = noise(newtons), FLAT_SHARE * range_n
    ways = {}
    for sign in (1, -1):
        mine = np.concatenate([np.arange(p.begin, p.end) for p in passages if p.sign == sign])
        ways[sign] = _levels(place[mine], steady[mine], noise_n, allowed_n)
        yield
    air = _air(ways[1], ways[-1], range_n)
    if air is None:
        return None
    near, far, end = (float(edges[i]) for i in air)
    halves, middles = _halves(passages, depth, newtons, near, far)
    yield
    if len(halves) == 0:
        return None
    found = _both_ways(halves)
    spread = 1.4826 * float(np.median(np.abs(halves[:, 1] - found)))
    deviation = math.hypot(1.25 * spread, noise_n / math.sqrt(FEWEST))
    deviation /= math.sqrt(len(halves))
    least = LEAST_SHARE if len(halves) >= ENOUGH_TURNS else ONE_PRESS_SHARE
    if found < max(CLEAR * deviation, least * range_n):
        return None
    outer, _ = _halves(passages, depth, newtons, near, 0.5 * (near + far))
    if len(outer) and _both_ways(outer) < LASTING_SHARE * found:
        return None  # what a slow sensor still shows of the tissue ceases on the way
    return Friction(found, deviation, float(np.median(middles)), end)


def held_back(friction: Friction) -> Suspicion:
    """Return the doubt about a force that friction is part of."""
    return Suspicion(
        Check.FRICTION,
        "force",
        f"free of contact the force is {2.0 * friction.newtons:.3g} N larger on the way in than on "
        f"the way out: friction of {friction.newtons:.3g} N between sensor and tissue (a cannula, "
        "a bearing, a cable), which the law takes for tissue: take it off (force.dry_friction)",
        friction.newtons,
    )


def find_presliding(
    time_s: FloatArray, displacement_mm: FloatArray, force_n: FloatArray, friction: Friction
) -> float:
    """Return how far the tool moves from rest until it slides [mm], as the air shows it.

    That with which the readings that are not left out (`DryFriction`) fit best.

    Args:
        time_s: stamps [s] in their order, shape (n,).
        displacement_mm: penetration [mm], shape (n,); NaN where there is no reading.
        force_n: force [N], shape (n,); NaN where there is no reading.
        friction: what was found of them.
    """
    time_s, displacement_mm, force_n = (
        readings[-MOST_ROWS:] for readings in (time_s, displacement_mm, force_n)
    )
    there = np.isfinite(displacement_mm)
    depth = np.interp(time_s, time_s[there], displacement_mm[there])
    in_air = np.isfinite(force_n) & (depth < friction.surface_mm)
    reach = friction.surface_mm - float(np.min(depth))
    left = force_n[in_air] - friction.zero_n
    stamps_ns = np.round(time_s * NANOSECONDS).astype(np.int64)
    widest = WIDEST_SHARE * reach
    finest = max(FINEST_SHARE * reach, SHORTEST * noise(displacement_mm[there]))
    ways = np.geomspace(min(finest, widest), widest, TRIED)
    rests = []
    for way_mm in ways.tolist():
        taken_off = DryFriction(friction.newtons, way_mm).of_many(stamps_ns, displacement_mm)
        taken_off = taken_off[in_air]
        known = ~np.isnan(taken_off)
        rests.append(float(np.mean((left - taken_off)[known] ** 2)) if known.any() else math.inf)
    return float(ways[int(np.argmin(rests))])


class _Passage(NamedTuple):
    """Samples from `begin` to before `end`, in which the tool goes in (1) or out (-1)."""

    sign: int
    begin: int
    end: int


def _passages(depth: FloatArray, outermost_mm: float, least_mm: float) -> list[_Passage]:
    """Return the ways in and out, of so much, that begin or end in the outermost part."""
    lag = _lag(depth, outermost_mm, least_mm)
    way = directions(depth, lag)
    starts = np.flatnonzero(np.concatenate(([True], way[1:] != way[:-1])))
    ends = np.append(starts[1:], len(way))
    goes = way[starts]
    rested = np.concatenate(([False], goes[:-1] == 0)), np.concatenate((goes[1:] == 0, [False]))
    # At a rest an advance over a lag begins, and ends, a lag too far within it.
    begins, ends = starts + lag * rested[0], ends - lag * rested[1]
    found = []
    for sign, begin, end in zip(goes.tolist(), begins.tolist(), ends.tolist(), strict=True):
        places = depth[begin:end]
        far = sign and end - begin >= FEWEST and np.ptp(places) > least_mm
        if far and float(np.min(places)) < outermost_mm:
            found.append(_Passage(sign, begin, end))
    return found


def _lag(depth: FloatArray, outermost_mm: float, least_mm: float) -> int:
    """Return over how many samples an advance shows the way: as the tool goes, not as it rests.

    It is a share of a recording, at most what the tool takes for `least_mm`.
    """
    lag = len(depth) // 500
    within = (depth > outermost_mm).astype(np.int64) + (depth > outermost_mm + least_mm)
    ends = np.flatnonzero(within != 1)
    goes_between = within[ends[1:]] != within[ends[:-1]]
    taken = np.diff(ends)[goes_between]
    return max(1, min(lag, int(np.median(taken))) if len(taken) else lag)


def _drift(
    passages: list[_Passage], depth: FloatArray, newtons: FloatArray, outermost_mm: float
) -> tuple[FloatArray, FloatArray]:
    """Return the samples at which the ways out end, and the force then [N]."""
    at, forces = [], []
    for passage in passages:
        rows = np.arange(passage.begin, passage.end)
        rows = rows[depth[rows] < outermost_mm]
        if passage.sign < 0 and len(rows) >= FEWEST // 2:
            at.append(float(np.mean(rows)))
            forces.append(float(np.median(newtons[rows])))
    return np.array(at), np.array(forces)


def _levels(
    place: NDArray[np.int64], newtons: FloatArray, noise_n: float, allowed_n: float
) -> tuple[FloatArray, FloatArray]:
    """Return the median force in each bin of the depth, and by how much it may be off [N]."""
    level, counts = medians_of(place, newtons)
    return level, np.maximum(allowed_n, 5.0 * noise_n / np.sqrt(np.maximum(counts, 1)))


def _air(
    going_in: tuple[FloatArray, FloatArray],
    going_out: tuple[FloatArray, FloatArray],
    range_n: float,
) -> tuple[int, int, int] | None:
    """Find where both ways are in the air, sliding, as edges of bins.

    On the way out the tool slides from the tissue on to where it turns. On the way in it does not
    at first; the longest flat part before the end of the air is where it does.

    Returns:
        First and last edge of that part, and the edge where the air ends; None without an air.
    """
    level, off = going_out
    flat = ~(np.abs(level) > off)  # it counts from what it is at the end of the way
    if np.isnan(level).all():
        return None
    flat[int(np.argmin(np.isnan(level)))] = True  # where it turns, or rests already
    end = BINS if flat.all() else int(np.argmin(flat))
    if end < FLAT_BINS:
        return None
    level, off = going_in
    if np.isnan(level).all() or float(np.nanmax(level)) < RISE_SHARE * range_n:
        return None  # no contact beside the air
    best = (0, 0)
    for first in range(end):
        flat = np.abs(level[first:end] - level[first]) <= off[first:end]
        count = len(flat) if flat.all() else int(np.argmin(flat))
        if count > best[1] - best[0]:
            best = (first, first + count)
    if best[1] - best[0] < max(FLAT_BINS, end // 3):
        return None
    return (*best, end)


def _halves(
    passages: list[_Passage], depth: FloatArray, newtons: FloatArray, near: float, far: float
) -> tuple[FloatArray, FloatArray]:
    """Compare passages with those before and after them, which go the other way.

    At the same places, for what the tool weighs when it is accelerated, and with what a drift makes
    of them in between. Of one way in and out, with each other.

    Returns:
        Direction of the passage and half the difference [N], shape (n, 2); their means [N], (n,).
    """
    nothing = np.empty((0, 2)), np.empty(0)
    signs, forces, at, slopes = [], [], [], []
    for passage in passages:
        rows = np.arange(passage.begin, passage.end)
        rows = rows[(depth[rows] > near) & (depth[rows] < far)]
        if len(rows) >= FEWEST:
            signs.append(float(passage.sign))
            forces.append(float(np.median(newtons[rows])))
            at.append(float(np.mean(rows)))
            away = rows - at[-1]
            slopes.append(float(away @ newtons[rows] / (away @ away)))
    sign, force, row = np.array(signs), np.array(forces), np.array(at)
    opposite = sign[1:] != sign[:-1]
    pairs = (0.5 * (sign[1:] * force[1:] + sign[:-1] * force[:-1]))[opposite]
    if len(sign) == 2 and opposite[0]:
        drifted = 0.5 * sign[1] * float(np.mean(slopes)) * (row[1] - row[0])
        if drifted > FEW_SHARE * pairs[0]:
            return nothing
        return np.array([[sign[0], pairs[0]]]), np.array([np.mean(force)])
    if len(sign) < 3:
        return nothing
    share = (row[1:-1] - row[:-2]) / (row[2:] - row[:-2])
    others = force[:-2] + share * (force[2:] - force[:-2])
    halves = np.stack([sign[1:-1], 0.5 * sign[1:-1] * (force[1:-1] - others)], axis=-1)
    between = opposite[:-1] & opposite[1:]
    halves, middles = halves[between], (0.5 * (force[1:-1] + others))[between]
    if 0 < len(halves) < MANY and np.median(pairs) < FEW_SHARE * _both_ways(halves):
        return nothing  # a step of the zero, which is in one pair alone
    return halves, middles


def _both_ways(halves: FloatArray) -> float:
    """Return the middle of what the ways in and the ways out show [N].

    A force that drifts other than evenly is more on the one, and less on the other: 0 if much.
    """
    shown = [float(np.median(half)) for half in (_of(halves, 1.0), _of(halves, -1.0)) if len(half)]
    middle = sum(shown) / len(shown)
    return middle if max(shown) - min(shown) <= abs(middle) else 0.0


def _of(halves: FloatArray, sign: float) -> FloatArray:
    """Return the half differences of the passages of one direction."""
    chosen: FloatArray = halves[halves[:, 0] == sign, 1]
    return chosen
