"""Jerk density of the motion model from the displacement alone, by a bank of small filters.

How fast the tool moves is not known beforehand. A bank of steady-state constant-acceleration
filters (alpha-beta-gamma filters, Kalata, IEEE Trans. AES 20(2), 1984) runs on the displacement,
one per tracking index G = q dt^5 / R over seventeen decades; the one whose innovations are the
likeliest says the density q. Neither force nor contact law take part: adapting q from the
filter's own innovations instead would let a wrong contact law pass for a restless tool.

Each member starts as a parabola through all readings since its start (growing-memory gains; Kalata,
and Morrison, Introduction to Sequential Smoothing and Prediction, 1969) and settles on its steady
gains once these are the larger. A member whose innovations lean to one side no longer follows the
motion: it starts anew from its quicker neighbour. So the bank is quick where the tool turns, and
calm again as soon as the readings since then allow it. Only members that have settled are chosen.

A real motion is smoother than white jerk at the scale of one sample. Where the force tells the
velocity better than the displacement does, the bank's density is therefore too large, and the
normalised innovations too small; a slow factor, never above 1, corrects that.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.adaptation import difference_noise
from hc_estimator.compilation import compiled
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "motion_adaptation",
        "bool",
        True,
        "Estimate the jerk density from the displacement; otherwise jerk_density holds throughout.",
    ),
    ParameterSpecification(
        "motion_memory",
        "float",
        400.0,
        "Samples over which the bank's innovations are averaged.",
        minimum=50.0,
        maximum=1e6,
    ),
)

INDICES = 10.0 ** np.arange(-14.0, 3.25, 0.5)
MEMBERS = INDICES.size
FIRST_READINGS = 3  # the bank starts from the parabola through them
SETTLED_READINGS = 100  # in the mean before a member's motion is used
CHOICE_PERIOD = 8  # samples between two choices
CORRECTION_RATE = 0.05  # per sample
SMALLEST_CORRECTION = -4.0  # of the logarithm of the factor
REFUTED = 4.0  # log likelihood ratio over the memory
LARGEST_NIS = 4.0  # one spike must not move the factor
# Two-sided cumulative sum of the normalised innovations: for white ones it passes the limit once in
# some 1e7 readings.
LEAN_DRIFT = 1.0
LEAN_LIMIT = 8.0
LARGEST_LEAN = 4.0  # one spike must not start a member anew


def steady_state(indices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Steady-state innovation variance and gains for unit time step and unit noise.

    Solves the Riccati equation by the structure-preserving doubling algorithm (Chu, Fan, Lin and
    Wang, Int. J. Control 77, 2004).

    Args:
        indices: tracking indices q dt^5 / R, shape (M,).

    Returns:
        Innovation variance; gains of displacement, velocity and acceleration; covariance after the
        update, row by row; shape (M, 13).
    """
    shape = (indices.size, 3, 3)
    transition = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    noise = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
    a = np.broadcast_to(transition.T, shape).copy()
    g = np.zeros(shape)
    g[:, 0, 0] = 1.0
    h = indices[:, None, None] * noise
    identity = np.eye(3)
    for _ in range(40):
        inverse = np.linalg.inv(identity + g @ h)
        transposed = a.transpose(0, 2, 1)
        h, g, a = (
            h + transposed @ h @ inverse @ a,
            g + a @ inverse @ g @ transposed,
            a @ inverse @ a,
        )
    variance = h[:, 0, 0] + 1.0
    gain = h[:, :, 0] / variance[:, None]
    updated = h - gain[:, :, None] * h[:, :1, :]
    return np.column_stack((variance, gain, updated.reshape(-1, 9)))


BANK = steady_state(INDICES)
LOG_VARIANCE = np.log(BANK[:, 0])


def settling_readings(gains: NDArray[np.float64]) -> NDArray[np.float64]:
    """Readings from which on a steady gain is above that of the parabola through all readings.

    Args:
        gains: steady gains of the displacement, shape (M,).

    Returns:
        Numbers of readings, shape (M,).
    """
    count = np.arange(3.0, 5000.0)
    growing = 3.0 * (3.0 * count * (count - 1.0) + 2.0) / (count * (count + 1.0) * (count + 2.0))
    readings: NDArray[np.float64] = count[np.argmax(growing <= gains[:, None], axis=1)]
    return readings


SETTLED = settling_readings(BANK[:, 1])

