"""By how much is the force late? One fit to the points of many half seconds says it.

Sensors filter and networks delay, and a delay of the force looks like damping (a negative one like
damping that is not there). The delay cannot be a state: the likelihood has two optima, one false.
Instead points of every half second in contact are kept as they would be with each candidate delay
(`delay_points`), and the law is fitted to all of them, for each candidate (`delay_fit`). What that
leaves says which candidate it is, the zero of the score beside it the delay, the information its
deviation. Where one K leaves far more than noise does, each half second has a K and a surface of
its own.

Along one way a delay is nothing but another depth: the tool must have gone both ways, and where
each half second has a surface of its own, within those. Near the delay in use the innovations of
the filter say the value more finely (`delay_evidence`).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector
from hc_estimator.multiple_model import delay_evidence, delay_fit, delay_points, smoothing
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model.delay_evidence import CORRECTION, FAR
from hc_estimator.multiple_model.delay_points import count_of
from hc_estimator.multiple_model.delay_records import CANDIDATES

APART = 0.012  # delays further apart are rivals [s]
RIVAL = 4.0  # log likelihood ratio to the best rival
LEAD = 8.0  # log likelihood ratio to what is in use
LEAST_CONTACT = 0.3  # share of a window that must be in contact
FEWEST_IN_CONTACT = 12  # points of a window that must be
INDEPENDENT = 0.5  # share of the points that counts as independent: 0.1 s apart
ALIKE = 0.2  # the same of what noise does not explain: a quarter of a second apart
VARIED = 0.35  # the same where each half second has a K and a surface of its own
ONE = 4.0  # squares that are left, over those of the noise, up to which one K is enough
VARYING = 8.0  # the same, from which on half seconds with their own are tried
FEWEST = 24  # points
NEW = 1.0 / 8.0  # share of the points that must be new for another fit
FIRST_EXPONENTS = (1.0, 1.5, 2.0, 2.5)
FIRST_STEPS = 6  # of a fit that begins anew
STEPS = 3  # of one that goes on
LARGEST = 0.0625  # delay that is looked for [s]
LARGEST_NOISE = 0.3  # share of noise in the squares of the damping that K does not explain
LARGEST_MISFIT = 0.1  # of the RMS force that the fit may leave
SMALLEST_DEVIATION = 0.02  # of a delay, in steps of the grid: what smoothing makes of a motion
FINER = 0.6  # deviation of the delay in use, from which on another one is known better
BEGINS = 4.0  # deviations, from which on a delay is one
# Squares that the delay in use leaves over those of the best: what smoothing leaves of a motion
# with corners is alike in all points, however many they are.
LEAST_RATIO = 1.5
BETWEEN = 3  # delays between two candidates that are tried
SMALL_STEP = 0.003  # from one to the next, in candidates, that is the last
LEAST_GAIN = 0.25  # of what one K leaves, that must be left by one for each half second


@compiled
def reset(finder: Any) -> None:
    """Nothing is known of the delay."""
    finder.delay = 0.0
    finder.deviation = math.nan
    finder.doubt = 0.0
    forget(finder)
    grids.restart(finder)


@compiled
def forget(finder: Any) -> None:
    """What was said of the delay no longer holds: the zeros are others."""
    finder.windows = 0
    delay_points.forget(finder)
    delay_evidence.reset(finder)


@compiled
def learn_window(settings: Any, finder: Any, sensor_noise: Any, moves: bool) -> bool:
    """Take a full window into what is known; True if the delay in use is to change.

    The new delay is then finder.delay, and K, B and n at it are finder.fit.

    Args:
        settings: settings record.
        finder: changed.
        sensor_noise: variances of displacement and force [mm^2], [N^2].
        moves: True if the surface moves, so that one for each half second says nothing.
    """
    if delay_points.find_contact(finder) < max(LEAST_CONTACT * finder.points, FEWEST_IN_CONTACT):
        return False
    finder.windows += 1
    smoothing.smooth(finder)
    _take_points(finder, sensor_noise)
    count = count_of(finder)
    if count >= FEWEST and finder.kept - finder.fitted >= NEW * count:
        clear = delay_points.go_both_ways(finder, False)
        if clear:
            _fit(settings, finder, count)
            clear = finder.varies == 0 or (not moves and delay_points.go_both_ways(finder, True))
            clear = clear and _is_clear(finder, count)
        finder.fitted = finder.kept
        finder.clear = 1 if clear else 0
    if finder.clear != 0 and (_leads(settings, finder) or _is_finer(finder)):
        finder.delay = finder.found
        finder.deviation = finder.found_deviation
        finder.doubt = finder.deviation**2
        law, fit = finder.law[CANDIDATES], finder.fit
        fit[0], fit[1], fit[2] = law[0], law[0] * law[1], law[2]
        return True
    if finder.delay == 0.0:
        _note_none(finder)
    return False


@compiled
def _note_none(finder: Any) -> None:
    """Deviation of no delay: what is not enough to be used may be too much for none.

    None at all is as likely beforehand as one of up to `LARGEST`: it is doubted where the Bayes
    factor says that one is likelier.
    """
    finder.doubt = 0.0
    finder.deviation = finder.found_deviation if finder.clear != 0 else math.nan
    if finder.clear == 0:
        return
    square = (finder.found / finder.deviation) ** 2
    none = math.log(LARGEST / (math.sqrt(0.5 * math.pi) * finder.deviation))
    if 0.5 * square > none:
        finder.deviation = math.hypot(finder.deviation, finder.found)
        finder.doubt = finder.deviation**2


@compiled
def _take_points(finder: Any, sensor_noise: Any) -> None:
    """Keep some points of the window, and note the variances of what they hold."""
    noise, few = sensor_noise[0], grids.readings_of(finder)
    widths = (finder.grid_width + 2.0 * finder.neighbours * finder.grid_step, finder.grid_width)
    for i in range(2):
        finder.depth_noise[i] = _value_variance(finder, 0, widths[i], noise)
        finder.force_noise[i] = _value_variance(finder, 1, widths[i], sensor_noise[1])
    velocities = finder.velocity_noise
    velocities[2] = grids.velocity_variance(finder, noise)
    velocities[0] = velocities[1] = velocities[2]
    if finder.neighbours > 0:
        velocities[0] = smoothing.velocity_variance(finder, noise, few)
    if finder.neighbours >= smoothing.FEWEST_NEIGHBOURS:
        velocities[1] = smoothing.wide_variance(finder, noise * smoothing.VALUE_VARIANCE / few)
    delay_points.take(finder)


@compiled
def _value_variance(finder: Any, channel: int, width: float, noise: float) -> float:
    """Variance of a parabola's value, by its width [s] and the variance of a reading."""
    readings = max(width / max(grids.period(finder, channel), 1e-9), 1.0)
    return smoothing.VALUE_VARIANCE * noise / readings


