"""The order of a sample in the default filter; each step answers one question.

0.  What belongs together?                                 -> `alignment`, before this
1.  Does the motion start anew (a start, a gap), or what is the state at the sample's stamp?
2.  Is a reading an outlier, by the chosen row?            -> it is refused
3.  What does each row make of the displacement, then of the force?
4.  How consistent is each row with it?                    -> alarms, model error
5.  How noisy are the sensors, how does the tool move?     -> noise, jerk density
6.  Who predicts best?                                     -> the chosen row
7.  Did the tool turn suddenly?                            -> back to before it
8.  Is an alarm another tissue?                            -> a fresh row, a change
9.  What does least squares say to what was felt?          -> `batch_fit`, after this
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.adaptation import difference_noise, motion_density
from hc_estimator.adaptation.policy import DIFFERENCES
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import change as changes
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import judge as judging
from hc_estimator.multiple_model import maneuver as maneuvers
from hc_estimator.multiple_model import model_error, plausible, tempering
from hc_estimator.multiple_model.hypotheses import (
    DEPTH,
    EXPONENT,
    FITTED,
    FRESH,
    LOG_DAMPING,
    LOG_STIFFNESS,
    SURFACE,
)
from hc_estimator.multiple_model.kalman import (
    HOLD_ALL,
    depth_of,
    displacement_of,
    force_of_row,
    foresee_force,
    innovate_force,
    predict,
    use_displacement,
    use_force,
)
from hc_estimator.multiple_model.rows import (
    begin_motion,
    free_parameters,
    is_sound,
    limit,
    reset,
    seed,
)
from hc_estimator.screening import ACCEPTED, NUMERICAL, OUTLIER, note_accepted

ALIGNED_DEVIATIONS = (0.3, 1.0, 0.15, 0.1)  # of ln K, ln B, n, p after an alignment
PERIOD_SHARE = 0.05  # of a new interval in the usual one
LARGEST_WAIT = 64  # accepted samples after which the given noise is used if none was found
UNKNOWN = 1e12  # variance of a force whose noise is not known yet [N^2]
SMALLEST_DEPTH = 0.05  # from which a force says the order of magnitude of K [mm]
SURE = 5.0  # a force beyond so many standard deviations is one
SUDDEN = 5.0  # latest differences beyond so many times the noise replace it
TOUCHING_DEPTH = 0.02  # from which the judge counts contact [mm]
AWAY_TIME = 1.0  # the parameters go on walking for so long after contact is lost [s]
FREE_DEVIATIONS = 3.0  # of the depth from which on free motion is certain
OPEN_SAMPLES = 30  # inside the gate before it closes again
STEADY_TIME = 0.5  # of contact before the jerk density is corrected [s]
UNTEMPERED = 1.2  # force noise over the sensor's up to which that is done
RECOVERY_TIME = 1.0  # a filter that refuses everything for so long starts anew [s]
RECOVERY_SAMPLES = 20  # and for so many samples


@compiled
def start(settings: Any, bank: Any) -> None:
    """Before any sample, and when the filter starts anew."""
    bank.calibrated = 0 if settings.noise_adaptation == DIFFERENCES else 1
    bank.guessed = 0
    bank.motion_anew = 0
    take_noise(settings, bank)
    for i in range(2):
        difference_noise.restart(bank.noise[i])
    motion_density.reset(bank.motion)
    tempering.reset(bank.tool)
    bank.tool.away_time = 0.0
    bank.tool.contact_clock = 0.0
    plausible.reset(bank.tool)
    for m in range(bank.rows.shape[0]):
        row = bank.rows[m]
        row.index = m
        row.active = 1
        reset(settings, row, 0.0)
    bank.rows[FITTED].active = 0
    bank.rows[2].active = settings.follow_stiffness
    bank.rows[3].active = settings.follow_layers
    bank.rows[4].active = settings.follow_surface
    judging.reset(bank.judge)
    changes.reset(bank.change, bank.rows)
    maneuvers.reset(bank.maneuver)
    histories.reset(bank.history)


@compiled
def take_noise(settings: Any, bank: Any) -> None:
    """Take the noise levels of the settings."""
    bank.sensor_noise[0] = settings.displacement_noise_std**2
    bank.sensor_noise[1] = settings.force_noise_std**2


@compiled
def given_row(bank: Any) -> int:
    """Index of the row whose estimate is given out."""
    if bank.change.leads != 0:
        return FRESH
    return bank.judge.chosen  # type: ignore[no-any-return]


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
    bank.change.detected = 0
    bank.given.extrapolated = extrapolated
    if clock.restart == 0:
        share = PERIOD_SHARE if clock.period > 0.0 else 1.0
        clock.period += share * (clock.elapsed - clock.period)
    anew = clock.restart != 0 or bank.motion_anew != 0
    clock.force_elapsed = clock.period if anew else place - clock.force_time
    decision = _update(settings, bank)
    clock.state_time = place
    if clock.present[1] != 0:
        clock.force_time = place
    if decision == ACCEPTED:
        note_accepted(clock, time)
        _learn_readings(settings, bank, place)
        _decide(settings, bank, place)
    else:  # the rows stand at the sample's stamp all the same
        clock.last_time = time
        clock.started = 1
    _recover(settings, bank, time, decision)
    return decision


@compiled
def note_held(bank: Any, time: float) -> None:
    """Take note of a reading that is held back."""
    bank.change.detected = 0
    note_accepted(bank.clock, time)


@compiled
def begin_aligned(settings: Any, bank: Any) -> None:
    """Begin every row with what the last window says, now that the channels are aligned."""
    fit = bank.delay.fit
    stiffness = max(fit[0], 1e-6)
    damping = max(fit[1], 1e-3 * stiffness)
    for m in range(FRESH):
        row = bank.rows[m]
        if row.active == 0:
            continue
        displacement = row.state[DEPTH]
        reset(settings, row, displacement)
        state = row.state
        if settings.initial_stiffness_log_std > 0.0:
            state[LOG_STIFFNESS] = math.log(stiffness)
        if settings.initial_damping_log_std > 0.0:
            state[LOG_DAMPING] = math.log(damping)
        if settings.initial_displacement_exponent_std > 0.0:
            state[EXPONENT] = fit[2]
        free_parameters(settings, row, ALIGNED_DEVIATIONS)
        limit(settings, row)
    bank.motion_anew = 1
    judging.reset(bank.judge)
    changes.reset(bank.change, bank.rows)
    maneuvers.reset(bank.maneuver)
    histories.reset(bank.history)


@compiled
def _update(settings: Any, bank: Any) -> int:
    """Predict every row to the sample and update it with the readings that are there."""
    clock, rows = bank.clock, bank.rows
    _predict(settings, bank)
    plausible.check(settings, rows, bank.tool, bank.judge.chosen, bank.sensor_noise[1])
    _foretell(settings, bank)
    chosen = rows[bank.judge.chosen]
    if clock.present[0] != 0 and _is_outlier(settings, bank, chosen, 0):
        return OUTLIER
    for m in range(rows.shape[0]):
        row = rows[m]
        if row.active == 0:
            continue
        if clock.present[0] != 0:
            hold = _hold(settings, bank, row)
            noise = bank.sensor_noise[0]
            use_displacement(row, clock.measurement[0], clock.offset, noise, hold)
    if clock.present[1] != 0:
        if not _foresee(settings, bank):
            return NUMERICAL
        if _is_outlier(settings, bank, chosen, 1):
            _give(settings, bank, OUTLIER)
            return OUTLIER
        for m in range(rows.shape[0]):
            if rows[m].active != 0:
                use_force(rows[m], _hold(settings, bank, rows[m]))
    _give(settings, bank, ACCEPTED)
    for m in range(rows.shape[0]):
        if rows[m].active != 0:
            limit(settings, rows[m])
    return ACCEPTED if _keep_sound(settings, bank) else NUMERICAL


@compiled
def _foretell(settings: Any, bank: Any) -> None:
    """Note the force that the row in charge expects of the sample's own reading."""
    row = bank.rows[given_row(bank)]
    bank.given.row = row.index
    bank.given.predicted_force = force_of_row(settings, row, bank.given.extrapolated)
    bank.given.reconstructed_force = bank.given.predicted_force
    bank.given.innovation[0] = math.nan
    bank.given.innovation[1] = math.nan


