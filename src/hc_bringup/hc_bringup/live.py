"""The live display of a run: a panel in a terminal, lines elsewhere.

Those are one a second while estimates come, one every few seconds where only the load is known, and
one for each step on the way there and back.
"""

from __future__ import annotations

import math
import sys
import time
from types import TracebackType
from typing import Final

from rich.console import Console
from rich.live import Live

from hc_bringup import heartbeat
from hc_bringup.explanation import BackgroundExplainer
from hc_bringup.phrases import phrases, without_numbers
from hc_bringup.plain_stream import drawing_on
from hc_bringup.run_state import DONE, RUNNING, RunState
from hc_bringup.statistics import PARAMETERS
from hc_bringup.terminal.keys import CHOICES, Keys
from hc_bringup.terminal.numbers import engineering
from hc_bringup.terminal.panel import PanelPainter
from hc_bringup.terminal.view import NO_SAMPLES, PanelHistory, PanelView
from hc_estimator.stream.readings import MEANINGS, Check
from hc_estimator.stream.vocabulary import STARTED_AFRESH
from hc_msgs_py.diagnostics import number_said
from hc_msgs_py.units import METRE_IN_MM

SYMBOLS: Final = {
    "stiffness": ("K", "N/mm^n"),
    "damping": ("B", "N(s/mm)^p/mm^n"),
    "displacement_exponent": ("n", ""),
    "velocity_exponent": ("p", ""),
}
_LINE_PERIOD_S: Final = 1.0
_LOAD_PERIOD_S: Final = 5.0
"""Between two lines of a run whose estimates somebody else hears: nothing in them is urgent."""
_REASON_WITHIN_S: Final = 1.6
"""So long a silent run is waited with, for the estimator to say why."""


