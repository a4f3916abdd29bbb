"""How the bank begins: before any sample, at the first contact, once aligned, and when lost."""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.adaptation import difference_noise, motion_density, noise_color, resolution
from hc_estimator.adaptation.policy import DIFFERENCES
from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector
from hc_estimator.multiple_model import (
    air_zero,
    another_place,
    contact_onset,
    delay_points,
    jumps,
    levels,
    moving_fit,
    place_delay,
    plausible,
    tempering,
    zero_fit,
    zero_moves,
)
from hc_estimator.multiple_model import change as changes
from hc_estimator.multiple_model import delay as delays
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import judge as judging
from hc_estimator.multiple_model import maneuver as maneuvers
from hc_estimator.multiple_model import search as searches
from hc_estimator.multiple_model.hypotheses import (
    DEPTH,
    EXPONENT,
    FITTED,
    FRESH,
    LOG_DAMPING,
    LOG_STIFFNESS,
    WAITS,
    is_tried,
)
from hc_estimator.multiple_model.place_fit import POSITION
from hc_estimator.multiple_model.rows import (
    LARGEST_LOG_STIFFNESS,
    free_parameters,
    guess_of,
    is_held,
    is_sound,
    limit,
    reset,
    take_motion,
)
from hc_estimator.multiple_model.spline_records import MOVES
from hc_estimator.screening import ACCEPTED, NUMERICAL

ALIGNED_DEVIATIONS = (0.3, 1.0, 0.15, 0.1)  # of ln K, ln B, n, p after an alignment
# From which a force says the order of magnitude of K [mm], and in deviations of the depth.
SMALLEST_DEPTH = 0.05
CERTAIN = 3.0
FREE_DEPTH = 1.0  # from which on no force says something of K [mm]
CONTACT_READINGS = 3  # readings in a row that say there is a force
RECOVERY_TIME = 1.0  # a filter that refuses everything for so long starts anew [s]
SMALLEST_STIFFNESS = math.exp(-LARGEST_LOG_STIFFNESS)  # [N/mm^n]
WORTHLESS_TIME = 0.5  # so does one whose model error exceeds the forces themselves for so long [s]
RECOVERY_SAMPLES = 20  # and for so many samples


@compiled
def start(settings: Any, bank: Any) -> None:
    """Before any sample, and when the filter starts anew."""
    bank.calibrated = 0 if settings.noise_adaptation == DIFFERENCES else 1
    bank.guessed = 0
    bank.motion_anew = 0
    jumps.reset(bank.gate)
    take_noise(settings, bank)
    for i in range(2):
        difference_noise.restart(bank.noise[i])
        noise_color.restart(bank.color[i])
        resolution.restart(bank.resolution[i])
    noise_color.limit_to_short_times(bank.color[0])
    motion_density.reset(bank.motion)
    tempering.reset(bank.tool)
    bank.tool.away_time = 0.0
    bank.tool.contact_clock = 0.0
    plausible.reset(bank.tool)
    levels.reset(bank.tool)
    for m in range(bank.rows.shape[0]):
        row = bank.rows[m]
        row.index = m
        row.active = 1 if is_tried(settings, m) and not WAITS[m] else 0
        reset(settings, row, 0.0)
    _choose_anew(bank)
    maneuvers.reset(bank.maneuver)
    histories.reset(bank.history)
    searches.reset(bank)
    contact_onset.restart(bank.onset)
    air_zero.reset(bank.air)
    zero_fit.restart(bank.zeros)
    another_place.reset(bank.place)


@compiled
def _choose_anew(bank: Any) -> None:
    """Forget which row predicted best, and what was under test or remembered of them."""
    judging.reset(bank.judge)
    changes.reset(bank.change, bank.rows)
    maneuvers.forget_rows(bank.maneuver)
    moving_fit.reset(bank.moving)


