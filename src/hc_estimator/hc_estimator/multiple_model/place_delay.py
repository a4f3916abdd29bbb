"""By how much is the force late, where every contact is with another place?

`delay` fits one law to all half seconds and is at a loss where the tissue is another one each time.
So each contact that is over says by itself what it knows of the delay, beside a K, B, n, p and
height of its own, and what contacts before said is the prior for the next. That tells that the
channels are in step, or by how much they are not where `delay` does not know. Until then what is
late looks like another place: the delay is an unknown of the fits that tell places apart, and what
is known of the place before is what its last contact said beside that delay (`another_place`).
(Ours; `hc bench accuracy places`.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector, copy_matrix, copy_vector
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import place_fit, place_prior
from hc_estimator.multiple_model.delay import BEGINS, LARGEST
from hc_estimator.multiple_model.delay_points import LEAST_BACK
from hc_estimator.multiple_model.hypotheses import SURFACE
from hc_estimator.multiple_model.kalman import exp_limited
from hc_estimator.multiple_model.levenberg_marquardt import solve
from hc_estimator.multiple_model.place_fit import DELAY, UNKNOWNS
from hc_estimator.multiple_model.place_prior import CONSISTENT, FEWEST, HEIGHT_DEVIATION
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.spline_records import LARGEST_SHIFT

FIRST_DEVIATION = 0.02  # of a delay of which nothing is known [s]
SMALL = 0.0015  # deviation of a delay from which on it is known [s]
KNOWN = 0.0025  # the same for the fit to the points of all contacts [s]
IN_STEP, LEAST = 2.0, 0.0005  # deviations, and delay [s], up to which it is none
FEWEST_CONTACTS = 3  # that say the same, for a delay to be used
SHIFTS = 4  # by whole points, until the rest is less than half of one
ALIKE = 4.0  # mean square of how contacts differ, over what it should be, up to which they agree


@compiled
def reset(place: Any) -> None:
    """No contact has said anything."""
    place.late = 0
    place.in_step = 0
    place.delay = 0.0
    place.delay_precision = 1.0 / FIRST_DEVIATION**2
    place.delay_contacts = 0
    place.delay_learnt = 0
    place.delay_squares = 0.0


@compiled
def may_be_late(settings: Any, place: Any) -> bool:
    """True as long as nobody knows whether the force is late."""
    return bool(math.isnan(settings.channel_delay) and place.in_step == 0)


@compiled
def is_known(finder: Any) -> bool:
    """True if the finder knows the delay, be it none, well enough to build on it."""
    return bool(finder.deviation < KNOWN)


@compiled
def leave_open(place: Any, finder: Any) -> None:
    """Let what is not known of the delay, in use or not, be an unknown of the fits to come.

    In a quick press a millisecond looks like another stiffness.
    """
    known = finder.delay == 0.0 or not finder.deviation > 0.0
    place.delay_doubt = 0.0 if known else finder.deviation**2
    place.late = 0 if known else 1
    if place.joint != 0:
        place.delay_doubt = 1.0 / place.delay_precision
        place.late = 1


@compiled
def _goes_both_ways(place: Any, history: Any) -> bool:
    """True if the tool goes deeper and back: along one way a delay is just another height."""
    deeper, back = 0.0, 0.0
    for k in range(place.first, place.last):
        velocity = history.points[k % POINTS].velocity
        deeper += max(velocity, 0.0)
        back += max(-velocity, 0.0)
    return bool(min(deeper, back) > LEAST_BACK * max(deeper, back))


@compiled
def _fit(
    settings: Any,
    bank: Any,
    noise: tuple[float, float, float],
    weight: float,
    passes: int,
    begin: float,
) -> tuple[float, float, float]:
    """Fit a delay beside the rest, from place.outcome on.

    The motion is that of place.shift points before, and a Taylor series for what is left.

    Args:
        settings: settings record.
        bank: place.values are those of the fit, but for the delay.
        noise: of the points.
        weight: of their squares.
        passes: with other weights.
        begin: first guess of the delay [s].

    Returns:
        Delay [s], its variance, and squares left in those of the noise; these infinite for none.
    """
    place = bank.place
    shifted = place.shift * place.spacing
    place_prior.set_other(place, HEIGHT_DEVIATION**2)
    place.guess[DELAY] = place.delay - shifted
    place.prior[DELAY, DELAY] = place.delay_precision
    copy_vector(place.outcome, place.values)
    place.values[DELAY] = begin - shifted
    place.late = 1
    squares = place_fit.fit(settings, place, bank.history, noise, weight, passes)
    place.late = 0
    delay = place.values[DELAY] + shifted
    place.values[DELAY] = 0.0
    if not (math.isfinite(squares) and place.expected > 0.0):
        return 0.0, math.inf, math.inf
    column = place.next
    clear_vector(column)
    column[DELAY] = 1.0
    solve(place.factor, column, UNKNOWNS)
    return delay, max(column[DELAY], 0.0), squares / place.expected


@compiled
def is_in_step(settings: Any, bank: Any, noise: tuple[float, float, float], weight: float) -> bool:
    """True if this contact and those before show by themselves that the force is in step.

    What is late looks like another place, as long as nobody knows that it is late.
    """
    delay, variance, _ = _fit(settings, bank, noise, weight, 1, bank.place.delay)
    return _is_shown(bank.place, bank.history, delay, variance)


@compiled
def _is_shown(place: Any, history: Any, delay: float, variance: float) -> bool:
    """True if such a delay is none for certain, which is noted."""
    deviation = math.sqrt(variance)
    if not (deviation < SMALL and abs(delay) < IN_STEP * deviation + LEAST):
        return False
    if not _goes_both_ways(place, history):
        return False
    place.in_step = 1
    place.delay, place.delay_precision = delay, 1.0 / max(variance, 1e-300)
    return True


@compiled
def learn(settings: Any, bank: Any) -> None:
    """Take what the contact that is over says of the delay, whatever its place is like.

    Not beneath a surface that moves and explains it: on its way in and out a contact with one that
    stays would have to be late.
    """
    place, history, row = bank.place, bank.history, bank.rows[bank.judge.chosen]
    if SURFACE[row.index] and row.model_error == 0.0:
        return
    place.first = max(history.contact, histories.oldest(history))
    place.last = min(history.count, place.first + int(place_prior.most_points(bank)))
    if not may_be_late(settings, place) or place.last - place.first < FEWEST:
        return
    noise = histories.noise_of_points(bank)
    place_prior.set_other(place, HEIGHT_DEVIATION**2)
    place_fit.begin(settings, place, history)
    copy_vector(place.values, place.outcome)
    delay, _, left = _fit(settings, bank, noise, 1.0, 2, place.delay)
    place.spacing = history.every * bank.delay.grid_step
    # Whole points that the motion is shifted by are lost on either side of the contact: only where
    # a Taylor series does not do.
    for _ in range(0 if left < CONSISTENT else SHIFTS):
        shift = min(max(round(delay / place.spacing), -LARGEST_SHIFT), LARGEST_SHIFT)
        if not math.isfinite(left) or shift == place.shift:
            break
        if place.last - place.first - abs(shift) < FEWEST:
            break
        place.shift = shift
        copy_vector(place.values, place.outcome)
        delay, _, left = _fit(settings, bank, noise, 1.0, 2, delay)
    if left < CONSISTENT:
        _note(settings, bank, noise, delay, place_prior.weight_of(left))
    place.shift = 0


@compiled
def _note(
    settings: Any, bank: Any, noise: tuple[float, float, float], begin: float, weight: float
) -> None:
    """Take what the last fit says of the delay, and of the place beside it.

    Args:
        settings: settings record.
        bank: its record `place` is changed.
        noise: of the points.
        begin: first guess of the delay [s].
        weight: of the points' squares.
    """
    place = bank.place
    copy_vector(place.values, place.outcome)
    delay, variance, left = _fit(settings, bank, noise, weight, 1, begin)
    before = place.delay_precision
    if not (math.isfinite(left) and 0.0 < variance < 1.0 / before):
        return
    off = delay - place.delay
    place.delay_squares += off * off * before / (1.0 - before * variance)
    place.delay_contacts += 1
    place.delay, place.delay_precision = delay, 1.0 / variance
    place.delay_learnt = 1
    copy_vector(place.values, place.outcome)
    place.late = 1
    place_fit.note_covariance(settings, place)
    place.late = 0
    if not _is_shown(place, bank.history, delay, variance):
        place.joint = 1
        copy_vector(place.values, place.before)
        place.before[DELAY] = delay
        copy_matrix(place.covariance, place.before_covariance)


@compiled
def is_found(finder: Any, place: Any) -> bool:
    """True if the contacts agree on a delay, where the finder says none; it is used from now on.

    Place.outcome and place.covariance are then those of the last contact, with the delay.

    Args:
        finder: record of `delay`; its delay, deviation and fit are set.
        place: what the contacts said.
    """
    delay, variance = place.delay, 1.0 / place.delay_precision
    enough = place.delay_learnt != 0 and place.delay_contacts >= FEWEST_CONTACTS
    unknown = finder.clear == 0 and finder.delay == 0.0 and place.in_step == 0
    if not (enough and unknown and SMALL < abs(delay) < LARGEST and variance < SMALL**2):
        return False
    differ = place.delay_squares > ALIKE * place.delay_contacts
    if differ or delay * delay < BEGINS**2 * variance:
        return False
    finder.delay = delay
    finder.deviation = math.sqrt(variance)
    finder.doubt = variance
    for i in range(2):
        finder.fit[i] = exp_limited(place.outcome[i])
    finder.fit[2] = place.outcome[2]
    return True


@compiled
def note_none(finder: Any, place: Any) -> None:
    """Deviation of no delay by the contacts, where the finder says none.

    Args:
        finder: record of `delay`; its deviation is set.
        place: what the contacts said.
    """
    known = place.in_step != 0 and place.delay_precision * SMALL**2 > 1.0
    if known and finder.delay == 0.0 and math.isnan(finder.deviation):
        finder.deviation = math.hypot(place.delay, 1.0 / math.sqrt(place.delay_precision))
