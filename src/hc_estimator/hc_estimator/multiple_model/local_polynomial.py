"""A polynomial through raw readings: a parabola, or more terms where that leaves more than noise.

Local polynomial regression (Savitzky and Golay, Anal. Chem. 36, 1964, for uneven times) trades
noise against what it flattens. A parabola through 30 ms of readings flattens quick taps by more
than the noise of a good sensor: those points fitted nothing, and were thrown away. A quartic of the
same width flattens next to nothing there, and its values have 1.6 times the variance. It is taken
where a parabola leaves more than noise. (Of quick taps at 125 to 500 Hz with the zeros off, a
sensor of 0.3 um and 0.5 mN told K 20 to 70 % wrong, and said so; `test_fine_sensors.py`.)
Where a parabola has few readings they take long, and a quartic may flatten those taps as well: two
more readings and degree six do not, with about the noise of the quartic.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector, leading_cholesky
from hc_estimator.mean_squares import largest_by_noise
from hc_estimator.multiple_model import raw_readings
from hc_estimator.multiple_model.delay_records import RAW, TERMS

# With even stamps readings lie on the very edge and the very middle of a parabola. Without a slack
# (a share of the half width) rounding of the stamps would decide, and with it the origin of time.
SLACK = 1e-3
EDGE = 1.0 + SLACK
FEWEST_READINGS = 7  # in a parabola
FEWEST_OF_SEXTIC = 9
LEAST_OWN = 1e-3  # of x^3 that no parabola shows, up to which a cubic says nothing
TOUCHING = 5.0  # deviations of the force below which it may be none
SMOOTH = 4.0  # mean square left over the noise up to which a polynomial fits
# Deviations of what noise leaves (`mean_squares`): beyond the first a parabola flattens something
# (by chance, more terms would follow the noise), beyond the second more terms do not fit. They
# leave half as much of a corner of the motion as a parabola does, and their slope is as wrong
# there: ramps have shown no zero with those among the points.
FLATTENS = 4.0
FOLLOWS = 2.0
QUADRATIC, QUARTIC, SEXTIC = 2, 4, 6  # degrees
TO_BE_READ = -1
# Variance of a value over that of a parabola's: a quartic's of the same width, and that of degree
# six with nine readings instead of seven.
QUARTIC_NOISE = 25.0 / 16.0
SEXTIC_NOISE = 1.86
# The same of a slope: what a cubic adds, and degree six.
CUBIC_SLOPE_NOISE = 5.25
SEXTIC_SLOPE_NOISE = 12.0


@compiled
def value_noise(degree: int) -> float:
    """Variance of a value over that of a parabola's."""
    if degree == QUADRATIC:
        return 1.0
    return QUARTIC_NOISE if degree == QUARTIC else SEXTIC_NOISE


@compiled
def widest(half: float, period: float) -> float:
    """Half of the width of the widest polynomial about a time [s].

    Args:
        half: of a parabola's width [s].
        period: usual time between two readings of the slower channel [s].
    """
    few = 2.0 * half < FEWEST_OF_SEXTIC * period
    return half * FEWEST_OF_SEXTIC / FEWEST_READINGS if few else half


@compiled
def _gather(finder: Any, channel: int, centre: float, half: float, fewest: int) -> bool:
    """Sums over the readings about a time, of powers of it and of them; False if they are few."""
    count, powers, sums = finder.raw_count[channel], finder.powers, finder.readings
    clear_vector(powers)
    clear_vector(sums)
    reference = finder.raw_value[channel, (count - 1) % RAW]
    before, after = 0, 0
    for back in range(1, raw_readings.count_of(finder, channel) + 1):
        slot = (count - back) % RAW
        x = (finder.raw_time[channel, slot] - centre) / half
        if x > EDGE:
            continue
        if x < -EDGE:
            break
        y = finder.raw_value[channel, slot] - reference
        before += 1 if x < -SLACK else 0
        after += 1 if x > SLACK else 0
        power = 1.0
        for i in range(2 * TERMS - 1):
            powers[i] += power
            if i < TERMS:
                sums[i] += power * y
            power *= x
        sums[TERMS] += y * y
    finder.fitted_to[channel, 5] = reference
    return min(before, after) >= fewest // 2


@compiled
def _factor(finder: Any, terms: int) -> int:
    """Factor the normal equations of so many terms; how many of them the readings determine.

    What fewer terms say is the leading part of what more do.
    """
    factor, reduced, powers = finder.normal_of_powers, finder.reduced, finder.powers
    for i in range(terms):
        for j in range(i + 1):
            factor[i, j] = powers[i + j]
    if not leading_cholesky(factor, factor, terms):
        return 0
    for i in range(terms):
        if not factor[i, i] > 0.0:
            return i
        reduced[i] = finder.readings[i]
        for k in range(i):
            reduced[i] -= factor[i, k] * reduced[k]
        reduced[i] /= factor[i, i]
    return terms


