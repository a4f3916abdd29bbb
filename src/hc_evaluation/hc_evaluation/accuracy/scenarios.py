"""Simulated contacts with a known answer: a smooth motion, a tissue, a sampling rate, sensor noise.

The motion is a drift plus a sum of sines, so that displacement, velocity and acceleration are exact
at any instant and no integration error enters the comparison with the truth. The tissue follows the
unilateral Hunt-Crossley law, F = max(0, K d^n + B d^n sign(v)|v|^p), and can change abruptly; the
sensors add white Gaussian noise, whose level can change abruptly too.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hc_estimator.contact.arrays import hunt_crossley_force
from hc_evaluation.accuracy.presses import Presses
from hc_evaluation.accuracy.varying_tissue import Inclusion, Surface, Way, along_the_way

FloatArray = NDArray[np.float64]

SPRING_SHARE = 0.9  # of the elastic force that damping takes away on the fastest retreat, at most


@dataclass(frozen=True)
class Tissue:
    """Parameters of the Hunt-Crossley law in mm, mm/s and N."""

    stiffness: float
    damping: float
    displacement_exponent: float
    velocity_exponent: float

    def as_array(self) -> FloatArray:
        """Return K, B, n, p, shape (4,)."""
        return np.array(
            [self.stiffness, self.damping, self.displacement_exponent, self.velocity_exponent]
        )


def log_uniform(draw: np.random.Generator, low: float, high: float) -> float:
    """Draw a number between two positive ones, every ratio equally likely."""
    return float(np.exp(draw.uniform(np.log(low), np.log(high))))


def without_tension(tissue: Tissue, fastest_mm_s: float) -> Tissue:
    """The tissue with at most the damping at which a retreat does not lose contact.

    Args:
        tissue: any tissue.
        fastest_mm_s: speed of the fastest retreat.
    """
    largest = SPRING_SHARE * tissue.stiffness / fastest_mm_s**tissue.velocity_exponent
    return replace(tissue, damping=min(tissue.damping, largest))


@dataclass(frozen=True)
class Motion:
    """Displacement offset + drift t + sum of amplitude sin(2 pi frequency t + phase), in mm."""

    offset_mm: float
    # Amplitude [mm], frequency [Hz] and phase [rad] of each.
    sines: tuple[tuple[float, float, float], ...] = ()
    drift_mm_s: float = 0.0

    def evaluate(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return displacement [mm], velocity [mm/s], acceleration [mm/s^2], each shape (N,)."""
        displacement = self.offset_mm + self.drift_mm_s * time_s
        velocity = np.full_like(time_s, self.drift_mm_s)
        acceleration = np.zeros_like(time_s)
        for amplitude, frequency, phase in self.sines:
            rate = 2.0 * np.pi * frequency
            angle = rate * time_s + phase
            displacement = displacement + amplitude * np.sin(angle)
            velocity = velocity + amplitude * rate * np.cos(angle)
            acceleration = acceleration - amplitude * rate**2 * np.sin(angle)
        return displacement, velocity, acceleration


@dataclass(frozen=True)
class Scenario:
    """One simulated contact.

    Attributes:
        name: Name for tables and pictures.
        tissue: Tissue from the start.
        motion: Motion of the tool.
        rate_hz: Sampling rate.
        displacement_noise_mm: Standard deviation of the displacement sensor's white noise.
        force_noise_n: Standard deviation of the force sensor's white noise.
        duration_s: Length.
        changes: Instants [s] and the tissue from then on, in order of time.
        noise_jumps: Instants [s] and the factors on displacement and force noise from then on.
        force_delay_s: Time by which the force channel lags the displacement channel.
        force_zero_n: Constant error of the force channel.
        contact_position_mm: Displacement reading at which the tool touches the tissue.
        way: Sideways motion; None: the tool stays at one place.
        inclusions: What is felt along the way.
        surface: How the surface moves; added to contact_position_mm.
        presses: Motion of the tool in place of `motion`; None: that holds.
        note: What the scenario is for.
    """

    name: str
    tissue: Tissue
    motion: Motion
    rate_hz: float
    displacement_noise_mm: float
    force_noise_n: float
    duration_s: float = 10.0
    changes: tuple[tuple[float, Tissue], ...] = ()
    noise_jumps: tuple[tuple[float, float, float], ...] = ()
    force_delay_s: float = 0.0
    force_zero_n: float = 0.0
    contact_position_mm: float = 0.0
    way: Way | None = None
    inclusions: tuple[Inclusion, ...] = ()
    surface: Surface | None = None
    presses: Presses | None = None
    note: str = field(default="", compare=False)