@compiled
def _fit(settings: Any, finder: Any, count: int) -> None:
    """Fit the law at every candidate: with one K, or where that leaves too much with many.

    Args:
        settings: settings record.
        finder: law and left of the candidates, what the slot CANDIDATES holds, and varies are set.
        count: number of points.
    """
    if finder.fits == 0:
        finder.varies = 0
        finder.chosen = CANDIDATES // 2
        _begin(settings, finder)
        _improve(settings, finder, FIRST_STEPS, True)
    varied, finder.varies = finder.varies, 0
    if varied != 0:  # has it one K by now?
        best = finder.chosen
        delay_points.shift(finder, 0.0)
        delay_fit.weigh(finder, best)
        delay_fit.improve(settings, finder, best, best, best, STEPS)
        _find_zero(settings, finder)
        varied = 1 if finder.left[CANDIDATES] > ONE * count else 0
    if varied == 0:
        _improve(settings, finder, STEPS, False)
        varied = 1 if finder.left[CANDIDATES] > VARYING * count else 0
    if varied != 0:
        alike, best = finder.left[CANDIDATES], finder.chosen
        finder.varies = 1
        delay_points.shift(finder, 0.0)
        delay_fit.improve(settings, finder, best, best, best, FIRST_STEPS)
        _find_zero(settings, finder)
        if not finder.left[CANDIDATES] < LEAST_GAIN * alike:
            finder.varies = 0
        _improve(settings, finder, STEPS, False)
    fits = finder.varies != 0 or finder.left[CANDIDATES] < VARYING * count
    finder.fits = 1 if fits else 0


