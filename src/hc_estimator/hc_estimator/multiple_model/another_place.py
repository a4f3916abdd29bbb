"""Is a new contact one with another place, of another stiffness and at another height?

A tool that was in the air comes down elsewhere, wherever a tissue is palpated place by place. So
what the points of a contact say by themselves is held against what was known in the air before it:
least squares with the contact position as a fifth unknown (and where the tissue varies along the
way, the rate of its stiffness), once with the prior that the place is
the same, once with one that lets everything go; their evidence decides (`place_fit`). If it is
another place, every row begins anew with that fit, what was felt before the contact no longer
counts, and the fit is made anew as the contact goes on, for as long as it explains the force.
Whether that is called a change says `place_change`.

As long as nobody knows whether the force is late, its delay is an unknown of both, with what the
contacts before said of it as prior, and what was known of the place is that of the contact before
beside that delay: what is late looks like another height, but by the same delay in both contacts.

Not where a surface that moves is in charge, which knows of another height, too. Where the law did
not fit before, only of whole contacts, for the first points of one are fitted by any law. (Ours;
`hc bench accuracy places`.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix, copy_matrix, copy_vector
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import (
    place_average,
    place_before,
    place_change,
    place_delay,
    place_fit,
    place_prior,
)
from hc_estimator.multiple_model.delay_records import GRID
from hc_estimator.multiple_model.hypotheses import OWN, SURFACE
from hc_estimator.multiple_model.kalman import force_at, probability
from hc_estimator.multiple_model.local_polynomial import TOUCHING
from hc_estimator.multiple_model.model_error import THRESHOLD
from hc_estimator.multiple_model.place_fit import POSITION
from hc_estimator.multiple_model.place_prior import CONSISTENT, FEWEST, HEIGHT_DEVIATION, OUT_TIME
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

MORE = 1.25  # times as many points at which it is asked again
DOUBTED = 0.3  # share of an alarm from which on it is asked
LIKELIER = 20.0  # logarithm of the evidence by which it is another place
LIKELIER_AGAIN = 5.0  # the same once there was one


@compiled
def reset(place: Any) -> None:
    """No contact is asked about."""
    place.away = 0.0
    forget(place)
    place.called = 0
    place.found = 0
    place.level = 0
    place.contacts = 0
    place.square_rate = 0.0
    place_delay.reset(place)
    forget_fits(place)


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
    place.joint = 0
    clear_matrix(place.open)


@compiled
def begin_in_step(place: Any) -> None:
    """Begin with what the last contact said beside the delay that it showed, its height as well."""
    forget_fits(place)
    place.known = 1
    place.row = 0
    place.square_rate = 0.0
    copy_vector(place.outcome, place.before)
    copy_matrix(place.covariance, place.before_covariance)


@compiled
def forget_fits(place: Any) -> None:
    """Whether the law fitted the contacts before says nothing: delay or height were not known."""
    place.ended = 0
    place.fitting = 0
    place.fitting_in_a_row = 0


@compiled
def look(settings: Any, bank: Any) -> bool:
    """Take the newest point of the grid; True if rows are to begin anew with the fit in `place`.

    Args:
        settings: settings record.
        bank: its record `place` is changed, and where the contact begins in `history`.
    """
    place, history, finder = bank.place, bank.history, bank.delay
    place.delay_learnt = 0
    if settings.find_places == 0 or is_held(settings, 0):
        return False
    shift = round(finder.delay / finder.grid_step)
    here = finder.grid_count - 1 - max(-shift, 0)
    if here < max(finder.grid_count - GRID, 0):
        return False
    least = TOUCHING * math.sqrt(bank.sensor_noise[1])
    if finder.grid[here % GRID].force < least:
        if _has_let_go(settings, bank, here - shift, least):
            return False
        before = place.away
        place.away += finder.grid_step
        place_before.let_vary(bank)
        if not (before <= OUT_TIME and place.away > OUT_TIME):
            return False
        last = place.is_other != 0 and history.count > place.last
        last = (last or _is_whole(bank)) and _ask(settings, bank)
        end(place)
        _note_end(bank)
        if not last:
            place_before.note(settings, bank)
            place_delay.learn(settings, bank)
        return last
    if place.away > OUT_TIME:
        history.contact = history.count
        place.testing = place.known
        place.doubted = 0
        place.called = 0
        place.contacts += place.known
        clear_matrix(place.open)
        place.due = FEWEST
    place.away = 0.0
    if place.testing == 0:
        return False
    _doubt(bank)
    if finder.delay != 0.0 or (finder.doubt == 0.0 and place_delay.is_known(finder)):
        place.in_step = 1
        place.joint = 0
    count = history.count - history.contact
    if place.doubted == 0 or place.unknown != 0 or count < place.due:
        return False
    place.due = math.ceil(MORE * count)
    if count > place_prior.most_points(bank) or history.contact < history.begun:
        place.testing = 0
        clear_matrix(place.open)  # by now the rows have learnt what the contact says
        return False
    return _ask(settings, bank)


@compiled
def _has_let_go(settings: Any, bank: Any, there: int, least: float) -> bool:
    """True if the law expects no force, for the tool withdraws faster than the tissue follows.

    Such a tool is still within the tissue, and cannot be anywhere else when it is felt again.

    Args:
        settings: settings record.
        bank: record of the bank.
        there: point of the grid that the displacement is of.
        least: force that is felt [N].
    """
    finder, row = bank.delay, bank.rows[bank.judge.chosen]
    if not max(finder.grid_count - GRID, 0) <= there < finder.grid_count:
        return False
    depth, velocity = finder.grid[there % GRID].displacement, finder.grid[there % GRID].velocity
    if SURFACE[row.index]:
        depth -= row.state[OWN]
    return bool(depth > 0.0 > velocity and force_at(settings, row, depth, velocity) < least)


@compiled
def _is_whole(bank: Any) -> bool:
    """True if the contact that is over is to be asked about as a whole."""
    place, history = bank.place, bank.history
    count = history.count - history.contact
    asked = place.testing != 0 and place.unknown != 0
    some = FEWEST <= count <= place_prior.most_points(bank)
    return bool(asked and some and history.contact >= history.begun)


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
        fits = row.model_error == 0.0
        place.ended += 1
        place.fitting += 1 if fits else 0
        place.fitting_in_a_row = place.fitting_in_a_row + 1 if fits else 0


@compiled
def _ask(settings: Any, bank: Any) -> bool:
    """Hold what the contact says by itself against what was known before it."""
    place_delay.leave_open(bank.place, bank.delay)
    is_other = _is_another(settings, bank)
    bank.place.late = 0
    return is_other


@compiled
def _is_another(settings: Any, bank: Any) -> bool:
    """True if the evidence of the contact's points says so, with the fit in `place`."""
    place, history = bank.place, bank.history
    noise = histories.noise_of_points(bank)
    needed = True
    place.first = history.contact
    place.last = history.count
    if place.is_other == 0:
        place_prior.set_same(place)
        copy_vector(place.guess, place.values)
        same = place_fit.fit(settings, place, history, noise, 1.0, 1)
        # A place that explains the contact to within the noise is no other one.
        needed = not same < CONSISTENT * place.expected
    weight, other = _fit_other(settings, bank, noise)
    if other == -math.inf:
        return False
    if place.is_other != 0:
        return True
    place_prior.set_same(place)
    copy_vector(place.guess, place.values)
    lead = other - _evidence(settings, place, history, noise, weight, 2)
    if needed and lead > (LIKELIER if place.found == 0 else LIKELIER_AGAIN):
        late = place_delay.may_be_late(settings, place) and place.joint == 0
        if late and not place_delay.is_in_step(settings, bank, noise, weight):
            place_average.leave_open(place, probability(lead))
            return False
        clear_matrix(place.open)
        place.is_other = 1
        place.found += 1
        if place.joint == 0:
            return True
        # Whatever the delay is, this is another place; the rows go on with the one in use.
        place.joint = 0
        place_delay.leave_open(place, bank.delay)
        return _fit_other(settings, bank, noise)[1] > -math.inf
    if place.found > 0:
        odds = math.log((1.0 + place.found) / (1.0 + place.contacts - place.found))
        place_average.leave_open(place, probability(lead + odds))
    return False


