"""Another tissue, or a law that does not fit? A row begun anew competes with the others.

After an alarm of the chosen row the fresh row begins: parameters let go, motion from the
displacement alone. Its log likelihood ratio to the reference (the row that raised the alarm) is
what decides, with forgetting, and floored, so that its first unsure steps do not count for ever.
It is given out as soon as it is clearly the likelier, and every other row has raised an alarm too
or is as clearly beaten: a lump is explained by a row that follows it. Where the rows had not
fitted, it must have predicted better as well. Where they had fitted for long, that is a change at
once (`SEEN_LATE` samples after the alarm, by which a noise that jumped is seen); otherwise at the
end of the probation, for a law that does not fit makes each fresh row better for a part of a
period and no better over a whole one.

A generalised likelihood ratio test (Willsky and Jones, IEEE Trans. AC 21, 1976); reference, floor
and probation are ours (`hc bench accuracy ablation`, changes of the tissue).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.adaptation import motion_density
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import judge as judging
from hc_estimator.multiple_model import zero_step
from hc_estimator.multiple_model.hypotheses import (
    ACCELERATION,
    FRESH,
    LOG_DAMPING,
    LOG_STIFFNESS,
    ZERO_STEP,
    is_tried,
)
from hc_estimator.multiple_model.model_error import THRESHOLD, is_in_air, raise_model_error
from hc_estimator.multiple_model.rows import free_parameters, prior_deviation, seed, take_motion
from hc_estimator.multiple_model.zero_step import FORGETTING_TIME, LEAD, SETTLED

PROBATION = 2.0  # time in contact over which a fresh row may compete [s]; none before it
KEEP = 20.0  # that the fresh row needs at the end of the probation
FLOOR = 15.0  # of the ratios, below zero
CALM = 0.3  # share of an alarm up to which the reference explains all by itself
TRUSTED_AFTER = 3.0  # rows that have fitted for so long are believed [s]
# A row that has seen one velocity only cannot tell a turn of the tool from another tissue: it is
# believed from this share of the prior variance of ln B down.
KNOWN = 0.05
BETTER = 2.0  # ratio of the mean squared errors of delayed predictions that is clear
DIFFERENT = 4.0  # deviations by which a parameter of another tissue differs
SEEN_LATE = 80.0  # samples that a jump of the noise may need to be seen
DEVIATIONS = (1.0, 1.0, 0.3, 0.1)  # of ln K, ln B, n and p about their old values


@compiled
def reset(change: Any, rows: Any) -> None:
    """The rows are believed until the data object."""
    end_test(change, rows)
    change.detected = 0
    change.fitting_time = 0.0


@compiled
def end_test(change: Any, rows: Any) -> None:
    """Go on without the rows under test."""
    change.testing = 0
    change.leads = 0
    change.zero_leads = 0
    rows[FRESH].active = 0
    rows[ZERO_STEP].active = 0


@compiled
def begin_test(settings: Any, bank: Any, ahead: float) -> bool:
    """Begin the fresh row against the chosen one; False where an alarm may not yet.

    What the row in use made of the motion since the change is as wrong as its parameters: the
    motion is that of the displacement, the last of which is some time [s] ago.
    """
    change, judge, rows, tool = bank.change, bank.judge, bank.rows, bank.tool
    if not (is_tried(settings, FRESH) and tool.contact_clock > PROBATION):
        return False
    change.testing = 1
    change.leads = 0
    change.time = 0.0
    change.calm_time = 0.0
    change.reference = judge.chosen
    reference = rows[judge.chosen]
    prior = prior_deviation(settings, 1) ** 2
    for i in range(4):
        change.before[i] = reference.state[LOG_STIFFNESS + i]
        change.before_variance[i] = reference.covariance[LOG_STIFFNESS + i, LOG_STIFFNESS + i]
    knows_damping = reference.covariance[LOG_DAMPING, LOG_DAMPING] <= KNOWN * prior
    change.fitted = 1 if change.fitting_time > TRUSTED_AFTER else 0
    change.trusted = 1 if change.fitted != 0 and knows_damping else 0
    for m in range(FRESH):
        rows[m].alarmed = 0
        rows[m].change_lead = 0.0
    rows[judge.chosen].alarmed = 1
    fresh = rows[FRESH]
    seed(rows[judge.chosen], fresh, tool.contact_clock, tool.contact_clock)
    fresh.model_error = 0.0
    fresh.score = reference.score
    fresh.contact_time = 0.0
    fresh.active = 1
    free_parameters(settings, fresh, DEVIATIONS)
    if motion_density.is_settled(bank.motion):
        take_motion(settings, fresh, bank.motion, bank.sensor_noise[0], ahead)
    zero_step.begin(settings, bank, reference)
    return True


@compiled
def answer(settings: Any, bank: Any, ahead: float) -> None:
    """Answer the alarms of this sample: a test of a change, or model error.

    Args:
        settings: settings record.
        bank: its records `change` and `rows` are changed.
        ahead: time of the sample since the last displacement [s].
    """
    change, chosen = bank.change, bank.judge.chosen
    for m in range(FRESH + 1):
        row = bank.rows[m]
        if row.active == 0 or row.alarm == 0:
            continue
        if change.zero_leads != 0 and m < FRESH:
            continue  # the law has not been asked since
        if is_in_air(row, bank.clock, bank.sensor_noise):
            continue  # it is the tool that surprises
        if m == chosen and change.testing == 0 and begin_test(settings, bank, ahead):
            continue
        raise_model_error(settings, row, bank.sensor_noise[1])
        if m == chosen:
            change.fitting_time = 0.0


@compiled
def _others_are_beaten(change: Any, rows: Any, elapsed: float) -> bool:
    """Advance the ratios to all rows; True if each raised an alarm too or is clearly beaten."""
    beaten = True
    evidence = rows[FRESH].evidence
    for m in range(rows.shape[0]):
        row = rows[m]
        if row.active == 0 or m == FRESH:
            continue
        lead = row.change_lead * (1.0 - elapsed / FORGETTING_TIME) + evidence - row.evidence
        row.change_lead = max(lead, -FLOOR)
        if row.alarmed == 0 and row.change_lead < LEAD:
            beaten = False
    return beaten


@compiled
def is_different(distance: float, variance: float) -> bool:
    """True if a parameter that is so far from another is clearly not that of the same tissue."""
    return distance * distance > DIFFERENT * DIFFERENT * variance


@compiled
def _differs(change: Any, rows: Any) -> bool:
    """True if the parameters of the fresh row are others than those at the alarm.

    A row that a turn of the tool has led astray is beaten by a fresh one as well, but that finds
    the same tissue again.
    """
    fresh = rows[FRESH]
    for i in range(LOG_STIFFNESS, ACCELERATION):
        distance = fresh.state[i] - change.before[i - LOG_STIFFNESS]
        variance = fresh.covariance[i, i] + change.before_variance[i - LOG_STIFFNESS]
        if is_different(distance, variance):
            return True
    return False


@compiled
def _is_believed(change: Any, rows: Any) -> bool:
    """True if what the fresh row foresaw speaks for it as well.

    Where the rows had fitted for long, it must not predict clearly worse than the best of them: a
    turn of the tool makes each of them unlikely for a while. Where they had not, it must predict
    clearly better, for a fresh one is the likelier for a part of each period of any misfit.
    """
    best = math.inf
    for m in range(FRESH):
        if rows[m].active != 0:
            best = min(best, rows[m].score)
    if change.fitted != 0:
        return bool(rows[FRESH].score < BETTER * best)
    return bool(BETTER * rows[FRESH].score < best)


@compiled
def is_explained(change: Any) -> bool:
    """True if the row that raised the alarm explains the readings again, alone and for long."""
    return bool(change.calm_time > SETTLED)


@compiled
def _is_late(bank: Any) -> bool:
    """True if a noise that jumped would have been seen by now."""
    return bool(bank.change.time > SEEN_LATE * bank.clock.force_elapsed)


@compiled
def judge_test(settings: Any, bank: Any) -> bool:
    """After all rows have used a force in contact: who leads, and is it over?

    Args:
        settings: settings record.
        bank: its record `change` is changed; if it is another tissue `judge` and `rows`, and if it
            is another zero all that was read since.

    Returns:
        True if it is another zero.
    """
    change, rows = bank.change, bank.rows
    rose = bank.noise[0].jumped > 0 or bank.noise[1].jumped > 0
    if rose and not _is_late(bank):
        # The alarm was the sensor's. If the tissue changed as well, the next alarm is near.
        end_test(change, rows)
        return False
    change.time += bank.clock.force_elapsed
    reference = rows[change.reference]
    calm = reference.model_error == 0.0 and reference.alarm_sum < CALM * THRESHOLD
    change.calm_time = change.calm_time + bank.clock.force_elapsed if calm else 0.0
    beaten = _others_are_beaten(change, rows, bank.clock.force_elapsed)
    zero_step.weigh(change, rows, bank.clock.force_elapsed)
    if zero_step.is_it(change, rows, change.time > PROBATION):
        zero_step.take(settings, bank)
        end_test(change, rows)
        return True
    _judge_fresh(bank, beaten)
    return False


@compiled
def _judge_fresh(bank: Any, beaten: bool) -> None:
    """Is it another tissue? `beaten`: all rows but the reference are."""
    change, rows = bank.change, bank.rows
    ratio = rows[change.reference].change_lead
    over = change.time > PROBATION
    if over and change.leads == 0:  # whatever happens to the rows just now came too late
        end_test(change, rows)
        return
    believed = _is_believed(change, rows)
    if change.leads == 0 and ratio > LEAD and beaten and believed:
        change.leads = 1
    elif change.leads != 0 and (ratio < -LEAD or not believed):
        change.leads = 0
    differs = _differs(change, rows)
    at_once = change.trusted != 0 and _is_late(bank) and differs
    if change.leads != 0 and (at_once or (over and ratio > KEEP)):
        change.detected = 1 if differs else 0
        judging.give_to_all(bank.judge, rows, FRESH, bank.tool.contact_clock)
        end_test(change, rows)
        return
    hopeless = ratio < -LEAD or (change.fitted != 0 and not believed)
    hopeless = hopeless or is_explained(change)
    if over or (change.time > SETTLED and change.leads == 0 and hopeless):
        end_test(change, rows)
