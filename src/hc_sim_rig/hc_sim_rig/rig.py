"""The rig: a scenario that runs, one sample or many at a time.

Free of ROS and of clocks: time is the number of samples divided by the rate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.engine import advance
from hc_sim_rig.layout import (
    CONFIG,
    DRAWS,
    OUT_COLUMNS,
    OUT_CONTACT,
    OUT_DISPLACEMENT,
    OUT_FORCE,
    OUT_MASTER,
    OUT_PARAMETERS,
    OUT_SLAVE,
    OUT_TIME,
    OUT_TRUE_DISPLACEMENT,
    OUT_TRUE_FORCE,
    OUT_TRUE_VELOCITY,
    STATE,
    TUNABLES,
    TUNE_AMPLITUDE,
    TUNE_DAMPING,
    TUNE_DISPLACEMENT_EXPONENT,
    TUNE_DISPLACEMENT_NOISE,
    TUNE_FORCE_NOISE,
    TUNE_SPEED,
    TUNE_STIFFNESS,
    TUNE_TARGET,
    TUNE_VALUE,
    TUNE_VELOCITY_EXPONENT,
)
from hc_sim_rig.scenario import Scenario, load_scenario
from hc_sim_rig.schema import ScenarioError

Array = NDArray[np.float64]

BLOCK = 512
"""Rows of random draws made at a time; the numbers do not depend on it."""

GLIDE_SHARE = 5.83
"""A critically damped response is 98 % there after 5.83 / natural frequency."""


class Truth(NamedTuple):
    """What no sensor tells. Scalars of a sample, or arrays with a leading sample axis."""

    displacement_mm: Any
    velocity_mm_s: Any
    force_n: Any
    parameters: Any
    """(4,) or (N, 4): K, B, n, p; NaN where the plant has no such parameter."""
    contact: Any


class Joint(NamedTuple):
    """Motion of the master or the slave in the slave's units [mm, mm/s, N]."""

    position_mm: Any
    velocity_mm_s: Any
    effort_n: Any


class RigSample(NamedTuple):
    """One sample: what the sensors read, and the truth behind it."""

    time_s: float
    sequence: int
    displacement_mm: float
    force_n: float
    truth: Truth
    master: Joint
    slave: Joint


@dataclass(frozen=True)
class RigSeries:
    """Many samples: the fields of RigSample as arrays with a leading sample axis."""

    time_s: Array
    sequence: NDArray[np.int64]
    displacement_mm: Array
    force_n: Array
    truth: Truth
    master: Joint
    slave: Joint

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.time_s)


class Setting(NamedTuple):
    """A setting that may change while the rig runs."""

    row: int
    minimum: float
    maximum: float
    unit: str
    about: str


SETTINGS: Mapping[str, Setting] = {
    "speed": Setting(TUNE_SPEED, 0.0, 10.0, "1", "pace of the motion; 0 stands still"),
    "amplitude": Setting(TUNE_AMPLITUDE, 0.0, 10.0, "1", "scale of the motion"),
    "stiffness": Setting(TUNE_STIFFNESS, 0.0, 1e6, "N/mm^n", "tissue parameter K"),
    "damping": Setting(TUNE_DAMPING, 0.0, 1e6, "N (s/mm)^p / mm^n", "tissue parameter B"),
    "displacement_exponent": Setting(
        TUNE_DISPLACEMENT_EXPONENT, 0.2, 6.0, "1", "tissue parameter n"
    ),
    "velocity_exponent": Setting(TUNE_VELOCITY_EXPONENT, 0.1, 3.0, "1", "tissue parameter p"),
    "displacement_noise_std_mm": Setting(
        TUNE_DISPLACEMENT_NOISE, 0.0, 1e3, "mm", "noise of the displacement sensor"
    ),
    "force_noise_std_n": Setting(TUNE_FORCE_NOISE, 0.0, 1e3, "N", "noise of the force sensor"),
}


