"""By how much is the force late? One fit to the points of many half seconds says it.

Sensors filter and networks delay, and a delay of the force looks like damping (a negative one like
damping that is not there). The delay cannot be a state: the likelihood has two optima, one false.
Instead points of every half second in contact are kept as they would be with each candidate delay
(`delay_points`), and the law is fitted to all of them, for each one (`delay_candidates`). What that
leaves says which candidate it is, the zero of the score beside it the delay, the information its
deviation. The surface may be elsewhere, sink or rise, and the force may have a zero. Where one K
leaves far more than noise even so, each half second has a K and a surface of its own.

Along one way a delay is nothing but another depth: the tool must have gone both ways, and where
each half second has a surface of its own, within those. A surface that sinks is another depth for
each of two ways: it is unknown once the tool has gone three. Near the delay in use the innovations
of the filter say the value more finely (`delay_evidence`).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import (
    delay_candidates,
    delay_evidence,
    delay_fit,
    delay_points,
    smoothing,
)
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model.delay_candidates import LEAD
from hc_estimator.multiple_model.delay_evidence import CORRECTION, FAR
from hc_estimator.multiple_model.delay_points import count_of
from hc_estimator.multiple_model.delay_records import CANDIDATES, IDLE

APART = 0.012  # delays further apart are rivals [s]
RIVAL = 4.0  # log likelihood ratio to the best rival
LEAST_CONTACT = 0.3  # share of a window that must be in contact
FEWEST_IN_CONTACT = 12  # points of a window that must be
INDEPENDENT = 0.5  # share of the points that counts as independent: 0.1 s apart
ALIKE = 0.2  # the same of what noise does not explain: a quarter of a second apart
VARIED = 0.35  # the same where each half second has a K and a surface of its own
FITS = 1.5  # squares that are left, over those of the noise, up to which a law fits
FEWEST = 24  # points
WAYS = 2  # that the tool must have gone, deeper or back; beyond that the zeros are unknown
NEW = 1.0 / 8.0  # share of the points that must be new for another fit
LARGEST = 0.0625  # delay that is looked for [s]
LARGEST_NOISE = 0.3  # share of noise in the squares of the damping that K does not explain
LARGEST_MISFIT = 0.1  # of the RMS force that the fit may leave
SMALLEST_DEVIATION = 0.02  # of a delay, in steps of the grid: what smoothing makes of a motion
FINER = 0.6  # deviation of the delay in use, from which on another one is known better
BEGINS = 4.0  # deviations, from which on a delay is one
# Squares that the delay in use leaves over those of the best: what smoothing leaves of a motion
# with corners is alike in all points, however many they are.
LEAST_RATIO = 1.5


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
    finder.found_deviation = 0.0
    finder.found_of = 0
    delay_points.forget(finder)
    delay_evidence.reset(finder)


@compiled
def begin_with_zeros(finder: Any) -> None:
    """The zeros have moved, and the points with them (`zero_moves`): fit them anew."""
    delay_points.fit_anew(finder)
    if finder.zeros == 0:  # else it was found whatever they are
        finder.found_deviation = 0.0
    delay_evidence.reset(finder)


@compiled
def learn_window(settings: Any, finder: Any, sensor_noise: Any, moves: bool) -> bool:
    """Take a full window into what is known; True if the delay in use is to change.

    The new delay is then finder.delay, and K, B and n at it are finder.fit. Mostly a fit begins,
    which says so once it has ended (`take_fit`).

    Args:
        settings: settings record.
        finder: changed.
        sensor_noise: variances of displacement and force [mm^2], [N^2].
        moves: True if the surface moves, so that one for each half second says nothing.
    """
    if delay_points.find_contact(finder) < max(LEAST_CONTACT * finder.points, FEWEST_IN_CONTACT):
        return False
    while finder.stage != IDLE:  # where readings are lost there may have been no time for it
        delay_candidates.go_on(settings, finder)
    finder.windows += 1
    smoothing.smooth(finder)
    _take_points(finder, sensor_noise)
    count = count_of(finder)
    if count >= FEWEST and finder.kept - finder.fitted >= NEW * count:
        finder.fitted = finder.kept
        finder.ways = delay_points.count_ways(finder)
        if finder.ways >= WAYS:
            finder.moves = 1 if moves else 0
            delay_candidates.begin(settings, finder, finder.ways > WAYS)
            return False
        finder.clear = 0
    return _conclude(settings, finder)


@compiled
def take_fit(settings: Any, finder: Any) -> bool:
    """Take what the fit that has ended says; as `learn_window`.

    Args:
        settings: settings record.
        finder: changed.
    """
    count = count_of(finder)
    finder.clear = 0
    found, deviation = _clear_delay(finder, count)
    if deviation > 0.0 and _is_asked(finder, count, found, deviation):
        finder.clear = 1
        finder.found, finder.found_deviation, finder.found_of = found, deviation, count
    elif count >= finder.found_of:
        finder.found_deviation = 0.0
    return _conclude(settings, finder)


@compiled
def _conclude(settings: Any, finder: Any) -> bool:
    """Use the delay that the last fit has said, if it is to be; as `learn_window`."""
    if finder.clear != 0 and (_leads(settings, finder) or _is_finer(finder)):
        finder.delay = finder.found
        finder.deviation = finder.found_deviation
        finder.doubt = finder.deviation**2
        delay_candidates.note_law(settings, finder)
        return True
    if finder.delay == 0.0:
        _note_none(finder)
    return False


@compiled
def _is_asked(finder: Any, count: int, found: float, deviation: float) -> bool:
    """True if what was fitted can say a delay: nothing else is known to explain it.

    Args:
        finder: with the fits.
        count: number of points.
        found: delay that the fits say clearly [s].
        deviation: of it [s].
    """
    if finder.varies != 0:
        # Beneath a surface that moves one for each half second says nothing.
        return finder.moves == 0 and delay_points.go_both_ways(finder)
    # What is left of two ways by a law at the zeros as given may be of zeros that are off: that
    # looks like a delay, and not like none.
    none = finder.delay == 0.0 and abs(found) < BEGINS * deviation
    return bool(finder.ways > WAYS or finder.left[CANDIDATES] < FITS * count or none)


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
        velocities[1] = smoothing.slope_variance(
            finder, noise * smoothing.VALUE_VARIANCE / few, smoothing.BY_CUBIC
        )
    delay_points.take(finder)


@compiled
def _value_variance(finder: Any, channel: int, width: float, noise: float) -> float:
    """Variance of a parabola's value, by its width [s] and the variance of a reading."""
    readings = max(width / max(grids.period(finder, channel), 1e-9), 1.0)
    return smoothing.VALUE_VARIANCE * noise / readings


