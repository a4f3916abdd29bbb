"""Jerk density of the motion model from the displacement alone, by a bank of small filters.

How fast the tool moves is not known beforehand. A bank of steady-state constant-acceleration
filters (alpha-beta-gamma filters, Kalata, IEEE Trans. AES 20(2), 1984) runs on the displacement,
one per tracking index G = q dt^5 / R over seventeen decades; the one whose innovations are the
likeliest says the density q. Neither force nor contact law take part: adapting q from the
filter's own innovations instead would let a wrong contact law pass for a restless tool.

A real motion is smoother than white jerk at the scale of one sample. Where the force tells the
velocity better than the displacement does, the bank's density is therefore too large, and the
normalised innovations too small; a slow factor, never above 1, corrects that.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
FIRST_READINGS = 24  # the bank starts from a parabola through them
SETTLED_READINGS = 100  # in the mean before a member's motion is used
CHOICE_PERIOD = 8  # samples between two choices
CORRECTION_RATE = 0.05  # per sample
SMALLEST_CORRECTION = -4.0  # of the logarithm of the factor
LARGEST_NIS = 4.0  # one spike must not move the factor


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

FIELDS = (
    ("bank_first", np.float64, (FIRST_READINGS,)),
    ("bank_count", np.int64, ()),  # readings since the start
    ("bank_step", np.float64, ()),  # mean step [s]
    ("bank_states", np.float64, (MEMBERS, 3)),  # displacement, velocity step, acceleration step^2
    ("bank_squares", np.float64, (MEMBERS,)),  # mean squared innovations [mm^2]
    ("bank_weighted", np.int64, ()),  # readings in that mean
    ("bank_chosen", np.int64, ()),  # likeliest member
    ("bank_density", np.float64, ()),  # jerk density of the likeliest member; 0: not known yet
    ("density_correction", np.float64, ()),  # logarithm of the slow factor
)


@compiled
def initialise(memory: Any) -> None:
    """Nothing is known of the motion."""
    memory.bank_density = 0.0
    memory.density_correction = 0.0
    restart(memory)


@compiled
def restart(memory: Any) -> None:
    """Begin anew after a gap; the density stays."""
    memory.bank_count = 0


@compiled
def _start_members(memory: Any) -> None:
    """Start all members on the least-squares parabola through the first readings."""
    count = FIRST_READINGS
    middle = 0.5 * (count - 1)
    second = 0.0
    fourth = 0.0
    sum0 = 0.0
    sum1 = 0.0
    sum2 = 0.0
    last = memory.bank_first[count - 1]
    for k in range(count):
        u = k - middle
        y = memory.bank_first[k] - last
        second += u * u
        fourth += u**4
        sum0 += y
        sum1 += u * y
        sum2 += u * u * y
    bend = (count * sum2 - second * sum0) / (count * fourth - second * second)
    slope = sum1 / second
    level = (sum0 - bend * second) / count
    for m in range(MEMBERS):
        memory.bank_states[m, 0] = last + level + slope * middle + bend * middle * middle
        memory.bank_states[m, 1] = slope + 2.0 * bend * middle
        memory.bank_states[m, 2] = 2.0 * bend
        memory.bank_squares[m] = 0.0
    memory.bank_weighted = 0


@compiled
def learn(settings: Any, memory: Any) -> None:
    """Take the accepted displacement into the bank and choose the likeliest member."""
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
        memory.bank_first[count - 1] = displacement
        if count == FIRST_READINGS:
            _start_members(memory)
        return
    steps = memory.elapsed / memory.bank_step  # 1 unless samples were lost
    regular = abs(steps - 1.0) < 0.5
    if regular:
        memory.bank_weighted += 1
    share = 1.0 / min(float(memory.bank_weighted + 1), settings.motion_memory)
    half = 0.5 * steps * steps
    states = memory.bank_states
    for m in range(MEMBERS):
        predicted = states[m, 0] + steps * states[m, 1] + half * states[m, 2]
        innovation = displacement - predicted
        states[m, 0] = predicted + BANK[m, 1] * innovation
        states[m, 1] += steps * states[m, 2] + BANK[m, 2] * innovation
        states[m, 2] += BANK[m, 3] * innovation
        if regular:
            memory.bank_squares[m] += share * (innovation * innovation - memory.bank_squares[m])
    if count % CHOICE_PERIOD == 0 and memory.bank_weighted >= CHOICE_PERIOD:
        choose(memory)


@compiled
def choose(memory: Any) -> None:
    """Set memory.bank_density from the member whose innovations are the likeliest."""
    noise = memory.sensor_noise[0]
    best = math.inf
    chosen = 0
    for m in range(MEMBERS):
        surprise = memory.bank_squares[m] / (noise * BANK[m, 0]) + LOG_VARIANCE[m]
        if surprise < best:
            best = surprise
            chosen = m
    memory.bank_chosen = chosen
    memory.bank_density = INDICES[chosen] * noise / memory.bank_step**5


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
    for i in range(3):
        for j in range(7):
            covariance[i, j] = 0.0
            covariance[j, i] = 0.0
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
        scale = density / settings.jerk_density
    memory.process_noise_scale = scale
    for i in range(3):
        for j in range(3):
            memory.process_noise[i, j] *= scale
