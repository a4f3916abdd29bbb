"""Writes what the bank knows after a sample into one row of numbers; see `estimate`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator import estimate as columns
from hc_estimator.adaptation import motion_density
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import levels, plausible, zero_doubt
from hc_estimator.multiple_model.given_out import given_row
from hc_estimator.multiple_model.hypotheses import (
    CODES,
    DEPTH,
    FITTED,
    FRESH,
    LOG_STIFFNESS,
    OWN,
    SURFACE,
    SURFACE_ROW,
    VELOCITY,
)
from hc_estimator.multiple_model.kalman import depth_of, log_speed_of
from hc_estimator.multiple_model.rows import is_held, prior_deviation
from hc_estimator.report import clear_row, write_fixed_parameters
from hc_estimator.screening import ACCEPTED, OUTLIER

PARAMETERS, COVARIANCE = columns.PARAMETERS, columns.COVARIANCE
IDENTIFIABILITY, INNOVATION = columns.IDENTIFIABILITY, columns.INNOVATION
FORCE_PREDICTED, FORCE_RECONSTRUCTED = columns.FORCE_PREDICTED, columns.FORCE_RECONSTRUCTED
NIS, REJECTED = columns.NIS, columns.REJECTED
DISPLACEMENT_COLUMN, VELOCITY_COLUMN = columns.DISPLACEMENT, columns.VELOCITY
DISPLACEMENT_NOISE_STD = columns.DISPLACEMENT_NOISE_STD
FORCE_NOISE_STD = columns.FORCE_NOISE_STD
CONTACT, CHANGE_DETECTED = columns.CONTACT, columns.CHANGE_DETECTED
MODEL_MISMATCH = columns.MODEL_MISMATCH
PROCESS_NOISE_SCALE = columns.PROCESS_NOISE_SCALE
CONTACT_POSITION, CONTACT_POSITION_STD = columns.CONTACT_POSITION, columns.CONTACT_POSITION_STD
FORCE_ZERO, FORCE_ZERO_STD = columns.FORCE_ZERO, columns.FORCE_ZERO_STD
CHANNEL_DELAY, CHANNEL_DELAY_STD = columns.CHANNEL_DELAY, columns.CHANNEL_DELAY_STD
HYPOTHESIS, HYPOTHESIS_SCORES = columns.HYPOTHESIS, columns.HYPOTHESIS_SCORES
VARIED_FOR = 10.0  # time in contact for which tissue that varied may vary again [s]


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
        out[PARAMETERS + i] = math.exp(value) if i < 2 else value
    for i in range(4):
        slope = out[PARAMETERS + i] if i < 2 else 1.0
        for j in range(i + 1):
            other = out[PARAMETERS + j] if j < 2 else 1.0
            element = slope * covariance[LOG_STIFFNESS + i, LOG_STIFFNESS + j] * other
            out[COVARIANCE + 4 * i + j] = element
            out[COVARIANCE + 4 * j + i] = element
    _add_delay(row, bank.delay.doubt, out)
    _add_bend(row, bank.tool, out)
    since_varying = bank.tool.contact_clock - bank.judge.varied_at
    if row.index <= FITTED and bank.judge.varying > 0 and since_varying < VARIED_FOR:
        _add_spread(row, bank.rows[bank.judge.varying], out)
    zero_doubt.add(settings, bank, row, out)
    _clear_held(settings, out)
    _write_identifiability(settings, out)
    write_fixed_parameters(settings, out)
    if rejected in (ACCEPTED, OUTLIER):
        out[FORCE_PREDICTED] = given.predicted_force + bank.onset.zero[1]
        out[NIS] = given.nis
        for i in range(2):
            out[INNOVATION + i] = given.innovation[i]
    out[FORCE_RECONSTRUCTED] = given.reconstructed_force + bank.onset.zero[1]
    out[DISPLACEMENT_COLUMN] = state[DEPTH] + bank.onset.zero[0]
    out[VELOCITY_COLUMN] = state[VELOCITY]
    out[DISPLACEMENT_NOISE_STD] = math.sqrt(bank.sensor_noise[0])
    out[FORCE_NOISE_STD] = math.sqrt(bank.sensor_noise[1] + row.model_error)
    out[CONTACT] = 1.0 if depth_of(row) > 0.0 else 0.0
    out[CHANGE_DETECTED] = float(bank.change.detected)
    out[MODEL_MISMATCH] = 1.0 if row.model_error > 0.0 else 0.0
    out[REJECTED] = float(rejected)
    density = motion_density.jerk_density(settings, bank.motion)
    out[PROCESS_NOISE_SCALE] = density / settings.jerk_density
    out[CHANNEL_DELAY] = bank.delay.delay
    out[CHANNEL_DELAY_STD] = bank.delay.deviation
    _write_zeros(settings, bank, row, out)
    out[HYPOTHESIS] = float(CODES[row.index])
    for m in range(FRESH + 1):
        if bank.rows[m].active != 0 and bank.judge.weight > 0.0:
            score = math.sqrt(max(bank.rows[m].score, 0.0))
            best = out[HYPOTHESIS_SCORES + CODES[m]]  # of the rows that are reported alike
            out[HYPOTHESIS_SCORES + CODES[m]] = score if math.isnan(best) else min(score, best)


@compiled
def _clear_held(settings: Any, out: NDArray[np.float64]) -> None:
    """Nothing is open of a parameter that is held fixed, whatever is of zeros or delay."""
    for i in range(4):
        if is_held(settings, i):
            for j in range(4):
                out[COVARIANCE + 4 * i + j] = 0.0
                out[COVARIANCE + 4 * j + i] = 0.0


@compiled
def _write_identifiability(settings: Any, out: NDArray[np.float64]) -> None:
    """How much of the prior variance the data took away, by all that the covariance owes to."""
    for i in range(4):
        slope = out[PARAMETERS + i] if i < 2 else 1.0
        prior = prior_deviation(settings, i) ** 2
        share = 0.0
        if prior > 0.0 and slope > 0.0:
            share = 1.0 - out[COVARIANCE + 5 * i] / slope / slope / prior
        out[IDENTIFIABILITY + i] = min(max(share, 0.0), 1.0)


@compiled
def _add_delay(row: Any, variance: float, out: NDArray[np.float64]) -> None:
    """Add to the covariance what is not known of the delay in use [s^2]."""
    if variance == 0.0:
        return
    for i in range(4):
        first = row.by_delay[LOG_STIFFNESS + i] * (out[PARAMETERS + i] if i < 2 else 1.0)
        for j in range(4):
            second = row.by_delay[LOG_STIFFNESS + j] * (out[PARAMETERS + j] if j < 2 else 1.0)
            out[COVARIANCE + 4 * i + j] += variance * (first * second)


@compiled
def _add_bend(row: Any, tool: Any, out: NDArray[np.float64]) -> None:
    """Add to the covariance of K and B that what is known of both together is bent."""
    log_speed = log_speed_of(row, levels.log_usual_speed(tool))
    if log_speed <= levels.UNBENT:
        return
    variance = levels.bend_variance(row, log_speed)
    for i in range(2):
        for j in range(2):
            both = out[PARAMETERS + i] * out[PARAMETERS + j]
            out[COVARIANCE + 4 * i + j] += variance * both


@compiled
def _add_spread(row: Any, other: Any, out: NDArray[np.float64]) -> None:
    """Add the spread between two hypotheses to the covariance (Bar-Shalom et al. 2001, 11.6).

    Between two inclusions constant tissue explains the force again, and a row of constant tissue is
    very sure of itself; that the tissue varies is not forgotten with it.
    """
    for i in range(4):
        here = out[PARAMETERS + i] if i < 2 else 1.0
        first = here * (other.state[LOG_STIFFNESS + i] - row.state[LOG_STIFFNESS + i])
        for j in range(4):
            there = out[PARAMETERS + j] if j < 2 else 1.0
            second = there * (other.state[LOG_STIFFNESS + j] - row.state[LOG_STIFFNESS + j])
            out[COVARIANCE + 4 * i + j] += first * second


@compiled
def _write_zeros(settings: Any, bank: Any, row: Any, out: NDArray[np.float64]) -> None:
    """Where the contact begins and what the force reads in the air, and how well that is known."""
    out[CONTACT_POSITION] = bank.onset.zero[0]
    out[FORCE_ZERO] = bank.onset.zero[1]
    out[FORCE_ZERO_STD] = zero_doubt.force_deviation(settings, bank)
    surface = bank.rows[SURFACE_ROW]
    if SURFACE[row.index]:
        surface = row
        out[CONTACT_POSITION] += row.state[OWN]
    elif bank.zeros.off[0] > 0.0:
        out[CONTACT_POSITION_STD] = bank.zeros.off[0]
        return
    if surface.active != 0:
        out[CONTACT_POSITION_STD] = math.sqrt(max(surface.covariance[OWN, OWN], 0.0))
    elif settings.contact_position_std > 0.0:
        out[CONTACT_POSITION_STD] = settings.contact_position_std