@compiled
def _fit_other(settings: Any, bank: Any, noise: tuple[float, float, float]) -> tuple[float, float]:
    """Fit another place, at the height of the one before and at any.

    Args:
        settings: settings record.
        bank: its record `place` has the likelier fit, and what the height leaves open.
        noise: of the points.

    Returns:
        Weight of the points' squares; logarithm of the evidence, minus infinity for no fit.
    """
    place, history = bank.place, bank.history
    place_prior.set_other(place, HEIGHT_DEVIATION**2)
    if place.is_other == 0:
        place_fit.begin(settings, place, history)
    else:
        copy_vector(place.outcome, place.values)
    other = place_fit.fit(settings, place, history, noise, 1.0, 2)
    if not (math.isfinite(other) and place.expected > 0.0):
        return 0.0, -math.inf
    left = other / place.expected
    if not left < CONSISTENT:
        return 0.0, -math.inf
    weight = place_prior.weight_of(left)
    elsewhere = _evidence(settings, place, history, noise, weight, 1)
    if elsewhere == -math.inf:
        return weight, elsewhere
    place_fit.note_covariance(settings, place)
    copy_vector(place.values, place.outcome_elsewhere)
    copy_matrix(place.covariance, place.covariance_elsewhere)
    place_fit.carry(place, history, place.outcome_elsewhere, place.covariance_elsewhere)
    known = place.before_covariance[POSITION, POSITION]
    place_prior.set_other(place, known + place_prior.UNEVEN**2)
    place.values[POSITION] = place.guess[POSITION]
    level = _evidence(settings, place, history, noise, weight, 2)
    place_fit.note_covariance(settings, place)
    copy_vector(place.values, place.outcome)
    place_fit.carry(place, history, place.outcome, place.covariance)
    odds = math.log((1.0 + place.level) / (1.0 + place.found - place.level))
    place_average.join(place, probability(elsewhere - level - odds))
    return weight, max(level, elsewhere)


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
    return place_fit.log_evidence(settings, place, history, squares, weight, noise[2])


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
    is_called = (
        place.called == 0 and place.square_rate == 0.0 and place_change.is_one(settings, bank)
    )
    if is_called:
        place.called = 1
    if place.unknown != 0:
        forget_fits(place)
    if place.testing == 0:  # the contact is over
        place_before.note(settings, bank)
        place_delay.learn(settings, bank)
    return is_called
