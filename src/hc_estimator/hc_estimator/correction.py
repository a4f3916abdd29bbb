"""The measurement update of the Kalman-type filters, in the coordinates that whiten the state.

With the Cholesky factor L of the predicted covariance, P = L L^T, every linear or statistically
linearised measurement has P_xy = L D with a 7x2 matrix D. Then S = D^T D + E with the residual
covariance E = R + what the nonlinearity adds, the gain is L D S^-1, and the Joseph form
(I - K H) P (I - K H)^T + K E K^T becomes W W^T + K E K^T with W = L - K D^T: symmetric and
positive semidefinite whatever the rounding, for the unscented and the extended filter alike.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import end_of_parameters, is_plain
from hc_estimator.linear_algebra import cholesky, clear_matrix
from hc_estimator.prediction import central_covariance_weight, sigma_scale
from hc_estimator.screening import ACCEPTED, NUMERICAL, OUTLIER, note_accepted
from hc_estimator.state_space import registry as state_space
from hc_estimator.state_space.sigma_forces import measure_sigma_points

# Once the gate has opened, so many samples in a row must lie inside before it closes: a change
# that takes a few samples must not be met by refusal after refusal.
OPEN_SAMPLES = 30
# Standard deviations of the predicted displacement from which on free motion is certain.
FREE_DEVIATIONS = 3.0


@compiled
def _measure_points(settings: Any, memory: Any, spread: float) -> None:
    """Measurement function at the predicted mean and at mean +- spread times each column of L."""
    outputs, center = memory.outputs, memory.predicted_state
    state_space.measure(settings, center, outputs[0])
    for j in range(7):
        for i in range(7):
            memory.point[i] = center[i] + spread * memory.factor[i, j]
        state_space.measure(settings, memory.point, outputs[1 + j])
        for i in range(7):
            memory.point[i] = center[i] - spread * memory.factor[i, j]
        state_space.measure(settings, memory.point, outputs[8 + j])


@compiled
def measure_unscented(settings: Any, memory: Any) -> bool:
    """Unscented transform through the measurement function, with points drawn anew.

    Paper A, Eq. 10 to 12; the points are redrawn from the predicted covariance, process noise
    included (reusing the predicted points would leave Q out of S). Each pair of opposite points
    splits into an odd part, which is linear (D), and an even part, which is curvature.

    Fills memory.factor, predicted_measurement, sensitivity and curvature.

    Returns:
        False if the predicted covariance has no Cholesky factor.
    """
    if not cholesky(memory.predicted_covariance, memory.factor):
        return False
    scale = sigma_scale(settings)
    spread = math.sqrt(scale)
    outputs, center = memory.outputs, memory.predicted_state
    model = settings.contact_model
    if state_space.has_linear_process(settings.state_space) and is_plain(model):
        covariance = memory.predicted_covariance
        measure_sigma_points(model, center, covariance, memory.factor, spread, outputs)
    else:
        _measure_points(settings, memory, spread)
    for i in range(2):
        total = 0.0
        for j in range(7):
            plus, minus = outputs[1 + j, i], outputs[8 + j, i]
            total += (plus - outputs[0, i]) + (minus - outputs[0, i])
            memory.sensitivity[j, i] = 0.5 * (plus - minus) / spread
        memory.predicted_measurement[i] = outputs[0, i] + 0.5 * total / scale
    central = central_covariance_weight(settings)
    mean = memory.predicted_measurement
    for i in range(2):
        for k in range(i + 1):
            total = 0.0
            for j in range(7):
                first = 0.5 * (outputs[1 + j, i] + outputs[8 + j, i]) - mean[i]
                second = 0.5 * (outputs[1 + j, k] + outputs[8 + j, k]) - mean[k]
                total += first * second
            element = central * (outputs[0, i] - mean[i]) * (outputs[0, k] - mean[k])
            memory.curvature[i, k] = element + total / scale
            memory.curvature[k, i] = memory.curvature[i, k]
    return True


@compiled
def measure_linearised(settings: Any, memory: Any) -> bool:
    """Measurement function at the mean and its Jacobian; fills what `measure_unscented` fills.

    Returns:
        False if the predicted covariance has no Cholesky factor.
    """
    if not cholesky(memory.predicted_covariance, memory.factor):
        return False
    jacobian = memory.measurement_jacobian
    state_space.measure(settings, memory.predicted_state, memory.predicted_measurement)
    state_space.measurement_jacobian(settings, memory.predicted_state, memory.gradient, jacobian)
    for i in range(2):
        for j in range(7):
            total = 0.0
            for k in range(j, 7):
                total += jacobian[i, k] * memory.factor[k, j]
            memory.sensitivity[j, i] = total
        memory.curvature[i, 0] = 0.0
        memory.curvature[i, 1] = 0.0
    return True


@compiled
def innovate(memory: Any) -> bool:
    """Innovation, its covariance S, the inverse of S and the normalised innovation squared.

    A missing reading has no innovation and no gain; the other one then has that of its own.

    Returns:
        False if S is not positive definite or not finite.
    """
    covariance, inverse = memory.innovation_covariance, memory.inverse
    innovation = memory.innovation
    for i in range(2):
        innovation[i] = 0.0
        if memory.present[i] != 0:
            innovation[i] = memory.measurement[i] - memory.predicted_measurement[i]
        for k in range(2):
            total = memory.curvature[i, k]
            for j in range(7):
                total += memory.sensitivity[j, i] * memory.sensitivity[j, k]
            covariance[i, k] = total
        covariance[i, i] += memory.measurement_noise[i]
        if not (covariance[i, i] > 0.0 and covariance[i, i] < math.inf):
            return False
    if memory.present[0] == 0 or memory.present[1] == 0:
        clear_matrix(inverse)
        memory.nis = 0.0
        for i in range(2):
            if memory.present[i] != 0:
                inverse[i, i] = 1.0 / covariance[i, i]
                memory.nis = innovation[i] * innovation[i] / covariance[i, i]
        return math.isfinite(memory.nis)
    # The force given the displacement. Of its variance no less can be left than its own noise;
    # where the two are all but one, the difference has lost its digits and may be below zero.
    share = covariance[0, 1] / covariance[0, 0]
    rest = covariance[1, 1] - share * covariance[0, 1]
    if not rest > memory.measurement_noise[1]:
        rest = memory.measurement_noise[1]
    inverse[1, 1] = 1.0 / rest
    inverse[0, 1] = inverse[1, 0] = -share / rest
    inverse[0, 0] = 1.0 / covariance[0, 0] + share * share / rest
    left = innovation[1] - share * innovation[0]
    memory.nis = innovation[0] * innovation[0] / covariance[0, 0] + left * left / rest
    return math.isfinite(memory.nis)


@compiled
def gate(settings: Any, memory: Any) -> int:
    """Refuse an innovation far outside its distribution, unless many come one after another.

    Each channel has a gate of its own. A sample is refused if either channel is; beside a
    displacement that is refused the force says nothing. What follows on `outlier_limit` refusals of
    a channel in a row stands in `recovery`.

    Returns:
        ACCEPTED or OUTLIER.
    """
    squared_limit = settings.outlier_gate * settings.outlier_gate
    decision = ACCEPTED
    for i in range(2):
        if memory.present[i] == 0 or decision != ACCEPTED:
            continue
        variance = memory.innovation_covariance[i, i]
        outside = memory.innovation[i] * memory.innovation[i] > squared_limit * variance
        count = memory.outlier_counts[i]
        if count >= settings.outlier_limit:  # the gate is open, or opens
            if outside:
                count = settings.outlier_limit + OPEN_SAMPLES
            else:
                count = count - 1 if count - 1 > settings.outlier_limit else 0
        elif outside:
            count += 1
            decision = OUTLIER
        else:
            count = 0
        memory.outlier_counts[i] = count
    return decision


@compiled
def open_gate(settings: Any, memory: Any, channel: int) -> None:
    """Believe the readings of a channel until many in a row lie inside the gate."""
    memory.outlier_counts[channel] = settings.outlier_limit + OPEN_SAMPLES


@compiled
def out_of_contact(memory: Any) -> bool:
    """True if the predicted displacement is free motion beyond doubt."""
    spread = FREE_DEVIATIONS * math.sqrt(memory.predicted_covariance[0, 0])
    return bool(memory.predicted_state[0] + spread <= 0.0)


@compiled
def correct(settings: Any, memory: Any) -> None:
    """Gain, updated state and covariance."""
    find_gain(settings, memory)
    apply_gain(memory)


@compiled
def find_gain(settings: Any, memory: Any) -> None:
    """Kalman gain (paper A, Eq. 13); without contact that of the parameters is zero."""
    factor, gain, half = memory.factor, memory.gain, memory.half
    for k in range(2):
        for i in range(7):  # G = D S^-1, kept in half for a moment
            half[i, k] = (
                memory.sensitivity[i, 0] * memory.inverse[0, k]
                + memory.sensitivity[i, 1] * memory.inverse[1, k]
            )
    for i in range(7):
        for k in range(2):
            total = 0.0
            for j in range(i + 1):
                total += factor[i, j] * half[j, k]
            gain[i, k] = total
    if out_of_contact(memory):
        # The air says nothing of the tissue. Without this the parameters would go on following
        # the displacement through what is left of their correlation with the motion.
        hold_parameters(settings, memory)


@compiled
def hold_parameters(settings: Any, memory: Any) -> None:
    """Take the parameters out of memory.gain: this update leaves them as they are."""
    last = end_of_parameters(settings.contact_model)
    for i in range(3, last):
        memory.gain[i, 0] = 0.0
        memory.gain[i, 1] = 0.0


@compiled
def apply_gain(memory: Any) -> None:
    """Updated state (paper A, Eq. 14), and covariance in the whitened Joseph form.

    That form holds for any gain; the caller may have changed memory.gain.
    """
    factor, gain, half = memory.factor, memory.gain, memory.half
    for i in range(7):
        memory.updated_state[i] = (
            memory.predicted_state[i]
            + gain[i, 0] * memory.innovation[0]
            + gain[i, 1] * memory.innovation[1]
        )
        for j in range(7):
            half[i, j] = (
                factor[i, j]
                - gain[i, 0] * memory.sensitivity[j, 0]
                - gain[i, 1] * memory.sensitivity[j, 1]
            )
    e00 = memory.curvature[0, 0] + memory.measurement_noise[0]
    e01 = memory.curvature[0, 1]
    e11 = memory.curvature[1, 1] + memory.measurement_noise[1]
    for i in range(7):
        left = gain[i, 0] * e00 + gain[i, 1] * e01
        right = gain[i, 0] * e01 + gain[i, 1] * e11
        for k in range(i + 1):
            total = left * gain[k, 0] + right * gain[k, 1]
            for j in range(7):
                total += half[i, j] * half[k, j]
            memory.updated_covariance[i, k] = total
            memory.updated_covariance[k, i] = total


@compiled
def commit(settings: Any, memory: Any, time: float) -> int:
    """Make the updated state the state, if it is sound.

    Returns:
        ACCEPTED, or NUMERICAL if the update is not finite; the state is then as before.
    """
    state_space.constrain(settings, memory.updated_state)
    total = 0.0
    for i in range(7):
        total += abs(memory.updated_state[i]) + memory.updated_covariance[i, i]
        if not memory.updated_covariance[i, i] >= 0.0:
            return NUMERICAL
    if not total < 1e150:
        return NUMERICAL
    for i in range(7):
        memory.state[i] = memory.updated_state[i]
        for j in range(7):
            memory.covariance[i, j] = memory.updated_covariance[i, j]
    note_accepted(memory, time)
    return ACCEPTED
