"""The order of a sample in the default filter; each step answers one question.

0.  What belongs together?                                 -> `alignment`, before this
1.  Does the motion start anew (a start, a gap), or what is the state at the sample's stamp?
2.  Is a reading an outlier, by the chosen row?            -> it is refused
3.  What does each row make of the displacement, then of the force?
4.  How consistent is each row with it?                    -> alarms, model error
5.  How noisy are the sensors, how does the tool move?     -> noise, jerk density
6.  Who predicts best?                                     -> the chosen row
7.  Did the tool turn suddenly?                            -> back to before it
8.  Is an alarm another tissue, or another zero?           -> a fresh row, a change; a zero
9.  What does least squares say to what was felt?          -> `batch_fit`, after this
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.adaptation import motion_density
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import (
    air_zero,
    beginning,
    contact_onset,
    departure,
    landing,
    levels,
    lift_off,
    model_error,
    motion_correction,
    outliers,
    plausible,
    readings,
    report,
    spread,
    tempering,
    unknown_velocity,
)
from hc_estimator.multiple_model import change as changes
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import judge as judging
from hc_estimator.multiple_model import maneuver as maneuvers
from hc_estimator.multiple_model.choice import WAIT
from hc_estimator.multiple_model.hypotheses import (
    DEPTH,
    FITTED,
    FRESH,
    SURFACE,
    SURFACE_ROW,
    VARIES,
)
from hc_estimator.multiple_model.kalman import (
    HOLD_ALL,
    depth_of,
    innovate_force,
    innovate_nothing,
    let_stiffness_vary,
    predict,
    use_displacement,
    use_force,
)
from hc_estimator.multiple_model.rows import (
    begin_motion,
    is_sound,
    let_surface_move,
    limit,
    limit_wild,
    seed,
)
from hc_estimator.multiple_model.unscented import foresee_force
from hc_estimator.screening import ACCEPTED, NUMERICAL, OUTLIER, note_accepted

PERIOD_SHARE = 0.05  # of a new interval in the usual one
UNKNOWN = 1e12  # variance of a force whose noise is not known yet [N^2]
TOUCHING_DEPTH = 0.02  # from which the judge counts contact [mm]
AWAY_TIME = 1.0  # the parameters go on walking for so long after contact is lost [s]
FREE_DEVIATIONS = 3.0  # of the depth from which on free motion is certain


@compiled
def use(settings: Any, bank: Any, time: float, place: float, extrapolated: float) -> int:
    """Use the sample in bank.clock.

    Args:
        settings: settings record.
        bank: changed.
        time: stamp of the sample [s].
        place: where it belongs in the displacement's time [s].
        extrapolated: by how much later the sample's own force belongs [s].

    Returns:
        ACCEPTED or the reason for the refusal.
    """
    clock = bank.clock
    readings.note_steps(settings, bank)
    found = bank.change.detected  # by a reading that was used with this sample, before
    bank.change.detected = 0
    bank.given.extrapolated = extrapolated
    if clock.restart == 0:
        share = PERIOD_SHARE if clock.period > 0.0 else 1.0
        clock.period += share * (clock.elapsed - clock.period)
    anew = clock.restart != 0 or bank.motion_anew != 0
    # Where another delay is used from now on, a place may lie before the last one.
    clock.force_elapsed = clock.period if anew else max(place - clock.force_time, 0.0)
    if anew and not _is_placed(bank, place):
        # As long as nobody knows where the tool is, a force says nothing.
        bank.motion_anew = 1
        report.foretell(settings, bank)
        note_accepted(clock, time)
        readings.learn(settings, bank, place)
        clock.state_time = place
        bank.change.detected = found
        return ACCEPTED
    decision = _update(settings, bank, place)
    clock.state_time = place
    if clock.present[1] != 0:
        clock.force_time = place
    if decision == ACCEPTED:
        note_accepted(clock, time)
        readings.learn(settings, bank, place)
        _decide(settings, bank, place)
    else:  # the rows stand at the sample's stamp all the same
        clock.last_time = time
        clock.started = 1
        clock.backward_count = 0
    if decision != NUMERICAL and contact_onset.learn(settings, bank, place):
        beginning.begin_at_onset(settings, bank)
    elif decision == ACCEPTED:
        air_zero.learn(settings, bank, place)
    beginning.recover(settings, bank, time, decision)
    bank.change.detected = max(bank.change.detected, found)
    return decision


@compiled
def _is_placed(bank: Any, place: float) -> bool:
    """True if a motion can begin at a place [s]: where the tool was is known by then.

    After a gap a force that is late may belong to a time before any displacement.
    """
    if math.isnan(readings.last_displacement(bank)):
        return False
    clock = bank.clock
    if clock.present[0] != 0 or clock.started == 0:
        return True
    return bool(readings.since_displacement(bank, place) >= 0.0)


@compiled
def note_held(bank: Any, time: float) -> None:
    """Take note of a reading that is held back."""
    note_accepted(bank.clock, time)


@compiled
def _update(settings: Any, bank: Any, place: float) -> int:
    """Predict every row to the sample's place [s] and update it with the readings there are."""
    clock, rows = bank.clock, bank.rows
    if outliers.is_lost(settings, bank, rows[bank.judge.chosen], place):
        report.foretell(settings, bank)
        report.give_refused(bank)
        return OUTLIER
    _predict(settings, bank)
    plausible.check(settings, bank)
    report.foretell(settings, bank)
    chosen = rows[bank.judge.chosen]
    log_speed = levels.log_usual_speed(bank.tool)
    if clock.present[0] != 0 and outliers.is_outlier(settings, bank, chosen, 0, place):
        report.give_refused(bank)
        return OUTLIER
    for m in range(rows.shape[0]):
        row = rows[m]
        if row.active == 0:
            continue
        if clock.present[0] != 0:
            hold = _hold(settings, bank, row)
            noise = bank.sensor_noise[0]
            use_displacement(row, clock.measurement[0], clock.offset, noise, hold, log_speed)
    if clock.present[1] != 0:
        if not _foresee(settings, bank):
            return NUMERICAL
        # Rows that learn nothing while another zero leads stay surprised.
        looks = bank.calibrated != 0 and bank.change.zero_leads == 0
        departs = settings.find_maneuvers != 0 and looks
        departs = departs and departure.let_go(bank.maneuver, rows, chosen, clock.period)
        if departs and not _foresee(settings, bank):
            return NUMERICAL
        open_before = clock.outlier_counts[1] > settings.outlier_limit
        if outliers.is_outlier(settings, bank, chosen, 1, place):
            report.give(settings, bank, OUTLIER)
            limit_wild(settings, rows)
            return OUTLIER
        opens = not open_before and clock.outlier_counts[1] > settings.outlier_limit
        # So many forces that cannot be are an alarm, and no row may be led astray by them before.
        goes_back = opens and maneuvers.answer_at_once(settings, bank, place, log_speed)
        if goes_back and not _foresee(settings, bank):
            return NUMERICAL
        for m in range(rows.shape[0]):
            if bank.change.zero_leads != 0 and m < FRESH:
                continue  # it expects the force under a zero that is none any more
            if rows[m].active != 0:
                # What surprises now is the motion, and teaches nothing about the tissue.
                hold = HOLD_ALL if departs else _hold(settings, bank, rows[m])
                _use_force(bank, rows[m], hold, log_speed)
    report.give(settings, bank, ACCEPTED)
    for m in range(rows.shape[0]):
        if rows[m].active != 0:
            limit(settings, rows[m])
    return ACCEPTED if _keep_sound(settings, bank) else NUMERICAL


