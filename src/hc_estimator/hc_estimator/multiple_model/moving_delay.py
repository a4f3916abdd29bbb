"""Does a force that is late explain what a surface that moves leaves?

`delay` gives each half second a K and a surface of its own where one law does not do. In an organ
that breathes that leaves so little of the delay that none was found of 20 or 40 ms (16 contacts),
and one of 49 ms where there was none. Over ten seconds least squares tell both: so where they say
that the surface moves (`moving_fit`), tissue that stays is fitted once more beneath such a surface,
with a delay that may be any, and believed if that is clearly one, and as likely as what was found
in step, three times in a row. What is left of a delay in use is corrected the same way. (Ours;
`test_moving_delay.py`.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import spline, spline_descent, spline_start
from hc_estimator.multiple_model.delay import BEGINS, LARGEST
from hc_estimator.multiple_model.delay_evidence import CORRECTION
from hc_estimator.multiple_model.kalman import exp_limited
from hc_estimator.multiple_model.levenberg_marquardt import solve
from hc_estimator.multiple_model.spline_fit import CONSISTENT
from hc_estimator.multiple_model.spline_prior import log_evidence
from hc_estimator.multiple_model.spline_records import LARGEST_SHIFT, MOVES

LATE_DEVIATION = 0.03  # of a delay that may be any [s]
LASTING = 3  # fits in a row that must say the same
SAME = 0.003  # difference, beside three deviations, up to which they do [s]
LEAST = 0.004  # delay that is one, where none is in use [s]
KNOWN = 0.0025  # deviation of a delay that is known [s]
GOES_ON = 0.005  # change of a delay in use with which the points remain what they are [s]
NEARER = 3  # searches for the points that belong to the forces
REMEMBERED = 10.0  # time in contact for which a surface that moved is remembered [s]


@compiled
def reset(moving: Any) -> None:
    """No surface was seen to move, and no delay beneath one."""
    moving.moved_at = -math.inf
    moving.delay = 0.0
    moving.delay_variance = 0.0
    moving.agreeing = 0


@compiled
def has_moved(moving: Any, clock: float) -> bool:
    """True if the latest fits say that the surface moves: then `delay` is not the one to ask."""
    return bool(clock - moving.moved_at < REMEMBERED)


@compiled
def cost_of_none(fit: Any) -> float:
    """By how much less likely a fit is, in the logarithm of its evidence, with nothing late.

    A kind that is in step has a small delay of its own: with it, 5 ms beneath a surface that
    breathes were as likely in step as late (by the normal posterior of that delay; Dickey, Annals
    of Mathematical Statistics 42, 1971).

    Args:
        fit: solved.
    """
    if fit.held[spline.DELAY] != 0:
        return 0.0
    variance, prior = _variance_of_delay(fit), fit.delay_deviation**2
    if not 0.0 < variance < prior:
        return 0.0
    delay = fit.values[spline.DELAY]
    return float(0.5 * delay * delay / variance + 0.5 * math.log(variance / prior))


@compiled
def _variance_of_delay(fit: Any) -> float:
    """Variance of the delay of a fit that is solved [s^2]."""
    column = fit.next
    clear_vector(column)
    column[spline.DELAY] = 1.0 / fit.weight
    solve(fit.factor, column, fit.unknowns)
    return float(max(column[spline.DELAY], 0.0))


@compiled
def begin(settings: Any, bank: Any, first: int) -> bool:
    """Begin to fit tissue that stays under a surface that moves, with a delay; False if none can.

    Args:
        settings: settings record.
        bank: its records `moving` and `fit` are changed; `search` has the points.
        first: number of the oldest point.
    """
    moving, fit, history = bank.moving, bank.fit, bank.search.history
    if not spline.lay_out_at_zeros(settings, history, fit, first, history.count, MOVES):
        _note_none(moving)
        return False
    fit.delay_deviation = LATE_DEVIATION
    fit.spacing = bank.delay.grid_step * history.every
    spline_start.begin(settings, history, fit, bank.rows[bank.judge.chosen])
    if moving.delay != 0.0:  # from none on the next one may end where no law fits
        steps = round(moving.delay / fit.spacing)
        fit.shift = min(max(steps, -LARGEST_SHIFT), LARGEST_SHIFT)
        fit.values[spline.DELAY] = moving.delay - fit.shift * fit.spacing
    spline_descent.begin(settings, fit)
    moving.nearer = 0
    return True


@compiled
def _note_none(moving: Any) -> None:
    """There is no delay that would be one."""
    moving.agreeing = 0
    moving.delay = 0.0


@compiled
def take(settings: Any, bank: Any, likeliest: float) -> bool:
    """Note what delay the solved fit has; False if it goes on with other points.

    Args:
        settings: settings record.
        bank: its records `moving` and `fit` are changed.
        likeliest: logarithm of the evidence for what is likeliest with nothing late.
    """
    moving, fit = bank.moving, bank.fit
    # Far from its own time a point says little of the motion; another one is nearer.
    steps = round(fit.values[spline.DELAY] / fit.spacing) if math.isfinite(fit.squares) else 0
    if steps != 0 and moving.nearer < NEARER:
        if abs(fit.shift + steps) > LARGEST_SHIFT:
            _note_none(moving)
            return True
        fit.shift += steps
        fit.values[spline.DELAY] -= steps * fit.spacing
        fit.delay_deviation = fit.spacing
        spline_descent.begin(settings, fit)
        moving.nearer += 1
        return False
    delay = fit.shift * fit.spacing + fit.values[spline.DELAY]
    if not _is_one(bank, delay, likeliest):
        _note_none(moving)
        return True
    variance = _variance_of_delay(fit)
    off = abs(delay - moving.delay)
    same = moving.agreeing > 0 and off < SAME + 3.0 * math.sqrt(variance)
    moving.agreeing = moving.agreeing + 1 if same else 1
    moving.delay = delay
    moving.delay_variance = variance
    return True


@compiled
def _is_one(bank: Any, delay: float, likeliest: float) -> bool:
    """True if the delay of the solved fit is clearly one, and as likely as what is in step [s]."""
    fit, finder, history = bank.fit, bank.delay, bank.search.history
    if not fit.squares < CONSISTENT * fit.expected:
        return False
    variance = _variance_of_delay(fit)
    # Noise of the positions is no delay, however much likelier it makes one. Of one that is in use
    # already what is left is no more than a correction.
    least = LEAST if finder.delay == 0.0 else CORRECTION
    if not variance < KNOWN * KNOWN or abs(delay) < max(least, BEGINS * math.sqrt(variance)):
        return False
    # Points that have none at that time would have left as much as the others.
    without = histories.count_known(history, fit.first, fit.last) - fit.count
    lost = without * fit.expected / max(fit.count, 1)
    # Nor is it a delay that averages the positions of two points, however little that leaves.
    lost += fit.averaged
    evidence = log_evidence(fit, fit.squares) - 0.5 * (lost + (delay / LATE_DEVIATION) ** 2)
    return bool(abs(finder.delay + delay) <= LARGEST and evidence >= likeliest)


@compiled
def is_found(bank: Any) -> bool:
    """True if the fits agree on a delay; it is used from now on.

    Args:
        bank: its record `delay` is changed: delay, deviation and fit; `moving` asks anew.
    """
    moving, finder = bank.moving, bank.delay
    if moving.agreeing < LASTING:
        return False
    values = bank.fit.values
    finder.delay += moving.delay
    finder.deviation = math.sqrt(moving.delay_variance)
    finder.doubt = moving.delay_variance
    stiffness = exp_limited(spline.log_stiffness(bank.fit, values))
    finder.fit[0] = stiffness
    finder.fit[1] = stiffness * exp_limited(values[spline.LOG_RATIO])
    finder.fit[2] = values[spline.EXPONENT]
    moving.agreeing = 0
    moving.delay = 0.0
    return True