@compiled
def _begin(settings: Any, finder: Any) -> None:
    """First law of no delay: with the usual damping and p, and the n that leaves least."""
    centre = CANDIDATES // 2
    law, trial, best = finder.law[centre], finder.trial, math.inf
    law[0], law[1] = 1.0, delay_fit.FIRST_DAMPING
    law[2], law[3] = settings.initial_displacement_exponent, settings.initial_velocity_exponent
    delay_points.shift(finder, 0.0)
    delay_fit.weigh(finder, centre)
    trial[1], trial[3] = law[1], law[3]
    for exponent in FIRST_EXPONENTS:
        trial[2] = exponent
        left = delay_fit.add_up(settings, finder, centre, trial)
        if left < best:
            best = left
            law[2] = exponent


@compiled
def _improve(settings: Any, finder: Any, steps: int, anew: bool) -> None:
    """Improve the law of every candidate, outwards from the one that left least so far.

    Args:
        settings: settings record.
        finder: changed; chosen becomes the one that leaves least, and place is found beside it.
        steps: of each, at most.
        anew: True if a candidate begins with the law of the one next to it; else with that only
            where it leaves less than its own.
    """
    centre, first = CANDIDATES // 2, finder.chosen
    delay_points.shift(finder, 0.0)
    delay_fit.weigh(finder, first)
    if finder.varies != 0:
        delay_fit.temper(settings, finder, first)
    delay_fit.improve(settings, finder, first, first, first, steps)
    finder.chosen = first
    for side in (1, -1):
        for away in range(1, 2 * finder.reach + 1):
            j = first + side * away
            if abs(j - centre) > finder.reach:
                break
            if anew:
                copy_vector(finder.law[j - side], finder.law[j])
            delay_fit.improve(settings, finder, j, j, j if anew else j - side, steps)
            if _least_near(finder, j) < _least_near(finder, finder.chosen):
                finder.chosen = j
    _find_zero(settings, finder)


@compiled
def _is_clear(finder: Any, count: int) -> bool:
    """True if the fits say one delay; it and its deviation are then set.

    Args:
        finder: with the fits; found and found_deviation are set.
        count: number of points.
    """
    centre, step, chosen = CANDIDATES // 2, finder.grid_step, finder.chosen
    low, high = centre - finder.reach, centre + finder.reach
    if chosen in (low, high) or not _explains(finder, count):
        return False
    best = finder.left[CANDIDATES]
    weight = _weight(finder)
    for j in range(low, high + 1):
        rival = abs(j - chosen) * step > APART
        if rival and weight * math.log(finder.left[j] / best) < RIVAL:
            return False
    finder.found = (finder.place - centre) * step
    if abs(finder.found) > LARGEST:
        return False
    known = 2.0 * weight / count * finder.information[CANDIDATES] * step * step
    variance = SMALLEST_DEVIATION**2 + max(best / count, 1.0) / known if known > 0.0 else math.inf
    finder.found_deviation = min(math.sqrt(variance), float(finder.reach)) * step
    return True


