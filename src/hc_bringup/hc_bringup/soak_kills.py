"""A soak in which nodes are killed: kill -9 of each in turn, and each is started again.

What is asked of it: the next estimates are those of before to 1 %, nothing is lost from the bag
but the last tenth of a second before a recorder was killed and what came while there was none, and
nobody else loses anything. A node is killed once the estimator has said for ten seconds that it has
its own settings again and its estimates are not late, and it keeps them until estimates have come
again: what changes over a kill is the kill's doing. On a busy machine that takes longer than 20 s.
"""

from __future__ import annotations

import dataclasses
import os
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hc_bringup.commands.run import with_parameters
from hc_bringup.paths import find_config
from hc_bringup.plan import RunPlan, load_plan
from hc_bringup.run_state import RunState
from hc_bringup.runner import Runner
from hc_bringup.soak import PARAMETERS, count_invalid, endless
from hc_bringup.soak_disturbers import ParameterStorm, Viewers
from hc_bringup.statistics import EstimateStatistics
from hc_logger.numbered_bags import numbered_bags
from hc_logger.reader import BagReader
from hc_logger.recording import read_recording
from hc_msgs_py.topics import NODE_ESTIMATOR, NODE_INDENTER, NODE_RECORDER

PERIOD_S = 20.0
STORM_S = (4.0, 10.0)
"""Of each period, its beginning and its end; the kill is at the beginning of the period."""
SETTLED_S = 9.5
"""Own settings before a kill: an estimator that has just begun anew still learns."""
LARGEST_LATENCY_S = 0.5
"""Later estimates are those of settings, or of a node, that are gone already."""
VICTIMS = (NODE_ESTIMATOR, NODE_RECORDER, NODE_INDENTER)
UNDER_WAY_NS = 300_000_000
"""After a kill estimates still come that were on their way; no node is back so soon."""
LARGEST_CHANGE = 0.01
LARGEST_LOSS_S = 0.1
LONGEST_ABSENCE_S = 2.0
"""Without estimates; nobody waits for the recorder."""


@dataclasses.dataclass
class Kill:
    """One kill and what came after it.

    Attributes:
        node: who was killed.
        at_ns: when, on the system clock.
        before: K, B, n, p of the last estimate before.
        back_after_s: until the next estimate; for the recorder, until the next message recorded.
        change: largest relative change of a parameter from before to the first estimate after.
        lost_s: what was not in the bag of what came before the kill of the recorder.
    """

    node: str
    at_ns: int
    before: dict[str, float]
    back_after_s: float = float("nan")
    change: float = float("nan")
    lost_s: float = float("nan")


