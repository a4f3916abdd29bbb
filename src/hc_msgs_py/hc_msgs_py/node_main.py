"""How every node of the suite starts, spins and ends.

Signals are handled here and not by rclpy: rclpy's own handler shuts the context down at once, and
a node could then no longer publish its last samples or close its file properly. The first SIGINT
or SIGTERM ends the loop; a second one ends the process. SIGHUP ends the loop too, and says that
nobody asked for the end: the terminal or the runner is gone (hc_bringup.processes), so that what
the node keeps for a restart stays. Where it is ignored, as under nohup, it stays so.
"""

from __future__ import annotations

import gc
import inspect
import os
import re
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Protocol

import rclpy
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.exceptions import ParameterException
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from hc_msgs_py import realtime
from hc_msgs_py.answers import give_up_on_clients_that_are_gone
from hc_msgs_py.clock_watch import ClockWatch
from hc_msgs_py.entry_points import FaultOfAnotherError
from hc_msgs_py.middleware import NoDomainError, NoSecurityError, set_defaults
from hc_msgs_py.parameter_requests import answer_impossible_parameters
from hc_msgs_py.parameter_sections import files_for_others
from hc_msgs_py.realtime import RealtimeError
from hc_msgs_py.warnings_of_others import ignore_those_of_others

SPIN_TIMEOUT_S = 1.0
"""Longest turn of the executor; the clock's watch ends each after a tenth of that."""
SWITCH_INTERVAL_S = 5e-5
"""After so long a thread that waits for the interpreter's lock asks for it; Python's own 5 ms are
five samples. What a node's threads do for longer (timers beside a rig's samples) lets go sooner."""


class NodeStartError(Exception):
    """Why a node cannot start, in one line that says what to do."""


class GivenWrongError(NodeStartError):
    """The same of what a node was given, where that shows only when it is under way."""


class Turn:
    """Ends a turn of the executor, in the place of the future that it waits for.

    Within a turn the executor goes from one event to the next without coming back: 2 us less of
    8.5 for each than `spin_once`, in a loop. While events wait it does not look at its timeout, so
    somebody else has to end it.
    """

    def __init__(self) -> None:
        self._stop: Callable[[Turn], None] | None = None

    def add_done_callback(self, stop: Callable[[Turn], None]) -> None:
        """Hear from the executor, as its turn begins, how it is stopped."""
        self._stop = stop

    def remove_done_callback(self, stop: Callable[[Turn], None]) -> None:
        """Hear that the turn is over; the next one can be ended before it begins."""

    def end(self) -> None:
        """End the turn, from any thread or signal handler; between two turns: the next one."""
        if self._stop is not None:
            self._stop(self)

    def forget(self) -> None:
        """Let go of the executor, which may be destroyed from now on."""
        self._stop = None


class ManagedNode(Protocol):
    """What run_node needs beyond rclpy.node.Node."""

    timers: Iterable[Any]
    services: Iterable[Any]

    def finished(self) -> bool:
        """Return True when the node has done its work and wants to end by itself."""

    def close(self) -> None:
        """Finish threads, publish what is left and close files, while the graph still works."""

    def get_fully_qualified_name(self) -> str:
        """Return namespace and name (rclpy.node.Node has it)."""

    def get_logger(self) -> Any:
        """Return where it logs (rclpy.node.Node has it)."""

    def destroy_node(self) -> None:
        """Destroy the node (rclpy.node.Node has it)."""