@compiled
def _use_force(bank: Any, row: Any, hold: int, log_speed: float) -> None:
    """Update a row with the force, by what that says of where the tool is."""
    reading, noise = bank.clock.measurement[1], bank.sensor_noise[1]
    says = landing.look(row, reading, noise) if bank.calibrated != 0 else landing.KNOWN
    if says == landing.AIR:
        landing.stay_in_air(row, reading, noise)
    elif says == landing.KNOWN or not landing.land(row, reading, noise):
        use_force(row, hold, log_speed)


@compiled
def _predict(settings: Any, bank: Any) -> None:
    """Bring every row to the sample's stamp."""
    clock = bank.clock
    anew = clock.restart != 0 or bank.motion_anew != 0
    density = motion_density.jerk_density(settings, bank.motion)
    goes_on = bank.tool.away_time < AWAY_TIME
    away = bank.tool.away_time > 0.0
    variance = spread.growth_in_air(bank.judge, bank.tool, clock.elapsed) if goes_on else 0.0
    displacement = readings.last_displacement(bank)
    for m in range(bank.rows.shape[0]):
        row = bank.rows[m]
        if row.active == 0:
            continue
        if anew:
            begin_motion(settings, row, displacement)
        else:
            jerk = maneuvers.jerk_density(bank.maneuver, row, clock.period, density)
            predict(row, clock.elapsed, jerk, goes_on or SURFACE[m], away)
            if variance > 0.0 and VARIES[m]:
                let_stiffness_vary(row, variance)
    if anew:
        clock.restart = 1
        bank.motion_anew = 0
    if bank.guessed == 0:
        beginning.centre_prior(settings, bank)


@compiled
def _hold(settings: Any, bank: Any, row: Any) -> int:
    """Which parameters of a row this sample must not teach.

    The air says nothing of the tissue; without this the parameters would go on following the
    displacement through what is left of their correlation with the motion.
    """
    reach = FREE_DEVIATIONS * math.sqrt(row.covariance[DEPTH, DEPTH])
    if row.state[DEPTH] + reach <= 0.0 and not SURFACE[row.index]:
        return HOLD_ALL
    return unknown_velocity.hold(settings, bank.maneuver, row, bank.clock.period)