@compiled
def _clear_delay(finder: Any, count: int) -> tuple[float, float]:
    """The one delay [s] that the fits say, and its deviation [s]; 0 where none is clear.

    Args:
        finder: with the fits.
        count: number of points.
    """
    centre, step, chosen = CANDIDATES // 2, finder.grid_step, finder.chosen
    low, high = centre - finder.reach, centre + finder.reach
    if chosen in (low, high) or not _explains(finder, count):
        return 0.0, 0.0
    best = finder.left[CANDIDATES]
    weight = _weight(finder)
    for j in range(low, high + 1):
        rival = abs(j - chosen) * step > APART
        if rival and weight * math.log(finder.left[j] / best) < RIVAL:
            return 0.0, 0.0
    found = (finder.place - centre) * step
    if abs(found) > LARGEST:
        return 0.0, 0.0
    known = 2.0 * weight / count * finder.information[CANDIDATES] * step * step
    variance = SMALLEST_DEVIATION**2 + max(best / count, 1.0) / known if known > 0.0 else math.inf
    return found, min(math.sqrt(variance), float(finder.reach)) * step


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
def _explains(finder: Any, count: int) -> bool:
    """True if the likeliest fit leaves little of the force, and its damping is not of noise."""
    law, total, squared = finder.law[CANDIDATES], 0.0, 0.0
    for k in range(count):
        kept_point = finder.kept_points[k]
        total += kept_point.force * kept_point.force
        squared += kept_point.weight
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