@dataclasses.dataclass(frozen=True)
class KillReport:
    """What a soak with kills found.

    Attributes:
        duration_s: how long samples flowed.
        kills: how often each node was killed.
        respawns: how often a node was started again.
        back_after_s: median and maximum by node [s].
        change: largest change of a parameter over a kill, relative, by node.
        recorder_lost_s: the most that a killed recorder had not written of what came before [s].
        samples_lost: samples missing in the bags that no kill accounts for.
        invalid: estimates with a number that is not finite or a covariance that is none.
        reconfigurations: changes of parameters that the node took.
        viewers: command lines that looked at the run meanwhile, and ended roughly.
        worst: the kill after which a parameter changed most, the one with the longest absence, and
            the recorder's that lost most, for whoever looks for the reason.
    """

    duration_s: float
    kills: dict[str, int]
    respawns: int
    back_after_s: dict[str, dict[str, float]]
    change: dict[str, float]
    recorder_lost_s: float
    samples_lost: int
    invalid: int
    reconfigurations: int
    viewers: int
    worst: dict[str, dict[str, Any]]

    @property
    def passed(self) -> bool:
        """Whether nothing was lost beyond the bounds, and every node came back soon as it was."""
        return (
            not self.samples_lost
            and not self.invalid
            and self.respawns >= sum(self.kills.values())
            and all(change <= LARGEST_CHANGE for change in self.change.values())
            and all(
                times["max"] <= LONGEST_ABSENCE_S
                for name, times in self.back_after_s.items()
                if name != NODE_RECORDER
            )
            and not self.recorder_lost_s > LARGEST_LOSS_S
        )

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain data for --json."""
        return dataclasses.asdict(self)


def run_kills(
    minutes: float,
    *,
    config: str = "run",
    seed: int = 0,
    show: Callable[[RunState], None] = lambda _state: None,
) -> KillReport:
    """Run a configuration for a while, killing a node every 20 s, and judge what came of it.

    Args:
        minutes: how long.
        config: configuration with nodes indenter, estimator and recorder, as for `hc run`.
        seed: of the random reconfigurations and viewers.
        show: called about ten times a second with the state of the run.

    Raises:
        UserError: if the configuration cannot be run, or a node did not come back.
    """
    with tempfile.TemporaryDirectory(prefix="hc_soak_") as folder:
        bag = Path(folder) / "bag"
        plan = _plan(config, minutes, Path(folder), bag)
        with ParameterStorm(seed) as storm, Viewers(seed) as viewers:
            killer = _Killer()

            def look(state: RunState) -> None:
                running = state.phase == "running"
                if running:
                    viewers.look(state.elapsed_s)
                    killer.look(state, storm.settled_s)
                begin, end = STORM_S
                in_time = begin <= killer.since_s(state.elapsed_s) < end
                storm.active = running and in_time and not killer.waiting
                show(state)

            state = Runner(plan, look).run()
        samples_lost, invalid = _judge(bag, killer.kills)
    kills = killer.kills
    return KillReport(
        duration_s=state.elapsed_s,
        kills={name: sum(kill.node == name for kill in kills) for name in VICTIMS},
        respawns=state.respawns,
        back_after_s={
            name: {"p50": float(np.median(times)), "max": float(np.max(times))}
            for name in VICTIMS
            if (times := [kill.back_after_s for kill in kills if kill.node == name])
        },
        change={
            name: max(changes)
            for name in VICTIMS
            if (changes := [k.change for k in kills if k.node == name and k.change == k.change])
        },
        recorder_lost_s=max((k.lost_s for k in kills if k.node == NODE_RECORDER), default=0.0),
        samples_lost=samples_lost,
        invalid=invalid,
        reconfigurations=storm.taken,
        viewers=viewers.count,
        worst=_worst(kills),
    )


def _worst(kills: list[Kill]) -> dict[str, dict[str, Any]]:
    """Return the worst kill by each measure, as plain data."""
    result = {}
    for name in ("change", "back_after_s", "lost_s"):
        known = [kill for kill in kills if getattr(kill, name) == getattr(kill, name)]
        if known:
            worst = max(known, key=lambda kill: float(getattr(kill, name)))
            result[name] = dataclasses.asdict(worst)
    return result


def _plan(config: str, minutes: float, folder: Path, bag: Path) -> RunPlan:
    plan = dataclasses.replace(load_plan(find_config(config)), duration_s=60.0 * minutes)
    plan = with_parameters(plan, NODE_RECORDER, {"output": str(bag), "when_exists": "number"})
    plan = with_parameters(plan, NODE_INDENTER, {"scenario": str(endless(folder))})
    plan = with_parameters(
        plan,
        NODE_ESTIMATOR,
        {"state.folder": str(folder / "state"), "state.autosave_period": 0.1},
    )
    nodes = tuple(dataclasses.replace(node, respawn=True) for node in plan.nodes)
    return RunPlan(nodes, plan.duration_s)


class _Killer:
    """Kills the next node when its time has come, and watches the estimates come back.

    Attributes:
        kills: all so far.
    """

    def __init__(self) -> None:
        self.kills: list[Kill] = []
        self._last_s = 0.0
        self._estimates = 0
        self._waits: Kill | None = None

    @property
    def waiting(self) -> bool:
        """Whether no estimate has come yet after a kill."""
        return self._waits is not None

    def since_s(self, elapsed_s: float) -> float:
        """Return for how long nobody was killed."""
        return elapsed_s - self._last_s

    def look(self, state: RunState, settled_s: float) -> None:
        """Do what is due; call it often.

        Args:
            state: of the run.
            settled_s: for how long the estimator has had its own settings.
        """
        self._hear(state.statistics)
        if self._waits is not None or self.since_s(state.elapsed_s) < PERIOD_S:
            return
        late = (
            state.statistics.latest is None or state.statistics.latest.latency > LARGEST_LATENCY_S
        )
        if late or settled_s < SETTLED_S or state.elapsed_s > state.duration_s - PERIOD_S / 2:
            return
        name = VICTIMS[len(self.kills) % len(VICTIMS)]
        pid = state.pids.get(name)
        if pid is None:
            return  # it is just starting again
        kill = Kill(name, time.time_ns(), state.statistics.parameters())
        os.kill(pid, signal.SIGKILL)
        self.kills.append(kill)
        self._last_s = state.elapsed_s
        self._waits, self._estimates = kill, state.statistics.estimates

    def _hear(self, statistics: EstimateStatistics) -> None:
        """Take note of the first estimate after a kill."""
        kill = self._waits
        if kill is None:
            return
        if time.time_ns() - kill.at_ns < UNDER_WAY_NS:
            self._estimates = statistics.estimates
        elif statistics.estimates > self._estimates:
            after = statistics.parameters()
            if kill.node != NODE_RECORDER:
                kill.back_after_s = (time.time_ns() - kill.at_ns) * 1e-9
            kill.change = max(abs(after[n] / kill.before[n] - 1.0) for n in PARAMETERS)
            self._waits = None


def _judge(bag: Path, kills: list[Kill]) -> tuple[int, int]:
    """Return samples missing that no kill accounts for, and invalid estimates, over all bags."""
    missing = invalid = 0
    of_recorder = [kill for kill in kills if kill.node == NODE_RECORDER]
    for number, folder in enumerate(numbered_bags(bag)):
        recording = read_recording(folder)
        with BagReader(folder) as reader:
            first, last = reader.time_range() or (0, 0)
        if number:  # this recorder took the place of one that was killed
            of_recorder[number - 1].back_after_s = (first - of_recorder[number - 1].at_ns) * 1e-9
        if number < len(of_recorder):
            of_recorder[number].lost_s = max(0.0, (of_recorder[number].at_ns - last) * 1e-9)
        steps = np.diff(recording.sequence.astype(np.int64))
        missing += int((steps[steps > 1] - 1).sum())  # a step back is a rig that started again
        invalid += count_invalid(recording.estimates)
    return missing, invalid
