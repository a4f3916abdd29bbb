"""Sensors as a scenario names them, and the random variates behind their noise."""

# ruff: noqa: RUF009 - the field functions of schema.py are made for defaults

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.schema import ScenarioError, Section, number, section, word

Variates = Callable[[np.random.Generator, int], NDArray[np.float64]]


@dataclass(frozen=True, kw_only=True)
class Noise(Section):
    """Distribution of a noise whose standard deviation stands beside it.

    gaussian: normal. gamma: shape alpha; positive, with the mean sqrt(alpha) standard deviations
    (paper C, Eq. 22: alpha 0.05 and standard deviation sqrt(0.002) have the mean 0.01).
    student_t: heavy tails, more than two degrees of freedom, scaled to the standard deviation.
    """

    distribution: str = word("gaussian", "gaussian", "gamma", "student_t")
    shape: float = number(1.0, above=0.0, maximum=1e4, about="alpha of gamma")
    degrees_of_freedom: float = number(4.0, above=2.0, maximum=1e4, about="of student_t")

    def variates(self) -> Variates:
        """Return what draws variates of standard deviation 1."""
        if self.distribution == "gamma":
            shape = self.shape
            return lambda generator, count: generator.gamma(shape, 1.0 / math.sqrt(shape), count)
        if self.distribution == "student_t":
            freedom = self.degrees_of_freedom
            scale = math.sqrt((freedom - 2.0) / freedom)
            return lambda generator, count: scale * generator.standard_t(freedom, count)
        return lambda generator, count: generator.standard_normal(count)


@dataclass(frozen=True, kw_only=True)
class Spikes(Section):
    """Single readings that are off by a fixed amount, either way."""

    probability: float = number(0.0, minimum=0.0, maximum=1.0, about="per sample")
    size: float = number(0.0, minimum=0.0, maximum=1e6, unit="mm or N")


@dataclass(frozen=True, kw_only=True)
class Dropouts(Section):
    """Times without a reading: the sensor repeats its last one, or gives NaN."""

    probability: float = number(0.0, minimum=0.0, maximum=1.0, about="to begin, per sample")
    mean_samples: float = number(1.0, minimum=1.0, maximum=1e6, about="mean length")
    reads: str = word("last", "last", "nan")


@dataclass(frozen=True, kw_only=True)
class Sensor(Section):
    """What both sensors have; lengths in mm, forces in N."""

    noise: Noise = section(Noise)
    bias: float = number(0.0, unit="mm or N")
    drift_per_s: float = number(0.0, about="steady", unit="mm/s or N/s")
    random_walk: float = number(0.0, minimum=0.0, maximum=1e3, about="std per root second")
    delay_s: float = number(0.0, minimum=0.0, maximum=0.2, about="it reads the past", unit="s")
    resolution: float = number(0.0, minimum=0.0, maximum=1e3, about="0 is continuous")
    range_minimum: float = number(-1e9, minimum=-1e9)
    range_maximum: float = number(1e9)
    spikes: Spikes = section(Spikes)
    dropouts: Dropouts = section(Dropouts)

    def __post_init__(self) -> None:
        """Check that the range is one."""
        super().__post_init__()
        if self.range_maximum <= self.range_minimum:
            raise ScenarioError(
                f"range_maximum is {self.range_maximum:g}, must be above range_minimum "
                f"{self.range_minimum:g}"
            )

    def constants(self) -> NDArray[np.float64]:
        """(SENSOR_COLUMNS,) constants in the order of layout.py."""
        return np.array(
            [
                self.bias,
                self.drift_per_s,
                self.random_walk,
                self.delay_s,
                self.resolution,
                self.range_minimum,
                self.range_maximum,
                self.spikes.probability,
                self.spikes.size,
                self.dropouts.probability,
                1.0 / self.dropouts.mean_samples,
                1.0 if self.dropouts.reads == "nan" else 0.0,
            ]
        )


@dataclass(frozen=True, kw_only=True)
class DisplacementSensor(Sensor):
    """How the displacement is read."""

    PRESETS: ClassVar[dict[str, dict[str, Any]]] = {
        # Linear magnetic motor with analogue Hall sensors (paper A, section 5.4): increments of
        # its maker's controller class, 6 um.
        "linear_motor_encoder": {"resolution": 0.006},
    }

    preset: str = word("none", "none", "linear_motor_encoder")
    noise_std_mm: float = number(0.0, minimum=0.0, maximum=1e3, unit="mm")


@dataclass(frozen=True, kw_only=True)
class ForceSensor(Sensor):
    """How the force is read."""

    PRESETS: ClassVar[dict[str, dict[str, Any]]] = {
        # Six-axis sensor of the Nano17 class (paper A, section 5.4): 1/320 N steps and 17 N along
        # its axis in the fine calibration; noise of about one step.
        "nano17": {
            "resolution": 0.003125,
            "range_minimum": -17.0,
            "range_maximum": 17.0,
            "noise_std_n": 0.003,
        },
    }

    preset: str = word("none", "none", "nano17")
    noise_std_n: float = number(0.0, minimum=0.0, maximum=1e3, unit="N")


@dataclass(frozen=True, kw_only=True)
class Sensors(Section):
    """Both sensors."""

    displacement: DisplacementSensor = section(DisplacementSensor)
    force: ForceSensor = section(ForceSensor)
