"""One fit of the law to all windows of the delay: where the tissue stays, it says more than they.

A window of its own has three parameters, and in half a second of a press or of a tap these take up
what a delay does. Tissue that stays has the same K, B, n and p in all windows. So some points of
each window are kept, as they are for each candidate delay, and what a fit to all of them leaves
(`delay_fit`) says which candidate it is; the zero of the score between two of them says the delay.
It is asked where that fit leaves little, and the tool has gone both ways: along one way a delay is
nothing but another depth. (Ours; `hc bench accuracy together`, presses and tapping out of step,
and `multirate`.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import delay_fit, smoothing
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model.delay_rules import APART, LEAD, RIVAL
from hc_estimator.multiple_model.records import CANDIDATES, JOINT_POINTS
from hc_estimator.multiple_model.window_fit import EXPONENTS, gather, stiffness_and_damping
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
MISFITTING = 4.0  # squares that are left, over those of the noise, from which on it does
FEWEST = 24  # points
NEW = 1.0 / 8.0  # share of the points that must be new for another fit
FIRST_STEPS = 8  # of a fit that begins anew
STEPS = 3  # of one that goes on
LARGEST_NOISE = 0.3  # share of noise in the squares of the damping that K does not explain
LEAST_BACK = 0.2  # of the way deeper that must have been gone back, or the other way round
LARGEST_MISFIT = 0.05  # of the RMS force that the fit may leave
INTERPOLATED = 0.1  # error of a delay between two candidates, in steps of the grid
FAR = 3.0  # deviations, from which on it is another delay
BEGINS = 5.0  # the same, where none is in use
# Squares that the delay in use leaves over those of the best: what smoothing leaves of a motion
# with corners is alike in all points, however many they are.
LEAST_RATIO = 1.5
BISECTIONS = 12


@compiled
def reset(finder: Any) -> None:
    """There is no common fit; what is felt from now on may make one."""
    finder.joint_count = 0
    finder.joint_fitted = 0
    finder.joint_clear = 0
    finder.joint_from = finder.grid_count
    finder.joint_fits = 0


@compiled
def take(finder: Any) -> None:
    """Take some points of a window that is in contact, and whose n is found."""
    finder.joint_from = min(finder.joint_from, finder.grid_count)  # the grid has begun anew
    if finder.first < finder.joint_from:
        return  # the tissue before it is in this window
    centre, added = CANDIDATES // 2, 0
    for j in range(centre - finder.reach, centre + finder.reach + 1):
        count = gather(finder, (j - centre) * finder.grid_step)
        added = 0
        for k in range(EVERY // 2, count, EVERY):
            slot = (finder.joint_count + added) % JOINT_POINTS
            point = finder.points_of[k]
            finder.joint[slot, j, 0] = point[0]
            finder.joint[slot, j, 1] = math.log(abs(point[1])) / finder.velocity_exponent
            finder.joint[slot, j, 2] = math.copysign(1.0, point[1])
            finder.joint_force[slot, 0] = point[3]
            added += 1
    finder.joint_count += added


@compiled
def decide(settings: Any, finder: Any, sensor_noise: Any) -> bool:
    """True if the common fit clearly says a delay, in finder.joint_delay.

    The fit is made anew once it has points enough that are new; until then it says what it said.

    Args:
        settings: settings record.
        finder: the fit is changed.
        sensor_noise: variances of displacement and force [mm^2], [N^2].
    """
    count = delay_fit.count_of(finder)
    if count < FEWEST:
        return False
    if finder.joint_count - finder.joint_fitted >= NEW * count:
        clear = _goes_both_ways(finder, count)
        if clear:
            _note_noise(finder, sensor_noise)
            _fit(settings, finder)
            clear = _is_clear(finder, count)
        finder.joint_fitted = finder.joint_count
        finder.joint_clear = 1 if clear else 0
    return bool(finder.joint_clear != 0)


@compiled
def _note_noise(finder: Any, sensor_noise: Any) -> None:
    """Variances of a smoothed point's force, depth and velocity, in finder.joint_noise."""
    width = finder.grid_width + 2.0 * finder.neighbours * finder.grid_step
    for i in range(2):
        readings = max(width / max(grids.period(finder, i), 1e-9), 1.0)
        finder.joint_noise[1 - i] = smoothing.VALUE_VARIANCE * sensor_noise[i] / readings
    finder.joint_noise[2] = finder.velocity_variance