@compiled
def _leads(settings: Any, finder: Any) -> bool:
    """True if the delay that was found, which is clear, is far likelier than the one in use.

    A first one that the innovations speak for as well need be no more than that.
    """
    away, none = abs(finder.found - finder.delay), finder.delay == 0.0
    small, varies = away < finder.grid_step, finder.varies != 0 or finder.fits == 0
    if none and small and varies:  # damping that goes its own way looks like a small delay
        return False
    agree = none and delay_evidence.agrees(finder)
    if not agree and not away > (BEGINS if none else FAR) * finder.found_deviation:
        return False
    centre = CANDIDATES // 2
    used = centre + round(finder.delay / finder.grid_step)
    used = min(max(used, centre - finder.reach), centre + finder.reach)
    if used == finder.chosen and not none:
        return True
    ratio = finder.left[used] / finder.left[CANDIDATES]
    if finder.varies == 0:
        ratio = min(ratio, delay_fit.ratio_by_its_own(settings, finder, used))
    ratio_needed = 1.0 if agree else LEAST_RATIO
    return bool(ratio > ratio_needed and _weight(finder) * math.log(ratio) > LEAD)


@compiled
def _is_finer(finder: Any) -> bool:
    """True if the delay in use is known far less well than the one that was found."""
    away, deviation = abs(finder.found - finder.delay), finder.found_deviation
    known = deviation < FINER * finder.deviation
    known = known and finder.delay != 0.0
    return bool(known and away > max(deviation, CORRECTION))


@compiled
def _find_zero(settings: Any, finder: Any) -> None:
    """Find where the score vanishes beside the chosen candidate, by Gauss-Newton steps.

    Args:
        settings: settings record.
        finder: place, and what the slot CANDIDATES holds, are set.
    """
    chosen, fine = finder.chosen, CANDIDATES
    finder.place = chosen + _step(finder, chosen)
    copy_vector(finder.law[chosen], finder.law[fine])
    for _ in range(BETWEEN):
        base = delay_fit.candidate_below(finder)
        delay_points.shift(finder, finder.place - base)
        delay_fit.improve(settings, finder, base, fine, fine, STEPS)
        step = _step(finder, fine)
        finder.place = min(max(finder.place + step, chosen - 1.0), chosen + 1.0)
        if abs(step) < SMALL_STEP:
            break


@compiled
def _least_near(finder: Any, j: int) -> float:
    """Squares that are left within half a step of a candidate, by its score."""
    away = _step(finder, j) * finder.grid_step
    return float(finder.left[j] - away * (2.0 * finder.score[j] - away * finder.bend[j]))


@compiled
def _step(finder: Any, slot: int) -> float:
    """Step of Gauss and Newton towards the zero of the score [candidates], at most half of one."""
    bend = finder.bend[slot] * finder.grid_step
    return min(max(finder.score[slot] / bend, -0.5), 0.5) if bend > 0.0 else 0.0


@compiled
def _explains(finder: Any, count: int) -> bool:
    """True if the likeliest fit leaves little of the force, and its damping is not of noise."""
    law, total, squared = finder.law[CANDIDATES], 0.0, 0.0
    for k in range(count):
        force = finder.point_force[k]
        total += force[0] * force[0]
        squared += force[1]
    # The weights differ: what is left of the force is of the usual weight.
    left = finder.left[CANDIDATES] / max(squared / count, 1e-300)
    noisy = finder.noise_share[CANDIDATES] > LARGEST_NOISE
    return bool(left < LARGEST_MISFIT**2 * total and law[0] > 0.0 and not noisy)


@compiled
def _weight(finder: Any) -> float:
    """Log likelihood by the logarithm of the squares: half the number of independent points.

    What noise does not explain is alike for as long as the tool goes one way.
    """
    count = count_of(finder)
    if finder.varies != 0:
        return 0.5 * VARIED * count
    ratio = max(finder.left[CANDIDATES] / count, 1.0)
    return 0.5 * count * ratio / (1.0 / INDEPENDENT + (ratio - 1.0) / ALIKE)  # type: ignore[no-any-return]
