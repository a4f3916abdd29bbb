"""A polynomial through raw readings: a parabola, or a quartic where that leaves more than noise.

Local polynomial regression (Savitzky and Golay, Anal. Chem. 36, 1964, for uneven times) trades
noise against what it flattens. A parabola through 30 ms of readings flattens quick taps by more
than the noise of a good sensor: those points fitted nothing, and were thrown away. A quartic of the
same width flattens next to nothing there, and its values have 1.6 times the variance. It is taken
where a parabola leaves more than noise. (Of quick taps at 125 to 500 Hz with the zeros off, a
sensor of 0.3 um and 0.5 mN told K 20 to 70 % wrong, and said so; `test_fine_sensors.py`.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix, clear_vector, is_definite, leading_cholesky
from hc_estimator.multiple_model.delay_records import RAW

# With even stamps readings lie on the very edge and the very middle of a parabola. Without a slack
# (a share of the half width) rounding of the stamps would decide, and with it the origin of time.
SLACK = 1e-3
EDGE = 1.0 + SLACK
FEWEST_READINGS = 7  # in it
LEAST_OWN = 1e-3  # of x^3 that no parabola shows, up to which a cubic says nothing
TERMS = 5  # of a quartic
TOUCHING = 5.0  # deviations of the force below which it may be none
SMOOTH = 4.0  # mean square left over the noise up to which a polynomial fits
# Deviations of what noise leaves, by its cube root (Wilson and Hilferty, PNAS 17, 1931): beyond the
# first a parabola flattens something (by chance, a quartic would follow the noise), beyond the
# second a quartic does not fit. It leaves half as much of a corner of the motion as a parabola
# does, and its slope is as wrong there: ramps have shown no zero with those among the points.
FLATTENS = 4.0
FOLLOWS = 2.0
QUADRATIC, QUARTIC = 2, 4  # degrees
VALUE_NOISE = 25.0 / 16.0  # variance of a quartic's value over that of a parabola's


@compiled
def value_noise(degree: float) -> float:
    """Variance of a value over that of a parabola's."""
    return VALUE_NOISE if degree == QUARTIC else 1.0


@compiled
def _most_by_noise(freedom: int, deviations: float) -> float:
    """Mean square that noise alone leaves at most, over that of a reading."""
    spread = 2.0 / (9.0 * max(freedom, 1))
    return (1.0 - spread + deviations * math.sqrt(spread)) ** 3


@compiled
def _parabola(finder: Any, channel: int, centre: float, half: float) -> int:
    """Least-squares parabola about a time, in finder.fitted_to; its readings, 0 if they are few.

    Value, slope, second derivative, mean square left, and what a cubic would add to the slope.
    """
    count = finder.raw_count[channel]
    s0, s1, s2, s3, s4, s5, s6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    y0, y1, y2, y3, squares = 0.0, 0.0, 0.0, 0.0, 0.0
    reference = finder.raw_value[channel, (count - 1) % RAW]
    before, after = 0, 0
    for back in range(1, min(count, RAW) + 1):
        slot = (count - back) % RAW
        x = (finder.raw_time[channel, slot] - centre) / half
        if x > EDGE:
            continue
        if x < -EDGE:
            break
        y = finder.raw_value[channel, slot] - reference
        if x < -SLACK:
            before += 1
        elif x > SLACK:
            after += 1
        square = x * x
        cube = square * x
        s0 += 1.0
        s1 += x
        s2 += square
        s3 += cube
        s4 += square * square
        s5 += square * cube
        s6 += cube * cube
        y0 += y
        y1 += x * y
        y2 += square * y
        y3 += cube * y
        squares += y * y
    if min(before, after) < FEWEST_READINGS // 2:
        return 0
    c00, c01, c02 = s2 * s4 - s3 * s3, s2 * s3 - s1 * s4, s1 * s3 - s2 * s2
    determinant = s0 * c00 + s1 * c01 + s2 * c02
    if not determinant > 0.0:
        return 0
    c11, c12, c22 = s0 * s4 - s2 * s2, s1 * s2 - s0 * s3, s0 * s2 - s1 * s1
    a = (c00 * y0 + c01 * y1 + c02 * y2) / determinant
    b = (c01 * y0 + c11 * y1 + c12 * y2) / determinant
    c = (c02 * y0 + c12 * y1 + c22 * y2) / determinant
    finder.fitted_to[channel, 0] = reference + a
    finder.fitted_to[channel, 1] = b / half
    finder.fitted_to[channel, 2] = 2.0 * c / (half * half)
    left = squares - a * y0 - b * y1 - c * y2
    finder.fitted_to[channel, 3] = max(left, 0.0) / max(s0 - 3.0, 1.0)
    # A parabola through x^3, and how much of what it leaves of that is in the readings.
    a = (c00 * s3 + c01 * s4 + c02 * s5) / determinant
    b = (c01 * s3 + c11 * s4 + c12 * s5) / determinant
    c = (c02 * s3 + c12 * s4 + c22 * s5) / determinant
    own = s6 - a * s3 - b * s4 - c * s5
    share = (y3 - a * y0 - b * y1 - c * y2) / own if own > LEAST_OWN * s6 else 0.0
    finder.fitted_to[channel, 4] = -share * b / half
    finder.fitted_to[channel, 5] = finder.fitted_to[channel, 0]
    return int(s0)


