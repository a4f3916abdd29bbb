"""What is given out of a sample: by which row, what that expected, and what it made of it.

At the end it is one row of numbers; see `estimate`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator import estimate as columns
from hc_estimator.adaptation import motion_density
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import levels, outliers, plausible, zero_doubt
from hc_estimator.multiple_model.hypotheses import (
    CODES,
    DEPTH,
    FRESH,
    LOG_STIFFNESS,
    OWN,
    SURFACE,
    SURFACE_ROW,
    VELOCITY,
)
from hc_estimator.multiple_model.kalman import depth_of, force_of_row, log_speed_of
from hc_estimator.multiple_model.rows import is_held, prior_deviation
from hc_estimator.report import clear_row, write_fixed_parameters
from hc_estimator.screening import ACCEPTED, OUTLIER


@compiled
def given_row(bank: Any) -> int:
    """Index of the row whose estimate is given out."""
    if bank.change.leads != 0:
        return FRESH
    return bank.judge.chosen  # type: ignore[no-any-return]


@compiled
def foretell(settings: Any, bank: Any) -> None:
    """Note the force that the row in charge expects of the sample's own reading."""
    row = bank.rows[given_row(bank)]
    bank.given.row = row.index
    bank.given.predicted_force = force_of_row(settings, row, bank.given.extrapolated)
    bank.given.reconstructed_force = bank.given.predicted_force
    bank.given.innovation[0] = math.nan
    bank.given.innovation[1] = math.nan
    bank.given.nis = 0.0


@compiled
def give_refused(bank: Any) -> None:
    """Note what the row in charge expected of a displacement that is refused; the force waits."""
    given = bank.given
    innovation, variance = outliers.innovation_of(bank, bank.rows[given.row], 0)
    given.innovation[0] = innovation
    given.nis = innovation * innovation / variance


@compiled
def give(settings: Any, bank: Any, decision: int) -> None:
    """Note what the row in charge made of the readings that were used.

    The force is its mean given law and sensor, each weighed by what is known of its error; an error
    of the linearisation that repeats itself counts once for the force of this moment.
    """
    clock, given, row = bank.clock, bank.given, bank.rows[bank.given.row]
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
def write_row(settings: Any, bank: Any, rejected: int, out: NDArray[np.float64]) -> None:
    """Fill a row of numbers after a sample.

    Args:
        settings: settings record.
        bank: record of the bank.
        rejected: code of the decision on the sample.
        out: takes the numbers, shape (estimate.COLUMNS,).
    """
    clear_row(out)
    row, given = bank.rows[given_row(bank)], bank.given
    state, covariance = row.state, row.covariance
    possible = plausible.limited_law(settings, row, bank.tool, bank.sensor_noise[1])
    for i in range(4):
        value = possible[i] if i < 2 else state[LOG_STIFFNESS + i]
        out[columns.PARAMETERS + i] = math.exp(value) if i < 2 else value
    for i in range(4):
        slope = out[columns.PARAMETERS + i] if i < 2 else 1.0
        for j in range(i + 1):
            other = out[columns.PARAMETERS + j] if j < 2 else 1.0
            element = slope * covariance[LOG_STIFFNESS + i, LOG_STIFFNESS + j] * other
            out[columns.COVARIANCE + 4 * i + j] = element
            out[columns.COVARIANCE + 4 * j + i] = element
    if bank.delay.doubt > 0.0:
        slope, k = row.by_delay, LOG_STIFFNESS
        way = (slope[k], slope[k + 1], slope[k + 2], slope[k + 3])
        zero_doubt.add_along(bank.delay.doubt, way, out)
    log_speed = log_speed_of(row, levels.log_usual_speed(bank.tool))
    if log_speed > levels.UNBENT:  # what is known of K and B together is bent
        zero_doubt.add_along(levels.bend_variance(row, log_speed), (1.0, 1.0, 0.0, 0.0), out)
    if row.index == bank.judge.chosen:
        zero_doubt.add_joint(bank.judge.spread, out)
    zero_doubt.add(settings, bank, row, out)
    _clear_held(settings, out)
    _write_identifiability(settings, out)
    write_fixed_parameters(settings, out)
    if rejected in (ACCEPTED, OUTLIER):
        out[columns.FORCE_PREDICTED] = given.predicted_force + bank.onset.zero[1]
        out[columns.NIS] = given.nis
        for i in range(2):
            out[columns.INNOVATION + i] = given.innovation[i]
    out[columns.FORCE_RECONSTRUCTED] = given.reconstructed_force + bank.onset.zero[1]
    out[columns.DISPLACEMENT] = state[DEPTH] + bank.onset.zero[0]
    out[columns.VELOCITY] = state[VELOCITY]
    out[columns.DISPLACEMENT_NOISE_STD] = math.sqrt(bank.sensor_noise[0])
    out[columns.FORCE_NOISE_STD] = math.sqrt(bank.sensor_noise[1] + row.model_error)
    out[columns.CONTACT] = 1.0 if depth_of(row) > 0.0 else 0.0
    out[columns.CHANGE_DETECTED] = float(bank.change.detected)
    out[columns.MODEL_MISMATCH] = 1.0 if row.model_error > 0.0 else 0.0
    out[columns.REJECTED] = float(rejected)
    density = motion_density.jerk_density(settings, bank.motion)
    out[columns.PROCESS_NOISE_SCALE] = density / settings.jerk_density
    out[columns.CHANNEL_DELAY] = bank.delay.delay
    out[columns.CHANNEL_DELAY_STD] = bank.delay.deviation
    _write_zeros(settings, bank, row, out)
    out[columns.HYPOTHESIS] = float(CODES[row.index])
    for m in range(FRESH + 1):
        if bank.rows[m].active != 0 and bank.judge.weight > 0.0:
            score = math.sqrt(max(bank.rows[m].score, 0.0))
            place = columns.HYPOTHESIS_SCORES + CODES[m]
            best = out[place]  # of the rows that are reported alike
            out[place] = score if math.isnan(best) else min(score, best)


