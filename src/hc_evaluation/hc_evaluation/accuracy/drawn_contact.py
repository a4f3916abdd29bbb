"""Contacts in which everything is drawn: motion, tissue, sensors, and what is wrong.

Motions that the other experiments do not have (a hand that wanders, ramps of a robot with rests,
taps) and troubles that they have one by one, each as likely with each motion. A plant of its own,
in plain numpy, so that it shares no mistake with the scenarios.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter, sosfiltfilt

from hc_evaluation.accuracy.scenarios import log_uniform

FloatArray = NDArray[np.float64]
Draw = np.random.Generator
Between = Callable[[Draw, FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""Takes stamps, place of the tool [mm] and its force [N]; returns both as sensors find them."""

DURATION_S = 20.0
RATES_HZ = (66.0, 100.0, 200.0, 500.0, 1000.0, 2000.0)
STIFFNESS = (0.05, 2.5)
EXPONENT = (1.0, 2.1)
VELOCITY_EXPONENT = (0.5, 1.3)
DAMPING_SHARE = (0.02, 0.6)  # of the elastic force, at the fastest
SLOWEST_FASTEST_MM_S = 5.0  # the same at least
FORCE_NOISE = (0.0005, 0.02)  # of the largest force
DISPLACEMENT_NOISE_MM = (0.0005, 0.02)
FINEST = 1e-4  # of the largest force: no sensor of its range has less noise


@dataclass(frozen=True)
class Acquisition:
    """How long, how often and how well a contact is read, and whether the tool visits the air.

    Attributes:
        duration_s: of the contact.
        rates_hz: readings a second, each as likely.
        displacement_noise_mm: deviation, from and to, drawn log-uniformly.
        force_noise: the same of the force, as a share of the largest one.
        force_noise_n: the same in N, instead of a share; at least `FINEST` of the largest force.
        visits: the tool begins in the air and is taken back to it every few seconds.
        shaken: readings are taken early or late by up to this share of the period, and say when.
    """

    duration_s: float = DURATION_S
    rates_hz: tuple[float, ...] = RATES_HZ
    displacement_noise_mm: tuple[float, float] = DISPLACEMENT_NOISE_MM
    force_noise: tuple[float, float] = FORCE_NOISE
    force_noise_n: tuple[float, float] | None = None
    visits: bool = False
    shaken: float = 0.0


USUAL = Acquisition()


@dataclass
class DrawnContact:
    """Readings of one contact beside the truth; arrays of shape (N,), parameters (N, 4).

    Attributes:
        time_s: stamps.
        displacement_mm: readings.
        force_n: readings.
        parameters: K, B, n, p.
        changed_s: when the tissue changed abruptly; None: it did not.
        acting_n: the force without noise and zero.
        force_noise_n: deviation of the force's noise.
        visits_s: from when until when the tool rested in the air, shape (visits, 2).
    """

    time_s: FloatArray
    displacement_mm: FloatArray
    force_n: FloatArray
    parameters: FloatArray
    changed_s: float | None
    acting_n: FloatArray
    force_noise_n: float
    visits_s: FloatArray


@dataclass
class _Plan:
    """What the troubles may change before anything is felt or read, arrays of shape (N,)."""

    time: FloatArray
    tool: FloatArray
    surface: FloatArray
    log_factor: FloatArray  # of K and B
    kept: NDArray[np.bool_]  # readings that arrive
    position_mm: float = 0.0
    zero_share: float | FloatArray = 0.0  # of the largest force
    delay_s: float = 0.0
    changed_s: float | None = None
    quanta: tuple[float, float] = (0.0, 0.0)  # deviations of a reading's noise
    colour: float = 0.0


def minimum_jerk(share: FloatArray) -> FloatArray:
    """Way of a smooth move at a share of its time (Flash and Hogan 1985)."""
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def _sines(draw: Draw, time: FloatArray, rate_hz: float) -> FloatArray:
    del rate_hz
    middle, count = float(draw.uniform(2.0, 7.0)), int(draw.integers(1, 4))
    way = np.full(time.size, middle)
    for _ in range(count):
        amplitude = middle * float(draw.uniform(0.1, 0.6)) / count
        frequency = log_uniform(draw, 0.3, 5.0) / (1.0 + 0.25 * amplitude)
        way += amplitude * np.sin(2.0 * np.pi * frequency * time + draw.uniform(0.0, 6.28))
    return way


