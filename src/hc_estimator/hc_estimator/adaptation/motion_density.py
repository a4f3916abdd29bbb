"""Jerk density of the motion model from the displacement alone, by a bank of small filters.

How fast the tool moves is not known beforehand. A bank of steady-state constant-acceleration
filters (alpha-beta-gamma filters, Kalata, IEEE Trans. AES 20(2), 1984) runs on the displacement,
one per tracking index G = q dt^5 / R over seventeen decades; the one whose innovations are the
likeliest says the density q. Neither force nor contact law take part: adapting q from the
filter's own innovations instead would let a wrong contact law pass for a tool that moves more.

Each member starts as a parabola through all readings since its start (growing-memory gains; Kalata,
and Morrison, Introduction to Sequential Smoothing and Prediction, 1969) and settles on its steady
gains once these are the larger. A member whose innovations have a bias no longer follows the
motion: it starts anew from its quicker neighbour. So the bank is quick where the tool turns, and
calm again as soon as the readings since then allow it. Only members that have settled are chosen.
After another step than the usual one, gains and variance are those of that step (of a fine pose at
125 Hz that lost half of its readings at random a misfit was said in a fifth of the time). Readings
that come in bursts are hardly ever a usual step apart; then nothing is known.

What the innovations of force and displacement say of that density is `density_correction`'s.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.adaptation import difference_noise
from hc_estimator.compilation import compiled
from hc_estimator.memory import Field, record_type
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "motion_adaptation",
        "bool",
        True,
        "Estimate the jerk density from the displacement; otherwise jerk_density holds throughout.",
    ),
)

MOTION_MEMORY = 400.0  # readings over which the bank's innovations are averaged
INDICES = np.array([10.0 ** (0.5 * k) for k in range(-28, 7)])
MEMBERS = INDICES.size
FIRST_READINGS = 3  # the bank starts from the parabola through them
SETTLED_READINGS = 100  # in the mean before a member's motion is used
CHOICE_PERIOD = 8  # samples between two choices
REGULAR_WORTH = 7.0  # a regular step against others: one in eight does
UNEVEN = 0.1  # share by which a step differs from the usual one, from which on it is another
LONGEST = 4.0  # usual steps, beyond which an innovation says nothing of the usual motion
FEW_REGULAR = 8.0  # score of the latest steps below which hardly any was regular
LARGEST_SCORE = 64.0
FEW_AFTER = 24  # readings since the start, before which that says nothing
RUN_AWAY = 1e6  # an innovation beyond is that of gains for another step than the readings have [mm]
SMALLEST_CORRECTION, LARGEST_CORRECTION = -4.0, 3.0  # of the logarithm of the slow factor
# Two-sided cumulative sum of the normalised innovations: for white ones it passes the limit once in
# some 1e7 readings.
BIAS_DRIFT = 1.0
BIAS_LIMIT = 8.0
LARGEST_TERM = 4.0  # one spike must not start a member anew


def _product(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Products of 3 x 3 matrices, shape (M, 3, 3), the same to the bit on every processor.

    The library's sum up in an order that depends on the processor, and so would all that is
    estimated with this bank.
    """
    columns = [one[:, :, k, None] * other[:, None, k, :] for k in range(3)]
    return columns[0] + columns[1] + columns[2]


