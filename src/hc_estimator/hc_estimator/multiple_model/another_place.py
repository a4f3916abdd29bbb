"""Is a new contact one with another place, of another stiffness and at another height?

A tool that was in the air comes down elsewhere, wherever a tissue is palpated place by place. So
what the points of a contact say by themselves is held against what was known in the air before it:
least squares with the contact position as a fifth unknown, once with the prior that the place is
the same, once with one that lets everything go; their evidence decides (`place_fit`). If it is
another place, every row begins anew with that fit, what was felt before the contact no longer
counts, and the fit is made anew as the contact goes on, for as long as it explains the force.

Not where a surface that moves is in charge, which knows of another height, too; nor where the law
did not fit before, for the first points of a contact are fitted by any law. (Ours; `hc bench
accuracy places`.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix, clear_vector, copy_matrix, copy_vector
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import place_average, place_fit
from hc_estimator.multiple_model.change import is_different
from hc_estimator.multiple_model.delay_records import GRID
from hc_estimator.multiple_model.history import TOUCHING
from hc_estimator.multiple_model.hypotheses import LOG_STIFFNESS, SURFACE
from hc_estimator.multiple_model.kalman import probability
from hc_estimator.multiple_model.levenberg_marquardt import solve
from hc_estimator.multiple_model.model_error import THRESHOLD
from hc_estimator.multiple_model.place_fit import DELAY, POSITION, UNKNOWNS
from hc_estimator.multiple_model.rows import is_held
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "find_places",
        "bool",
        True,
        "Ask of every new contact whether it is with another place.",
    ),
)

OUT_TIME = 0.05  # without a force before a contact is a new one [s]
FEWEST = 6  # points
MORE = 1.25  # times as many points at which it is asked again
LONGEST = 2.0  # time for which a contact is asked [s]
# Of ln K, ln B / K, n and p about those of the place before, and of the height [mm].
DEVIATIONS = (1.0, 1.0, 0.3, 0.1)
HEIGHT_DEVIATION = 1.0
VARIES = 0.01  # deviation of ln K and ln B by which the same place is another later on
UNEVEN = 0.03  # of a surface that is level [mm]
DOUBTED = 0.3  # share of an alarm from which on it is asked
LIKELIER = 20.0  # logarithm of the evidence by which it is another place
LIKELIER_AGAIN = 5.0  # the same once there was one
CONSISTENT = 1.5  # squares left, in those of the noise, up to which a law fits
LEAST_VARIANCE = 1e-8
NARROW = 0.03  # width of a parabola that misses nothing [s]
DELAY_DEVIATION = 0.02  # of a delay that is not known yet [s]
SMALL_DELAY = 0.0015  # deviation of a delay from which on it is known [s]
IN_STEP, LEAST_DELAY = 2.0, 0.0005  # deviations, and delay [s], up to which it is none


@compiled
def reset(place: Any) -> None:
    """No contact is asked about."""
    place.away = 0.0
    forget(place)
    place.called = 0
    place.found = 0
    place.level = 0
    place.contacts = 0
    place.in_step = 0
    place.ended = 0
    place.fitting = 0
    place.late = 0


@compiled
def end(place: Any) -> None:
    """Ask no more about the present contact."""
    place.testing = 0
    place.is_other = 0


@compiled
def forget(place: Any) -> None:
    """What was known before the present contact no longer holds: the zeros or the delay moved."""
    end(place)
    place.known = 0
    clear_matrix(place.open)


@compiled
def look(settings: Any, bank: Any) -> bool:
    """Take the newest point of the grid; True if rows are to begin anew with the fit in `place`.

    Args:
        settings: settings record.
        bank: its record `place` is changed, and where the contact begins in `history`.
    """
    place, history, finder = bank.place, bank.history, bank.delay
    if settings.find_places == 0 or is_held(settings, 0):
        return False
    here = finder.grid_count - 1 - max(-round(finder.delay / finder.grid_step), 0)
    if here < max(finder.grid_count - GRID, 0):
        return False
    if finder.grid[here % GRID, 3] < TOUCHING * math.sqrt(bank.sensor_noise[1]):
        before = place.away
        place.away += finder.grid_step
        if not (before <= OUT_TIME and place.away > OUT_TIME):
            return False
        last = place.is_other != 0 and history.count > place.last
        last = last and _ask(settings, bank)
        end(place)
        _note_end(bank)
        if not last:
            _note_before(settings, bank)
        return last
    if place.away > OUT_TIME and place.known != 0:
        place.testing = 1
        place.doubted = 0
        place.called = 0
        place.contacts += 1
        clear_matrix(place.open)
        place.due = FEWEST
        history.contact = history.count
    place.away = 0.0
    if place.testing == 0:
        return False
    _doubt(bank)
    if finder.delay != 0.0 or (finder.doubt == 0.0 and not math.isnan(finder.deviation)):
        place.in_step = 1
    count = history.count - history.contact
    if place.doubted == 0 or count < place.due:
        return False
    place.due = math.ceil(MORE * count)
    if count * history.every * finder.grid_step > LONGEST or history.contact < history.begun:
        place.testing = 0
        clear_matrix(place.open)  # by now the rows have learnt what the contact says
        return False
    return _ask(settings, bank)


@compiled
def _doubt(bank: Any) -> None:
    """Note whether the row that was in charge in the air has failed since then."""
    place, row = bank.place, bank.rows[bank.place.row]
    fails = row.model_error > 0.0 or row.alarm_sum > DOUBTED * THRESHOLD
    fails = fails or bank.judge.chosen != place.row or bank.change.testing != 0
    if fails or place.found > 0:
        place.doubted = 1


@compiled
def _note_end(bank: Any) -> None:
    """Take note of whether the law fitted at the end of a contact."""
    place, row = bank.place, bank.rows[bank.judge.chosen]
    if bank.tool.contact_clock > 0.0:
        place.ended += 1
        place.fitting += 1 if row.model_error == 0.0 else 0


@compiled
def _note_before(settings: Any, bank: Any) -> None:
    """What is known of the place that the tool was at, or nothing."""
    place, row = bank.place, bank.rows[bank.judge.chosen]
    fits = 2 * place.fitting > place.ended
    place.known = 1 if fits and not SURFACE[row.index] and bank.change.testing == 0 else 0
    place.row = row.index
    clear_matrix(place.before_covariance)
    for i in range(4):
        place.before[i] = row.state[LOG_STIFFNESS + i]
        for j in range(4):
            element = row.covariance[LOG_STIFFNESS + i, LOG_STIFFNESS + j]
            place.before_covariance[i, j] = element
    place.before[POSITION] = 0.0
    deviation = max(bank.onset.position_deviation, settings.contact_position_std)
    place.before_covariance[POSITION, POSITION] = deviation * deviation


@compiled
def _ask(settings: Any, bank: Any) -> bool:
    """Hold what the contact says by itself against what was known before it."""
    place, history = bank.place, bank.history
    noise = histories.noise_of_points(bank)
    needed = True
    place.first = history.contact
    place.last = history.count
    if place.is_other == 0:
        _set_same(place)
        copy_vector(place.guess, place.values)
        same = place_fit.fit(settings, place, history, noise, 1.0, 1)
        # A place that explains the contact to within the noise is no other one.
        needed = not same < CONSISTENT * place.expected
    _set_other(place, HEIGHT_DEVIATION**2)
    if place.is_other == 0:
        place_fit.begin(settings, place, history)
    else:
        copy_vector(place.outcome, place.values)
    other = place_fit.fit(settings, place, history, noise, 1.0, 2)
    if not (math.isfinite(other) and place.expected > 0.0):
        return False
    left = other / place.expected
    if not left < CONSISTENT:
        return False
    # What the law misses is no reason for another place, nor what wide parabolas miss of a press.
    wider = max(bank.delay.grid_width / NARROW, 1.0)
    weight = 1.0 / (max(left, 1.0) * wider * wider)
    elsewhere = _evidence(settings, place, history, noise, weight, 1)
    if elsewhere == -math.inf:
        return False
    place_fit.note_covariance(settings, place)
    copy_vector(place.values, place.outcome_elsewhere)
    copy_matrix(place.covariance, place.covariance_elsewhere)
    _set_other(place, place.before_covariance[POSITION, POSITION] + UNEVEN**2)
    place.values[POSITION] = place.guess[POSITION]
    level = _evidence(settings, place, history, noise, weight, 0)
    place_fit.note_covariance(settings, place)
    copy_vector(place.values, place.outcome)
    odds = math.log((1.0 + place.level) / (1.0 + place.found - place.level))
    place_average.join(place, probability(elsewhere - level - odds))
    if place.is_other != 0:
        return True
    _set_same(place)
    copy_vector(place.guess, place.values)
    lead = max(level, elsewhere) - _evidence(settings, place, history, noise, weight, 0)
    if needed and lead > (LIKELIER if place.found == 0 else LIKELIER_AGAIN):
        unknown = math.isnan(settings.channel_delay) and place.in_step == 0
        if unknown and not _is_in_step(settings, place, history, noise, weight):
            place_average.leave_open(place, probability(lead))
            return False
        clear_matrix(place.open)
        place.is_other = 1
        place.found += 1
        return True
    if place.found > 0:
        odds = math.log((1.0 + place.found) / (1.0 + place.contacts - place.found))
        place_average.leave_open(place, probability(lead + odds))
    return False


@compiled
def _is_in_step(
    settings: Any, place: Any, history: Any, noise: tuple[float, float, float], weight: float
) -> bool:
    """True if the contact by itself shows that the force is not late, nor early.

    What is late looks like another place, as long as nobody knows that it is late.
    """
    _set_other(place, HEIGHT_DEVIATION**2)
    copy_vector(place.outcome, place.values)
    place.late = 1
    left = place_fit.fit(settings, place, history, noise, weight, 1)
    column = place.next
    clear_vector(column)
    column[DELAY] = 1.0
    if math.isfinite(left):
        solve(place.factor, column, UNKNOWNS)
    place.late = 0
    deviation, delay = math.sqrt(max(column[DELAY], 0.0)), place.values[DELAY]
    place.values[DELAY] = 0.0
    return bool(deviation < SMALL_DELAY and abs(delay) < IN_STEP * deviation + LEAST_DELAY)


@compiled
def _evidence(
    settings: Any,
    place: Any,
    history: Any,
    noise: tuple[float, float, float],
    weight: float,
    passes: int,
) -> float:
    """Logarithm of the evidence of a fit with the prior that is set; minus infinity for none."""
    squares = place_fit.fit(settings, place, history, noise, weight, passes)
    if not math.isfinite(squares):
        return -math.inf
    return place_fit.log_evidence(settings, place, squares, weight)


@compiled
def _set_same(place: Any) -> None:
    """It is the place before: what was known of it is the prior, and its height stays."""
    for i in range(UNKNOWNS):
        for j in range(UNKNOWNS):
            place.seen[i, j] = place.before_covariance[i, j]
        place.seen[i, i] += LEAST_VARIANCE
    for i in range(2):
        for j in range(2):
            place.seen[i, j] += VARIES**2
    place.seen[POSITION, POSITION] = LEAST_VARIANCE
    copy_vector(place.before, place.guess)
    place_fit.invert(place.seen, place)


@compiled
def _set_other(place: Any, height_variance: float) -> None:
    """It is another place: alike, but no more.

    Args:
        place: its prior is set.
        height_variance: of where the contact begins [mm^2].
    """
    prior, before = place.prior, place.before_covariance
    clear_matrix(prior)
    for i in range(POSITION):
        prior[i, i] = 1.0 / (DEVIATIONS[i] ** 2 + before[i, i])
    prior[POSITION, POSITION] = 1.0 / max(height_variance, LEAST_VARIANCE)
    prior[DELAY, DELAY] = 1.0 / DELAY_DEVIATION**2
    # That of B is one of B / K.
    prior[0, 0] += prior[1, 1]
    prior[0, 1] = prior[1, 0] = -prior[1, 1]
    copy_vector(place.before, place.guess)


@compiled
def count_level(place: Any) -> None:
    """Count another place at the height of the one before."""
    place.level += place.is_level


@compiled
def is_to_be_called(settings: Any, bank: Any) -> bool:
    """True once the place is clearly of another tissue; its height is where the contact begins now.

    Args:
        settings: settings record.
        bank: its record `place` is changed.
    """
    place = bank.place
    place.before[POSITION] -= place.outcome[POSITION]
    place.outcome[POSITION] = 0.0
    is_called = place.called == 0 and _is_other_tissue(place)
    if is_called:
        place.called = 1
    if place.testing == 0:  # the contact is over
        _note_before(settings, bank)
    return bool(is_called)


@compiled
def _is_other_tissue(place: Any) -> bool:
    """True if K, B, n or p of the last fit is clearly another than before the contact."""
    for i in range(POSITION):
        off = place.outcome[i] - place.before[i]
        variance = place.covariance[i, i] + place.before_covariance[i, i]
        if is_different(off, variance):
            return True
    return False