FIELDS = (
    ("bank_first", np.float64, (FIRST_READINGS,)),
    ("bank_count", np.int64, ()),  # readings since the start
    ("bank_step", np.float64, ()),  # mean step [s]
    ("bank_states", np.float64, (MEMBERS, 3)),  # displacement, velocity step, acceleration step^2
    ("bank_age", np.float64, (MEMBERS,)),  # readings since a member's start, at least
    ("bank_lean", np.float64, (MEMBERS, 2)),  # cumulative sums upward and downward
    ("bank_squares", np.float64, (MEMBERS,)),  # mean squared innovations over their variance [mm^2]
    ("bank_logs", np.float64, (MEMBERS,)),  # mean logarithm of that variance over the noise's
    ("bank_weighted", np.int64, ()),  # readings in that mean
    ("bank_chosen", np.int64, ()),  # likeliest member
    ("bank_quickest", np.int64, ()),  # quickest member that the displacement does not refute
    ("bank_lean_since", np.int64, (2,)),  # readings since those of the likeliest were zero
    ("bank_turned", np.int64, ()),  # readings since a turn that the likeliest member has just shown
    ("bank_density", np.float64, ()),  # jerk density of the likeliest member; 0: not known yet
    ("density_correction", np.float64, ()),  # logarithm of the slow factor
    ("hidden_density", np.float64, ()),  # least jerk density that the force asks for
)


@compiled
def initialise(memory: Any) -> None:
    """Nothing is known of the motion."""
    memory.bank_density = 0.0
    memory.density_correction = 0.0
    memory.hidden_density = 0.0
    restart(memory)


@compiled
def restart(memory: Any) -> None:
    """Begin anew after a gap; the density stays."""
    memory.bank_count = 0


@compiled
def _start(memory: Any, displacement: float) -> None:
    """Start all members on the parabola through the first three readings."""
    memory.bank_lean_since[:] = 0
    first = memory.bank_first
    first[memory.bank_count - 1] = displacement
    memory.bank_weighted = 0
    if memory.bank_count < FIRST_READINGS:
        return
    bend = first[2] - 2.0 * first[1] + first[0]
    for m in range(MEMBERS):
        memory.bank_states[m, 0] = displacement
        memory.bank_states[m, 1] = first[2] - first[1] + 0.5 * bend
        memory.bank_states[m, 2] = bend
        memory.bank_age[m] = FIRST_READINGS
        memory.bank_lean[m, :] = 0.0
        memory.bank_squares[m] = 0.0
        memory.bank_logs[m] = 0.0


@compiled
def learn(settings: Any, memory: Any) -> None:
    """Take the accepted displacement into the bank and choose the likeliest member."""
    memory.bank_turned = 0
    if memory.restart != 0:
        restart(memory)
    if memory.difference_jumped[0] != 0:
        memory.bank_weighted = min(memory.bank_weighted, 12)
    memory.bank_count += 1
    count = memory.bank_count
    displacement = memory.measurement[0]
    if count == 2:
        memory.bank_step = memory.elapsed
    elif count > 2:
        memory.bank_step += (memory.elapsed - memory.bank_step) / min(count, 100)
    if count <= FIRST_READINGS:
        _start(memory, displacement)
        return
    steps = memory.elapsed / memory.bank_step  # 1 unless samples were lost
    regular = abs(steps - 1.0) < 0.5
    if regular:
        memory.bank_weighted += 1
    share = 1.0 / min(float(max(memory.bank_weighted, 1)), settings.motion_memory)
    half = 0.5 * steps * steps
    noise = memory.sensor_noise[0]
    if memory.difference_count[0] > 0:  # a noise that just rose is no turn of the tool
        noise = max(noise, difference_noise.latest(memory, 0))
    states = memory.bank_states
    for m in range(MEMBERS - 1, -1, -1):
        predicted = states[m, 0] + steps * states[m, 1] + half * states[m, 2]
        innovation = displacement - predicted
        memory.bank_age[m] += 1.0
        age = memory.bank_age[m]
        if age < SETTLED[m]:  # gains of the parabola through all readings since the start
            scale = 1.0 / (age * (age + 1.0) * (age + 2.0))
            first = 3.0 * (3.0 * age * (age - 1.0) + 2.0) * scale
            second = 18.0 * (2.0 * age - 1.0) * scale
            third = 60.0 * scale
            variance = 1.0 / (1.0 - first)
            log_variance = math.log(variance)
        else:
            first, second, third = BANK[m, 1], BANK[m, 2], BANK[m, 3]
            variance = BANK[m, 0]
            log_variance = LOG_VARIANCE[m]
        states[m, 0] = predicted + first * innovation
        states[m, 1] += steps * states[m, 2] + second * innovation
        states[m, 2] += third * innovation
        if regular:
            squares = innovation * innovation / variance
            memory.bank_squares[m] += share * (squares - memory.bank_squares[m])
            memory.bank_logs[m] += share * (log_variance - memory.bank_logs[m])
            _lean(memory, m, innovation / math.sqrt(noise * variance))
    if count % CHOICE_PERIOD == 0 and memory.bank_weighted >= CHOICE_PERIOD:
        choose(settings, memory)


