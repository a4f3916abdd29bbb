"""Noise covariances by covariance matching, windowed (AUKF) and recursive (RAUKF), paper B.

The innovations of the last m samples say how large the predicted covariances should have been
(Eq. 22 and 33); what the state's own uncertainty does not explain of them is noise (Eq. 24, 30 and
36). The recursive form averages the window's answer over all samples since the last abrupt change
with the weight C_k = 1 / J (Eq. 25, 26, 29, 34), the windowed form takes it as it is.

Two forms of the traces can be chosen. "literal" is as printed: traces over all seven states and
over both measurements, whatever their units. "corrected" matches each measurement on its own and,
for the process noise, one state (the force of `paper`, the acceleration of `kinematic`), and adds
the window mean of the updated covariance P(k|k), without which Eq. 22 estimates
P(k|k-1) - P(k|k).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector
from hc_estimator.memory import Field
from hc_estimator.specification import ParameterSpecification
from hc_estimator.state_space.registry import KINEMATIC

LONGEST_WINDOW = 256
MATCHED_STATE = 2  # force of `paper`, acceleration of `kinematic`
# Positions in the choices.
MEASUREMENT = 0
PROCESS = 1
LITERAL = 1
KEEP = 0
MODIFIED = 1

SPECIFICATIONS = (
    ParameterSpecification(
        "adapted_noise",
        "str",
        "measurement",
        "Which noise covariance is estimated: R of the measurement, Q of the process, or both "
        "(which the papers never do at once: they are hard to tell apart).",
        choices=("measurement", "process", "both"),
    ),
    ParameterSpecification(
        "matching_window",
        "int",
        14,
        "Number m of samples in the window (paper B, Eq. 19; its experiments use 4 and 14).",
        minimum=1,
        maximum=LONGEST_WINDOW,
        runtime=False,
    ),
    ParameterSpecification(
        "matching_trace",
        "str",
        "corrected",
        "Traces as printed in paper B, or matched state by state and with the mean of P(k|k).",
        choices=("corrected", "literal"),
    ),
    ParameterSpecification(
        "nonpositive",
        "str",
        "keep",
        "What happens when a scaling factor comes out zero or negative: keep the last covariance, "
        "or fall to the floor.",
        choices=("keep", "floor"),
    ),
    ParameterSpecification(
        "matching_floor",
        "float",
        1e-6,
        "Adapted covariances do not fall below this share of the given ones.",
        minimum=1e-15,
        maximum=1.0,
    ),
)

WEIGHTING_SPECIFICATION = ParameterSpecification(
    "weighting",
    "str",
    "modified",
    "Weight of the window in the recursion: 1 over the number of samples (Eq. 26), or the same "
    "begun anew at each abrupt change (Eq. 27 and 28).",
    choices=("standard", "modified"),
)

WINDOW_ONLY = ParameterSpecification(  # not offered: what makes `raukf` an `aukf`
    "window_only",
    "bool",
    False,
    "Take the window as it is, without recursion.",
)

FIELDS = (
    # Three rings: the matched state's share per accepted sample, and the squared innovation of
    # each channel per reading.
    Field("matching_values", np.float64, (LONGEST_WINDOW, 3), 0.0),
    Field("matching_position", np.int64, (3,), 0, LONGEST_WINDOW - 1),
    Field("matching_filled", np.int64, (3,), 0, LONGEST_WINDOW),
    Field("matching_mean", np.float64, (3,), 0.0),  # what the predicted covariances should be
    Field("matching_count", np.int64, (3,), 0),  # J: samples in the recursion
)


@compiled
def restart(memory: Any) -> None:
    """Empty the windows; the recursion begins anew."""
    for c in range(3):
        memory.matching_position[c] = 0
        memory.matching_filled[c] = 0
        memory.matching_mean[c] = 0.0
    abrupt_change(memory)


@compiled
def abrupt_change(memory: Any) -> None:
    """Let the weight of the next window be 1 again (Eq. 27 and 28, b = k_r - 1)."""
    for c in range(3):
        memory.matching_count[c] = 0


@compiled
def scale_process_noise(settings: Any, memory: Any) -> None:
    """Set memory.process_noise from the window and the propagated covariance (Eq. 24 and 30).

    Call between `prediction.predict` and `add_process_noise`.
    """
    if settings.adapted_noise == MEASUREMENT:
        return
    literal = settings.matching_trace == LITERAL
    scale = memory.process_noise_scale
    if memory.matching_count[0] > 0 and memory.restart == 0:
        propagated = 0.0
        given = 0.0
        for i in range(7):
            if literal or i == MATCHED_STATE:
                propagated += memory.predicted_covariance[i, i]
                given += memory.process_noise[i, i]
        if given > 0.0:
            found = (memory.matching_mean[0] - propagated) / given
            if found > 0.0:
                scale = max(found, settings.matching_floor)
            elif settings.nonpositive != KEEP:
                scale = settings.matching_floor
    memory.next_process_noise_scale = scale
    for i in range(7):
        for j in range(7):
            moved = i == MATCHED_STATE and j == MATCHED_STATE
            if settings.state_space == KINEMATIC:
                moved = i < 3 and j < 3
            if literal or moved:
                memory.process_noise[i, j] *= scale


@compiled
def match_measurement_noise(settings: Any, memory: Any) -> None:
    """Set memory.next_noise from the window and the predicted measurement (Eq. 31 to 36).

    Call between the measurement's transform and `correction.innovate`.
    """
    copy_vector(memory.noise, memory.next_noise)
    if settings.adapted_noise == PROCESS:
        return
    if memory.matching_count[1] == 0 or memory.matching_count[2] == 0:
        return
    floor0 = settings.matching_floor * settings.displacement_noise_std**2
    floor1 = settings.matching_floor * settings.force_noise_std**2
    found0 = memory.matching_mean[1] - memory.curvature[0, 0]
    found1 = memory.matching_mean[2] - memory.curvature[1, 1]
    for j in range(7):
        found0 -= memory.sensitivity[j, 0] ** 2
        found1 -= memory.sensitivity[j, 1] ** 2
    if settings.matching_trace == LITERAL:
        ratio = (found0 + found1) / (memory.noise[0] + memory.noise[1])
        found0 = ratio * memory.noise[0]
        found1 = ratio * memory.noise[1]
    if found0 > 0.0:
        memory.next_noise[0] = max(found0, floor0)
    elif settings.nonpositive != KEEP:
        memory.next_noise[0] = floor0
    if found1 > 0.0:
        memory.next_noise[1] = max(found1, floor1)
    elif settings.nonpositive != KEEP:
        memory.next_noise[1] = floor1


@compiled
def learn(settings: Any, memory: Any) -> None:
    """Take an accepted sample into the windows and the recursion (Eq. 22, 25, 29, 33, 34).

    The noise of a reading that is missing stays as it is.
    """
    for i in range(2):
        if memory.present[i] != 0:
            memory.noise[i] = memory.next_noise[i]
    if settings.adapted_noise != MEASUREMENT:
        memory.process_noise_scale = memory.next_process_noise_scale
    literal = settings.matching_trace == LITERAL
    share = 0.0
    for i in range(7):
        if literal or i == MATCHED_STATE:
            moved = (
                memory.gain[i, 0] * memory.innovation[0] + memory.gain[i, 1] * memory.innovation[1]
            )
            share += moved * moved
            if not literal:
                share += memory.covariance[i, i]
    _take(settings, memory, 0, share)
    for i in range(2):
        if memory.present[i] != 0:
            _take(settings, memory, 1 + i, memory.innovation[i] ** 2)


@compiled
def _take(settings: Any, memory: Any, c: int, value: float) -> None:
    """Put a value into ring c, and its mean into the recursion once the ring is full."""
    values, window = memory.matching_values, settings.matching_window
    values[memory.matching_position[c], c] = value
    memory.matching_position[c] = (memory.matching_position[c] + 1) % window
    memory.matching_filled[c] = min(memory.matching_filled[c] + 1, window)
    if memory.matching_filled[c] < window:
        return
    memory.matching_count[c] += 1
    weight = 1.0 if settings.window_only != 0 else 1.0 / memory.matching_count[c]
    total = 0.0
    for k in range(window):
        total += values[k, c]
    memory.matching_mean[c] += weight * (total / window - memory.matching_mean[c])
