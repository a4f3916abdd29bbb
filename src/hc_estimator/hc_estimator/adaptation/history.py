"""What was felt before: least squares over thinned-out samples holds the estimate to it.

A recursive filter with a contact law that does not fit is drawn along by the latest misfit, and
pays for a tenth of a newton now with newtons in another depth or direction of motion: it has no
means to see what its new parameters make of the samples that it has used up. Least squares has.
So a sample is remembered every few hundredths of a second of contact. While there is a model
error, the estimate is held against them, and where it explains them clearly worse than the best
fit (Levenberg-Marquardt; the exponents and B / K keep their prior), the fit takes its place: mean,
covariance and model error. Where the contact law fits, none of this is ever used.

The memory also knows a changed tissue from a newcomer in `contest` that only bends to the misfit
of the moment: if one set of parameters explains the samples before and after the alarm alike, it
is the same tissue.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import contact_force, contact_gradient, has_lagged_velocity
from hc_estimator.linear_algebra import cholesky, copy_matrix, copy_vector
from hc_estimator.specification import ParameterSpecification
from hc_estimator.state_space.kinematic import exponential

SPECIFICATIONS = (
    ParameterSpecification(
        "history_interval",
        "float",
        0.02,
        "Time in contact between two remembered samples; the latest 256 are kept.",
        minimum=1e-3,
        maximum=10.0,
        unit="s",
    ),
    ParameterSpecification(
        "refit_ratio",
        "float",
        1.3,
        "Where the contact law does not fit: RMS misfit of the estimate over the remembered "
        "samples, relative to that of the least-squares fit, from which on the fit replaces it.",
        minimum=1.0,
        maximum=1e6,
    ),
)

POINTS = 256
FEWEST = 32  # remembered samples that make a fit
LATEST = 8  # remembered samples that would show another tissue first
FEWEST_SINCE = 6  # remembered samples since an alarm that say whether it is the same tissue
# A fit that leaves more than this share of the RMS force says nothing (two tissues, relaxation).
LARGEST_MISFIT = 0.2
ALIKE = 2.0  # RMS misfit since the alarm over that before, up to which it is the same tissue
STALE = 16  # remembered samples after which the fit is made anew in any case
STEPS = 12  # Levenberg-Marquardt steps at most; one or two suffice from the fit before
FIRST_DAMPING = 1e-3
LARGEST_DAMPING = 1e6
SMALLEST_GAIN = 1e-3  # relative decrease of the cost at which the fit is done

FIELDS = (
    ("history", np.float64, (POINTS, 3)),  # ring: displacement, velocity, force
    ("history_count", np.int64, ()),  # samples remembered since the start or the last change
    ("history_time", np.float64, ()),  # in contact since the last of them [s]
    ("history_fit", np.float64, (4,)),  # ln K, ln B, n, p
    ("history_before", np.int64, ()),  # history_count when no contest ran
    ("history_fitted", np.int64, ()),  # history_count at the last fit
    ("history_misfit", np.float64, ()),  # mean square left by it [N^2]; 0: none that says anything
)
SCRATCH = (
    ("fit_next", np.float64, (4,)),
    ("fit_slope", np.float64, (4,)),
    ("fit_information", np.float64, (4, 4)),
    ("fit_damped", np.float64, (4, 4)),
    ("fit_factor", np.float64, (4, 4)),
)


@compiled
def restart(memory: Any) -> None:
    """Nothing was felt of this tissue yet."""
    memory.history_count = 0
    memory.history_time = 0.0
    memory.history_before = 0
    memory.history_fitted = 0
    memory.history_misfit = 0.0


@compiled
def learn(settings: Any, memory: Any) -> bool:
    """Remember the accepted sample if it is time to; True if it was remembered."""
    if not memory.state[0] > 0.0 or memory.restart != 0:
        return False
    memory.history_time += memory.elapsed
    if memory.history_time < settings.history_interval:
        return False
    memory.history_time = 0.0
    point = memory.history[memory.history_count % POINTS]
    point[0] = memory.state[0]
    point[1] = memory.state[1]
    point[2] = memory.measurement[1]
    memory.history_count += 1
    return True


@compiled
def hold(settings: Any, memory: Any) -> None:
    """Hold the estimate against what was felt; without a contest, after a remembered sample."""
    memory.history_before = memory.history_count
    if memory.model_error[0] == 0.0 or memory.history_count < FEWEST:
        memory.history_misfit = 0.0
        return
    if has_lagged_velocity(settings.contact_model):
        return
    first = max(memory.history_count - POINTS, 0)
    own = _misfit(settings, memory, memory.state[3:7], first)
    # More samples can only add to the least sum of squares: most fits need not be made.
    bound = memory.history_misfit * min(memory.history_fitted, POINTS)
    stale = memory.history_count - memory.history_fitted >= STALE
    if own * (memory.history_count - first) < settings.refit_ratio**2 * bound and not stale:
        return
    fitted = memory.history_fitted > 0
    if not (fitted and _misfit(settings, memory, memory.history_fit, first) < own):
        copy_vector(memory.state[3:7], memory.history_fit)
    memory.history_fitted = memory.history_count
    memory.history_misfit = 0.0
    noise = memory.sensor_noise[1] + memory.model_error[0]
    if not _fit(settings, memory, 1.0 / noise):
        return
    least = _misfit(settings, memory, memory.history_fit, first)
    if not least < LARGEST_MISFIT**2 * _mean_square_force(memory, first):
        return
    memory.history_misfit = least
    if not own > settings.refit_ratio**2 * least:
        return
    # Another tissue, begun just now, would show in the latest samples.
    latest = _misfit(settings, memory, memory.history_fit, memory.history_count - LATEST)
    if latest < ALIKE**2 * least:
        _adopt(settings, memory, least)


@compiled
def same_tissue(settings: Any, memory: Any) -> bool:
    """True if one fit explains the samples before and since the alarm of the contest alike."""
    since = memory.history_count - memory.history_before
    if memory.history_misfit == 0.0 or since < FEWEST_SINCE or since > POINTS // 2:
        return False
    if not _fit(settings, memory, 1.0 / memory.history_misfit):
        return False
    later = _misfit(settings, memory, memory.history_fit, memory.history_before)
    return bool(later < ALIKE**2 * memory.history_misfit)


@compiled
def _adopt(settings: Any, memory: Any, least: float) -> None:
    """Make the fit the estimate, its misfit the model error."""
    memory.model_error[0] = max(memory.model_error[0], least - memory.sensor_noise[1])
    noise = memory.sensor_noise[1] + memory.model_error[0]
    # Certain as the filter would be that had used all samples in between with this noise.
    share = min(1.0, memory.elapsed / settings.history_interval)
    _linearise(settings, memory, 1.0 / (share * noise))
    if not cholesky(memory.fit_information, memory.fit_factor):
        return
    state, covariance = memory.state, memory.covariance
    for i in range(4):
        state[3 + i] = memory.history_fit[i]
        for j in range(7):
            covariance[3 + i, j] = 0.0
            covariance[j, 3 + i] = 0.0
    for i in range(4):
        for j in range(4):
            memory.fit_next[j] = 1.0 if i == j else 0.0
        _solve(memory.fit_factor, memory.fit_next)
        for j in range(i + 1):
            if memory.prior_variance[i] > 0.0 and memory.prior_variance[j] > 0.0:
                covariance[3 + i, 3 + j] = memory.fit_next[j]
                covariance[3 + j, 3 + i] = memory.fit_next[j]


@compiled
def _force(settings: Any, point: Any, values: Any) -> float:
    return contact_force(
        settings.contact_model,
        point[0],
        point[1],
        exponential(values[0]),
        exponential(values[1]),
        values[2],
        values[3],
    )


@compiled
def _misfit(settings: Any, memory: Any, values: Any, first: int) -> float:
    """Mean squared residual [N^2] of ln K, ln B, n, p over the samples from the first on."""
    total = 0.0
    for k in range(first, memory.history_count):
        point = memory.history[k % POINTS]
        total += (_force(settings, point, values) - point[2]) ** 2
    return total / (memory.history_count - first)  # type: ignore[no-any-return]


@compiled
def _mean_square_force(memory: Any, first: int) -> float:
    total = 0.0
    for k in range(first, memory.history_count):
        total += memory.history[k % POINTS, 2] ** 2
    return total / (memory.history_count - first)  # type: ignore[no-any-return]


@compiled
def _damping_off(settings: Any, values: Any) -> float:
    """Logarithm of B / K, from that of the first guess."""
    guess = math.log(settings.initial_damping / settings.initial_stiffness)
    return values[1] - values[0] - guess  # type: ignore[no-any-return]


@compiled
def _cost(settings: Any, memory: Any, values: Any, weight: float) -> float:
    """Weighted squared residuals and squared distance from the prior."""
    first = max(memory.history_count - POINTS, 0)
    total = weight * (memory.history_count - first) * _misfit(settings, memory, values, first)
    prior = memory.prior_variance
    if prior[0] > 0.0 and prior[1] > 0.0:
        total += _damping_off(settings, values) ** 2 / prior[1]
    if prior[2] > 0.0:
        total += (values[2] - settings.initial_displacement_exponent) ** 2 / prior[2]
    if prior[3] > 0.0:
        total += (values[3] - settings.initial_velocity_exponent) ** 2 / prior[3]
    return total  # type: ignore[no-any-return]


@compiled
def _linearise(settings: Any, memory: Any, weight: float) -> None:
    """Normal equations of `_cost` at memory.history_fit."""
    values, prior = memory.history_fit, memory.prior_variance
    information, slope, gradient = memory.fit_information, memory.fit_slope, memory.gradient
    for i in range(4):
        slope[i] = 0.0
        for j in range(4):
            information[i, j] = 0.0
    stiffness, damping = exponential(values[0]), exponential(values[1])
    for k in range(max(memory.history_count - POINTS, 0), memory.history_count):
        point = memory.history[k % POINTS]
        residual = point[2] - _force(settings, point, values)
        contact_gradient(
            settings.contact_model,
            point[0],
            point[1],
            stiffness,
            damping,
            values[2],
            values[3],
            gradient,
        )
        gradient[2] *= stiffness
        gradient[3] *= damping
        for i in range(4):
            if prior[i] <= 0.0:  # held fixed
                gradient[2 + i] = 0.0
            slope[i] += weight * gradient[2 + i] * residual
            for j in range(i + 1):
                information[i, j] += weight * gradient[2 + i] * gradient[2 + j]
    if prior[0] > 0.0 and prior[1] > 0.0:
        off = _damping_off(settings, values) / prior[1]
        slope[0] += off
        slope[1] -= off
        information[0, 0] += 1.0 / prior[1]
        information[1, 1] += 1.0 / prior[1]
        information[1, 0] -= 1.0 / prior[1]
    if prior[2] > 0.0:
        slope[2] += (settings.initial_displacement_exponent - values[2]) / prior[2]
        information[2, 2] += 1.0 / prior[2]
    if prior[3] > 0.0:
        slope[3] += (settings.initial_velocity_exponent - values[3]) / prior[3]
        information[3, 3] += 1.0 / prior[3]
    for i in range(4):
        if prior[i] <= 0.0:
            information[i, i] = 1.0
        for j in range(i):
            information[j, i] = information[i, j]


@compiled
def _solve(factor: Any, vector: Any) -> None:
    """Replace b by the solution x of L L^T x = b."""
    for i in range(4):
        for j in range(i):
            vector[i] -= factor[i, j] * vector[j]
        vector[i] /= factor[i, i]
    for i in range(3, -1, -1):
        for j in range(i + 1, 4):
            vector[i] -= factor[j, i] * vector[j]
        vector[i] /= factor[i, i]


@compiled
def _fit(settings: Any, memory: Any, weight: float) -> bool:
    """Levenberg-Marquardt from memory.history_fit on; False if it broke down."""
    values, following = memory.history_fit, memory.fit_next
    cost = _cost(settings, memory, values, weight)
    damping = FIRST_DAMPING
    _linearise(settings, memory, weight)
    for _ in range(STEPS):
        copy_matrix(memory.fit_information, memory.fit_damped)
        copy_vector(memory.fit_slope, following)
        for i in range(4):
            memory.fit_damped[i, i] *= 1.0 + damping
        if not cholesky(memory.fit_damped, memory.fit_factor):
            return False
        _solve(memory.fit_factor, following)
        for i in range(4):
            following[i] += values[i]
        following[2] = min(
            max(following[2], settings.smallest_displacement_exponent),
            settings.largest_displacement_exponent,
        )
        following[3] = min(
            max(following[3], settings.smallest_velocity_exponent),
            settings.largest_velocity_exponent,
        )
        after = _cost(settings, memory, following, weight)
        if after < cost:
            gain = cost - after
            cost = after
            copy_vector(following, values)
            if gain < SMALLEST_GAIN * cost:
                break
            _linearise(settings, memory, weight)
            damping *= 0.1
        else:
            damping *= 10.0
            if damping > LARGEST_DAMPING:
                break
    return math.isfinite(cost)