@dataclass(frozen=True)
class SimulatedContact:
    """Sensor readings of one run beside the truth; arrays of shape (N,), parameters (N, 4).

    ``displacement`` and ``velocity`` are the penetration and its rate as the tissue feels them;
    the readings differ from them by noise, contact position (where the surface is), delay and zero.
    """

    time_s: FloatArray
    displacement_mm: FloatArray
    force_n: FloatArray
    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    force: FloatArray
    parameters: FloatArray
    displacement_noise_std: FloatArray
    force_noise_std: FloatArray
    contact_position: FloatArray


def tissue_over_time(scenario: Scenario, time_s: FloatArray) -> FloatArray:
    """True K, B, n, p at each instant, shape (N, 4)."""
    parameters = np.tile(scenario.tissue.as_array(), (time_s.size, 1))
    for instant, tissue in scenario.changes:
        parameters[time_s >= instant] = tissue.as_array()
    if scenario.way is None:
        return parameters
    return along_the_way(parameters, scenario.way.position(time_s), scenario.inclusions)


def penetration(
    scenario: Scenario, time_s: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Penetration [mm], its rate [mm/s], acceleration of the tool, contact position; each (N,)."""
    moves = scenario.presses if scenario.presses is not None else scenario.motion
    displacement, velocity, acceleration = moves.evaluate(time_s)
    if scenario.surface is None:
        return displacement, velocity, acceleration, np.zeros_like(time_s)
    position, rate = scenario.surface.evaluate(time_s)
    return displacement - position, velocity - rate, acceleration, position


def simulate(scenario: Scenario, seed: int, time_s: FloatArray | None = None) -> SimulatedContact:
    """Simulate one run; the same seed gives the same noise, whatever the tissue.

    Args:
        scenario: the contact.
        seed: of the noise.
        time_s: instants [s], shape (N,); None for even ones at the scenario's rate and duration.
    """
    if time_s is None:
        time_s = np.arange(round(scenario.duration_s * scenario.rate_hz) + 1) / scenario.rate_hz
    count = time_s.size
    displacement, velocity, acceleration, surface = penetration(scenario, time_s)
    delayed_time = time_s - scenario.force_delay_s
    delayed_displacement, delayed_velocity, _, _ = penetration(scenario, delayed_time)
    parameters = tissue_over_time(scenario, time_s)
    force = hunt_crossley_force(
        delayed_displacement, delayed_velocity, tissue_over_time(scenario, delayed_time)
    )
    displacement_noise = np.full(count, scenario.displacement_noise_mm)
    force_noise = np.full(count, scenario.force_noise_n)
    for instant, displacement_factor, force_factor in scenario.noise_jumps:
        displacement_noise[time_s >= instant] = scenario.displacement_noise_mm * displacement_factor
        force_noise[time_s >= instant] = scenario.force_noise_n * force_factor
    generator = np.random.default_rng(seed)
    contact_position = surface + scenario.contact_position_mm
    return SimulatedContact(
        time_s=time_s,
        displacement_mm=displacement
        + contact_position
        + displacement_noise * generator.standard_normal(count),
        force_n=force + scenario.force_zero_n + force_noise * generator.standard_normal(count),
        displacement=displacement,
        velocity=velocity,
        acceleration=acceleration,
        force=force,
        parameters=parameters,
        displacement_noise_std=displacement_noise,
        force_noise_std=force_noise,
        contact_position=contact_position,
    )
