"""The live display of a run: a panel in a terminal, a line a second elsewhere."""

from __future__ import annotations

import math
import sys
import time
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from hc_bringup.runner import RunState
from hc_bringup.statistics import PARAMETERS, EstimateStatistics

SYMBOLS = {
    "stiffness": ("K", "N/mm^n"),
    "damping": ("B", "N(s/mm)^p/mm^n"),
    "displacement_exponent": ("n", ""),
    "velocity_exponent": ("p", ""),
}
_LINE_PERIOD_S = 1.0


class Display:
    """Shows a RunState on standard error. Use as a context manager."""

    def __init__(self, enabled: bool, *, with_latency: bool = True) -> None:
        """Prepare the display.

        Args:
            enabled: False shows nothing at all.
            with_latency: False where the stamps are not of the time of publication (a replay).
        """
        self._enabled = enabled
        self._with_latency = with_latency
        self._console = Console(stderr=True)
        self._live: Live | None = None
        self._last_line_at = 0.0
        self._rate = _RateMeter()
        self._told: dict[str, str] = {}

    def __enter__(self) -> Display:
        if self._enabled and self._console.is_terminal:
            self._live = Live(console=self._console, auto_refresh=False, transient=False)
            self._live.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._live is not None:
            self._live.__exit__(kind, error, traceback)

    def show(self, state: RunState) -> None:
        """Show the state; cheap to call often. What is wrong is told even if it is not enabled."""
        if self._live is None:
            self._tell_problems(state)
        if not self._enabled:
            return
        rate = self._rate.update(state.statistics.estimates)
        if self._live is not None:
            self._live.update(_panel(state, rate, self._with_latency), refresh=True)
            return
        now = time.monotonic()
        if now - self._last_line_at >= _LINE_PERIOD_S:
            self._last_line_at = now
            sys.stderr.write(_line(state, rate, self._with_latency) + "\n")
            sys.stderr.flush()

    def _tell_problems(self, state: RunState) -> None:
        """Write a line for each problem that is new."""
        for name, problem in state.problems.items():
            if self._told.get(name) != problem:
                sys.stderr.write(f"{name}: {problem}\n")
                sys.stderr.flush()
        self._told = dict(state.problems)


class _RateMeter:
    """Rate of a counter over about the last second."""

    def __init__(self) -> None:
        self._count = 0
        self._time = time.monotonic()
        self._rate = 0.0

    def update(self, count: int) -> float:
        now = time.monotonic()
        if now - self._time >= _LINE_PERIOD_S:
            self._rate = (count - self._count) / (now - self._time)
            self._count, self._time = count, now
        return self._rate


def _number(value: float, form: str) -> str:
    return "-" if math.isnan(value) else format(value, form)


def _lost(statistics: EstimateStatistics) -> str:
    return str(statistics.lost) if statistics.counts else "? (no counter in the samples)"


def _milliseconds(seconds: float) -> str:
    return "-" if math.isnan(seconds) else f"{1e3 * seconds:.2f} ms"


def _line(state: RunState, rate: float, with_latency: bool) -> str:
    if state.phase != "running":
        return state.phase
    statistics = state.statistics
    values, deviations = statistics.parameters(), statistics.parameters_std()
    parameters = " ".join(
        f"{SYMBOLS[name][0]}={_number(values[name], '.4g')}±{_number(deviations[name], '.2g')}"
        for name in PARAMETERS
    )
    latency = ""
    if with_latency:
        latency = f"p99 {_milliseconds(statistics.latency.quantile(0.99))}  "
    return (
        f"{state.elapsed_s:6.1f} s  {rate:6.0f} Hz  lost {_lost(statistics)}  "
        f"{latency}{parameters}  "
        f"force error {_number(1e3 * statistics.recent_force_rmse_n, '.3g')} mN"
    )


def _panel(state: RunState, rate: float, with_latency: bool) -> Any:
    statistics = state.statistics
    grid = Table.grid(padding=(0, 2))
    for _ in range(4):
        grid.add_column(justify="right")
    values, deviations = statistics.parameters(), statistics.parameters_std()
    known = statistics.identifiability()
    grid.add_row("", "estimate", "± 1 sd", "known from data")
    for name in PARAMETERS:
        symbol, unit = SYMBOLS[name]
        grid.add_row(
            f"[bold]{symbol}[/bold] {unit}",
            _number(values[name], ".5g"),
            _number(deviations[name], ".2g"),
            "-" if math.isnan(known[name]) else f"{100 * known[name]:.0f} %",
        )
    footer = Table.grid(padding=(0, 2))
    figures = [
        f"{rate:.0f} Hz",
        f"lost {_lost(statistics)}",
        f"rejected {sum(statistics.rejected.values())}",
        f"force error {_number(1e3 * statistics.recent_force_rmse_n, '.3g')} mN",
    ]
    if with_latency:
        figures.append(
            f"latency p50 {_milliseconds(statistics.latency.quantile(0.5))}"
            f"  p99 {_milliseconds(statistics.latency.quantile(0.99))}"
        )
    footer.add_row(*figures)
    flags = []
    if statistics.latest is not None:
        flags.append("in contact" if statistics.latest.contact else "free motion")
        if statistics.latest.model_mismatch:
            flags.append("[yellow]contact law does not fit[/yellow]")
    flags.append(f"changes {statistics.changes}")
    if state.respawns:
        flags.append(f"[yellow]started again {state.respawns}[/yellow]")
    flags += [f"{name} {percent:.0f} %" for name, percent in state.cpu_percent.items()]
    footer.add_row(*flags[:5])
    if len(flags) > 5:
        footer.add_row(*flags[5:])
    body = Table.grid()
    body.add_row(grid)
    body.add_row(footer)
    for name, problem in state.problems.items():
        body.add_row(Text(f"{name}: {problem}", style="bold red"))
    until = f" of {state.duration_s:.0f}" if state.duration_s else ""
    title = f"hc: {state.phase}  {state.elapsed_s:.1f}{until} s"
    return Panel(body, title=title, title_align="left", expand=False)