class Display:
    """Shows a RunState on standard error. Use as a context manager."""

    def __init__(
        self,
        enabled: bool,
        *,
        with_latency: bool = True,
        scenario: str = "",
        with_keys: bool = True,
        with_estimates: bool = True,
    ) -> None:
        """Prepare the display.

        Args:
            enabled: False shows nothing at all.
            with_latency: False where the stamps are not of the time of publication (a replay).
            scenario: of the rig, for the title.
            with_keys: False where somebody else reads the terminal's keys.
            with_estimates: False where the run leaves the estimates to others; what they say is
                then not known here.
        """
        self._with_estimates = with_estimates
        self._enabled = enabled
        self._with_latency = with_latency
        self._scenario = scenario
        self._console = Console(file=drawing_on(sys.stderr))
        self._live: Live | None = None
        self._keys: Keys | None = Keys() if with_keys else None
        self._keys_for = 0  # number of the estimator
        self._painter = PanelPainter()
        self._history = PanelHistory()
        self._rate = _RateMeter()
        self._explainer = BackgroundExplainer()
        self._last_line_at = 0.0
        self._last_phase = ""
        self._page_announced = False
        self._reported: dict[str, set[str]] = {}
        self._doubted: dict[str, set[str]] = {}
        self._afresh: dict[str, str] = {}
        self._revived = 0
        self._silence_reported = False

    def __enter__(self) -> Display:
        if self._enabled and self._console.is_terminal:
            self._live = Live(console=self._console, auto_refresh=False, transient=False)
            self._live.__enter__()
            if self._keys is not None:
                self._keys.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._live is not None:
            if self._keys is not None:
                self._keys.__exit__(kind, error, traceback)
            self._live.__exit__(kind, error, traceback)

    @property
    def shows_truth(self) -> bool:
        """Whether the rig's truth is seen: in the panel of a terminal, and nowhere else."""
        return self._live is not None

    def show(self, state: RunState) -> None:
        """Show the state; cheap to call often. What is wrong is told even if it is not enabled."""
        self._tell_page(state)
        if self._live is None:
            self._tell_problems(state)
            self._tell_silence(state)
        if not self._enabled:
            heartbeat.doing("" if state.phase in (RUNNING, DONE) else state.phase)
            return
        if state.phase == RUNNING:  # while it ends, the source has stopped
            self._rate.update(state.statistics.estimates)
        if self._live is not None:
            heartbeat.nothing()  # the panel tells it
            if self._keys is not None:
                self._take_keys(state, self._keys.requests())
            view = self._view(state)
            self._live.update(self._painter.draw(view, self._console.width), refresh=True)
            return
        self._tell_line(state)

    def _take_keys(self, state: RunState, pressed: list[str]) -> None:
        """Ask for what was pressed, of the estimator that was chosen by then."""
        for name in pressed:
            if name not in CHOICES:
                state.requests.append((name, state.estimators[self._keys_for]))
            elif CHOICES.index(name) < len(state.estimators):
                self._keys_for = CHOICES.index(name)

    def _tell_line(self, state: RunState) -> None:
        """Write a line if one is due; that a step lasts, the heartbeat tells."""
        if state.phase != RUNNING and state.phase == self._last_phase:
            heartbeat.doing("" if state.phase == DONE else state.phase)
            return
        heartbeat.nothing()
        period_s = _LINE_PERIOD_S
        if state.phase == RUNNING and not self._with_estimates:
            period_s = _LOAD_PERIOD_S if self._last_phase == RUNNING else 0.0
        now = time.monotonic()
        if now - self._last_line_at < period_s:
            return
        self._last_line_at, self._last_phase = now, state.phase
        line = _line(state, self._rate, self._with_latency)
        if state.others and state.phase == RUNNING:
            line = "\n".join((f"{state.estimator}: {line}", *map(_line_of_other, state.others)))
        sys.stderr.write((line if self._with_estimates else _load_line(state)) + "\n")
        sys.stderr.flush()
        heartbeat.spoke()

    def _tell_page(self, state: RunState) -> None:
        """Say once where the live page is: above the panel, whole, so that it can be copied."""
        if self._page_announced or not state.page:
            return
        self._page_announced = True
        said = f"live page: {state.page}"
        if state.others:
            space = state.others[0].estimator.rpartition("/")[0]
            of_another = "hc dashboard" + (f" --namespace {space}" if space else "")
            said = f"live page of {state.estimator} (of another one: {of_another}): {state.page}"
        if self._live is not None:
            self._console.print(said, soft_wrap=True, highlight=False, markup=False)
        else:
            sys.stderr.write(f"{said}\n")
            sys.stderr.flush()

    def _tell_problems(self, state: RunState) -> None:
        """Write a line for each problem that is new, and not for one whose numbers change."""
        for line in state.revived[self._revived :]:
            sys.stderr.write(f"{state.elapsed_s:.1f} s: {line}\n")
            sys.stderr.flush()
        self._revived = len(state.revived)
        for name in set(self._reported) - set(state.problems):
            del self._reported[name]
        for name, problem in state.problems.items():
            said = self._reported.setdefault(name, set())
            parts = without_numbers(problem)
            if parts - said:
                sys.stderr.write(f"{name}: {problem}\n")
                sys.stderr.flush()
            said |= parts
        for one in (state, *state.others):
            whose = f"{one.estimator}: " if state.others else ""
            self._tell_afresh(one, whose)
            for name, sentence in one.suspicions.items():
                # Its numbers change with every look; a clock may be off in one way, then another.
                said = self._doubted.setdefault(whose + name, set())
                kind = without_numbers(sentence) if name.startswith(Check.CLOCK.value) else {""}
                if not kind <= said:
                    said |= kind
                    sys.stderr.write(f"{whose}{sentence} ({MEANINGS})\n")
                    sys.stderr.flush()

    def _tell_afresh(self, state: RunState, whose: str) -> None:
        """Say once why an estimator forgot what it knew: its numbers begin anew."""
        message = state.diagnostics.get(state.estimator, {}).get("message", "")
        for phrase in phrases(message):
            if phrase.endswith(STARTED_AFRESH) and self._afresh.get(state.estimator) != phrase:
                self._afresh[state.estimator] = phrase
                sys.stderr.write(f"{whose}{phrase}\n")
                sys.stderr.flush()

    def _tell_silence(self, state: RunState) -> None:
        """Write a line when the estimates come no more, and one when they come again.

        And one where none comes at all, once the estimator says why.
        """
        said = ""
        if not state.statistics.estimates and state.phase == RUNNING:
            if state.silent_reason and not self._silence_reported:
                self._silence_reported = True
                said = f"no estimate yet: {state.silent_reason} ({MEANINGS})"
        elif state.silent and not self._silence_reported:
            # Why, the estimator says once a second.
            if state.silent_reason or state.silent_s > _REASON_WITHIN_S:
                self._silence_reported = True
                said = f"silent for {state.silent_s:.1f} s: {state.silent_reason or NO_SAMPLES}"
        elif self._silence_reported and not state.silent and state.phase == RUNNING:
            self._silence_reported = False
            said = "samples come again"
        if said:
            sys.stderr.write(f"{state.elapsed_s:.1f} s: {said}\n")
            sys.stderr.flush()

    def _view(self, state: RunState) -> PanelView:
        statistics = state.statistics
        latest = statistics.latest
        if state.phase == RUNNING and latest is not None and not state.silent_s > 0.3:
            for i, name in enumerate(PARAMETERS):
                self._history.parameters[i].append(float(getattr(latest, name)))
            self._history.force.append(statistics.force_n)
            self._history.depth.append(latest.displacement * METRE_IN_MM)
        estimator = state.diagnostics.get(state.estimator, {})
        recorder = next((v for v in state.diagnostics.values() if "file_bytes" in v), {})
        latency = None
        if self._with_latency:
            latency = (statistics.latency.quantile_s(0.5), statistics.latency.quantile_s(0.99))
        mismatch = bool(latest is not None and latest.model_mismatch)
        return PanelView(
            phase=state.phase,
            elapsed_s=state.elapsed_s,
            duration_s=state.duration_s,
            with_estimates=self._with_estimates,
            rate_hz=0.0 if state.silent else self._rate.hz,
            silent_s=state.silent_s,
            silent_reason=state.silent_reason,
            lost=_lost(state),
            refused=sum(statistics.rejected.values()),
            latency_s=latency,
            parameters=list(statistics.parameters().values()),
            deviations=list(statistics.parameters_std().values()),
            known=list(statistics.identifiability().values()),
            truth=state.truth,
            force_n=statistics.force_n,
            depth_mm=math.nan if latest is None else latest.displacement * METRE_IN_MM,
            force_error_n=statistics.recent_force_rmse_n,
            contact=None if latest is None else bool(latest.contact),
            mismatch=mismatch,
            explanation=self._explainer.explain(statistics.motion, mismatch),
            hypothesis=None if latest is None else int(latest.hypothesis),
            several_hypotheses=latest is not None
            and sum(math.isfinite(s) for s in latest.hypothesis_scores) > 1,
            changes=statistics.changes,
            filter=estimator.get("filter", ""),
            scenario=state.estimator if state.others else self._scenario,
            bag=recorder.get("bag", "").rstrip("/").rpartition("/")[2],
            bag_bytes=number_said(recorder, "file_bytes", math.nan),
            bag_dropped=int(number_said(recorder, "dropped")),
            processor=dict(state.cpu_percent),
            problems=state.problems,
            suspicions=tuple(state.suspicions.values()),
            respawns=state.respawns,
            answer=state.answer,
            others=tuple(map(_line_of_other, state.others)),
            keys=self._keys.legend if self._keys is not None else (),
            keys_for=self._keys_for,
            estimators=tuple(state.estimators),
            history=self._history,
        )


