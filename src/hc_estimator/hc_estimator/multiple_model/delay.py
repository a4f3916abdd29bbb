"""By how much is the force late? Short windows, each with parameters of its own, say it together.

Sensors filter and networks delay, and a delay of the force looks like damping (a negative one like
damping that is not there). The delay cannot be a state: the likelihood has two optima, one false.
Instead the readings of every half second are fitted, for each candidate delay, by the law F = d^n
(K + B v^p), B >= 0 (ours). Windows of their own are what makes this immune to tissue that varies.
The logarithm of what a fit leaves is a log likelihood with an unknown noise per window; the
windows' sum chooses, and their scatter says whether the answer is clear. A Gauss-Newton fit gives
the fine value. One window says too little of p, and with another p it would say another delay: each
keeps its information on both, and both are found from the sum, with the prior of p. (The p of the
filters would not do: next to a wrong delay they find the p that goes with it.) Where p is so wrong
that no window has a fine value near the likeliest candidate, as a quick tool's may be, a few others
are tried.

Where the tissue stays, one fit to all windows says the delay (`delay_joint`), and near it the
innovations of the filter say the value (`delay_evidence`); the windows remain for tissue that
varies and for a law that misses.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import delay_evidence, delay_joint, smoothing
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model.delay_exponent import FEWEST_WINDOWS, find_exponent
from hc_estimator.multiple_model.delay_rules import (
    APART,
    CORRECTED,
    CORRECTION,
    LEAD,
    RIVAL,
    SMALLEST,
    student_quantile,
)
from hc_estimator.multiple_model.records import (
    CANDIDATES,
    WINDOWS,
)
from hc_estimator.multiple_model.rows import (
    LARGEST_VELOCITY_EXPONENT,
    SMALLEST_VELOCITY_EXPONENT,
    prior_deviation,
)
from hc_estimator.multiple_model.window_fit import (
    EXPONENTS,
    NEAR,
    SMALLEST_DEVIATION,
    find_contact,
    fine_delay,
    gather,
    linear_fit,
    noise_left,
    refine_exponent,
    take_profile,
)

LEAST_SHARE = 0.3  # of a window that must be in contact
FEWEST_POINTS = 12  # of a window: three for each unknown
# When the answer is clear:
FEWEST_DECISIVE = 2  # windows that are enough where each decides by itself
DECISIVE = 4.0  # log likelihood ratio of a window that does
LEAST_NEAR = 0.4  # share of the windows that must have a fine value near the candidate
CONSISTENT = 4.0  # mean over standard error of the windows' ratios
CONTRADICTED = 0.75  # of a step, between the fine value and the likeliest candidate
INFLUENCE = 4.0  # of a window's log likelihood ratio in that mean, at most
SIGNIFICANT = 4.5  # standard deviations
DOUBTFUL = 3.0  # the same, from which on it is no longer believed that there is none
LESS_CONSISTENT = 3.0  # the same, where the fine values are clear as well
AGREEING = 0.7  # share of the windows with a fine value that must be near the candidate then
FEWEST_AGREEING = 8  # windows of which that is so, at least


@compiled
def reset(finder: Any) -> None:
    """Nothing is known of the delay."""
    finder.delay = 0.0
    finder.deviation = math.nan
    finder.doubt = 0.0
    finder.windows = 0
    finder.velocity_exponent = 1.0
    finder.exponent_windows = 0
    finder.exponent_chosen = 0
    finder.agreed = 0
    delay_joint.reset(finder)
    delay_evidence.reset(finder)
    grids.restart(finder)


@compiled
def forget_tissue(finder: Any) -> None:
    """It is another tissue: what was fitted to all windows together is none of it."""
    delay_joint.reset(finder)


@compiled
def forget_zeros(finder: Any) -> None:
    """The zeros are others: what was said of the delay rests on the old ones."""
    finder.windows = 0
    delay_joint.reset(finder)
    delay_evidence.reset(finder)


@compiled
def learn_window(
    settings: Any, finder: Any, sensor_noise: Any, constant: bool, misses: bool
) -> bool:
    """Take a full window into what is known; True if the delay in use is to change.

    The new delay is then finder.delay, and the window's K, B and n at it are finder.fit.

    Args:
        settings: settings record.
        finder: changed.
        sensor_noise: variances of displacement and force [mm^2], [N^2].
        constant: False where tissue or surface seem to vary: that looks like a small delay.
        misses: True if the law of the filter misses more than the noise; else the filter's own
            innovations (`delay_evidence`) say the delay more finely than the windows.
    """
    noise = sensor_noise[0]
    if finder.neighbours > 0:
        readings = grids.readings_of(finder)
        finder.velocity_variance = smoothing.velocity_variance(finder, noise, readings)
    else:
        finder.velocity_variance = grids.velocity_variance(finder, noise)
    if finder.windows == 0 and finder.exponent_chosen == 0:
        finder.velocity_exponent = settings.initial_velocity_exponent
    if find_contact(finder) < max(LEAST_SHARE * finder.points, FEWEST_POINTS):
        return False
    smoothing.smooth(finder)
    slot = finder.windows % WINDOWS
    centre = CANDIDATES // 2
    count = gather(finder, 0.0)
    best = math.inf
    finder.noise_left = 0.0
    for exponent in EXPONENTS:
        left = linear_fit(finder, count, exponent)
        if left < best:
            best = left
            finder.guess[2] = exponent
            finder.noise_left = noise_left(finder, count)
    take_profile(finder, finder.profile[slot])
    common = False
    if settings.delay_by_common_fit != 0:
        delay_joint.take(finder)
        common = delay_joint.decide(settings, finder, sensor_noise)
    finder.windows += 1
    chosen = _choose(finder)
    start = (chosen - centre) * finder.grid_step
    count = gather(finder, start)
    finder.fit[2] = finder.guess[2]
    refine_exponent(finder, count)
    finder.fine_valid[slot] = 1 if fine_delay(finder, start, slot) else 0
    windows = min(finder.windows, WINDOWS)
    lost = _used_windows(finder, chosen, windows) <= LEAST_NEAR * windows
    if not lost or finder.delay != 0.0 or finder.exponent_chosen != 0:
        finder.exponent_windows = 0
    elif windows >= FEWEST_WINDOWS and find_exponent(settings, finder, finder.profile[slot]):
        finder.windows = 0
        return False
    if common and delay_joint.leads(finder):
        finder.delay = finder.joint_delay
        finder.deviation = finder.joint_deviation
        finder.doubt = finder.deviation**2
        delay_joint.note_fit(finder)
        return True
    if finder.joint_fits != 0:  # one law for all windows: none of them knows more than it
        finder.agreed = 0
        if finder.delay == 0.0:
            _tell_none(finder, finder.joint_delay, finder.joint_deviation if common else math.nan)
        return False
    return _decide(settings, finder, chosen, constant, misses, common)


@compiled
def _tell_none(finder: Any, mean: float, deviation: float) -> None:
    """Deviation of no delay: what is not enough to be used may be too much for none."""
    doubtful = abs(mean) > DOUBTFUL * deviation
    finder.deviation = math.hypot(deviation, mean) if doubtful else deviation
    finder.doubt = finder.deviation**2 if doubtful else 0.0


@compiled
def _choose(finder: Any) -> int:
    """Candidate with the largest likelihood over the remembered windows."""
    chosen, best = CANDIDATES // 2, math.inf
    for j in range(CANDIDATES):
        total = 0.0
        for w in range(min(finder.windows, WINDOWS)):
            total += finder.profile[w, j]
        finder.total[j] = total
        if total < best:
            best = total
            chosen = j
    return chosen


@compiled
def _is_used(finder: Any, w: int, chosen: int) -> bool:
    """True if a window has a fine value, and that is near the chosen candidate."""
    away = finder.fine_delay[w] - (chosen - CANDIDATES // 2) * finder.grid_step
    return bool(finder.fine_valid[w] != 0 and abs(away) < NEAR * finder.grid_step)


@compiled
def _join(settings: Any, finder: Any, chosen: int) -> bool:
    """Delay and its deviation from all windows, in finder.fine; False if too few say something.

    Windows in separation or over an edge are off by more than their own deviation. How much the
    windows differ beyond that is found by the method of moments and counts for each of them
    (random effects; DerSimonian and Laird 1986): else the one window that claims to know the delay
    best would decide. The p that goes with it is that of the next window.
    """
    windows = min(finder.windows, WINDOWS)
    if _used_windows(finder, chosen, windows) < FEWEST_DECISIVE:
        return False
    _weigh(finder, chosen, windows, 0.0)
    if not _solve(settings, finder, windows):
        return False
    between = _variance_between(finder, windows)
    if between > 0.0:
        _weigh(finder, chosen, windows, between)
        return _solve(settings, finder, windows)
    return True


@compiled
def _weigh(finder: Any, chosen: int, windows: int, between: float) -> None:
    """Share of each window's information that counts, for a variance between them [s^2]."""
    for w in range(windows):
        used = _is_used(finder, w, chosen)
        own = finder.fine_information[w, 0]
        finder.weight[w] = 1.0 / (1.0 + own * between) if used and own > 0.0 else 0.0


