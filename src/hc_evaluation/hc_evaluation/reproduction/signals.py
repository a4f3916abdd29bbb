"""The data of an experiment for a seed: what the sensors read, and the truth behind it.

Two kinds. `hunt_crossley`: a prescribed motion on a tissue with constant parameters, white noise
that may jump (the papers' simulations). `rig`: a scenario of hc_sim_rig (the papers' recordings,
which are not public, and the teleoperation of paper C).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.contact.arrays import hunt_crossley_force
from hc_sim_rig import Rig

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Signal:
    """Readings and truth; arrays of shape (N,) unless said. Units: mm, mm/s, N, s."""

    time_s: FloatArray
    displacement_mm: FloatArray
    force_n: FloatArray
    true_displacement: FloatArray
    true_velocity: FloatArray
    true_force: FloatArray
    parameters: FloatArray  # true K, B, n, p, shape (4,); NaN where the plant has none
    force_noise_std: FloatArray
    displacement_noise_std: FloatArray
    jump_s: float = float("nan")  # when the noise jumps
    rig: Mapping[str, FloatArray] = field(default_factory=dict)  # signals of the teleoperation

    @property
    def time_step(self) -> float:
        """Time between two samples [s]."""
        return float(self.time_s[1] - self.time_s[0])


def _motion(settings: Mapping[str, Any], time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Displacement and velocity: offset + ramp + sines (amplitude, frequency, phase in rad)."""
    displacement = np.full_like(time, float(settings.get("offset_mm", 0.0)))
    velocity = np.full_like(time, float(settings.get("velocity_mm_s", 0.0)))
    displacement += velocity * time
    for amplitude, frequency, phase in settings.get("sines", ()):
        angle = 2.0 * np.pi * frequency * time + phase
        displacement += amplitude * np.sin(angle)
        velocity += amplitude * 2.0 * np.pi * frequency * np.cos(angle)
    return displacement, velocity


def _hunt_crossley(settings: Mapping[str, Any], seed: int) -> Signal:
    step = float(settings["time_step_s"])
    time: FloatArray = step * np.arange(1.0, round(float(settings["duration_s"]) / step) + 1.0)
    displacement, velocity = _motion(settings["motion"], time)
    tissue = settings["tissue"]
    parameters = np.array([float(tissue[name]) for name in ("K", "B", "n", "p")])
    force = hunt_crossley_force(displacement, velocity, parameters)
    noise = settings["noise"]
    force_std = np.full_like(time, float(noise["force_std_n"]))
    jump = float("nan")
    if "jump" in noise:
        jump = float(noise["jump"]["time_s"])
        force_std[time > jump] = float(noise["jump"]["force_std_n"])
    displacement_std = np.full_like(time, float(noise["displacement_std_mm"]))
    generator = np.random.Generator(np.random.PCG64(seed))
    return Signal(
        time,
        displacement + displacement_std * generator.standard_normal(time.size),
        force + force_std * generator.standard_normal(time.size),
        displacement,
        velocity,
        force,
        parameters,
        force_std,
        displacement_std,
        jump,
    )


def _from_rig(settings: Mapping[str, Any], seed: int) -> Signal:
    series = Rig(str(settings["scenario"]), seed).run(float(settings["duration_s"]))
    truth = series.truth
    noise = settings["noise"]
    extra = {
        "slave_position": np.asarray(series.slave.position_mm),
        "slave_velocity": np.asarray(series.slave.velocity_mm_s),
        "slave_effort": np.asarray(series.slave.effort_n),
        "master_position": np.asarray(series.master.position_mm),
        "master_effort": np.asarray(series.master.effort_n),
        "command": np.asarray(series.coupling.command_mm),
        "operator_force": np.asarray(series.coupling.operator_force_n),
        "feedback_force": np.asarray(series.coupling.feedback_force_n),
    }
    return Signal(
        series.time_s,
        series.displacement_mm,
        series.force_n,
        np.asarray(truth.displacement_mm),
        np.asarray(truth.velocity_mm_s),
        np.asarray(truth.force_n),
        np.asarray(truth.parameters[-1]),
        np.full(len(series), float(noise["force_std_n"])),
        np.full(len(series), float(noise["displacement_std_mm"])),
        rig=extra,
    )


def make_signal(settings: Mapping[str, Any], seed: int) -> Signal:
    """Make the data of a seed.

    Args:
        settings: the experiment's `signal` section.
        seed: seed of all its noise.

    Raises:
        ValueError: the kind is not known.
    """
    kind = settings["kind"]
    if kind == "hunt_crossley":
        return _hunt_crossley(settings, seed)
    if kind == "rig":
        return _from_rig(settings, seed)
    raise ValueError(f"signal.kind = {kind!r} is not one of hunt_crossley, rig")
