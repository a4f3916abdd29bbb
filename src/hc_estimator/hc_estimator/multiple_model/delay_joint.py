"""One fit of the law to all windows of the delay: where the tissue stays, it says more than they.

A window of its own has three parameters, and in half a second of a press or of a tap these take up
what a delay does. Tissue that stays has the same K, B and n in all windows. So some points of each
window are kept, as they are for each candidate delay, and what a fit to all of them leaves says
which candidate it is. It is asked where that fit leaves little, and the tool has gone both ways:
along one way a delay is nothing but another depth. (Ours; `hc bench accuracy together`, presses and
tapping out of step.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model.delay_rules import APART, LEAD, RIVAL
from hc_estimator.multiple_model.records import CANDIDATES, JOINT_POINTS
from hc_estimator.multiple_model.rows import (
    LARGEST_VELOCITY_EXPONENT,
    SMALLEST_VELOCITY_EXPONENT,
    prior_deviation,
)
from hc_estimator.multiple_model.window_fit import (
    EXPONENTS,
    LEAST_RESIDUAL,
    SMALLEST_DEVIATION,
    gather,
    secant_step,
    stiffness_and_damping,
    within_limits,
)
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "delay_by_common_fit",
        "bool",
        True,
        "Look for the delay by one fit to all windows of a tissue that stays, not by each alone.",
    ),
)

EVERY = 5  # points of the grid between two that are kept
INDEPENDENT = 0.5  # share of the points that counts as independent: 0.1 s apart
ALIKE = 0.1  # the same where the law misfits: half a second apart
MISFITTING = 20.0  # squares that are left, over those of the noise, from which on it does
FEWEST = 24  # points
NEW = 1.0 / 8.0  # share of the points that must be new for another fit
REFINEMENTS = 3  # secant steps for n
WIDTH = 0.1  # of the first of them
LARGEST_NOISE = 0.3  # share of noise in the squares of the damping that K does not explain
LEAST_BACK = 0.2  # of the way deeper that must have been gone back, or the other way round
LARGEST_MISFIT = 0.05  # of the RMS force that the fit may leave
INTERPOLATED = 0.1  # error of a delay between two candidates, in steps of the grid
FAR = 1.0  # steps of the grid
TAKEN_OFF = 0.5  # of what noise of the velocities leaves that is in doubt: its variance is a guess
LEAST_RELATIVE = 1e-9  # deviation of a speed over the speed: its sign is that of the velocity
# Squares that the delay in use leaves over those of the best: what smoothing and a p that is not
# known well leave is alike in all points, however many they are.
LEAST_RATIO = 3.0


@compiled
def reset(finder: Any) -> None:
    """There is no common fit; what is felt from now on may make one."""
    finder.joint_count = 0
    finder.joint_from = finder.grid_count


@compiled
def take(finder: Any) -> None:
    """Take some points of a window that is in contact, and whose n is found."""
    finder.joint_from = min(finder.joint_from, finder.grid_count)  # the grid has begun anew
    if finder.first < finder.joint_from:
        return  # the tissue before it is in this window
    if finder.joint_count == 0:
        for j in range(CANDIDATES):
            finder.joint_exponent[j] = 0.0
    centre, added = CANDIDATES // 2, 0
    deviation = math.sqrt(finder.velocity_variance)
    for j in range(centre - finder.reach, centre + finder.reach + 1):
        count = gather(finder, (j - centre) * finder.grid_step)
        added = 0
        for k in range(EVERY // 2, count, EVERY):
            slot = (finder.joint_count + added) % JOINT_POINTS
            point = finder.points_of[k]
            finder.joint[slot, j, 0] = point[0]
            log_speed = math.log(abs(point[1])) / finder.velocity_exponent
            finder.joint[slot, j, 1] = log_speed
            relative = deviation / max(math.exp(log_speed), deviation)
            finder.joint[slot, j, 2] = math.copysign(max(relative, LEAST_RELATIVE), point[1])
            finder.joint_force[slot] = point[3]
            added += 1
    finder.joint_count += added


@compiled
def _left(finder: Any, j: int, exponent: float) -> float:
    """Squares that the best K and B >= 0 leave at a candidate and an n [N^2]; these in finder.fit.

    Less what noise of the velocities adds, as in `window_fit.linear_fit`; all of them where it is
    so large a part of what tells B from K that anything would fit.
    """
    g00, g01, g11, r0, r1, total, noise = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    p = finder.velocity_exponent
    for k in range(min(finder.joint_count, JOINT_POINTS)):
        point = finder.joint[k, j]
        a = math.exp(exponent * point[0])
        power = a * math.exp(p * point[1])
        b = math.copysign(power, point[2])
        force = finder.joint_force[k]
        g00 += a * a
        g01 += a * b
        g11 += b * b
        # With the p of this fit: with that of the window one that is too small fitted too well.
        noise += (p * power * point[2]) ** 2
        r0 += a * force
        r1 += b * force
        total += force * force
    if noise > LARGEST_NOISE * (g11 - g01 * g01 / g00):
        return total
    g11 -= noise
    stiffness, damping = stiffness_and_damping(g00, g01, g11, r0, r1)
    finder.fit[0] = stiffness
    finder.fit[1] = damping
    finder.fit[2] = exponent
    left = max(total - stiffness * r0 - damping * r1, LEAST_RESIDUAL * total)
    return float(left + TAKEN_OFF * damping * damping * noise)


@compiled
def _refine(finder: Any, j: int) -> float:
    """Improve the n of a candidate by secant steps; what it leaves [N^2].

    The first fit looks everywhere: the n of one window may be anything.
    """
    exponent, width = finder.joint_exponent[j], WIDTH
    best = math.inf
    if exponent == 0.0:
        for trial in EXPONENTS:
            left = _left(finder, j, trial)
            if left < best:
                exponent, best = trial, left
    else:
        best = _left(finder, j, exponent)
    for _ in range(REFINEMENTS):
        above = _left(finder, j, exponent + width)
        below = _left(finder, j, exponent - width)
        step = secant_step(above, best, below, width)
        trial = within_limits(exponent + step)
        left = _left(finder, j, trial)
        if left < best:
            exponent, best = trial, left
        if abs(step) <= width:  # else it is still on its way
            width = max(0.3 * width, 0.002)
    finder.joint_exponent[j] = exponent
    return best


@compiled
def decide(settings: Any, finder: Any, force_noise: float) -> bool:
    """True if the common fit clearly says a delay, in finder.joint_delay.

    The fit is made anew once it has points enough that are new; until then it says what it said.

    Args:
        settings: settings record.
        finder: the fit is changed.
        force_noise: variance of a reading [N^2].
    """
    count = min(finder.joint_count, JOINT_POINTS)
    if count < FEWEST:
        finder.joint_fitted = 0
        finder.joint_clear = 0
    elif finder.joint_count - finder.joint_fitted >= NEW * count:
        finder.joint_fitted = finder.joint_count
        finder.joint_clear = (
            1 if _goes_both_ways(finder, count) and _fit(settings, finder, force_noise) else 0
        )
    return bool(finder.joint_clear != 0)


@compiled
def _fit(settings: Any, finder: Any, force_noise: float) -> bool:
    """Find the delay of the common fit; False if it says none clearly.

    Args:
        settings: settings record.
        finder: joint_left, joint_delay and its deviation are set, the n of the fits improved.
        force_noise: variance of a reading [N^2].
    """
    count = min(finder.joint_count, JOINT_POINTS)
    centre, step = CANDIDATES // 2, finder.grid_step
    low, high = centre - finder.reach, centre + finder.reach
    noise = count * force_noise / grids.readings_of(finder)
    chosen = centre
    for j in range(low, high + 1):
        finder.joint_left[j] = _refine(finder, j) + noise
        if finder.joint_left[j] < finder.joint_left[chosen]:
            chosen = j
    best, total = finder.joint_left[chosen], 0.0
    for k in range(count):
        total += finder.joint_force[k] ** 2
    if chosen in (low, high) or best > LARGEST_MISFIT**2 * total:
        return False
    weight = _weight(count, best, noise)
    for j in range(low, high + 1):
        rival = abs(j - chosen) * step > APART
        if rival and weight * math.log(finder.joint_left[j] / best) < RIVAL:
            return False
    before, after = finder.joint_left[chosen - 1], finder.joint_left[chosen + 1]
    bend = before - 2.0 * best + after
    if not bend > 0.0:  # several do equally well
        return False
    offset = 0.5 * (before - after) / bend
    finder.joint_delay = (chosen - centre + offset) * step
    variance = INTERPOLATED**2 + best / (weight * bend)
    finder.joint_deviation = min(math.sqrt(variance), 0.5) * step
    if not is_far(finder, finder.delay):
        return True
    used = min(max(centre + round(finder.delay / step), low), high)
    if not _leads(finder.joint_left[used] / best, weight):
        return False
    # The p in use goes with the delay that the windows say: with its own, the other may do better.
    return _leads(_left_with_its_own_p(settings, finder, used, weight, noise) / best, weight)


@compiled
def _leads(ratio: float, weight: float) -> bool:
    """True if the delay in use leaves so many times the squares of the best that it is not it."""
    return bool(ratio > LEAST_RATIO and weight * math.log(ratio) > LEAD)


@compiled
def _left_with_its_own_p(settings: Any, finder: Any, j: int, weight: float, noise: float) -> float:
    """Squares that a candidate leaves with the p that suits it best [N^2], and the prior of p.

    Args:
        settings: settings record.
        finder: as it was afterwards.
        j: candidate.
        weight: log likelihood by the logarithm of the squares.
        noise: squares that noise adds to what the fit leaves [N^2].
    """
    in_use, exponent = finder.velocity_exponent, finder.joint_exponent[j]
    p, width, best = in_use, WIDTH, finder.joint_left[j] - noise
    for _ in range(REFINEMENTS):
        step = secant_step(
            _left_at(finder, j, p + width), best, _left_at(finder, j, p - width), width
        )
        trial = min(max(p + step, SMALLEST_VELOCITY_EXPONENT), LARGEST_VELOCITY_EXPONENT)
        left = _left_at(finder, j, trial)
        if left < best:
            p, best = trial, left
        if abs(step) <= width:
            width *= 0.3
    finder.velocity_exponent = in_use
    finder.joint_exponent[j] = exponent
    less_likely = 0.5 * (_deviations(settings, p) ** 2 - _deviations(settings, in_use) ** 2)
    return float((best + noise) * math.exp(less_likely / weight))


@compiled
def _left_at(finder: Any, j: int, p: float) -> float:
    """Squares that a candidate leaves with another p, which is then in use [N^2]."""
    finder.velocity_exponent = p
    return _refine(finder, j)


@compiled
def _deviations(settings: Any, p: float) -> float:
    """How many deviations of its prior a p is off."""
    deviation = max(prior_deviation(settings, 3), SMALLEST_DEVIATION)
    return float((p - settings.initial_velocity_exponent) / deviation)


@compiled
def note_fit(finder: Any) -> None:
    """K, B and n of the common fit at its delay, in finder.fit: between those of two candidates."""
    place = finder.joint_delay / finder.grid_step + CANDIDATES // 2
    before = min(max(int(place), 0), CANDIDATES - 2)
    share = place - before
    _left(finder, before, finder.joint_exponent[before])
    stiffness, damping, exponent = finder.fit[0], finder.fit[1], finder.fit[2]
    _left(finder, before + 1, finder.joint_exponent[before + 1])
    finder.fit[0] = stiffness + share * (finder.fit[0] - stiffness)
    finder.fit[1] = damping + share * (finder.fit[1] - damping)
    finder.fit[2] = exponent + share * (finder.fit[2] - exponent)


@compiled
def is_far(finder: Any, delay: float) -> bool:
    """True if a delay is not the one of the common fit; near it others know the value better."""
    return bool(abs(finder.joint_delay - delay) > FAR * finder.grid_step)


@compiled
def _weight(count: int, best: float, noise: float) -> float:
    """Log likelihood by the logarithm of the squares: half the number of independent points.

    What noise does not explain is alike for as long as the tool goes one way.
    """
    share = INDEPENDENT if best < MISFITTING * noise else ALIKE
    return 0.5 * share * count


@compiled
def _goes_both_ways(finder: Any, count: int) -> bool:
    """True if the tool has gone deeper and back, neither five times as far as the other."""
    deeper, back = 0.0, 0.0
    for k in range(count):
        point = finder.joint[k, CANDIDATES // 2]
        velocity = math.copysign(math.exp(point[1]), point[2])
        deeper += max(velocity, 0.0)
        back += max(-velocity, 0.0)
    return bool(min(deeper, back) > LEAST_BACK * max(deeper, back))