@compiled
def _solve(settings: Any, finder: Any, windows: int) -> bool:
    """Delay, its deviation and the p that goes with it, from the windows' information."""
    of_p = 1.0 / max(prior_deviation(settings, 3), SMALLEST_DEVIATION) ** 2
    vector_p = of_p * settings.initial_velocity_exponent
    of_delay, both, vector = 0.0, 0.0, 0.0
    for w in range(windows):
        weight = finder.weight[w]
        if weight > 0.0:
            information = finder.fine_information[w]
            of_delay += weight * information[0]
            both += weight * information[1]
            of_p += weight * information[2]
            vector += weight * finder.fine_vector[w, 0]
            vector_p += weight * finder.fine_vector[w, 1]
    known = of_delay - both * both / of_p
    if not known > 0.0:
        return False
    mean = (vector - both * vector_p / of_p) / known
    p = (vector_p - both * mean) / of_p
    finder.fine[0] = mean
    finder.fine[1] = math.sqrt(1.0 / known + SMALLEST_DEVIATION**2)
    finder.velocity_exponent = min(max(p, SMALLEST_VELOCITY_EXPONENT), LARGEST_VELOCITY_EXPONENT)
    return True


@compiled
def _variance_between(finder: Any, windows: int) -> float:
    """Variance of the windows' delays beyond their own [s^2], by the method of moments."""
    square, total, squares, used = 0.0, 0.0, 0.0, 0
    for w in range(windows):
        if finder.weight[w] > 0.0:
            information = finder.fine_information[w]
            of_p = information[1] * finder.velocity_exponent
            own = (finder.fine_vector[w, 0] - of_p) / information[0]
            square += information[0] * (own - finder.fine[0]) ** 2
            total += information[0]
            squares += information[0] ** 2
            used += 1
    freedom = total - squares / total if total > 0.0 else 0.0
    return max((square - (used - 1)) / freedom, 0.0) if freedom > 0.0 else 0.0