@compiled
def _quartic(finder: Any, channel: int, centre: float, half: float) -> None:
    """Value, bend and what is left by a quartic, unless the readings do not determine it.

    What is left in units in which it fits up to `SMOOTH` times the noise, as a parabola does.

    Its slope is the parabola's and what a cubic adds: who uses it says how much of that is noise.
    """
    count, normal, solution = finder.raw_count[channel], finder.normal_of_quartic, finder.quartic
    clear_matrix(normal)
    clear_vector(solution)
    squares, readings, reference = 0.0, 0, finder.fitted_to[channel, 0]
    for back in range(1, min(count, RAW) + 1):
        slot = (count - back) % RAW
        x = (finder.raw_time[channel, slot] - centre) / half
        if x > EDGE:
            continue
        if x < -EDGE:
            break
        y = finder.raw_value[channel, slot] - reference
        readings += 1
        squares += y * y
        of_i = 1.0
        for i in range(TERMS):
            solution[i] += of_i * y
            of_both = of_i
            for j in range(i + 1):
                normal[i, j] += of_both
                of_both *= x
            of_i *= x
    if readings <= TERMS or not leading_cholesky(normal, normal, TERMS):
        return
    if not is_definite(normal, TERMS):
        return
    for i in range(TERMS):
        for k in range(i):
            solution[i] -= normal[i, k] * solution[k]
        solution[i] /= normal[i, i]
        squares -= solution[i] * solution[i]
    for back in range(TERMS):
        i = TERMS - 1 - back
        for k in range(i + 1, TERMS):
            solution[i] -= normal[k, i] * solution[k]
        solution[i] /= normal[i, i]
    finder.fitted_to[channel, 0] = reference + solution[0]
    finder.fitted_to[channel, 4] = solution[1] / half - finder.fitted_to[channel, 1]
    finder.fitted_to[channel, 2] = 2.0 * solution[2] / (half * half)
    freedom = readings - TERMS
    left = max(squares, 0.0) / freedom
    finder.fitted_to[channel, 3] = left * SMOOTH / _most_by_noise(freedom, FOLLOWS)


@compiled
def _is_touching(finder: Any, half: float, noise: float) -> bool:
    """True if the force is none nowhere in a parabola: the corner at a touch is no quartic."""
    rise = abs(finder.fitted_to[1, 1]) * half
    return bool(finder.fitted_to[1, 0] - rise > TOUCHING * math.sqrt(noise))


@compiled
def fit(finder: Any, centre: float, half: float, noise: Any) -> int:
    """Fit the readings of both channels about a time, in finder.fitted_to.

    Value, slope, second derivative, mean square left, what a cubic would add to the slope, and the
    value by a parabola. Both by a quartic if one of them asks for it: what is flattened of one
    alone looks like a delay. (The finder of the delay takes the parabolas', which flatten both
    channels alike at any time.)

    Args:
        finder: changed.
        centre: the time [s].
        half: half of the width [s].
        noise: variances of a reading, shape (2,).

    Returns:
        `QUADRATIC` or `QUARTIC`; 0 if readings are few in either channel.
    """
    degree = QUADRATIC
    for channel in range(2):
        readings = _parabola(finder, channel, centre, half)
        if readings == 0:
            return 0
        most = _most_by_noise(readings - 3, FLATTENS)
        bends = finder.fitted_to[channel, 3] > most * noise[channel]
        if bends and (channel == 0 or _is_touching(finder, half, noise[1])):
            degree = QUARTIC
    if degree == QUARTIC:
        for channel in range(2):
            _quartic(finder, channel, centre, half)
    return degree