@compiled
def _solve(finder: Any, terms: int) -> float:
    """Coefficients of a polynomial of so many terms, in finder.polynomial; mean square left."""
    factor, reduced, solution = finder.normal_of_powers, finder.reduced, finder.polynomial
    left = float(finder.readings[TERMS])
    for back in range(terms):
        i = terms - 1 - back
        left -= reduced[i] * reduced[i]
        solution[i] = reduced[i]
        for k in range(i + 1, terms):
            solution[i] -= factor[k, i] * solution[k]
        solution[i] /= factor[i, i]
    return max(left, 0.0) / max(finder.powers[0] - terms, 1.0)  # type: ignore[no-any-return]


@compiled
def _parabola(finder: Any, channel: int, centre: float, half: float) -> int:
    """Least-squares parabola about a time, in finder.fitted_to; its readings, 0 if they are few."""
    if not _gather(finder, channel, centre, half, FEWEST_READINGS):
        return 0
    determined = _factor(finder, 4)
    if determined < 3:
        return 0
    fitted, found = finder.fitted_to[channel], finder.polynomial
    fitted[3] = _solve(finder, 3)
    slope = found[1]
    fitted[0] = fitted[5] + found[0]
    fitted[1] = slope / half
    fitted[2] = 2.0 * found[2] / (half * half)
    fitted[4] = 0.0
    fitted[5] = fitted[0]
    if determined == 4 and finder.normal_of_powers[3, 3] ** 2 > LEAST_OWN * finder.powers[6]:
        _solve(finder, 4)
        fitted[4] = (found[1] - slope) / half
    return int(finder.powers[0])


@compiled
def _refine(finder: Any, channel: int, centre: float, half: float, degree: int) -> None:
    """Value, bend and what is left by more terms, unless the readings do not determine them.

    What is left in units in which it fits up to `SMOOTH` times the noise, as a parabola does.

    Its slope is the parabola's and what these terms add: who uses it says how much of that is
    noise.
    """
    by_parabola = finder.fitted_to[channel, 5]
    terms = degree + 1
    enough = _gather(finder, channel, centre, half, degree)
    fitted, found = finder.fitted_to[channel], finder.polynomial
    reference, fitted[5] = fitted[5], by_parabola
    freedom = int(finder.powers[0]) - terms
    if not enough or freedom < 1 or _factor(finder, terms) < terms:
        return
    left = _solve(finder, terms)
    fitted[0] = reference + found[0]
    fitted[4] = found[1] / half - fitted[1]
    fitted[2] = 2.0 * found[2] / (half * half)
    fitted[3] = left * SMOOTH / largest_by_noise(freedom, FOLLOWS)


@compiled
def _is_touching(finder: Any, half: float, noise: float) -> bool:
    """True if the force is none nowhere in a parabola: the corner at a touch is no polynomial."""
    rise = abs(finder.fitted_to[1, 1]) * half
    return bool(finder.fitted_to[1, 0] - rise > TOUCHING * math.sqrt(noise))


@compiled
def _is_read_to(finder: Any, time: float) -> bool:
    """True if both channels have been read up to a time [s]."""
    for channel in range(2):
        if finder.raw_time[channel, (finder.raw_count[channel] - 1) % RAW] < time:
            return False
    return True


@compiled
def fit(finder: Any, centre: float, half: float, wider: float, noise: Any) -> int:
    """Fit the readings of both channels about a time, in finder.fitted_to.

    Value, slope, second derivative, mean square left, what a cubic would add to the slope, and the
    value by a parabola. Both by more terms if one of them asks for it: what is flattened of one
    alone looks like a delay. (The finder of the delay takes the parabolas', which flatten both
    channels alike at any time.)

    Args:
        finder: changed.
        centre: the time [s].
        half: half of the width of a parabola [s].
        wider: that of a polynomial of more terms, from `widest` [s].
        noise: variances of a reading, shape (2,).

    Returns:
        Degree; 0 if readings are few in either channel, `TO_BE_READ` if more are still to come.
    """
    bends = False
    for channel in range(2):
        readings = _parabola(finder, channel, centre, half)
        if readings == 0:
            return 0
        most = largest_by_noise(readings - 3, FLATTENS)
        leaves = finder.fitted_to[channel, 3] > most * noise[channel]
        if leaves and (channel == 0 or _is_touching(finder, wider, noise[1])):
            bends = True
    if not bends:
        return QUADRATIC
    fits = True
    for channel in range(2):
        _refine(finder, channel, centre, half, QUARTIC)
        fits = fits and finder.fitted_to[channel, 3] <= SMOOTH * noise[channel]
    if fits or wider == half:
        return QUARTIC
    if not _is_read_to(finder, centre + wider * (1.0 - SLACK)):
        return TO_BE_READ
    for channel in range(2):
        _refine(finder, channel, centre, wider, SEXTIC)
    return SEXTIC