@compiled
def _foresee(settings: Any, bank: Any) -> bool:
    """Innovation of the force for every row; False if the chosen row is lost."""
    clock, noise = bank.clock, bank.sensor_noise[1]
    samples = tempering.coherent_samples(settings, bank.tool, clock.force_elapsed)
    log_speed = levels.log_usual_speed(bank.tool)
    for m in range(bank.rows.shape[0]):
        row = bank.rows[m]
        if row.active == 0:
            continue
        known = noise + row.model_error
        if not foresee_force(settings, row, log_speed, clock.measurement[1], known):
            chosen = bank.rows[bank.judge.chosen]
            seed(chosen, row, bank.tool.contact_clock, bank.tool.contact_clock + WAIT)
            if not foresee_force(settings, row, log_speed, clock.measurement[1], known):
                return False
        force_noise = UNKNOWN
        if bank.calibrated != 0:
            force_noise = noise + row.model_error + max(row.force_noise, 0.0) * samples
            if settings.find_maneuvers != 0:
                force_noise += unknown_velocity.product_variance(
                    settings, bank.maneuver, row, clock.period, samples
                )
        innovate_force(row, clock.measurement[1], force_noise)
        if bank.calibrated != 0 and landing.look(row, clock.measurement[1], noise) == landing.AIR:
            innovate_nothing(row, clock.measurement[1], known)
    return True


@compiled
def _keep_sound(settings: Any, bank: Any) -> bool:
    """Seed rows that are no numbers any more from the chosen one; False if that is lost itself."""
    rows, chosen = bank.rows, bank.rows[bank.judge.chosen]
    if not is_sound(chosen):
        return False
    for m in range(rows.shape[0]):
        if rows[m].active != 0 and not is_sound(rows[m]):
            clock = bank.tool.contact_clock
            seed(chosen, rows[m], clock, clock + WAIT)
    return True


@compiled
def _is_touching(bank: Any, chosen: Any) -> bool:
    """True if there is contact, as the chosen row sees it, or as one whose surface may move does.

    A row that expects no force where there is one must not stop what would refute it: where the
    zero was a guess it slept beside half a newton for seconds. A force that is small beside what
    was felt may be a zero that moved, and is left to the chosen row.
    """
    clock, noise = bank.clock, bank.sensor_noise[1]
    pressed = clock.present[1] != 0 and clock.measurement[1] > judging.SURE * math.sqrt(noise)
    if depth_of(chosen) > TOUCHING_DEPTH:
        return bool(chosen.predicted_force > 0.0 or pressed)
    if not pressed or SURFACE[chosen.index]:
        return bool(pressed)
    surface, largest = bank.rows[SURFACE_ROW], bank.tool.largest_force
    if surface.active == 0 or largest == 0.0 or clock.measurement[1] < judging.PRESSED * largest:
        return False
    return bool(depth_of(surface) > TOUCHING_DEPTH and surface.predicted_force > 0.0)


@compiled
def _decide(settings: Any, bank: Any, time: float) -> None:
    """Learn from the innovations; choose a row; answer alarms."""
    clock, rows, tool = bank.clock, bank.rows, bank.tool
    if bank.calibrated == 0:
        return
    latest = model_error.latest_noise(bank.sensor_noise, bank.noise)
    for m in range(rows.shape[0]):
        if rows[m].active != 0:
            model_error.learn(settings, rows[m], bank.sensor_noise, latest, clock)
            if rows[m].position_deviation > 0.0 and SURFACE[m] and rows[m].model_error > 0.0:
                let_surface_move(rows[m])
    chosen = rows[bank.judge.chosen]
    touching = _is_touching(bank, chosen)
    elapsed = clock.elapsed if clock.restart == 0 else clock.period  # a gap is no contact
    if touching:
        tool.away_time = 0.0
        tool.contact_clock += elapsed
        levels.learn(tool, rows, chosen, elapsed)
        if clock.present[1] != 0 and bank.change.zero_leads == 0:
            plausible.learn(tool, chosen, clock.measurement[1], clock.force_elapsed)
    else:
        lift_off.look(settings, bank, clock.elapsed)
        tool.away_time += clock.elapsed
        chosen = rows[bank.judge.chosen]
        spread.find_in_air(settings, bank.judge, rows, tool.contact_clock)
    motion_correction.correct(settings, bank, chosen)
    turning = maneuvers.is_turning(bank.maneuver, chosen, clock.period)
    if touching and clock.present[1] != 0 and not turning:
        judging.learn(settings, bank)
    alarm = rows[bank.judge.chosen].alarm != 0
    tested = bank.change.testing != 0  # then the fresh row has used this sample as well
    if not maneuvers.answer(settings, bank, time, alarm):
        changes.answer(settings, bank, readings.since_displacement(bank, time))
    stepped = False  # the force's zero
    if tested and bank.change.testing != 0 and touching and clock.present[1] != 0:
        stepped = changes.judge_test(settings, bank)
        if bank.change.testing == 0 and bank.change.detected == 0:
            maneuvers.audit(settings, bank, stepped)
    if bank.change.detected != 0:
        histories.reset(bank.history)
        rows[FITTED].active = 0
    if rows[bank.judge.chosen].model_error > 0.0:
        bank.change.fitting_time = 0.0
    elif touching:
        bank.change.fitting_time += elapsed
    if clock.restart != 0 or bank.change.detected != 0 or stepped:
        bank.maneuver.count = 0
    departure.learn(bank)
    maneuvers.keep(bank, time)