class Rig:
    """A scenario that runs."""

    def __init__(self, scenario: Scenario | str, seed: int | None = None) -> None:
        """Set the rig up at the scenario's beginning.

        Args:
            scenario: a scenario, or what load_scenario takes.
            seed: seed of all random draws; None takes the scenario's.

        Raises:
            ScenarioError: if the scenario cannot be loaded, or the seed is negative.
        """
        self.scenario = load_scenario(scenario) if isinstance(scenario, str) else scenario
        self.seed = self.scenario.seed if seed is None else int(seed)
        if self.seed < 0:
            raise ScenarioError(f"seed is {self.seed}, must be >= 0")
        self.rate_hz = self.scenario.rate_hz
        self._config = np.zeros(1, CONFIG)
        self._row = np.empty((1, OUT_COLUMNS))
        self._profile = self.scenario.drive.motion.profile()
        config = self._config[0]
        config["rate"] = self.rate_hz
        if self.scenario.transition_time_s > 0.0:
            config["transition_rate"] = GLIDE_SHARE / self.scenario.transition_time_s
        config["surface"] = self.scenario.tissue.surface_mm
        config["offset"] = self._profile.offset
        if self.scenario.at_end == "loop":
            config["loop_time"] = self.scenario.duration_s
        self.reset()

    def reset(self) -> None:
        """Go back to the beginning: same scenario, same seed, same numbers."""
        self._state = np.zeros(1, STATE)
        self._tunables = np.zeros((TUNABLES, 3))
        tissue, sensors = self.scenario.tissue, self.scenario.sensors
        start = {
            TUNE_SPEED: 1.0,
            TUNE_AMPLITUDE: 1.0,
            TUNE_STIFFNESS: tissue.stiffness,
            TUNE_DAMPING: tissue.damping,
            TUNE_DISPLACEMENT_EXPONENT: tissue.displacement_exponent,
            TUNE_VELOCITY_EXPONENT: tissue.velocity_exponent,
            TUNE_DISPLACEMENT_NOISE: sensors.displacement.noise_std_mm,
            TUNE_FORCE_NOISE: sensors.force.noise_std_n,
        }
        for index, value in start.items():
            self._tunables[index, TUNE_VALUE] = value
            self._tunables[index, TUNE_TARGET] = value
        children = np.random.SeedSequence(self.seed).spawn(DRAWS)
        self._generators = [np.random.Generator(np.random.PCG64(child)) for child in children]
        self._draws = np.empty((BLOCK, DRAWS))
        self._state[0]["draw"] = BLOCK

    @property
    def sequence(self) -> int:
        """Sequence number of the next sample."""
        return int(self._state[0]["tick"])

    @property
    def time_s(self) -> float:
        """Time of the next sample [s]."""
        return self.sequence / self.rate_hz

    @property
    def finished(self) -> bool:
        """Whether the scenario's duration is over (never, if it loops)."""
        return self.scenario.at_end == "stop" and self.sequence >= self.samples_in(
            self.scenario.duration_s
        )

    def samples_in(self, duration_s: float) -> int:
        """Number of samples in a duration [s]."""
        return round(duration_s * self.rate_hz)

    def settings(self) -> dict[str, float]:
        """Targets of the settings that may change while the rig runs, by name."""
        return {
            name: float(self._tunables[setting.row, TUNE_TARGET])
            for name, setting in SETTINGS.items()
        }

    def check(self, **settings: float) -> None:
        """Check new values of settings.

        Args:
            **settings: values by name (SETTINGS).

        Raises:
            ScenarioError: names the setting, its value and what is allowed.
        """
        for name, value in settings.items():
            if name not in SETTINGS:
                raise ScenarioError(f"no setting {name!r}; known: {', '.join(SETTINGS)}")
            limits = SETTINGS[name]
            if not limits.minimum <= value <= limits.maximum:
                raise ScenarioError(
                    f"{name} is {value:g}, must be in [{limits.minimum:g}, {limits.maximum:g}] "
                    f"{limits.unit}"
                )

    def tune(self, **settings: float) -> None:
        """Let settings glide to new values, within about the scenario's transition_time_s.

        Args:
            **settings: new values by name (SETTINGS).

        Raises:
            ScenarioError: as `check`; nothing changes then.
        """
        self.check(**settings)
        for name, value in settings.items():
            self._tunables[SETTINGS[name].row, TUNE_TARGET] = value

    def start_with(self, **settings: float) -> None:
        """Set settings at once, for use before the first sample.

        Args:
            **settings: new values by name (SETTINGS).

        Raises:
            ScenarioError: as `check`; nothing changes then.
        """
        self.check(**settings)
        for name, value in settings.items():
            self._tunables[SETTINGS[name].row] = (value, 0.0, value)

    def warm_up(self) -> None:
        """Compile the rig's loop, or load it from the cache; changes nothing."""
        other = Rig(self.scenario, self.seed)
        other.step()

    def step(self) -> RigSample:
        """Take one sample and move on."""
        sequence = self.sequence
        self._advance(self._row)
        values = self._row[0].tolist()
        return RigSample(
            values[OUT_TIME],
            sequence,
            values[OUT_DISPLACEMENT],
            values[OUT_FORCE],
            Truth(
                values[OUT_TRUE_DISPLACEMENT],
                values[OUT_TRUE_VELOCITY],
                values[OUT_TRUE_FORCE],
                self._row[0, OUT_PARAMETERS : OUT_PARAMETERS + 4].copy(),
                values[OUT_CONTACT] > 0.0,
            ),
            Joint(*values[OUT_MASTER : OUT_MASTER + 3]),
            Joint(*values[OUT_SLAVE : OUT_SLAVE + 3]),
        )

    def run(self, duration_s: float | None = None) -> RigSeries:
        """Take the samples of a duration, as fast as the machine can: the same numbers as step().

        Args:
            duration_s: how long [s]; None takes what is left of the scenario's duration.

        Raises:
            ScenarioError: if the duration is negative or not finite.
        """
        if duration_s is None:
            count = max(0, self.samples_in(self.scenario.duration_s) - self.sequence)
        elif not 0.0 <= duration_s < 1e9:
            raise ScenarioError(f"duration_s is {duration_s:g}, must be in [0, 1e9) s")
        else:
            count = self.samples_in(duration_s)
        first = self.sequence
        out = np.empty((count, OUT_COLUMNS))
        self._advance(out)
        columns = np.ascontiguousarray(out.T)
        return RigSeries(
            columns[OUT_TIME],
            np.arange(first, first + count),
            columns[OUT_DISPLACEMENT],
            columns[OUT_FORCE],
            Truth(
                columns[OUT_TRUE_DISPLACEMENT],
                columns[OUT_TRUE_VELOCITY],
                columns[OUT_TRUE_FORCE],
                np.ascontiguousarray(out[:, OUT_PARAMETERS : OUT_PARAMETERS + 4]),
                columns[OUT_CONTACT] > 0.0,
            ),
            Joint(*columns[OUT_MASTER : OUT_MASTER + 3]),
            Joint(*columns[OUT_SLAVE : OUT_SLAVE + 3]),
        )

    def _advance(self, out: Array) -> None:
        """Fill the rows of `out`, making random draws as they run out."""
        done = 0
        while done < len(out):
            row = int(self._state[0]["draw"])
            if row == BLOCK:
                self._draw()
                row = 0
            count = min(len(out) - done, BLOCK - row)
            advance(
                self._config,
                self._state,
                self._tunables,
                self._profile.segments,
                self._profile.sines,
                self._draws,
                out[done : done + count],
            )
            done += count

    def _draw(self) -> None:
        """Fill the block of random draws, one generator per column."""
        for column, generator in enumerate(self._generators):
            self._draws[:, column] = generator.standard_normal(BLOCK)
        self._state[0]["draw"] = 0


__all__ = [
    "SETTINGS",
    "Joint",
    "Rig",
    "RigSample",
    "RigSeries",
    "Setting",
    "Truth",
]