@compiled
def _clear_held(settings: Any, out: NDArray[np.float64]) -> None:
    """Nothing is open of a parameter that is held fixed, whatever is of zeros or delay."""
    for i in range(4):
        if is_held(settings, i):
            for j in range(4):
                out[columns.COVARIANCE + 4 * i + j] = 0.0
                out[columns.COVARIANCE + 4 * j + i] = 0.0


@compiled
def _write_identifiability(settings: Any, out: NDArray[np.float64]) -> None:
    """How much of the prior variance the data took away, by all that the covariance owes to."""
    for i in range(4):
        slope = out[columns.PARAMETERS + i] if i < 2 else 1.0
        prior = prior_deviation(settings, i) ** 2
        share = 0.0
        if prior > 0.0 and slope > 0.0:
            share = 1.0 - out[columns.COVARIANCE + 5 * i] / slope / slope / prior
        out[columns.IDENTIFIABILITY + i] = min(max(share, 0.0), 1.0)


@compiled
def _write_zeros(settings: Any, bank: Any, row: Any, out: NDArray[np.float64]) -> None:
    """Where the contact begins and what the force reads in the air, and how well that is known."""
    out[columns.CONTACT_POSITION] = bank.onset.zero[0]
    out[columns.FORCE_ZERO] = bank.onset.zero[1]
    out[columns.FORCE_ZERO_STD] = zero_doubt.force_deviation(settings, bank)
    surface = bank.rows[SURFACE_ROW]
    if SURFACE[row.index]:
        surface = row
        out[columns.CONTACT_POSITION] += row.state[OWN]
    elif bank.zeros.off[0] > 0.0:
        out[columns.CONTACT_POSITION_STD] = bank.zeros.off[0]
        return
    given = settings.contact_position_std
    if surface.active != 0:
        deviation = math.sqrt(max(surface.covariance[OWN, OWN], 0.0))
        if given > 0.0 and row.index != surface.index:
            deviation = min(deviation, given)  # a surface that stays is known at least so well
        out[columns.CONTACT_POSITION_STD] = deviation
    elif given > 0.0:
        out[columns.CONTACT_POSITION_STD] = given