@compiled
def take_noise(settings: Any, bank: Any) -> None:
    """Take the noise levels of the settings."""
    bank.sensor_noise[0] = settings.displacement_noise_std**2
    bank.sensor_noise[1] = settings.force_noise_std**2


@compiled
def centre_prior(settings: Any, bank: Any) -> None:
    """Centre the prior of K and B on the first clear contact; its width stays.

    K spans decades between tissues. From a first guess a hundred times too stiff the linearised
    update needs long to come down, and the first force reading says the order of magnitude (no fit;
    ours). As long as nothing was felt yet, it says what K is at most.
    """
    clock = bank.clock
    chosen = bank.rows[bank.judge.chosen]
    depth = chosen.state[DEPTH]
    sure = judging.SURE * math.sqrt(bank.sensor_noise[1])
    if clock.present[1] == 0 or depth < SMALLEST_DEPTH:
        return
    if depth < CERTAIN * math.sqrt(chosen.covariance[DEPTH, DEPTH]):
        return
    pressed = clock.measurement[1] >= sure
    if bank.contact_readings < CONTACT_READINGS:
        bank.contact_readings = bank.contact_readings + 1 if pressed else 0
    if not pressed and (depth < FREE_DEPTH or bank.contact_readings == CONTACT_READINGS):
        return
    if pressed:  # until calibrated each sample says it anew, for no force is used
        bank.guessed = bank.calibrated
    if is_held(settings, 0):
        return
    log_force = math.log(max(clock.measurement[1], sure))
    for m in range(bank.rows.shape[0]):
        state = bank.rows[m].state
        shift = log_force - state[EXPONENT] * math.log(depth) - state[LOG_STIFFNESS]
        if not pressed and shift > 0.0:
            continue
        if bank.tool.deepest > depth:  # felt before the zeros moved, in the same tissue
            most = math.log(plausible.LARGEST_FACTOR * max(bank.tool.largest_force, sure))
            most -= state[EXPONENT] * math.log(bank.tool.deepest)
            shift = min(shift, most - state[LOG_STIFFNESS])
        state[LOG_STIFFNESS] += shift
        if not is_held(settings, 1):
            state[LOG_DAMPING] += shift


@compiled
def _begin_rows(settings: Any, rows: Any, fit: tuple[float, float, float, float]) -> None:
    """Begin every row that takes part with ln K, ln B, n and p of a fit."""
    for m in range(FRESH):
        row = rows[m]
        if row.active == 0:
            continue
        reset(settings, row, row.state[DEPTH])
        for i in range(4):
            row.state[LOG_STIFFNESS + i] = fit[i]
        free_parameters(settings, row, ALIGNED_DEVIATIONS)
        limit(settings, row)


@compiled
def begin_aligned(settings: Any, bank: Any) -> None:
    """Begin every row with what the last window says, now that the channels are aligned."""
    fit = bank.delay.fit
    stiffness = max(fit[0], SMALLEST_STIFFNESS)
    damping = max(fit[1], 1e-3 * stiffness)
    p = guess_of(settings, 3)
    _begin_rows(settings, bank.rows, (math.log(stiffness), math.log(damping), fit[2], p))
    bank.motion_anew = 1
    another_place.forget(bank.place)
    _choose_anew(bank)
    histories.reset(bank.history)


@compiled
def begin_at_onset(settings: Any, bank: Any) -> None:
    """Begin every row anew, now that the zeros are known better."""
    zero_moves.move(bank)
    zero_fit.reset(bank.zeros)
    _forget_tissue(settings, bank)
    delays.forget(bank.delay)


@compiled
def begin_with_zeros(settings: Any, bank: Any) -> None:
    """Begin every row with the fit that found a zero to be off, in the new zeros."""
    moves = bank.fit.kind == MOVES
    zero_moves.move(bank)
    fit = bank.zeros.fit
    _begin_rows(settings, bank.rows, (fit[0], fit[1], fit[2], fit[3]))
    copy_vector(fit, bank.history.fit)
    bank.history.unfitted = bank.history.count
    bank.rows[FITTED].active = 0
    _go_on_moving(settings, bank)
    delays.begin_with_zeros(bank.delay)
    another_place.forget(bank.place)
    _choose_anew(bank)
    if moves:
        moving_fit.look_for_moving(settings, bank)