def _inverse(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverses of 3 x 3 matrices by Gauss and Jordan, as `_product`; no pivot is small here."""
    left, inverse = matrices.copy(), np.broadcast_to(np.eye(3), matrices.shape).copy()
    for i in range(3):
        pivot = left[:, i, i, None].copy()
        left[:, i] /= pivot
        inverse[:, i] /= pivot
        for j in range(3):
            if j != i:
                share = left[:, j, i, None].copy()
                left[:, j] -= share * left[:, i]
                inverse[:, j] -= share * inverse[:, i]
    return inverse


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
        inverse = _inverse(identity + _product(g, h))
        back = a.transpose(0, 2, 1)
        h, g, a = (
            h + _product(_product(_product(back, h), inverse), a),
            g + _product(_product(_product(a, inverse), g), back),
            _product(_product(a, inverse), a),
        )
    variance = h[:, 0, 0] + 1.0
    gain = h[:, :, 0] / variance[:, None]
    updated = h - gain[:, :, None] * h[:, :1, :]
    return np.column_stack((variance, gain, updated.reshape(-1, 9)))


BANK = steady_state(INDICES)
LOG_VARIANCE = np.array([math.log(variance) for variance in BANK[:, 0]])


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

MOTION = record_type(
    (
        Field("first", np.float64, (FIRST_READINGS,)),
        Field("count", np.int64, (), 0),  # readings since the start
        Field("last_time", np.float64, ()),  # of the last reading [s]
        Field("step", np.float64, (), 0.0),  # mean step [s]
        # Displacement, velocity step, acceleration step^2.
        Field("states", np.float64, (MEMBERS, 3)),
        Field("age", np.float64, (MEMBERS,)),  # readings since a member's start, at least
        Field("regularity", np.float64, (), 0.0, LARGEST_SCORE),  # score of the latest steps
        Field("bias", np.float64, (MEMBERS, 2)),  # cumulative sums upward and downward
        # Mean squared innovations over variance [mm^2].
        Field("squares", np.float64, (MEMBERS,), 0.0),
        Field("logs", np.float64, (MEMBERS,)),  # mean logarithm of that variance over the noise's
        Field("weighted", np.int64, (), 0),  # readings in that mean
        Field("chosen", np.int64, (), 0, MEMBERS - 1),  # likeliest member
        Field("density", np.float64, (), 0.0),  # its jerk density; 0: not known yet
        # Logarithm of the slow factor.
        Field("log_correction", np.float64, (), SMALLEST_CORRECTION, LARGEST_CORRECTION),
        Field("means", np.float64, (2,)),  # short and long, of the force's innovations
    )
)


@compiled
def reset(motion: Any) -> None:
    """Nothing is known of the motion."""
    motion.density = 0.0
    motion.log_correction = 0.0
    motion.means[0], motion.means[1] = 0.0, 0.0
    motion.chosen = 0
    restart(motion)


@compiled
def restart(motion: Any) -> None:
    """Begin anew, after a gap say; the density stays."""
    motion.count = 0


@compiled
def _start(motion: Any, displacement: float) -> None:
    """Start all members on the parabola through the first three readings."""
    first = motion.first
    first[motion.count - 1] = displacement
    motion.weighted = 0
    motion.regularity = 0.0
    if motion.count < FIRST_READINGS:
        return
    bend = first[2] - 2.0 * first[1] + first[0]
    for m in range(MEMBERS):
        motion.states[m, 0] = displacement
        motion.states[m, 1] = first[2] - first[1] + 0.5 * bend
        motion.states[m, 2] = bend
        motion.age[m] = FIRST_READINGS
        motion.bias[m, 0] = 0.0
        motion.bias[m, 1] = 0.0
        motion.squares[m] = 0.0
        motion.logs[m] = 0.0


@compiled
def learn(
    motion: Any,
    channel: Any,
    time: float,
    displacement: float,
    broken: bool,
    noise: float,
    held: bool,
) -> None:
    """Take an accepted displacement into the bank and choose the likeliest member.

    Args:
        motion: record of the bank; changed.
        channel: noise record of the displacement, which has taken the reading.
        time: stamp of the reading [s].
        displacement: reading [mm].
        broken: True if it does not follow the last one (a start, a gap).
        noise: variance of the displacement's noise [mm^2].
        held: True if no member may start anew: what a wrong law misses must not be taken for a
            calm motion.
    """
    if broken:
        restart(motion)
    elif motion.count > 0 and not time > motion.last_time:
        return  # a step backwards would turn the parabolas around
    if channel.jumped != 0:
        motion.weighted = min(motion.weighted, 12)
    elapsed = time - motion.last_time
    motion.last_time = time
    motion.count += 1
    count = motion.count
    if count == 2:
        motion.step = elapsed
    elif count > 2:
        motion.step += (elapsed - motion.step) / min(count, 100)
    if count <= FIRST_READINGS:
        _start(motion, displacement)
        return
    steps = elapsed / motion.step  # 1 unless samples were lost
    regular = abs(steps - 1.0) < 0.5
    counts = regular or 1.0 < steps <= LONGEST
    if counts:
        motion.weighted += 1
    share = 1.0 / min(float(max(motion.weighted, 1)), MOTION_MEMORY)
    half = 0.5 * steps * steps
    cautious_noise = noise
    if channel.count > 0:  # a noise that just rose is no turn of the tool
        cautious_noise = max(noise, difference_noise.latest(channel))
    few = _has_few(motion, regular)
    states = motion.states
    ran_away = False
    for m in range(MEMBERS - 1, -1, -1):
        predicted = states[m, 0] + steps * states[m, 1] + half * states[m, 2]
        innovation = displacement - predicted
        ran_away = ran_away or not abs(innovation) < RUN_AWAY
        motion.age[m] += 1.0
        age = motion.age[m]
        if age < SETTLED[m]:  # gains of the parabola through all readings since the start
            scale = 1.0 / (age * (age + 1.0) * (age + 2.0))
            first = 3.0 * (3.0 * age * (age - 1.0) + 2.0) * scale
            second = 18.0 * (2.0 * age - 1.0) * scale
            third = 60.0 * scale
            variance = 1.0 / (1.0 - first)
            log_variance = math.log(variance)
        elif abs(steps - 1.0) > UNEVEN:
            variance, first, second, third = _gains_after(m, steps)
            log_variance = math.log(variance)
        else:
            first, second, third = BANK[m, 1], BANK[m, 2], BANK[m, 3]
            variance = BANK[m, 0]
            log_variance = LOG_VARIANCE[m]
        states[m, 0] = predicted + first * innovation
        states[m, 1] += steps * states[m, 2] + second * innovation
        states[m, 2] += third * innovation
        if regular or (counts and age >= SETTLED[m]):
            squares = innovation * innovation / variance
            motion.squares[m] += share * (squares - motion.squares[m])
            motion.logs[m] += share * (log_variance - motion.logs[m])
            _sum_up_bias(motion, m, innovation / math.sqrt(cautious_noise * variance), held)
    if ran_away:  # where readings come more slowly than before, by the time that the step is learnt
        motion.weighted = 0
        restart(motion)
    elif few:
        motion.density = 0.0
    elif count % CHOICE_PERIOD == 0 and motion.weighted >= CHOICE_PERIOD:
        _choose(motion, noise)


@compiled
def _gains_after(m: int, steps: float) -> tuple[float, float, float, float]:
    """Innovation variance and gains of a member in steady state, after so many usual steps."""
    p00, p01, p02 = BANK[m, 4], BANK[m, 5], BANK[m, 6]
    p11, p12, p22 = BANK[m, 8], BANK[m, 9], BANK[m, 12]
    s, density = steps, INDICES[m]
    crossed = p11 + p02
    third = p02 + s * (p12 + s * (0.5 * p22 + s * density / 6.0))
    second = p01 + s * (crossed + s * (1.5 * p12 + s * (0.5 * p22 + s * density / 8.0)))
    first = p12 + s * (0.25 * p22 + s * density / 20.0)
    first = p00 + s * (2.0 * p01 + s * (crossed + s * first))
    variance = first + 1.0
    return variance, first / variance, second / variance, third / variance


@compiled
def _has_few(motion: Any, regular: bool) -> bool:
    """Note whether a step was regular; True if hardly any of the latest ones were.

    What the bank says is old then, and members that learn nothing more grow old enough to be
    chosen: the jerk of a tool that moves at 10 mm/s was called that of one at rest.
    """
    score = motion.regularity + (REGULAR_WORTH if regular else -1.0)
    motion.regularity = min(max(score, 0.0), LARGEST_SCORE)
    return bool(motion.count >= FEW_AFTER and motion.regularity < FEW_REGULAR)


@compiled
def _sum_up_bias(motion: Any, m: int, normalised: float, held: bool) -> None:
    """Start member m anew from its quicker neighbour once its innovations have a bias."""
    bias = motion.bias[m]
    term = min(max(normalised, -LARGEST_TERM), LARGEST_TERM)
    bias[0] = max(bias[0] + term - BIAS_DRIFT, 0.0)
    bias[1] = max(bias[1] - term - BIAS_DRIFT, 0.0)
    if max(bias[0], bias[1]) < BIAS_LIMIT or m == MEMBERS - 1:
        return
    bias[0] = 0.0
    bias[1] = 0.0
    if held:
        return
    for i in range(3):
        motion.states[m, i] = motion.states[m + 1, i]
    motion.squares[m] = motion.squares[m + 1]
    motion.logs[m] = motion.logs[m + 1]
    motion.age[m] = min(motion.age[m + 1], SETTLED[m + 1])


@compiled
def _choose(motion: Any, noise: float) -> None:
    """Find the likeliest settled member; its density is motion.density."""
    best = math.inf
    chosen = MEMBERS - 1
    for m in range(MEMBERS):
        if motion.age[m] >= SETTLED[m]:
            # Twice the negative log likelihood per reading.
            surprise = motion.squares[m] / noise + motion.logs[m]
            if surprise < best:
                best = surprise
                chosen = m
    motion.chosen = chosen
    motion.density = INDICES[chosen] * noise / motion.step**5


@compiled
def is_settled(motion: Any) -> bool:
    """True once the chosen member's motion can be used."""
    return bool(motion.density > 0.0 and motion.weighted >= SETTLED_READINGS)


@compiled
def motion_of(motion: Any, i: int) -> float:
    """Displacement [mm], velocity [mm/s] or acceleration [mm/s^2] (i = 0, 1, 2)."""
    return motion.states[motion.chosen, i] / motion.step**i  # type: ignore[no-any-return]


@compiled
def covariance_of(motion: Any, i: int, j: int, noise: float) -> float:
    """Element of the covariance of `motion_of`, for noise of the given variance [mm^2]."""
    element = BANK[motion.chosen, 4 + 3 * i + j]
    return noise * element / motion.step ** (i + j)  # type: ignore[no-any-return]


@compiled
def jerk_density(settings: Any, motion: Any) -> float:
    """Jerk density in use [mm^2/s^5]."""
    if settings.motion_adaptation != 0 and motion.density > 0.0:
        return motion.density * math.exp(motion.log_correction)  # type: ignore[no-any-return]
    return settings.jerk_density  # type: ignore[no-any-return]