class _RateMeter:
    """Rate of a counter over about the last second."""

    def __init__(self) -> None:
        self._count = 0
        self._time = time.monotonic()
        self.hz = 0.0

    def update(self, count: int) -> None:
        now = time.monotonic()
        if now - self._time >= _LINE_PERIOD_S:
            self.hz = (count - self._count) / (now - self._time)
            self._count, self._time = count, now


def _figure(value: float, form: str) -> str:
    return "-" if math.isnan(value) else format(value, form)


def _lost(state: RunState) -> str:
    """Return how many samples have no estimate; what only this display missed is none of them."""
    if state.statistics.mixed:
        return "? (estimates of several estimators)"
    if not state.statistics.counts:
        return "? (no counter in the samples)"
    missed = min(state.unseen, state.statistics.lost)
    beside = f" ({missed} not seen here)" if missed else ""
    return f"{state.statistics.lost - missed}{beside}"


def _load_line(state: RunState) -> str:
    """Return what is known of a run whose estimates somebody else hears."""
    if state.phase != "running":
        return state.phase
    use = ", ".join(f"{name} {percent:.0f} %" for name, percent in state.cpu_percent.items())
    return f"{state.elapsed_s:6.1f} of {state.duration_s:.0f} s  of a core: {use}"


def _parameters(state: RunState) -> str:
    statistics = state.statistics
    values, deviations = statistics.parameters(), statistics.parameters_std()
    return " ".join(
        f"{SYMBOLS[name][0]}={_figure(values[name], '.4g')}±{_figure(deviations[name], '.2g')}"
        for name in PARAMETERS
    )


def _line_of_other(state: RunState) -> str:
    """Return what a further estimator of the run says."""
    silent = f"silent for {state.silent_s:.1f} s " if state.silent else ""
    wanted = state.silent or not state.statistics.estimates  # at the end all sources have stopped
    reason = f"({state.silent_reason}) " if wanted and state.silent_reason else ""
    return f"{state.estimator}: {silent}{reason}lost {_lost(state)}  {_parameters(state)}"


def _line(state: RunState, rate: _RateMeter, with_latency: bool) -> str:
    if state.phase != "running":
        return state.phase
    statistics = state.statistics
    latency = ""
    if with_latency:
        latency = f"99 % {engineering(statistics.latency.quantile_s(0.99), 's')}  "
    silent = f"silent for {state.silent_s:.1f} s  " if state.silent else ""
    hz = 0.0 if state.silent else rate.hz
    return (
        f"{state.elapsed_s:6.1f} s  {hz:6.0f} Hz  {silent}lost {_lost(state)}  "
        f"{latency}{_parameters(state)}  "
        f"force error {engineering(statistics.recent_force_rmse_n, 'N')}"
    )