def run_node(
    factory: Callable[[], Any],
    arguments: Sequence[str] | None = None,
    *,
    at_clean_end: Callable[[Any], None] | None = None,
    at_hang_up: Callable[[Any], None] | None = None,
    below: int = 0,
) -> int:
    """Make a node, spin it until a signal or until it has finished, and end it cleanly.

    Args:
        factory: makes the node (a ManagedNode); may raise NodeStartError, ValueError or OSError
            with a message for the user.
        arguments: command line with ROS arguments; None takes sys.argv.
        at_clean_end: called with the node after its close, if it had done its work or somebody
            asked for the end; not if the node failed.
        at_hang_up: the same, if it ends because its terminal or its runner is gone.
        below: priorities below that of the other nodes, where real time is asked for.

    Returns:
        Exit status: 0 after a clean end, 2 when the node could not start for what it was given,
        1 when it failed later; standard error then says why in one line.
    """
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    ignore_those_of_others()
    stopped_by: int | None = None
    turn = Turn()

    def request_stop(number: int, _frame: Any) -> None:
        nonlocal stopped_by
        stopped_by = stopped_by or number
        turn.end()
        # A second signal ends the process at once. But a runner that is killed sends one SIGHUP
        # for each of its threads: Linux makes the next thread the parent until none is left.
        again = signal.SIG_IGN if number == signal.SIGHUP else signal.SIG_DFL
        signal.signal(number, again)

    signal.signal(signal.SIGINT, request_stop)
    signal.signal(signal.SIGTERM, request_stop)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signal.signal(signal.SIGHUP, request_stop)
    # rcl would write its own line about arguments that it cannot read, before ours.
    rclpy.logging.set_logger_level("rcl", rclpy.logging.LoggingSeverity.FATAL)
    try:
        realtime.stay_on_processors()
        realtime.wanted_priority()
        set_defaults()
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except UnicodeEncodeError as error:
        print(f"an argument is not in UTF-8: {error.object!a}", file=sys.stderr)  # noqa: T201
        return 2
    except (RCLError, UnknownROSArgsError, NoDomainError, NoSecurityError, RealtimeError) as error:
        print(_without_source_lines(_one_line(error)), file=sys.stderr)  # noqa: T201
        return 2
    rclpy.logging.set_logger_level("rcl", rclpy.logging.LoggingSeverity.INFO)
    try:
        try:
            node: ManagedNode = factory()
        except (NodeStartError, ParameterException, ValueError, OSError) as error:
            print(_one_line(error), file=sys.stderr)  # noqa: T201 - there is no logger yet
            return 2
        except Exception as error:  # noqa: BLE001 - whatever it is, it is one line
            print(_failure(error), file=sys.stderr)  # noqa: T201
            return 1
        answer_impossible_parameters(node)
        give_up_on_clients_that_are_gone(node)
        for line in files_for_others(arguments, node.get_fully_qualified_name()):
            node.get_logger().warning(line)
        executor = EventsExecutor()
        executor.add_node(node)
        # At a process's first line rclpy looks for the place that logs among all modules, 60 ms of
        # the thread that has the samples; what it finds is kept, so it looks now.
        inspect.getmodule(run_node.__code__)
        # What exists now lives until the end: taking it out of the collector's sight avoids
        # pauses of about 11 ms in the middle of a run.
        gc.collect()
        gc.freeze()
        status = 0
        try:
            realtime.enter(below)
            # spin() of this executor busy-loops in these wheels; with a timeout it works.
            # Nothing but this function shuts the context down, so it is not asked each time.
            with ClockWatch(executor, lambda: node.timers, each_look=turn.end):
                while stopped_by is None and not node.finished():
                    executor.spin_until_future_complete(turn, timeout_sec=SPIN_TIMEOUT_S)
        except (NodeStartError, RealtimeError) as error:
            print(_one_line(error), file=sys.stderr)  # noqa: T201
            status = 2 if isinstance(error, GivenWrongError) else 1
        except Exception as error:  # noqa: BLE001 - whatever it is, the node ends and says so
            print(_failure(error), file=sys.stderr)  # noqa: T201
            status = 1
        finally:
            turn.forget()
            node.close()
            at_end = at_hang_up if stopped_by == signal.SIGHUP else at_clean_end
            if status == 0 and at_end is not None:
                at_end(node)
            executor.remove_node(node)
            node.destroy_node()
        return status
    finally:
        rclpy.try_shutdown()


def _without_source_lines(message: str) -> str:
    """Cut off where in the source of rcl a message arose."""
    return re.split(r",? at /\S+:\d+", message)[0].removeprefix("failed to initialize rcl: ")


def _failure(error: Exception) -> str:
    """Write the traceback of a failure to a file; return a line that says what and where."""
    line = f"the node failed: {type(error).__name__}: {_one_line(error)}"
    if isinstance(error, FaultOfAnotherError):
        line = _one_line(error)
    try:
        file = Path(rclpy.logging.get_logging_directory()) / f"failure_{os.getpid()}.txt"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("".join(traceback.format_exception(error)), encoding="utf-8")
    except OSError as reason:
        return f"{line} (no file could be written about it: {reason.strerror})"
    return f"{line} (where: {file})"


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())
