"""Runs a plan: starts the nodes, waits until they found each other, watches, stops, sums up.

Ctrl-C, SIGTERM and SIGHUP (a terminal that was closed) end a run in order.
"""

from __future__ import annotations

import math
import shutil
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from types import FrameType

from hc_bringup import byte_code, last_resort
from hc_bringup.domain_lock import DomainLock, domain_id
from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.monitor import NOT_STARTED, Monitor
from hc_bringup.plan import RunPlan
from hc_bringup.processes import NodeProcess, describe_exit, end_all
from hc_bringup.run_state import DONE, RUNNING, RunState
from hc_logger.session import INCOMPLETE
from hc_msgs_py.background import STARTING
from hc_msgs_py.diagnostics import number_said
from hc_msgs_py.topics import NODE_ESTIMATOR

POLL_S = 0.1
START_TIMEOUT_S = 240.0
"""Until a node offers ~/ready: the first start on a machine compiles the estimator."""
MATCH_TIMEOUT_S = 15.0
"""From then on, until it has found its partners."""
DRAIN_QUIET_S = 1.0
"""Without an estimate, and some still missing: they are lost."""
DRAIN_TIMEOUT_S = 10.0


class Runner:
    """One run of a plan. run() does it all and always leaves a clean machine."""

    def __init__(
        self,
        plan: RunPlan,
        show: Callable[[RunState], None],
        *,
        with_estimates: bool = True,
        with_truth: bool = False,
    ) -> None:
        """Prepare a run.

        Args:
            plan: what to run.
            show: called about ten times a second with the state of the run.
            with_estimates: False: leave the estimates to others; the statistics stay empty.
            with_truth: listen to the rig's truth, for who shows it: a message a sample more.
        """
        self._plan = plan
        self._with_estimates = with_estimates
        self._with_truth = with_truth
        self._show = show
        self._processes: list[NodeProcess] = []
        self._signal: int | None = None

    def run(self) -> RunState:
        """Run the plan to its end.

        Raises:
            UserError: if another run has the domain, if a node died, did not start or did not find
                its partners, or if a signal came before the first sample.
        """
        last_resort.disarm()  # from here on a signal ends the nodes first
        with DomainLock(domain_id()):
            return self._run()

    def _run(self) -> RunState:
        folder = Path(tempfile.mkdtemp(prefix="hc_run_"))
        ends = [signal.SIGINT, signal.SIGTERM]
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as it is under nohup
            ends.append(signal.SIGHUP)
        previous = {number: signal.signal(number, self._on_signal) for number in ends}
        try:
            with Monitor(
                with_estimates=self._with_estimates,
                with_truth=self._with_truth,
                estimators=[node.name for node in self._plan.of_kind(NODE_ESTIMATOR)],
            ) as monitor:
                first, *others = monitor.listeners
                state = RunState(
                    monitor.statistics,
                    self._plan.duration_s,
                    diagnostics=monitor.diagnostics,
                    dropped=monitor.dropped,
                    estimator=first,
                    estimating=bool(self._plan.of_kind(NODE_ESTIMATOR)),
                )
                for name in others:
                    state.add_other(name, monitor.listeners[name].statistics)
                try:
                    self._start(folder, monitor, state)
                    if self._signal is not None:
                        raise StoppedEarlyError(self._signal)
                    self._watch(monitor, state)
                    self._stop(monitor, state)
                finally:
                    # Only what failed still runs here, or what a signal stopped at its start.
                    end_all(self._processes, asked=self._signal is not None)
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)
            shutil.rmtree(folder, ignore_errors=True)
        return state

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        self._signal = number

    def _start(self, folder: Path, monitor: Monitor, state: RunState) -> None:
        for node in self._plan.nodes:
            self._processes.append(NodeProcess(node, folder))
        self._wait_until_ready(monitor, state)
        if self._signal is not None:
            return
        for process in self._processes:
            process.ready = True
            if process.plan.source:
                self._start_samples(process, monitor, state)

    def _start_samples(self, process: NodeProcess, monitor: Monitor, state: RunState) -> None:
        problem = monitor.set_running(process.name, True)
        if problem is not None:
            self._check_alive(state)
            raise UserError(f"node {process.name} cannot start the samples: {problem}")

    def _wait_until_ready(self, monitor: Monitor, state: RunState) -> None:
        """Ask every node's ~/ready until all have started and found their partners.

        The time to find each other counts from when the last one has started, because a node
        that compiles its estimator keeps the others waiting. One that has answered before and does
        not now is busy: its time counts from its last answer.
        """
        answered_at = {process.name: time.monotonic() for process in self._processes}
        all_started_at: float | None = None
        while self._signal is None:
            self._check_alive(state)
            missing = {
                process.name: problem
                for process in self._processes
                if (problem := monitor.missing(process.name)) is not None
            }
            if not missing:
                self._check_names(monitor)
                return
            now = time.monotonic()
            answered_at.update(
                (name, now) for name in answered_at if missing.get(name) != NOT_STARTED
            )
            waiting = [name for name, problem in missing.items() if problem == NOT_STARTED]
            busy = {
                n: p.removeprefix(STARTING) for n, p in missing.items() if p.startswith(STARTING)
            }
            if waiting:
                state.phase = f"starting {', '.join(waiting)}"
                longest = min(waiting, key=lambda name: answered_at[name])
                if now - answered_at[longest] > START_TIMEOUT_S:
                    raise UserError(
                        f"node {longest} has not answered its ~/ready service for "
                        f"{START_TIMEOUT_S:.0f} s: is this machine very busy?"
                    )
            elif busy:  # it says what it does, and whether it lives is looked at above
                all_started_at = None
                state.phase = "; ".join(f"{name}: {progress}" for name, progress in busy.items())
            else:
                all_started_at = all_started_at or now
                name, problem = next(iter(missing.items()))
                state.phase = f"waiting for {name}: {problem}"
                if now - all_started_at > MATCH_TIMEOUT_S:
                    raise UserError(
                        f"node {name} does not get ready within {MATCH_TIMEOUT_S:.0f} s: {problem}"
                    )
            self._show(state)
            monitor.spin(0.02)

    def _check_names(self, monitor: Monitor) -> None:
        """See that nobody else runs a node of ours: its samples would mix with ours."""
        for process in self._processes:
            if monitor.namesakes(process.name) > 1:
                raise UserError(
                    f"there is another node {process.name} in ROS domain {domain_id()}: end it, or "
                    "take another domain by setting ROS_DOMAIN_ID"
                )

    def _watch(self, monitor: Monitor, state: RunState) -> None:
        state.phase = RUNNING
        start = time.monotonic()
        cpu_before = {p.name: p.cpu_s() for p in self._processes}
        while self._signal is None:
            monitor.spin(POLL_S)
            self._revive(monitor, state)
            state.elapsed_s = time.monotonic() - start
            state.pids = {p.name: p.pid for p in self._processes if p.exit_status() is None}
            for process in self._processes:
                used = process.cpu_s() - cpu_before[process.name]
                state.cpu_percent[process.name] = 100.0 * max(0.0, used) / state.elapsed_s
            finished = any(p.plan.source and monitor.has_finished(p.name) for p in self._processes)
            problems = monitor.problems()
            state.problems = state.after_the_source(problems) if finished else problems
            state.truth = monitor.truth()
            state.page = monitor.page()
            state.silent_s = math.nan if finished else monitor.silent_s()
            state.mute_s = monitor.mute_s(state.estimator)
            for other in state.others:
                other.phase, other.elapsed_s = state.phase, state.elapsed_s
                other.problems = state.problems
                other.silent_s = monitor.listeners[other.estimator].silent_s()
                other.mute_s = monitor.mute_s(other.estimator)
            self._show(state)
            while state.requests:
                monitor.ask(*state.requests.pop(0))
            state.answer = monitor.answer
            if state.duration_s and state.elapsed_s >= state.duration_s:
                return
            if self._source_has_ended(state):
                state.silent_s = math.nan
                return

    def _revive(self, monitor: Monitor, state: RunState) -> None:
        """Let a node that was started again take part as soon as it can, and a successor wait."""
        for process in self._processes:
            if process.ready:
                process.stand_by()
            if process.ready or not monitor.is_there(process.name):
                continue
            if monitor.missing(process.name) is None:
                process.ready = True
                if process.plan.source:
                    self._start_samples(process, monitor, state)

    def _source_has_ended(self, state: RunState) -> bool:
        self._check_alive(state)
        return any(p.plan.source and p.exit_status() == 0 for p in self._processes)

    def _check_alive(self, state: RunState) -> None:
        for process in self._processes:
            status = process.exit_status()
            if status is None or (process.plan.source and status == 0):
                continue
            # Status 2 is that of a node that cannot start with what it was given: it never will.
            if process.plan.respawn and status not in (0, WRONG_USE):
                state.respawns += 1
                state.revived.append(
                    f"{process.name} {describe_exit(status)}, and is started again"
                )
                process.respawn()
                continue
            output = process.tail()
            raise NodeDiedError(process.name, status, output)

    def _stop(self, monitor: Monitor, state: RunState) -> None:
        state.phase = "stopping"
        self._show(state)
        for process in self._processes:
            process.dismiss()
        sources = [p for p in self._processes if p.plan.source]
        for process in sources:
            self._stop_one(process, state)
        state.phase = "waiting for the last estimates"
        self._drain(monitor, state)
        for process in self._processes:
            if not process.plan.source:
                self._stop_one(process, state)
                monitor.spin(POLL_S)  # what it said last
        problems = monitor.problems()
        state.problems = state.after_the_source(problems) if sources else problems
        for other in state.others:
            other.problems, other.phase = state.problems, DONE
        state.phase = DONE
        self._show(state)
        for process in self._processes:
            if process.exit_status() == INCOMPLETE:
                said = state.problems.get(process.name) or process.last_line()
                state.failures.append(f"node {process.name}: {said}")

    def _drain(self, monitor: Monitor, state: RunState) -> None:
        """Wait for the estimates of what the source published last.

        A robot goes on when the run ends, and so do its estimates: those are not waited for.
        """
        if not any(process.plan.source for process in self._processes):
            monitor.spin(POLL_S)
            return
        end = time.monotonic() + DRAIN_TIMEOUT_S
        asked = time.monotonic()
        while time.monotonic() < end:
            monitor.spin(POLL_S)
            self._show(state)
            self._count_samples(monitor, state)
            if all(
                one.samples is not None and one.statistics.since_restart >= one.samples
                for one in (state, *state.others)
            ):
                return
            if time.monotonic() - max(asked, monitor.last_estimate_at) > DRAIN_QUIET_S:
                return

    def _count_samples(self, monitor: Monitor, state: RunState) -> None:
        sources = [process.plan for process in self._processes if process.plan.source]
        for one in (state, *state.others):
            space = one.estimator.rpartition("/")[0]
            beside = [source for source in sources if source.namespace == space]
            for source in beside or sources:
                values = monitor.diagnostics.get(source.name, {})
                for counted in ("samples", "messages"):
                    number = number_said(values, counted, -1.0)
                    if number >= 0.0:
                        setattr(one, counted, int(number))

    def _stop_one(self, process: NodeProcess, state: RunState) -> None:
        state.phase = f"stopping {process.name}"
        status = process.stop(while_waiting=lambda: self._show(state))
        # One that is just starting again has no handler for the signal yet: it just ends.
        obeyed = not process.ready and -status in (signal.SIGINT, signal.SIGTERM)
        if status not in (0, INCOMPLETE) and not obeyed:
            raise NodeDiedError(process.name, status, process.tail())


class StoppedEarlyError(UserError):
    """A signal came before the first sample: there is nothing to sum up."""

    def __init__(self, number: int) -> None:
        super().__init__("stopped before the first sample", 128 + number)


class NodeDiedError(UserError):
    """A node ended that should not have, with the last lines that it printed."""

    def __init__(self, name: str, status: int, output: str) -> None:
        why = f": {byte_code.clear()}" if byte_code.in_output(output) else ""
        wrong = WRONG_USE if status == WRONG_USE else FAILURE  # of the parameters it was given
        super().__init__(f"node {name} {describe_exit(status)}{why}", wrong)
        self.output = output