def _moves(
    draw: Draw, time: FloatArray, fastest: tuple[float, float], rest: tuple[float, float]
) -> FloatArray:
    place = home = float(draw.uniform(-2.0, 1.0))
    way, now = np.full(time.size, place), 0.0
    while now < time[-1]:
        now += float(draw.uniform(*rest))
        goal = float(draw.uniform(2.0, 8.0)) if place == home else home
        if place != home and draw.random() < 0.2:
            goal = float(draw.uniform(1.0, 8.0))
        takes = max(1.9 * abs(goal - place) / float(draw.uniform(*fastest)), 0.08)
        share = np.clip((time - now) / takes, 0.0, 1.0)
        way = np.where(time >= now, place + (goal - place) * minimum_jerk(share), way)
        now, place = now + takes, goal
    return way


def _presses(draw: Draw, time: FloatArray, rate_hz: float) -> FloatArray:
    del rate_hz
    return _moves(draw, time, (4.0, 40.0), (0.1, 1.2))


def _taps(draw: Draw, time: FloatArray, rate_hz: float) -> FloatArray:
    del rate_hz
    return _moves(draw, time, (20.0, 60.0), (0.0, 0.3))


def _ramps(draw: Draw, time: FloatArray, rate_hz: float) -> FloatArray:
    place = home = float(draw.uniform(-0.5, 1.0))
    way, now = np.full(time.size, place), 0.0
    while now < time[-1]:
        goal = float(draw.uniform(2.0, 6.0)) if place == home or draw.random() < 0.3 else home
        takes = max(abs(goal - place), 0.05) / log_uniform(draw, 0.5, 6.0)
        share = np.clip((time - now) / takes, 0.0, 1.0)
        way = np.where(time >= now, place + (goal - place) * share, way)
        now, place = now + takes + float(draw.uniform(0.2, 2.0)), goal
    corner = min(float(draw.uniform(5.0, 20.0)), 0.4 * rate_hz)
    smooth: FloatArray = sosfiltfilt(butter(2, corner, fs=rate_hz, output="sos"), way)
    return smooth


def _wanders(draw: Draw, time: FloatArray, rate_hz: float) -> FloatArray:
    low = butter(3, log_uniform(draw, 0.7, 3.5), fs=rate_hz, output="sos")
    settles = int(2.0 * rate_hz)
    noise = sosfiltfilt(low, draw.standard_normal(time.size + 2 * settles))[settles:-settles]
    scaled: FloatArray = noise / np.std(noise)
    return float(draw.uniform(2.5, 6.0)) + float(draw.uniform(0.4, 1.2)) * scaled


MOTIONS = {
    "sines": _sines,
    "presses": _presses,
    "taps": _taps,
    "ramps": _ramps,
    "wanders": _wanders,
}


