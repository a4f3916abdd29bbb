"""K, B, n and p by the points of all windows, at one candidate delay: weighted least squares.

A point weighs by the noise that its residual has: that of the force, that of the depth times the
law's slope, and that of the velocity times B d^n p |v|^(p-1). At rest the last one is large where
p is below 1, for there |v|^p is mostly noise (errors in variables by effective variance; York, Can.
J. Phys. 44, 1966). What noise of the velocity takes from B is given back (corrected least
squares; Fuller, Measurement Error Models, 1987), for a B that is too small looks like a force that
is early. p is found with the others, and not taken from elsewhere, because a delay and p are next
to one ridge. The sum of squares has a derivative by the delay: the score. It is exact at a
candidate, where between two of them interpolation would average the noise of both and draw any
least squares to the middle.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.records import CANDIDATES, JOINT_POINTS
from hc_estimator.multiple_model.rows import (
    LARGEST_VELOCITY_EXPONENT,
    SMALLEST_VELOCITY_EXPONENT,
    prior_deviation,
)
from hc_estimator.multiple_model.window_fit import (
    LARGEST_EXPONENT,
    LEAST_MOTION,
    SMALLEST_DEVIATION,
    SMALLEST_EXPONENT,
    solve_four,
)

LARGEST_STEPS = (0.4, 0.3)  # of n and p in one step
HALVINGS = 3  # of a step that makes it worse
FIRST_DAMPING = 0.02  # of K, from which a B of zero begins
SMALLEST_VARIANCE = 1e-12  # of a residual [N^2]
LEAST_GAIN = 1e-4  # of the squares, below which a fit is done


@compiled
def count_of(finder: Any) -> int:
    """Number of points that are kept."""
    return min(finder.joint_count, JOINT_POINTS)  # type: ignore[no-any-return]


@compiled
def _acceleration(finder: Any, k: int, j: int) -> float:
    """Rate of a point's velocity, by those of the candidates next to it [mm/s^2]."""
    before = min(j + 1, CANDIDATES // 2 + finder.reach)  # a larger delay is an earlier motion
    after = max(j - 1, CANDIDATES // 2 - finder.reach)
    first, last = finder.joint[k, before], finder.joint[k, after]
    change = last[2] * math.exp(last[1]) - first[2] * math.exp(first[1])
    return float(change / ((before - after) * finder.grid_step))


@compiled
def slowest(finder: Any) -> float:
    """Logarithm of the speed below which a velocity is noise, [mm/s]."""
    variance = finder.joint_noise[2]
    return 0.5 * math.log(variance) if variance > 0.0 else -math.inf


@compiled
def weigh(finder: Any, j: int, law: Any) -> None:
    """Set the weights of all points by a law at a candidate.

    Args:
        finder: joint_noise holds the variances of a point's force, depth and velocity [N^2, mm^2,
            mm^2/s^2]; joint_force[:, 1] is set [1/N^2].
        j: candidate.
        law: K, B, n, p.
    """
    least, noise = slowest(finder), finder.joint_noise
    for k in range(count_of(finder)):
        point = finder.joint[k, j]
        slope = law[2] * finder.joint_force[k, 0] * math.exp(-point[0])
        speed = max(point[1], least)
        swing = law[1] * law[3] * math.exp(law[2] * point[0] + (law[3] - 1.0) * speed)
        swing *= swing * noise[2]
        variance = noise[0] + slope * slope * noise[1] + swing
        finder.joint_force[k, 1] = 1.0 / max(variance, SMALLEST_VARIANCE)


@compiled
def add_up(settings: Any, finder: Any, j: int, law: Any) -> float:
    """Normal equations of K, B, n, p and the delay at a law (lower triangle), weighted.

    Args:
        settings: settings record, for the prior of p.
        finder: normal and slope are set, joint_taken, what normal lacks on B for the noise of the
            velocity, and joint_squares: weighted squares left, those of the prior among them.
        j: candidate.
        law: K, B, n, p.

    Returns:
        joint_squares less what noise of the velocity adds to them.
    """
    normal, slope, column = finder.normal, finder.slope, finder.column
    for i in range(5):
        slope[i] = 0.0
        for m in range(5):
            normal[i, m] = 0.0
    left, taken, by_n, by_p = 0.0, 0.0, 0.0, 0.0
    least, variance = slowest(finder), finder.joint_noise[2]
    for k in range(count_of(finder)):
        point = finder.joint[k, j]
        power = math.exp(law[2] * point[0])
        rate = point[2] * math.exp(law[3] * point[1])
        force = power * (law[0] + law[1] * rate)
        speed = math.exp(point[1])
        column[0] = power
        column[1] = power * rate
        column[2] = force * point[0]
        column[3] = power * law[1] * rate * point[1]
        moves = law[2] * force * point[2] * speed * math.exp(-point[0])
        bends = power * law[1] * law[3] * abs(rate) / speed * _acceleration(finder, k, j)
        column[4] = -(moves + bends)
        weight = finder.joint_force[k, 1]
        residual = finder.joint_force[k, 0] - force
        left += weight * residual * residual
        for i in range(5):
            slope[i] += weight * column[i] * residual
            for m in range(i + 1):
                normal[i, m] += weight * column[i] * column[m]
        usual = max(point[1], least)
        swing = power * law[3] * math.exp((law[3] - 1.0) * usual)
        swing *= swing * weight * variance
        taken += swing
        by_n += swing * point[0]
        by_p += swing * (1.0 / law[3] + usual)
    share = min(1.0, (1.0 - LEAST_MOTION) * normal[1, 1] / taken) if taken > 0.0 else 0.0
    slope[1] += share * law[1] * taken
    slope[2] += share * law[1] * law[1] * by_n
    slope[3] += share * law[1] * law[1] * by_p
    finder.joint_taken = share * taken
    normal[1, 1] -= finder.joint_taken
    deviation = max(prior_deviation(settings, 3), SMALLEST_DEVIATION)
    off = (settings.initial_velocity_exponent - law[3]) / deviation
    normal[3, 3] += 1.0 / (deviation * deviation)
    slope[3] += off / deviation
    finder.joint_squares = left + off * off
    return finder.joint_squares - law[1] * law[1] * finder.joint_taken  # type: ignore[no-any-return]


@compiled
def improve(settings: Any, finder: Any, j: int, steps: int) -> None:
    """Gauss-Newton on K, B >= 0, n and p of a candidate.

    Args:
        settings: settings record.
        finder: joint_law[j] is where it begins and is improved; joint_left[j], joint_score[j] and
            joint_information[j] are set.
        j: candidate.
        steps: at most.
    """
    law, trial, slope = finder.joint_law[j], finder.trial, finder.slope
    if not law[1] > 0.0:
        law[1] = FIRST_DAMPING * law[0]
    left = add_up(settings, finder, j, law)
    for _ in range(steps):
        fixed = 1 if law[1] <= 0.0 and slope[1] <= 0.0 else -1
        if not solve_four(finder.normal, slope, fixed):
            break
        size, better = 1.0, math.inf
        largest = max(abs(slope[2]) / LARGEST_STEPS[0], abs(slope[3]) / LARGEST_STEPS[1])
        if largest > 1.0:
            size = 1.0 / largest
        for i in range(4):
            finder.direction[i] = slope[i]
        for _ in range(HALVINGS):
            for i in range(4):
                trial[i] = law[i] + size * finder.direction[i]
            _limit(trial)
            better = add_up(settings, finder, j, trial)
            if better < left:
                break
            size *= 0.5
        if not better < left:
            break
        done = left - better < LEAST_GAIN * finder.joint_squares
        left = better
        for i in range(4):
            law[i] = trial[i]
        if done:
            break
    add_up(settings, finder, j, law)
    finder.joint_left[j] = finder.joint_squares
    _note_score(finder, j, law)


@compiled
def _limit(law: Any) -> None:
    """Keep a law within what tissue may have."""
    law[0] = max(law[0], 0.0)
    law[1] = max(law[1], 0.0)
    law[2] = min(max(law[2], SMALLEST_EXPONENT), LARGEST_EXPONENT)
    law[3] = min(max(law[3], SMALLEST_VELOCITY_EXPONENT), LARGEST_VELOCITY_EXPONENT)


@compiled
def _note_score(finder: Any, j: int, law: Any) -> None:
    """Score and information of the delay, K, B, n and p having been found (Schur complement)."""
    normal, slope = finder.normal, finder.slope
    normal[1, 1] += finder.joint_taken  # it bends the squares, and tells nothing
    for k in range(4):
        pivot = normal[k, k]
        if not pivot > 0.0 or (law[1] <= 0.0 and k in (1, 3)):
            continue
        for i in range(k + 1, 5):
            share = normal[i, k] / pivot
            slope[i] -= share * slope[k]
            for m in range(k + 1, i + 1):
                normal[i, m] -= share * normal[m, k]
    finder.joint_score[j] = slope[4]
    finder.joint_information[j] = max(normal[4, 4], 0.0)