@compiled
def _decide(
    settings: Any, finder: Any, chosen: int, constant: bool, misses: bool, common: bool
) -> bool:
    """Value and deviation of the delay; True if the one in use is to change."""
    windows = min(finder.windows, WINDOWS)
    step = finder.grid_step
    finder.agreed = 0
    for j in range(CANDIDATES):
        apart = abs(j - chosen) * step > APART
        if apart and finder.total[j] - finder.total[chosen] < RIVAL:
            finder.deviation = math.nan if finder.delay == 0.0 else finder.deviation
            return False
    if not _join(settings, finder, chosen):
        return False
    mean, deviation = finder.fine[0], finder.fine[1]
    distance = abs(mean - finder.delay)
    if delay_joint.contradicts(finder, mean):
        return False
    near = _used_windows(finder, chosen, windows)
    few = near < FEWEST_WINDOWS
    finder.agreed = 1 if not few and near > LEAST_NEAR * windows else 0
    if few and (finder.delay != 0.0 or not _each_decides(finder, chosen, windows)):
        return False
    if finder.delay == 0.0:
        _tell_none(finder, mean, deviation)
        significant = SIGNIFICANT
        if distance < step:  # the scatter of the fine values alone decides
            significant = student_quantile(near - 1)
        changes = distance > max(significant * deviation, SMALLEST)
        changes = changes and (constant or distance > step)
        changes = changes and (few or _is_clear(finder, chosen, windows))
        # Windows of a tissue that lets go may prefer a delay, but find none near it.
        changes = changes and near > LEAST_NEAR * windows
    else:
        changes = distance > max(CORRECTED * deviation, CORRECTION)
        changes = changes and (misses or distance > step)
        if changes and distance > step:
            # Back towards none it takes less: the first windows may have been wrong.
            used = min(max(CANDIDATES // 2 + round(finder.delay / step), 0), CANDIDATES - 1)
            doubted = finder.total[used] - finder.total[chosen] > RIVAL
            back = abs(mean) < 0.5 * abs(finder.delay) and doubted
            changes = back or _is_clear(finder, chosen, windows)
    if changes:
        finder.delay = mean
    if changes or (finder.delay != 0.0 and misses):
        finder.deviation = math.hypot(deviation, mean - finder.delay)
        finder.doubt = finder.deviation**2
    return bool(changes)


@compiled
def _used_windows(finder: Any, chosen: int, windows: int) -> int:
    """Number of windows with a fine value near the chosen candidate."""
    near = 0
    for w in range(windows):
        near += 1 if _is_used(finder, w, chosen) else 0
    return near


@compiled
def _valid_windows(finder: Any, windows: int) -> int:
    """Number of windows that have a fine value at all."""
    valid = 0
    for w in range(windows):
        valid += finder.fine_valid[w]
    return valid


@compiled
def _each_decides(finder: Any, chosen: int, windows: int) -> bool:
    """True if each window near the chosen candidate is enough against none, and most are near."""
    total = 0.0
    for w in range(windows):
        lead = finder.profile[w, CANDIDATES // 2] - finder.profile[w, chosen]
        if lead < (DECISIVE if _is_used(finder, w, chosen) else 0.0):
            return False
        total += lead
    return bool(total > LEAD and 2 * _used_windows(finder, chosen, windows) > windows)


@compiled
def _is_clear(finder: Any, chosen: int, windows: int) -> bool:
    """True if the windows agree that the chosen candidate is better than the delay in use.

    By their likelihoods, or by their fine values, whose scatter is in the deviation.
    """
    step, centre = finder.grid_step, CANDIDATES // 2
    used = centre + round(finder.delay / step)
    near = _used_windows(finder, chosen, windows)
    if used == chosen:  # between two candidates: by the fine values alone
        away = abs(finder.fine[0] - (chosen - centre) * step)
        return bool(near >= FEWEST_AGREEING and away < CONTRADICTED * step)
    distance = abs(finder.fine[0] - finder.delay)
    agreeing = near > AGREEING * _valid_windows(finder, windows) and 2 * near > windows
    agreeing = agreeing and near > AGREEING * FEWEST_AGREEING
    agreeing = agreeing and abs(chosen - centre) < finder.reach
    agreeing = agreeing and distance > SIGNIFICANT * finder.fine[1]
    if agreeing and distance < step:  # one of the two candidates is as wrong as the other
        return True
    mean, square = 0.0, 0.0
    for w in range(windows):
        lead = finder.profile[w, used] - finder.profile[w, chosen]
        lead = min(max(lead, -INFLUENCE), INFLUENCE)  # else the clearest make the mean unclear
        mean += lead / windows
        square += lead * lead / windows
    error = math.sqrt(max(square - mean * mean, 0.0) / max(windows - 1, 1))
    consistent = mean > (LESS_CONSISTENT if agreeing else CONSISTENT) * error
    return bool(mean * windows > LEAD and consistent)