@compiled
def _fit(settings: Any, finder: Any) -> None:
    """Fit the law at every candidate, with the weights of the likeliest one so far.

    Where no law has been found that fits, each candidate begins anew.

    Args:
        settings: settings record.
        finder: joint_law, joint_left, joint_chosen, scores and information are set.
    """
    low, high = CANDIDATES // 2 - finder.reach, CANDIDATES // 2 + finder.reach
    if finder.joint_fits == 0:
        for j in range(low, high + 1):
            left = _begin(settings, finder, j)
            if j == low or left < finder.joint_left[finder.joint_chosen]:
                finder.joint_chosen = j
            finder.joint_left[j] = left
        _improve(settings, finder, FIRST_STEPS)
    _improve(settings, finder, STEPS)
    _give_a_second_chance(settings, finder, _candidate_in_use(finder))
    count = delay_fit.count_of(finder)
    fits = finder.joint_left[finder.joint_chosen] < MISFITTING * count
    finder.joint_fits = 1 if fits else 0


@compiled
def _begin(settings: Any, finder: Any, j: int) -> float:
    """First law of a candidate, with the usual p and the n that leaves least; these squares."""
    law, best, p = finder.joint_law[j], math.inf, settings.initial_velocity_exponent
    for exponent in EXPONENTS:
        g00, g01, g11, r0, r1, total = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(delay_fit.count_of(finder)):
            point = finder.joint[k, j]
            a = math.exp(exponent * point[0])
            b = a * point[2] * math.exp(p * point[1])
            force = finder.joint_force[k, 0]
            g00 += a * a
            g01 += a * b
            g11 += b * b
            r0 += a * force
            r1 += b * force
            total += force * force
        stiffness, damping = stiffness_and_damping(g00, g01, g11, r0, r1)
        left = total - stiffness * r0 - damping * r1
        if left < best:
            best = left
            law[0], law[1], law[2], law[3] = stiffness, damping, exponent, p
    return best


@compiled
def _improve(settings: Any, finder: Any, steps: int) -> None:
    """Improve the law of every candidate; joint_chosen becomes the one that leaves least."""
    low, high = CANDIDATES // 2 - finder.reach, CANDIDATES // 2 + finder.reach
    chosen = finder.joint_chosen
    delay_fit.weigh(finder, chosen, finder.joint_law[chosen])
    for j in range(low, high + 1):
        delay_fit.improve(settings, finder, j, steps)
        if j == low or finder.joint_left[j] < finder.joint_left[finder.joint_chosen]:
            finder.joint_chosen = j


@compiled
def _candidate_in_use(finder: Any) -> int:
    """Candidate nearest to the delay in use."""
    centre = CANDIDATES // 2
    near = centre + round(finder.delay / finder.grid_step)
    return min(max(near, centre - finder.reach), centre + finder.reach)  # type: ignore[no-any-return]


@compiled
def _give_a_second_chance(settings: Any, finder: Any, j: int) -> None:
    """Improve a candidate from the law of the chosen one, too: it may have kept to a false optimum.

    Args:
        settings: settings record.
        finder: what was found for the candidate is changed if this is better.
        j: candidate.
    """
    chosen = finder.joint_chosen
    if j == chosen:
        return
    law, before = finder.joint_law[j], finder.joint_left[j]
    score, information = finder.joint_score[j], finder.joint_information[j]
    for i in range(4):
        finder.joint_before[i] = law[i]
        law[i] = finder.joint_law[chosen, i]
    delay_fit.improve(settings, finder, j, FIRST_STEPS)
    if finder.joint_left[j] < finder.joint_left[chosen]:
        finder.joint_chosen = j
    if not finder.joint_left[j] < before:
        finder.joint_left[j] = before
        finder.joint_score[j] = score
        finder.joint_information[j] = information
        for i in range(4):
            law[i] = finder.joint_before[i]


@compiled
def _is_clear(finder: Any, count: int) -> bool:
    """True if the fits say one delay; it and its deviation are then set.

    Args:
        finder: with the fits; joint_delay and joint_deviation are set.
        count: number of points.
    """
    centre, step, chosen = CANDIDATES // 2, finder.grid_step, finder.joint_chosen
    low, high = centre - finder.reach, centre + finder.reach
    if chosen in (low, high) or not _explains(finder, count):
        return False
    best = finder.joint_left[chosen]
    weight = _weight(count, best)
    for j in range(low, high + 1):
        rival = abs(j - chosen) * step > APART
        if rival and weight * math.log(finder.joint_left[j] / best) < RIVAL:
            return False
    finder.joint_delay = (chosen - centre + _zero_of_the_score(finder)) * step
    known = 2.0 * weight / count * finder.joint_information[chosen] * step * step
    variance = INTERPOLATED**2 + max(best / count, 1.0) / known if known > 0.0 else math.inf
    finder.joint_deviation = min(math.sqrt(variance), float(finder.reach)) * step
    return True