@compiled
def begin_at_place(settings: Any, bank: Any) -> None:
    """Begin every row at another place, with the fit to the contact with it."""
    place, history, values = bank.place, bank.history, bank.place.outcome
    zero_moves.move_position(bank, values[POSITION], place.height_deviation)
    zero_fit.begin_at_place(bank.zeros, place.doubt, place.height_deviation)
    if histories.begin_at_place(history):
        another_place.count_level(place)
        if not place_delay.may_be_late(settings, place):
            delay_points.forget(bank.delay)
    for i in range(4):
        history.fit[i] = values[i]
    history.unfitted = history.count
    bank.rows[FITTED].active = 0
    _begin_rows(settings, bank.rows, (values[0], values[1], values[2], values[3]))
    for m in range(FRESH):
        covariance = bank.rows[m].covariance
        for i in range(4 if bank.rows[m].active != 0 else 0):
            for j in range(4):
                covariance[LOG_STIFFNESS + i, LOG_STIFFNESS + j] = place.conditional[i, j]
    _go_on_moving(settings, bank)
    _choose_anew(bank)
    if another_place.is_to_be_called(settings, bank):
        bank.change.detected = 1


@compiled
def _go_on_moving(settings: Any, bank: Any) -> None:
    """Begin with the motion that the displacement alone says, if it does; else at the next reading.

    At an unknown velocity any force is possible, an outlier's as well.
    """
    ahead = bank.clock.state_time - bank.motion.last_time
    near = ahead >= 0.0 and ahead < 2.0 * bank.motion.step
    if not (near and motion_density.is_settled(bank.motion)):
        bank.motion_anew = 1
        return
    for m in range(FRESH):
        if bank.rows[m].active != 0:
            take_motion(settings, bank.rows[m], bank.motion, bank.sensor_noise[0], ahead)


@compiled
def _forget_tissue(settings: Any, bank: Any) -> None:
    """Begin every row from the prior; what is known of sensors and motion stays."""
    for m in range(bank.rows.shape[0]):
        row = bank.rows[m]
        reset(settings, row, row.state[DEPTH])
    bank.rows[FITTED].active = 0
    bank.guessed = 0
    _go_on_moving(settings, bank)
    bank.tool.worthless_time = 0.0
    levels.reset(bank.tool)
    bank.tool.contact_clock = 0.0
    another_place.forget(bank.place)
    _choose_anew(bank)
    histories.reset(bank.history)


@compiled
def recover(settings: Any, bank: Any, time: float, decision: int) -> None:
    """Start anew after a second in which everything was refused; say so as a change."""
    clock = bank.clock
    if decision == ACCEPTED:
        clock.refused_count = 0
        if bank.tool.worthless_time > WORTHLESS_TIME:  # a law that explains nothing
            contact_onset.take_back(bank)
            _forget_tissue(settings, bank)
            plausible.reset(bank.tool)
            bank.change.detected = 1
        return
    if decision == NUMERICAL:
        for m in range(bank.rows.shape[0]):
            if not is_sound(bank.rows[m]):
                reset(settings, bank.rows[m], clock.measurement[0])
        bank.motion_anew = 1
    if jumps.waits(bank.gate):  # it is the sensor that is lost
        clock.refused_count = 0
        return
    if clock.refused_count == 0:
        clock.refused_since = time
    clock.refused_count += 1
    waited = time - clock.refused_since
    if clock.refused_count >= RECOVERY_SAMPLES and waited > RECOVERY_TIME:
        clock.refused_count = 0
        clock.started = 0
        start(settings, bank)
        bank.change.detected = 1