@compiled
def _give(settings: Any, bank: Any, decision: int) -> None:
    """Note what the row in charge made of the readings that were used.

    The force is its mean given law and sensor, each weighed by what is known of its error; an error
    of the linearisation that repeats itself counts once for the force of this moment.
    """
    clock, given, row = bank.clock, bank.given, bank.rows[bank.given.row]
    given.nis = 0.0
    if clock.present[0] != 0:
        given.innovation[0] = row.innovation[0]
        given.nis += row.nis[0]
    if clock.present[1] == 0:
        return
    # The innovation of both readings together is against the state before either.
    given.innovation[1] = clock.measurement[1] - row.predicted_force
    given.nis += row.nis[1]
    unsure = row.explained + row.model_error
    share = unsure / (unsure + bank.sensor_noise[1]) if decision == ACCEPTED else 0.0
    if given.extrapolated == 0.0:
        law = clock.measurement[1] - row.innovation[1]
        given.reconstructed_force = law + share * row.innovation[1]
    else:
        law = given.predicted_force
        given.reconstructed_force = law + share * (given.latest_force - law)


@compiled
def _predict(settings: Any, bank: Any) -> None:
    """Bring every row to the sample's stamp."""
    clock = bank.clock
    anew = clock.restart != 0 or bank.motion_anew != 0
    density = motion_density.jerk_density(settings, bank.motion)
    goes_on = bank.tool.away_time < AWAY_TIME
    for m in range(bank.rows.shape[0]):
        row = bank.rows[m]
        if row.active == 0:
            continue
        if anew:
            begin_motion(settings, row, clock.measurement[0])
        else:
            jerk = maneuvers.jerk_density(bank.maneuver, row, clock.period, density)
            predict(row, clock.elapsed, jerk, goes_on or SURFACE[m])
    if anew:
        clock.restart = 1
        bank.motion_anew = 0
    if bank.guessed == 0:
        _guess_stiffness(settings, bank)