@compiled
def leads(finder: Any) -> bool:
    """True if the delay of the common fit, which is clear, is far likelier than the one in use."""
    away = abs(finder.joint_delay - finder.delay)
    if not away > (BEGINS if finder.delay == 0.0 else FAR) * finder.joint_deviation:
        return False
    used, chosen = _candidate_in_use(finder), finder.joint_chosen
    best = finder.joint_left[chosen]
    weight = _weight(delay_fit.count_of(finder), best)
    ratio = finder.joint_left[used] / best
    return bool(used == chosen or (ratio > LEAST_RATIO and weight * math.log(ratio) > LEAD))


@compiled
def _zero_of_the_score(finder: Any) -> float:
    """Where the score vanishes, in steps from the chosen candidate, at most half a step beyond.

    Between two candidates of which the scores point at each other it is a parabola, with the
    difference of the squares as its integral.
    """
    chosen, step = finder.joint_chosen, finder.grid_step
    score = finder.joint_score[chosen] * step
    side = 1 if score > 0.0 else -1
    other = finder.joint_score[chosen + side] * step
    if score * other >= 0.0:
        information = finder.joint_information[chosen] * step * step
        return float(min(max(score / information, -0.5), 0.5)) if information > 0.0 else 0.0
    gained = 0.5 * (finder.joint_left[chosen] - finder.joint_left[chosen + side])
    bend = 6.0 * (gained - 0.5 * side * (score + other))
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        x = 0.5 * (low + high)
        here = side * (score * (1.0 - x) + other * x) + bend * x * (1.0 - x)
        if here > 0.0:  # it is positive at the chosen one, in this direction
            low = x
        else:
            high = x
    return side * 0.5 * (low + high)


@compiled
def _explains(finder: Any, count: int) -> bool:
    """True if the likeliest fit leaves little of the force, and its damping is not of noise."""
    chosen = finder.joint_chosen
    law = finder.joint_law[chosen]
    left, total, noise, g00, g01, g11 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        point = finder.joint[k, chosen]
        a = math.exp(law[2] * point[0])
        b = a * point[2] * math.exp(law[3] * point[1])
        force = finder.joint_force[k, 0]
        left += (force - law[0] * a - law[1] * b) ** 2
        total += force * force
        weight = finder.joint_force[k, 1]
        g00 += weight * a * a
        g01 += weight * a * b
        g11 += weight * b * b
        speed = max(point[1], delay_fit.slowest(finder))
        by_speed = a * law[3] * math.exp((law[3] - 1.0) * speed)
        noise += weight * by_speed * by_speed * finder.joint_noise[2]
    shown = g11 - g01 * g01 / g00
    return bool(left < LARGEST_MISFIT**2 * total and noise < LARGEST_NOISE * shown)


@compiled
def note_fit(finder: Any) -> None:
    """K, B and n of the common fit at its delay, in finder.fit: between those of two candidates."""
    place = finder.joint_delay / finder.grid_step + CANDIDATES // 2
    before = min(max(int(place), 0), CANDIDATES - 2)
    share = place - before
    for i in range(3):
        first, last = finder.joint_law[before, i], finder.joint_law[before + 1, i]
        finder.fit[i] = first + share * (last - first)


@compiled
def contradicts(finder: Any, delay: float) -> bool:
    """True if the common fit clearly says another delay."""
    away = abs(finder.joint_delay - delay)
    return bool(finder.joint_clear != 0 and away > FAR * finder.joint_deviation)


@compiled
def _weight(count: int, best: float) -> float:
    """Log likelihood by the logarithm of the squares: half the number of independent points.

    What noise does not explain is alike for as long as the tool goes one way.
    """
    share = INDEPENDENT if best < MISFITTING * count else ALIKE
    return 0.5 * share * count


@compiled
def _goes_both_ways(finder: Any, count: int) -> bool:
    """True if the tool has gone deeper and back, neither five times as far as the other."""
    deeper, back = 0.0, 0.0
    for k in range(count):
        point = finder.joint[k, CANDIDATES // 2]
        velocity = point[2] * math.exp(point[1])
        deeper += max(velocity, 0.0)
        back += max(-velocity, 0.0)
    return bool(min(deeper, back) > LEAST_BACK * max(deeper, back))