def _with_visits(draw: Draw, time: FloatArray, way: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A motion that begins in the air and comes back to it; and when it rests there, (visits, 2).

    About every eight seconds somebody lifts the tool, waits, and goes on with the motion.
    """
    height = float(draw.uniform(0.5, 3.0))
    lifted, begins, visits = np.zeros(time.size), 0.0, []
    while begins < time[-1]:
        up, rest, down = draw.uniform([0.4, 0.3, 0.4], [0.8, 2.0, 0.8]).tolist()
        ends = begins + rest
        lifted += minimum_jerk(np.clip((time - begins + up) / up, 0.0, 1.0))
        lifted -= minimum_jerk(np.clip((time - ends) / down, 0.0, 1.0))
        visits.append((begins, min(ends, float(time[-1]))))
        begins = ends + down + float(draw.uniform(4.0, 8.0)) + 0.8
    return way * (1.0 - lifted) - height * lifted, np.array(visits)


def _sign(draw: Draw) -> float:
    return float(draw.choice([-1.0, 1.0]))


def _lumps(draw: Draw, plan: _Plan) -> None:
    for _ in range(int(draw.integers(1, 3))):
        away = (plan.time - draw.uniform(3.0, 18.0)) / draw.uniform(0.5, 2.0)
        plan.log_factor += np.log(log_uniform(draw, 0.5, 3.5)) * np.exp(-0.5 * away**2)


def _drift(draw: Draw, plan: _Plan) -> None:
    plan.log_factor += _sign(draw) * draw.uniform(0.2, 0.5) * plan.time / DURATION_S


def _change(draw: Draw, plan: _Plan) -> None:
    plan.changed_s = float(draw.uniform(6.0, 14.0))
    change = _sign(draw) * np.log(log_uniform(draw, 1.3, 3.0))
    plan.log_factor += np.where(plan.time >= plan.changed_s, change, 0.0)


def _delay(draw: Draw, plan: _Plan) -> None:
    plan.delay_s = _sign(draw) * float(draw.uniform(0.005, 0.05))


def _force_zero(draw: Draw, plan: _Plan) -> None:
    plan.zero_share = plan.zero_share + _sign(draw) * float(draw.uniform(0.005, 0.03))


def _zero_drift(draw: Draw, plan: _Plan) -> None:
    """A sensor that warms up."""
    share = _sign(draw) * log_uniform(draw, 0.003, 0.02)
    plan.zero_share = plan.zero_share - share * np.expm1(-plan.time / draw.uniform(5.0, 30.0))


def _contact_position(draw: Draw, plan: _Plan) -> None:
    plan.position_mm = _sign(draw) * float(draw.uniform(0.05, 0.4))


def _breathing(draw: Draw, plan: _Plan) -> None:
    phase = float(draw.uniform(0.0, 6.28))
    angle = 2.0 * np.pi * draw.uniform(0.2, 0.35) * plan.time + phase
    plan.surface += draw.uniform(0.3, 1.0) * (np.sin(angle) - np.sin(phase))


def _sinking(draw: Draw, plan: _Plan) -> None:
    plan.surface += _sign(draw) * draw.uniform(0.02, 0.06) * plan.time


def _tremor(draw: Draw, plan: _Plan) -> None:
    angle = 2.0 * np.pi * draw.uniform(6.0, 10.0) * plan.time
    plan.tool += log_uniform(draw, 0.01, 0.1) * np.sin(angle + 1.0)


def _coloured(draw: Draw, plan: _Plan) -> None:
    plan.colour = float(draw.uniform(0.3, 0.8))


def _coarse(draw: Draw, plan: _Plan) -> None:
    plan.quanta = (float(draw.uniform(0.5, 3.0)), float(draw.uniform(0.5, 3.0)))


def _gaps(draw: Draw, plan: _Plan) -> None:
    for _ in range(int(draw.integers(1, 5))):
        start = float(draw.uniform(1.0, 19.0))
        end = start + log_uniform(draw, 0.01, 0.5)
        plan.kept &= ~((plan.time > start) & (plan.time < end))
    plan.kept &= draw.random(plan.time.size) > 0.01


TROUBLES: dict[str, Callable[[Draw, _Plan], None]] = {
    "lumps": _lumps,
    "drift": _drift,
    "change": _change,
    "delay": _delay,
    "force zero": _force_zero,
    "contact position": _contact_position,
    "breathing": _breathing,
    "sinking": _sinking,
    "tremor": _tremor,
    "coloured noise": _coloured,
    "coarse readings": _coarse,
    "gaps": _gaps,
    "zero drift": _zero_drift,
}
"""By name: what is wrong, drawn and put into the plan of a contact."""


def drawn_contact(
    troubles: tuple[str, ...],
    seed: int,
    between: Between | None = None,
    acquisition: Acquisition = USUAL,
) -> DrawnContact:
    """The contact that a seed draws with some troubles; without them it is otherwise the same.

    Args:
        troubles: of `TROUBLES`.
        seed: of everything.
        between: what lies between tissue and readings, if anything does.
        acquisition: how it is read. Readings that are `shaken` are of the same tissue and motion.

    Raises:
        KeyError: no such trouble.
    """
    draw = np.random.default_rng([seed, 777])
    motion = str(draw.choice(sorted(MOTIONS)))
    rate_hz = float(draw.choice(acquisition.rates_hz))
    time = np.arange(0.0, acquisition.duration_s, 1.0 / rate_hz)
    tool = MOTIONS[motion](draw, time, rate_hz)
    stiffness, exponent = log_uniform(draw, *STIFFNESS), float(draw.uniform(*EXPONENT))
    velocity_exponent = float(draw.uniform(*VELOCITY_EXPONENT))
    damping_share = log_uniform(draw, *DAMPING_SHARE)
    force_noise = log_uniform(draw, *(acquisition.force_noise_n or acquisition.force_noise))
    place_noise_mm = log_uniform(draw, *acquisition.displacement_noise_mm)
    white = draw.standard_normal((2, time.size))
    visits = np.empty((0, 2))
    if acquisition.visits:
        tool, visits = _with_visits(np.random.default_rng([seed, 781]), time, tool)
    nothing = np.zeros(time.size)
    plan = _Plan(time, tool, nothing.copy(), nothing, np.ones(time.size, np.bool_))
    for name in troubles:
        place = list(TROUBLES).index(name)
        TROUBLES[name](np.random.default_rng([seed, 778, place]), plan)
    # Between two readings of a slow sensor the tool goes on smoothly, and the tissue with it.
    way = CubicSpline(time, plan.tool - plan.surface)
    fastest = max(float(np.max(np.abs(way(time, 1)))), SLOWEST_FASTEST_MM_S)
    factor = np.exp(plan.log_factor)
    damping = stiffness * damping_share / fastest**velocity_exponent

    def law_at(when: FloatArray) -> FloatArray:
        velocity = way(when, 1)
        drag = damping * np.sign(velocity) * np.abs(velocity) ** velocity_exponent
        elastic = np.maximum(way(when), 0.0) ** exponent * np.interp(when, time, factor)
        # Tissue cannot pull.
        pushes: FloatArray = elastic * np.maximum(stiffness + drag, 0.0)
        return pushes

    largest = float(np.max(law_at(time)))
    stamps, tool = time, plan.tool
    if acquisition.shaken > 0.0:
        early = np.random.default_rng([seed, 782]).uniform(-1.0, 1.0, time.size)
        stamps = np.clip(time + early * acquisition.shaken / rate_hz, time[0], time[-1])
        tool = CubicSpline(time, plan.tool)(stamps)
    acting = law_at(np.clip(stamps - plan.delay_s, time[0], time[-1]))
    if between is not None:
        tool, acting = between(np.random.default_rng([seed, 780]), stamps, tool, acting)
    deviation_n = force_noise * largest
    if acquisition.force_noise_n:
        deviation_n = max(force_noise, FINEST * largest)
    read = acting + plan.zero_share * largest
    force = _read(read, deviation_n, white[0], plan.colour, plan.quanta[0])
    place_read = _read(tool, place_noise_mm, white[1], plan.colour, plan.quanta[1])
    parameters = np.column_stack(
        [
            stiffness * factor,
            damping * factor,
            np.full(time.size, exponent),
            np.full(time.size, velocity_exponent),
        ]
    )
    kept = plan.kept
    return DrawnContact(
        stamps[kept],
        (place_read + plan.position_mm)[kept],
        force[kept],
        parameters[kept],
        plan.changed_s,
        acting[kept],
        deviation_n,
        visits,
    )


def _read(
    value: FloatArray, deviation: float, white: FloatArray, colour: float, quantum: float
) -> FloatArray:
    """Readings of a sensor: with noise, first-order coloured if asked, in steps if asked."""
    noise = lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], white) if colour > 0.0 else white
    reading: FloatArray = value + deviation * noise
    if quantum > 0.0:
        step = quantum * deviation
        reading = np.round(reading / step) * step
    return reading