@compiled
def _guess_stiffness(settings: Any, bank: Any) -> None:
    """Centre the prior of K and B on the first clear contact; its width stays.

    K spans decades between tissues. From a first guess a hundred times too stiff the linearised
    update needs long to come down, and the first force reading says the order of magnitude.
    """
    clock = bank.clock
    depth = bank.rows[bank.judge.chosen].state[DEPTH]
    sure = SURE * math.sqrt(bank.sensor_noise[1])
    if clock.present[1] == 0 or depth < SMALLEST_DEPTH or clock.measurement[1] < sure:
        return
    bank.guessed = bank.calibrated  # until then each sample says it anew, for no force is used
    if settings.initial_stiffness_log_std == 0.0:
        return
    for m in range(bank.rows.shape[0]):
        state = bank.rows[m].state
        shift = math.log(clock.measurement[1]) - state[EXPONENT] * math.log(depth)
        shift -= state[LOG_STIFFNESS]
        state[LOG_STIFFNESS] += shift
        if settings.initial_damping_log_std > 0.0:
            state[LOG_DAMPING] += shift


@compiled
def _hold(settings: Any, bank: Any, row: Any) -> int:
    """Which parameters of a row this sample must not teach.

    The air says nothing of the tissue; without this the parameters would go on following the
    displacement through what is left of their correlation with the motion.
    """
    spread = FREE_DEVIATIONS * math.sqrt(row.covariance[DEPTH, DEPTH])
    if row.state[DEPTH] + spread <= 0.0 and not SURFACE[row.index]:
        return HOLD_ALL
    return maneuvers.hold(settings, bank.maneuver, row, bank.clock.period)


