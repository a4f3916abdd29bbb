"""Writes what a filter knows after a sample into one row of numbers; see `estimate`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator import estimate as columns
from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import fixed_value
from hc_estimator.screening import ACCEPTED, NOT_FINITE, OUT_OF_RANGE, OUTLIER
from hc_estimator.state_space import registry as state_space

# Globals of a module are constants to the compiler.
PARAMETERS = columns.PARAMETERS
COVARIANCE = columns.COVARIANCE
FORCE_PREDICTED = columns.FORCE_PREDICTED
FORCE_RECONSTRUCTED = columns.FORCE_RECONSTRUCTED
INNOVATION = columns.INNOVATION
NIS = columns.NIS
IDENTIFIABILITY = columns.IDENTIFIABILITY
DISPLACEMENT = columns.DISPLACEMENT
VELOCITY = columns.VELOCITY
FORCE_NOISE_STD = columns.FORCE_NOISE_STD
DISPLACEMENT_NOISE_STD = columns.DISPLACEMENT_NOISE_STD
CONTACT = columns.CONTACT
CHANGE_DETECTED = columns.CHANGE_DETECTED
MODEL_MISMATCH = columns.MODEL_MISMATCH
REJECTED = columns.REJECTED
PROCESS_NOISE_SCALE = columns.PROCESS_NOISE_SCALE
CHANNEL_DELAY = columns.CHANNEL_DELAY
CONTACT_POSITION = columns.CONTACT_POSITION
FORCE_ZERO = columns.FORCE_ZERO
HYPOTHESIS = columns.HYPOTHESIS


@compiled
def clear_row(row: NDArray[np.float64]) -> None:
    """What a filter says that does not know better: NaN, and 0 for flags and faults."""
    for i in range(row.shape[0]):
        row[i] = math.nan
    row[MODEL_MISMATCH] = 0.0
    row[CHANNEL_DELAY] = 0.0
    row[CONTACT_POSITION] = 0.0
    row[FORCE_ZERO] = 0.0
    row[HYPOTHESIS] = 0.0


@compiled
def say_range(settings: Any, force: float, row: NDArray[np.float64]) -> None:
    """Report a sample as out of range whose force is, though the displacement was used.

    Args:
        settings: settings record.
        force: reading of the sample [N].
        row: as written of that sample.
    """
    if row[REJECTED] != NOT_FINITE and abs(force) > settings.force_limit:
        row[REJECTED] = OUT_OF_RANGE


@compiled
def write_fixed_parameters(settings: Any, row: NDArray[np.float64]) -> None:
    """Put what a contact model fixes in the place of parameters that it does not have."""
    for i in range(4):
        value = fixed_value(settings.contact_model, i)
        if math.isnan(value):
            continue
        row[PARAMETERS + i] = value
        row[IDENTIFIABILITY + i] = 0.0
        for j in range(4):
            row[COVARIANCE + 4 * i + j] = 0.0
            row[COVARIANCE + 4 * j + i] = 0.0


@compiled
def write_row(settings: Any, memory: Any, rejected: int, row: NDArray[np.float64]) -> None:
    """Fill a row from memory.state, memory.covariance and the scratch of the last update.

    Args:
        settings: settings record.
        memory: memory record.
        rejected: code of the decision on the sample.
        row: takes the numbers, shape (estimate.COLUMNS,).
    """
    clear_row(row)
    state, slopes = memory.state, memory.slopes
    state_space.to_parameters(settings, state, memory.parameters, slopes)
    for i in range(4):
        row[PARAMETERS + i] = memory.parameters[i]
        for j in range(i + 1):
            element = slopes[i] * memory.covariance[3 + i, 3 + j] * slopes[j]
            row[COVARIANCE + 4 * i + j] = element
            row[COVARIANCE + 4 * j + i] = element
        prior = memory.prior_variance[i]
        share = 0.0 if prior <= 0.0 else 1.0 - memory.covariance[3 + i, 3 + i] / prior
        row[IDENTIFIABILITY + i] = min(max(share, 0.0), 1.0)
    if rejected in (ACCEPTED, OUTLIER):
        row[FORCE_PREDICTED] = memory.predicted_measurement[1]
        for i in range(2):
            if memory.present[i] != 0:
                row[INNOVATION + i] = memory.innovation[i]
        row[NIS] = memory.nis
    force = state_space.force_of_parameters(settings, state, memory.parameters)
    row[FORCE_RECONSTRUCTED] = force
    row[DISPLACEMENT] = state[0]
    row[VELOCITY] = state[1]
    row[DISPLACEMENT_NOISE_STD] = math.sqrt(memory.noise[0])
    row[FORCE_NOISE_STD] = math.sqrt(memory.noise[1])
    row[CONTACT] = 1.0 if state[0] > 0.0 else 0.0
    row[CHANGE_DETECTED] = float(memory.change_detected)
    row[REJECTED] = float(rejected)
    row[PROCESS_NOISE_SCALE] = memory.process_noise_scale
