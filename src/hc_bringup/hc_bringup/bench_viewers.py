"""What viewers of the live page cost: latency of the estimates and load with 0, 1 and 5 of them.

Each case is a run of its own: rig, estimator, recorder and live page, the viewers in a process
beside them. One of several viewers is stalled: it is connected and reads nothing.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from hc_bringup.commands.run import with_dashboard, with_parameters
from hc_bringup.errors import UserError
from hc_bringup.paths import find_config
from hc_bringup.plan import load_plan
from hc_bringup.run_state import RunState
from hc_bringup.runner import Runner
from hc_msgs_py.histogram import DurationHistogram

CASES: Final = ((0, 0), (1, 0), (4, 1))
"""Viewers that read, and that do not."""
SETTLING_S: Final = 10.0
"""Before the measurement: the nodes find each other, the page is imported, the viewers connect."""
CLOSE_TIMEOUT_S: Final = 10.0


class _Case:
    """Viewers of one run, opened once the page is there; measures after they are."""

    def __init__(self, reading: int, stalled: int, show: Callable[[RunState], None]) -> None:
        self._counts = reading, stalled
        self._show = show
        self._process: subprocess.Popen[str] | None = None
        self._measuring = False
        self._lost_before = 0
        self.latest: dict[str, float] = {}

    def look(self, state: RunState) -> None:
        """Follow a run."""
        if state.phase == "running" and state.page and self._process is None and any(self._counts):
            self._process = subprocess.Popen(
                [
                    *(sys.executable, "-m", "hc_bringup.viewer_load", state.page),
                    *map(str, self._counts),
                ],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        if not self._measuring and state.elapsed_s > SETTLING_S:
            self._measuring = True
            self._lost_before = state.statistics.lost
            state.statistics.latency = DurationHistogram()
        self._show(state)

    def close(self) -> None:
        """End the viewers and read what they say.

        Raises:
            UserError: if they could not look.
        """
        if self._process is None:
            if any(self._counts):
                raise UserError("the live page was not served: the viewers saw nothing")
            return
        out, _ = self._process.communicate(timeout=CLOSE_TIMEOUT_S)
        lines = out.splitlines()
        if self._process.returncode != 0 or len(lines) < 2:
            raise UserError("the viewers could not connect to the live page")
        self.latest = json.loads(lines[-1])

    def figures(self, state: RunState) -> dict[str, Any]:
        """Return what was measured."""
        latency = state.statistics.latency
        return {
            "estimates": latency.count,
            "lost": state.statistics.lost - self._lost_before,
            "latency_us": {
                "p50": 1e6 * latency.quantile_s(0.5),
                "p99": 1e6 * latency.quantile_s(0.99),
                "max": 1e6 * latency.maximum_s,
            },
            "cpu_percent": dict(state.cpu_percent),
            **self.latest,
        }


def bench_viewers(
    seconds: float, *, show: Callable[[RunState], None] = lambda _state: None
) -> dict[str, Any]:
    """Return latency, losses and load of a run with 0, 1 and 5 viewers, one of the five stalled.

    Args:
        seconds: how long each is measured.
        show: called about ten times a second with the state of the run.

    Raises:
        UserError: if the suite cannot be run, or the viewers cannot look.
    """
    figures = {}
    for reading, stalled in CASES:
        plan = dataclasses.replace(load_plan(find_config("run")), duration_s=SETTLING_S + seconds)
        plan = with_dashboard(plan, argparse.Namespace(control=False, allow_origin=[]))
        case = _Case(reading, stalled, show)
        with tempfile.TemporaryDirectory(prefix="hc_viewers_") as folder:
            plan = with_parameters(plan, "recorder", {"output": str(Path(folder) / "bag")})
            try:
                state = Runner(plan, case.look).run()
            finally:
                case.close()
        count = reading + stalled
        name = "1 viewer" if count == 1 else f"{count} viewers"
        name += f", {stalled} of them stalled" * bool(stalled)
        figures[name] = case.figures(state)
    return figures