@compiled
def _foresee(settings: Any, bank: Any) -> bool:
    """Innovation of the force for every row; False if the chosen row is lost."""
    clock, noise = bank.clock, bank.sensor_noise[1]
    samples = tempering.coherent_samples(settings, bank.tool, clock.force_elapsed)
    for m in range(bank.rows.shape[0]):
        row = bank.rows[m]
        if row.active == 0:
            continue
        if not foresee_force(settings, row):
            return False
        force_noise = UNKNOWN
        if bank.calibrated != 0:
            force_noise = noise + row.model_error + max(row.force_noise, 0.0) * samples
            if settings.find_maneuvers != 0:
                force_noise += maneuvers.product_variance(
                    settings, bank.maneuver, row, clock.period, samples
                )
        innovate_force(row, clock.measurement[1], force_noise)
    return True


@compiled
def _is_outlier(settings: Any, bank: Any, chosen: Any, channel: int) -> bool:
    """Refuse an innovation far outside its distribution, unless many come one after another."""
    clock = bank.clock
    limit_squared = settings.outlier_gate * settings.outlier_gate
    if channel == 0:
        innovation = clock.measurement[0] - displacement_of(chosen, clock.offset)
        variance = chosen.covariance[DEPTH, DEPTH] + bank.sensor_noise[0]
    else:
        innovation = chosen.innovation[1]
        variance = chosen.innovation_variance[1]
    outside = bank.calibrated != 0 and innovation * innovation > limit_squared * variance
    count = clock.outlier_count
    if count > settings.outlier_limit:  # the gate is open
        if outside:
            clock.outlier_count = settings.outlier_limit + OPEN_SAMPLES
        elif channel == 1 or clock.present[1] == 0:
            clock.outlier_count = count - 1
            if clock.outlier_count == settings.outlier_limit:
                clock.outlier_count = 0
        return False
    if not outside:
        if channel == 1 or clock.present[1] == 0:
            clock.outlier_count = 0
        return False
    if settings.noise_adaptation == DIFFERENCES and difference_noise.learn_refused(
        bank.noise[channel], innovation
    ):
        clock.outlier_count = 0
        _follow_noise(bank)
    if count == settings.outlier_limit:
        clock.outlier_count = settings.outlier_limit + OPEN_SAMPLES
        return False
    clock.outlier_count += 1
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
            seed(chosen, rows[m], clock, clock + judging.WAIT)
    return True


@compiled
def _learn_readings(settings: Any, bank: Any, time: float) -> None:
    """Take the accepted readings into everything that does not depend on the contact law."""
    clock = bank.clock
    broken = clock.restart != 0
    if settings.noise_adaptation == DIFFERENCES:
        for i in range(2):
            if clock.present[i] != 0:
                floor = settings.displacement_noise_floor if i == 0 else settings.force_noise_floor
                reading = clock.measurement[i]
                difference_noise.learn(settings, bank.noise[i], time, reading, broken, floor)
        _follow_noise(bank)
    chosen = bank.rows[bank.judge.chosen]
    if settings.motion_adaptation != 0 and clock.present[0] != 0:
        motion_density.learn(
            bank.motion,
            bank.noise[0],
            time,
            clock.measurement[0],
            broken,
            bank.sensor_noise[0],
            chosen.model_error > 0.0,
        )
    tempering.learn(bank.tool, chosen, clock.elapsed)


@compiled
def _follow_noise(bank: Any) -> None:
    """Bring bank.sensor_noise up to the differences."""
    first = difference_noise.FIRST_SAMPLES
    noise = bank.noise
    if bank.calibrated == 0:
        known = noise[0].count >= first and noise[1].count >= first
        if not known and bank.clock.accepted < LARGEST_WAIT:
            return
        bank.calibrated = 1
        bank.motion_anew = 1
    for i in range(2):
        if noise[i].count == 0:
            continue
        variance = difference_noise.cautious(noise[i])
        latest = difference_noise.latest(noise[i])
        if noise[i].count > first and latest > SUDDEN * variance:
            variance = latest
        bank.sensor_noise[i] = variance


