"""Has the force's zero stepped while the tool is in the tissue? A driver that tares, say.

A force that jumps from one reading to the next is that of another tissue, or the old one under
another zero (no tissue changes within a millisecond, but `change` has to ask). Beside the fresh row
the one in use goes on as it was, with what the zero is off by as a state of its own: the exact
filter of a step. Until it is less likely than the row that raised the alarm, that and its
like learn nothing. It is the zero once the law's force has changed by so much that a tissue that is
stiffer by the same factor would have been told from it, or where the tool is held until the test
is over, for then nothing speaks for a tissue. The parameters are those of before, and all that was
read since the jump is moved. (A separate bias as a state: Friedland, IEEE Trans. AC 14, 1969; ours
is what it competes with.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model import judge as judging
from hc_estimator.multiple_model import raw_readings, zero_moves
from hc_estimator.multiple_model.hypotheses import OWN, SURFACE, ZERO_STEP, is_tried
from hc_estimator.multiple_model.rows import seed

FORGETTING_TIME = 0.5  # of log likelihood ratios [s]
LEAD = 10.0  # log likelihood ratio that is clear
SETTLED = 0.5  # time after which one that is clear has not been so by chance [s]
IN_PLACE = 4.0  # deviations within which the displacement is where the row expects it
STEPS = 8  # between readings that say how the force went before it jumped
JUMP = 8.0  # deviations of a reading
GOES_ON = 0.5  # of the jump, by which the force changes in the next readings
# Squared deviations by which a tissue would have been told from a zero. They are far more than the
# likelihood loses by a wrong one: where the tool turns, the motion explains much of the first ones.
SWING = 1000.0
LARGEST_TERM = 16.0  # of one reading in them


@compiled
def begin(settings: Any, bank: Any, reference: Any) -> None:
    """Let the row in use go on under another zero, if the force jumped.

    Args:
        settings: settings record.
        bank: rows and change are changed.
        reference: row that raised the alarm.
    """
    change, row = bank.change, bank.rows[ZERO_STEP]
    known = reference.model_error == 0.0 and not SURFACE[reference.index]
    known = known and reference.nis[0] < IN_PLACE * IN_PLACE
    asked = is_tried(settings, ZERO_STEP) and settings.find_zeros != 0
    if not (asked and known and _has_jumped(settings, bank)):
        return
    clock = bank.tool.contact_clock
    seed(reference, row, clock, clock)
    off = bank.clock.measurement[1] - reference.predicted_force
    row.state[OWN] = off
    row.covariance[OWN, OWN] = off * off
    row.active = 1
    # It has used this sample's displacement already.
    row.innovation[0] = reference.innovation[0]
    row.innovation_variance[0] = reference.innovation_variance[0]
    row.nis[0] = reference.nis[0]
    change.zero_leads = 1
    change.zero_lead = 0.0
    change.jumped_at = bank.gate.refused_from[1]
    change.jumped_from = max(reference.predicted_force, math.sqrt(bank.sensor_noise[1]))
    change.swing = 0.0
    change.swing_mean = 0.0
    change.swing_weight = 0.0


@compiled
def _has_jumped(settings: Any, bank: Any) -> bool:
    """True if the forces that have opened the gate jumped, and went on as before from there.

    Where the tool sets off, lands or lets go, the force goes on to change.
    """
    finder, limit = bank.delay, settings.outlier_limit
    if bank.clock.outlier_counts[1] <= limit:
        return False
    half = 0.5 * grids.period(finder, 1)
    first = raw_readings.latest_up_to(finder, 1, bank.gate.refused_from[1] + half)
    before, last = first - 1, first + limit
    if before - STEPS < raw_readings.oldest(finder, 1) or last >= finder.raw_count[1]:
        return False
    slope = raw_readings.slope_between(finder, 1, before - STEPS, before)
    step = raw_readings.change_between(finder, 1, before, first, slope)
    goes_on = raw_readings.change_between(finder, 1, first, last, slope)
    clear = step * step > JUMP * JUMP * bank.sensor_noise[1]
    return bool(clear and abs(goes_on) < GOES_ON * abs(step))


@compiled
def weigh(change: Any, rows: Any, elapsed: float) -> None:
    """Weigh the zero against the row in use after a sample in contact of a time [s]."""
    row = rows[ZERO_STEP]
    if row.active == 0:
        return
    if row.alarmed != 0 or rows[change.reference].active == 0:
        row.active = 0
        change.zero_leads = 0
        return
    # What a tissue that is stiffer by a factor would have made of the same jump, about its mean:
    # that the row takes for the zero.
    weight = 1.0 / row.innovation_variance[1]
    beside = row.predicted_force / change.jumped_from * row.state[OWN] - change.swing_mean
    change.swing_weight += weight
    change.swing_mean += weight / change.swing_weight * beside
    beside *= row.predicted_force / change.jumped_from * row.state[OWN] - change.swing_mean
    change.swing += min(weight * beside, LARGEST_TERM)
    lead = row.evidence - rows[change.reference].evidence
    change.zero_lead += lead - change.zero_lead * elapsed / FORGETTING_TIME
    change.zero_leads = 1 if change.zero_lead > LEAD else 0


@compiled
def is_it(change: Any, rows: Any, over: bool) -> bool:
    """True if it is the zero; `over`: the test ends here, whether the force swung or not.

    No tissue at all explains some steps: what was tared in the tissue pulls at once.
    """
    row = rows[ZERO_STEP]
    if row.active == 0 or change.zero_leads == 0:
        return False
    if over:
        return bool(row.change_lead < LEAD)
    none_fits = change.time > SETTLED and row.change_lead < -LEAD
    return bool(none_fits or (row.change_lead < 0.0 and change.swing > SWING))


@compiled
def take(settings: Any, bank: Any) -> None:
    """The zero is another one since the jump, and the tissue the one of before."""
    row = bank.rows[ZERO_STEP]
    deviation = math.sqrt(row.covariance[OWN, OWN])
    zero_moves.step_force(settings, bank, row.state[OWN], deviation, bank.change.jumped_at)
    judging.give_to_all(bank.judge, bank.rows, ZERO_STEP, bank.tool.contact_clock)
