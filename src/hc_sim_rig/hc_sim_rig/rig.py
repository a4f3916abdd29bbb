"""The rig: a scenario that runs, one sample or many at a time.

Free of ROS and of clocks: time is the number of samples divided by the rate.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator import DEFAULT_FILTER, Estimator, create_estimator
from hc_sim_rig.assembly import (
    SIDES,
    configuration,
    constants,
    first_memory,
    first_state,
    first_tunables,
    variates,
)
from hc_sim_rig.drives import Teleoperation
from hc_sim_rig.engine import advance
from hc_sim_rig.layout import (
    DRAWS,
    OUT_COLUMNS,
    OUT_DISPLACEMENT,
    OUT_FORCE,
    OUT_TIME,
    PACKETS_LOST,
    PACKETS_OVERTAKEN,
    TUNE_TARGET,
)
from hc_sim_rig.records import RigSample, RigSeries, sample_from_row, series_from_rows
from hc_sim_rig.scenario import Scenario, load_scenario
from hc_sim_rig.schema import ScenarioError
from hc_sim_rig.settings import check_settings, settings_of

Array = NDArray[np.float64]

BLOCK = 512
"""Rows of random draws made at a time; the numbers do not depend on it."""


FARTHEST = 1e6
"""[mm, mm/s, rad, rad/s] A moving state beyond this is a loop that has run away."""


class RigDivergedError(ScenarioError):
    """The simulated loop is unstable and has run away: one line that says when."""


class LinkReport(NamedTuple):
    """Packets of one direction that did not count."""

    lost: int
    overtaken: int


class Rig:
    """A scenario that runs."""

    def __init__(
        self, scenario: Scenario | str | Path, seed: int | None = None, side: str = "both"
    ) -> None:
        """Set the rig up at the scenario's beginning.

        Args:
            scenario: a scenario, or what load_scenario takes.
            seed: seed of all random draws; None takes the scenario's.
            side: "both"; or the "master" or "slave" of a teleoperation alone, to be fed with what
                comes from the other side (receive) through a channel that is not simulated.

        Raises:
            ScenarioError: if the scenario cannot be loaded, its estimator cannot be made, or the
                seed is negative, or a scenario without master and slave is to be split.
        """
        self.scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
        self.seed = self.scenario.seed if seed is None else int(seed)
        if self.seed < 0:
            raise ScenarioError(f"seed is {self.seed}, must be >= 0")
        self.rate_hz = self.scenario.rate_hz
        self.side = side
        if side not in SIDES:
            raise ScenarioError(f"side is {side!r}, must be one of {', '.join(SIDES)}")
        if side != "both" and not isinstance(self.scenario.drive, Teleoperation):
            raise ScenarioError(
                f"side is {side}, but scenario {self.scenario.name} has no master and slave"
            )
        self._config = configuration(self.scenario, side)
        self._constants = constants(self.scenario)
        self._row = np.empty((1, OUT_COLUMNS))
        self._estimator = self._make_estimator()
        self.reset()

    def _make_estimator(self) -> Estimator | None:
        """The estimator in the loop, if a controller uses one."""
        drive = self.scenario.drive
        if not isinstance(drive, Teleoperation) or not drive.signals.uses_estimator():
            return None
        if self.side == "master":
            return None
        try:
            return create_estimator(**{"filter": DEFAULT_FILTER, **drive.signals.estimator})
        except (TypeError, ValueError) as error:
            raise ScenarioError(f"drive.signals.estimator: {error}") from None

    def reset(self) -> None:
        """Go back to the beginning: same scenario, same seed, same numbers."""
        self._state = first_state()
        self._tunables = first_tunables(self.scenario)
        self._memory = first_memory(self.scenario)
        self._variates = variates(self.scenario)
        children = np.random.SeedSequence(self.seed).spawn(DRAWS)
        self._generators = [np.random.Generator(np.random.PCG64(child)) for child in children]
        self._draws = np.empty((BLOCK, DRAWS))
        self._state[0]["draw"] = BLOCK
        if self._estimator is not None:
            self._estimator.reset()

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

    def link_reports(self) -> tuple[LinkReport, LinkReport]:
        """Packets lost and overtaken so far, forward (master to slave) and backward."""
        forward, backward = (
            LinkReport(int(row[PACKETS_LOST]), int(row[PACKETS_OVERTAKEN]))
            for row in self._memory.packets
        )
        return forward, backward

    def settings(self) -> dict[str, float]:
        """Targets of the settings that may change while the rig runs, by name."""
        return {
            name: float(self._tunables[setting.row, TUNE_TARGET])
            for name, setting in settings_of(self.scenario).items()
        }

    def check(self, **settings: float) -> None:
        """Check new values of settings.

        Raises:
            ScenarioError: names the setting, its value and what is allowed.
        """
        check_settings(self.scenario, settings)

    def tune(self, **settings: float) -> None:
        """Let settings glide to new values, within about the scenario's transition_time_s.

        Args:
            **settings: new values by name (settings.py).

        Raises:
            ScenarioError: as `check`; nothing changes then.
        """
        self.check(**settings)
        known = settings_of(self.scenario)
        for name, value in settings.items():
            self._tunables[known[name].row, TUNE_TARGET] = value

    def start_with(self, **settings: float) -> None:
        """Set settings at once, for use before the first sample.

        Args:
            **settings: new values by name (settings.py).

        Raises:
            ScenarioError: as `check`; nothing changes then.
        """
        self.check(**settings)
        known = settings_of(self.scenario)
        for name, value in settings.items():
            self._tunables[known[name].row] = (value, 0.0, value)

    def warm_up(self) -> None:
        """Compile the rig's loop, or load it from the cache; changes nothing here."""
        Rig(self.scenario, self.seed, self.side).step()

    def receive(self, value: float) -> None:
        """Take what the other side sends: the master's position [mm], or the contact force [N].

        Only for a rig with one side; it holds from the next sample on.
        """
        self._state[0]["received_command" if self.side == "slave" else "received_force"] = value

    def step(self) -> RigSample:
        """Take one sample and move on.

        Raises:
            RigDivergedError: if an unstable loop has run away.
        """
        sequence = self.sequence
        self._advance(self._row)
        return sample_from_row(self._row[0], sequence)

    def run(self, duration_s: float | None = None) -> RigSeries:
        """Take the samples of a duration, as fast as the machine can: the same numbers as step().

        Args:
            duration_s: how long [s]; None takes what is left of the scenario's duration.

        Raises:
            ScenarioError: if the duration is negative or not finite.
            RigDivergedError: if an unstable loop has run away.
        """
        if duration_s is None:
            count = max(0, self.samples_in(self.scenario.duration_s) - self.sequence)
        elif not 0.0 <= duration_s < 1e9:
            raise ScenarioError(f"duration_s is {duration_s:g}, must be in [0, 1e9) s")
        else:
            count = self.samples_in(duration_s)
        first = self.sequence
        return series_from_rows(self.rows(count), first)

    def rows(self, count: int) -> Array:
        """Take samples as they come out of the compiled rig: the same numbers as step().

        Args:
            count: how many.

        Returns:
            A row each, shape (count, OUT_COLUMNS); layout.py names the columns.

        Raises:
            RigDivergedError: if an unstable loop has run away.
        """
        out = np.empty((count, OUT_COLUMNS))
        self._advance(out)
        return out

    def _advance(self, out: Array) -> None:
        """Fill the rows of `out`, making random draws as they run out."""
        done = 0
        while done < len(out):
            row = int(self._state[0]["draw"])
            if row == BLOCK:
                self._draw()
                row = 0
            count = min(len(out) - done, BLOCK - row)
            if self._estimator is not None:  # it closes the loop at every sample
                count = 1
            part = out[done : done + count]
            advance(
                self._config,
                self._state,
                self._tunables,
                *self._constants,
                *self._memory,
                self._draws,
                part,
            )
            if self._estimator is not None:
                self._estimate(self._estimator, part[0])
            done += count
            if not np.abs(self._memory.y).max() < FARTHEST:  # also when it is not a number
                raise RigDivergedError(
                    f"scenario {self.scenario.name} has run away before {self.time_s:g} s: its "
                    "loop is unstable (less operator force, delay or feedback_gain may help)"
                )

    def _estimate(self, estimator: Estimator, line: Array) -> None:
        """Give a sample to the estimator in the loop, and its answer to the controllers.

        It arrives at the next sample: a period of computing time, as on a real robot.
        """
        estimate = estimator.step(line[OUT_TIME], line[OUT_DISPLACEMENT], line[OUT_FORCE])
        state = self._state[0]
        state["estimated_force"] = estimate.force_reconstructed
        state["estimated_position"] = estimate.displacement + self._config[0]["surface"]
        state["estimated_velocity"] = estimate.velocity

    def _draw(self) -> None:
        """Fill the block of random draws, one generator per column."""
        for column, (draw, generator) in enumerate(
            zip(self._variates, self._generators, strict=True)
        ):
            self._draws[:, column] = draw(generator, BLOCK)
        self._state[0]["draw"] = 0
