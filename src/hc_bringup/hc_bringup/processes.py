"""Node processes: started in their own session, watched, ended without leaving anything behind.

A child gets SIGHUP when the runner dies however it dies (PR_SET_PDEATHSIG), so that not even a
SIGKILL of the runner leaves a node behind. The nodes close what they write and end, and keep what
they keep for a restart, because nobody asked for that end (hc_msgs_py.node_main).

A node that is started again when it dies can have a successor that waits (hc_bringup.standby).
"""

from __future__ import annotations

import ctypes
import functools
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from hc_bringup.plan import NodePlan
from hc_msgs_py.ros_yaml import dump_for_ros

STOP_TIMEOUT_S = 10.0
END_TIMEOUT_S = 3.0
_WAIT_POLL_S = 0.2
_TAIL_LINES = 12
_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None, use_errno=True)
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


class NodeProcess:
    """One node as an operating system process.

    Attributes:
        ready: whether the node has said so since it was started; whoever asks it sets this.
    """

    def __init__(self, plan: NodePlan, folder: Path) -> None:
        """Start the node.

        Args:
            plan: what to start.
            folder: existing folder for its output and its parameter overrides.
        """
        self.plan = plan
        self._folder = folder
        self._output_path = folder / f"{_file_name(plan)}.log"
        self._cpu_s = 0.0
        self._cpu_before_s = 0.0  # of the processes that this one took the place of
        self._successor: subprocess.Popen[bytes] | None = None
        self.ready = False
        self._process = self._started_as_usual()

    def _started_as_usual(self) -> subprocess.Popen[bytes]:
        return self._started(
            self._command_line(), None if self.plan.terminal else subprocess.DEVNULL
        )

    def _command_line(self) -> list[str]:
        return [sys.executable, "-m", self.plan.module, *self._arguments()]

    def _started(self, command: list[str], stdin: int | None) -> subprocess.Popen[bytes]:
        with self._output_path.open("ab") as output:
            return subprocess.Popen(
                command,
                stdin=stdin,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C reaches the runner only, which passes it on
                preexec_fn=functools.partial(_die_with, os.getpid()),
                env={**os.environ, "PYTHONUNBUFFERED": "1", "ROS_LOG_DIR": str(self._folder)},
            )

    def _arguments(self) -> list[str]:
        files: list[Path] = list(self.plan.parameter_files)
        if self.plan.parameters:
            overrides = self._folder / f"{_file_name(self.plan)}.parameters.yaml"
            overrides.write_text(
                dump_for_ros(
                    {f"/{self.plan.name}": {"ros__parameters": dict(self.plan.parameters)}}
                )
            )
            files.append(overrides)
        arguments = ["--ros-args", "-r", f"__node:={self.plan.kind}"]
        if self.plan.namespace:
            arguments += ["-r", f"__ns:=/{self.plan.namespace}"]
        for file in files:
            arguments += ["--params-file", str(file)]
        return arguments

    @property
    def name(self) -> str:
        """ROS name of the node, with its namespace."""
        return self.plan.name

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def exit_status(self) -> int | None:
        """Return the exit status, negative for a signal, or None while it runs."""
        return self._process.poll()

    def stand_by(self) -> None:
        """Let a successor wait, if the node is one that is started again and has none."""
        if self.plan.respawn and not self.plan.terminal and self._successor is None:
            command = [sys.executable, "-m", "hc_bringup.standby", self.plan.module]
            self._successor = self._started(command, subprocess.PIPE)

    def dismiss(self) -> None:
        """End the successor that waits, if there is one."""
        if self._successor is not None:
            self._successor.kill()  # it holds nothing
            self._successor.communicate()
            self._successor = None

    def respawn(self) -> None:
        """Start the node again after it died: the successor that waits, if there is one."""
        self.ready = False
        self._cpu_before_s = self._cpu_s
        self._process = self._succeeded() or self._started_as_usual()

    def _succeeded(self) -> subprocess.Popen[bytes] | None:
        successor, self._successor = self._successor, None
        if successor is None or successor.stdin is None:
            return None
        try:
            with successor.stdin as line:
                line.write(json.dumps(self._arguments()).encode() + b"\n")
        except OSError:  # it has died, or is ending
            successor.kill()
            successor.wait()
            return None
        return successor

    def cpu_s(self) -> float:
        """Return the processor time used so far, also before it was started again.

        After its end the last known one.
        """
        try:
            fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return self._cpu_s
        self._cpu_s = self._cpu_before_s + (int(fields[11]) + int(fields[12])) / _TICKS_PER_S
        return self._cpu_s

    def tail(self) -> str:
        """Return the last lines that the node printed."""
        lines = self._output_path.read_text(errors="replace").splitlines()
        return "\n".join(lines[-_TAIL_LINES:])

    def last_line(self) -> str:
        """Return the last line that the node printed."""
        lines = self.tail().splitlines()
        return lines[-1].strip() if lines else "it said nothing"

    def signal(self, number: int) -> None:
        """Send a signal if the process still runs."""
        if self._process.poll() is None:
            self._process.send_signal(number)

    def stop(
        self,
        timeout_s: float = STOP_TIMEOUT_S,
        *,
        while_waiting: Callable[[], None] = lambda: None,
    ) -> int:
        """End the node: SIGINT, then SIGTERM, then SIGKILL; return its exit status.

        Args:
            timeout_s: how long to wait before the next harder signal.
            while_waiting: called about five times a second until it has ended.
        """
        self.cpu_s()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            self.signal(number)
            end = time.monotonic() + timeout_s
            while (left := end - time.monotonic()) > 0.0:
                try:
                    return self._process.wait(min(left, _WAIT_POLL_S))
                except subprocess.TimeoutExpired:
                    while_waiting()
        return self._process.wait()


def _file_name(plan: NodePlan) -> str:
    return plan.name.replace("/", ".")


def describe_exit(status: int) -> str:
    """Say an exit status in words."""
    if status < 0:
        known = -status in {number.value for number in signal.Signals}
        name = (
            signal.Signals(-status).name if known else f"signal {-status}"
        )  # of the real-time ones
        return f"was ended by {name}"
    return f"ended with exit status {status}"


def end_all(
    processes: Sequence[NodeProcess], *, asked: bool, timeout_s: float = END_TIMEOUT_S
) -> None:
    """End nodes at once, however far they have got; their exit statuses do not matter.

    Args:
        processes: the nodes.
        asked: whether the user wants this end; if not, nodes keep what they keep for a restart.
        timeout_s: how long to wait before the next harder signal.
    """
    for process in processes:
        process.dismiss()
    first = signal.SIGINT if asked else signal.SIGHUP
    for number in (first, signal.SIGTERM, signal.SIGKILL):
        for process in processes:
            process.signal(number)
        end = time.monotonic() + timeout_s
        while any(p.exit_status() is None for p in processes) and time.monotonic() < end:
            time.sleep(0.02)


def _die_with(parent: int) -> None:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # a runner under nohup ignores it
    result: Any = _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGHUP)
    if result != 0 or os.getppid() != parent:  # it may have died before the call
        os._exit(126)