@compiled
def _decide(settings: Any, bank: Any, time: float) -> None:
    """Learn from the innovations; choose a row; answer alarms."""
    clock, rows, tool = bank.clock, bank.rows, bank.tool
    if bank.calibrated == 0:
        return
    for m in range(rows.shape[0]):
        if rows[m].active != 0:
            model_error.learn(settings, rows[m], bank.sensor_noise, bank.noise, clock)
    chosen = rows[bank.judge.chosen]
    touching = depth_of(chosen) > TOUCHING_DEPTH and chosen.predicted_force > 0.0
    if touching:
        tool.away_time = 0.0
        tool.contact_clock += clock.elapsed
        if clock.present[1] != 0:
            plausible.learn(tool, chosen, clock.measurement[1])
    else:
        tool.away_time += clock.elapsed
    _correct_density(settings, bank, chosen)
    turning = maneuvers.is_turning(bank.maneuver, chosen, clock.period)
    if clock.present[1] != 0 and not turning:
        judging.learn(
            settings,
            bank.judge,
            rows,
            tool,
            clock.measurement[1],
            bank.sensor_noise[1],
            clock.force_elapsed,
            touching,
        )
    alarm = rows[bank.judge.chosen].alarm != 0
    if not maneuvers.answer(settings, bank, time, alarm):
        changes.answer(
            settings,
            bank.change,
            bank.judge,
            rows,
            tool,
            bank.motion,
            bank.sensor_noise,
        )
    if bank.change.testing != 0 and touching and clock.present[1] != 0:
        rose = bank.noise[0].jumped > 0 or bank.noise[1].jumped > 0
        changes.judge_test(bank.change, bank.judge, rows, tool, clock.force_elapsed, rose)
        if bank.change.testing == 0 and bank.change.detected == 0:
            maneuvers.audit(settings, bank)
    if bank.change.detected != 0:
        histories.reset(bank.history)
        rows[FITTED].active = 0
    if rows[bank.judge.chosen].model_error > 0.0:
        bank.change.fitting_time = 0.0
    elif touching:
        bank.change.fitting_time += clock.elapsed
    if clock.restart != 0 or bank.change.detected != 0:
        bank.maneuver.count = 0
    maneuvers.keep(
        bank.maneuver,
        rows,
        rows[bank.judge.chosen],
        tool,
        bank.motion,
        time,
        clock.elapsed,
        bank.change.testing != 0,
    )


@compiled
def _correct_density(settings: Any, bank: Any, chosen: Any) -> None:
    """Let the jerk density follow the joint innovations while the contact law fits."""
    present = bank.clock.present
    if settings.motion_adaptation == 0 or bank.motion.density <= 0.0:
        return
    if present[0] == 0 or present[1] == 0:
        return
    if chosen.model_error > 0.0 or chosen.contact_time < STEADY_TIME or depth_of(chosen) <= 0.0:
        return
    if chosen.force_noise > UNTEMPERED * bank.sensor_noise[1]:
        return
    if settings.noise_adaptation == DIFFERENCES:
        for i in range(2):  # a noise about to be called lower would pass for a calmer tool
            if 2.0 * bank.noise[i].short_mean < bank.noise[i].mean:
                return
    motion_density.correct(bank.motion, chosen.untempered_nis)


@compiled
def _recover(settings: Any, bank: Any, time: float, decision: int) -> None:
    """Start anew after a second in which everything was refused; say so as a change."""
    clock = bank.clock
    if decision == ACCEPTED:
        clock.refused_count = 0
        return
    if decision == NUMERICAL:
        for m in range(bank.rows.shape[0]):
            if not is_sound(bank.rows[m]):
                reset(settings, bank.rows[m], clock.measurement[0])
        bank.motion_anew = 1
    if clock.refused_count == 0:
        clock.refused_since = time
    clock.refused_count += 1
    waited = time - clock.refused_since
    if clock.refused_count >= RECOVERY_SAMPLES and waited > RECOVERY_TIME:
        clock.refused_count = 0
        clock.started = 0
        start(settings, bank)
        bank.change.detected = 1