@compiled
def _lean(memory: Any, m: int, normalised: float) -> None:
    """Start member m anew from its quicker neighbour once its innovations lean to one side."""
    lean = memory.bank_lean[m]
    term = min(max(normalised, -LARGEST_LEAN), LARGEST_LEAN)
    lean[0] = max(lean[0] + term - LEAN_DRIFT, 0.0)
    lean[1] = max(lean[1] - term - LEAN_DRIFT, 0.0)
    since = memory.bank_lean_since
    if m == memory.bank_chosen:
        for i in range(2):
            since[i] = since[i] + 1 if lean[i] > 0.0 else 0
    if max(lean[0], lean[1]) < LEAN_LIMIT or m == MEMBERS - 1:
        return
    side = 0 if lean[0] > lean[1] else 1
    lean[0] = 0.0
    lean[1] = 0.0
    if memory.model_error[0] > 0.0:  # what the law misses must not be taken for a calm motion
        return
    if m == memory.bank_chosen:
        memory.bank_turned = since[side]
        since[:] = 0
    for i in range(3):
        memory.bank_states[m, i] = memory.bank_states[m + 1, i]
    memory.bank_squares[m] = memory.bank_squares[m + 1]
    memory.bank_logs[m] = memory.bank_logs[m + 1]
    memory.bank_age[m] = min(memory.bank_age[m + 1], SETTLED[m + 1])


@compiled
def _surprise(memory: Any, m: int) -> float:
    """Twice the negative log likelihood of a member per reading; infinite before it has settled."""
    if memory.bank_age[m] < SETTLED[m]:
        return math.inf
    return memory.bank_squares[m] / memory.sensor_noise[0] + memory.bank_logs[m]  # type: ignore[no-any-return]


@compiled
def choose(settings: Any, memory: Any) -> None:
    """Find the likeliest member, whose density is memory.bank_density, and the quickest."""
    best = math.inf
    chosen = MEMBERS - 1
    for m in range(MEMBERS):
        surprise = _surprise(memory, m)
        if surprise < best:
            best = surprise
            chosen = m
    allowed = best + 2.0 * REFUTED / min(float(memory.bank_weighted), settings.motion_memory)
    quickest = chosen
    for m in range(chosen, MEMBERS):
        if _surprise(memory, m) < allowed:
            quickest = m
    memory.bank_quickest = quickest
    if chosen != memory.bank_chosen:
        memory.bank_lean_since[:] = 0
    memory.bank_chosen = chosen
    memory.bank_density = density_of(memory, chosen)


@compiled
def density_of(memory: Any, member: int) -> float:
    """Jerk density of a member [mm^2/s^5]."""
    return INDICES[member] * memory.sensor_noise[0] / memory.bank_step**5  # type: ignore[no-any-return]


@compiled
def clear_motion(covariance: NDArray[np.float64]) -> None:
    """Zero the motion's variances and its ties to the parameters; covariance of shape (7, 7)."""
    for i in range(3):
        for j in range(7):
            covariance[i, j] = 0.0
            covariance[j, i] = 0.0


@compiled
def set_motion(memory: Any, state: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
    """Replace the motion in state and covariance by what the displacement alone says.

    Nothing is done before the bank has settled on a member.

    Args:
        memory: memory record.
        state: shape (7,).
        covariance: shape (7, 7); ties between motion and parameters are cut.
    """
    if memory.bank_density <= 0.0 or memory.bank_weighted < SETTLED_READINGS:
        return
    member = memory.bank_chosen
    noise = memory.sensor_noise[0]
    clear_motion(covariance)
    scale_i = 1.0
    for i in range(3):
        state[i] = memory.bank_states[member, i] * scale_i
        scale_j = 1.0
        for j in range(3):
            covariance[i, j] = noise * BANK[member, 4 + 3 * i + j] * scale_i * scale_j
            scale_j /= memory.bank_step
        scale_i /= memory.bank_step


@compiled
def correct(memory: Any, joint_nis: float) -> None:
    """Move the slow factor by one normalised innovation squared (mean 2 when it is right)."""
    moved = memory.density_correction + CORRECTION_RATE * (min(0.5 * joint_nis, LARGEST_NIS) - 1.0)
    memory.density_correction = min(max(moved, SMALLEST_CORRECTION), 0.0)


@compiled
def scale_process_noise(settings: Any, memory: Any) -> None:
    """Replace the settings' jerk density in memory.process_noise by the estimated one."""
    scale = 1.0
    if settings.motion_adaptation != 0 and memory.bank_density > 0.0:
        density = memory.bank_density * math.exp(memory.density_correction)
        density = max(density, memory.hidden_density)
        scale = density / settings.jerk_density
    memory.process_noise_scale = scale
    scale_motion_noise(memory, scale)


@compiled
def scale_motion_noise(memory: Any, factor: float) -> None:
    """Multiply the motion's part of memory.process_noise."""
    for i in range(3):
        for j in range(3):
            memory.process_noise[i, j] *= factor
