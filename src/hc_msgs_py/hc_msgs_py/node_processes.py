"""Nodes as processes in one ROS domain, and a node of one's own that calls their services.

For benchmarks and tests: what they start always ends, and speaks with nobody outside its domain
and this machine.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any

END_TIMEOUT_S = 20.0
"""A process that goes on so long after SIGINT is killed."""
ANSWER_TIMEOUT_S = 5.0
"""Discovery is one-sided: an answer may be lost, so after this time a service is asked again."""


def domain_environment(domain: int | None, **more: str) -> dict[str, str]:
    """Environment of a process that speaks in one domain, on this machine only.

    Without a domain that of this process, for what speaks with nobody.
    """
    spoken = (
        {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        if domain is not None
        else {}
    )
    return {**os.environ, **spoken, **more}


def ros_arguments(parameters: Mapping[str, Any], *arguments: str) -> list[str]:
    """Words behind `python -m MODULE`: ROS arguments and parameters, `__` in a name is a dot."""
    words = ["--ros-args", *arguments]
    for name, value in parameters.items():
        text = str(value).lower() if isinstance(value, bool) else str(value)
        words += ["-p", f"{name if name.startswith('__') else name.replace('__', '.')}:={text}"]
    return words


def end(
    process: subprocess.Popen[str], number: int = signal.SIGINT, timeout_s: float = END_TIMEOUT_S
) -> tuple[int, str, str]:
    """Ask a process to end, and kill it if it does not; its status, output and errors."""
    if process.poll() is None:
        process.send_signal(number)
    return wait(process, timeout_s)


def wait(process: subprocess.Popen[str], timeout_s: float = END_TIMEOUT_S) -> tuple[int, str, str]:
    """Wait for a process to end by itself, and kill it if it does not; as `end`."""
    if process.stdin is not None and process.stdin.closed:
        process.stdin = None  # or communicate() would flush it
    try:
        output, errors = process.communicate(timeout=timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        output, errors = process.communicate(timeout=timeout_s)
    return process.returncode, output or "", errors or ""


class Processes:
    """Processes in one ROS domain; a context manager that ends them.

    Attributes:
        environment: of all that are started.
        started: them.
    """

    def __init__(self, domain: int | None, folder: Path | None = None, **environment: str) -> None:
        """Begin; `folder` is where they run, `environment` what they get beside the domain's."""
        self.environment = domain_environment(domain, **environment)
        self.started: list[subprocess.Popen[str]] = []
        self._folder = folder

    def start(
        self,
        *words: str,
        through: Sequence[str] = (),
        stdout: int | IO[str] = subprocess.PIPE,
        stderr: int | IO[str] = subprocess.PIPE,
        **environment: str,
    ) -> subprocess.Popen[str]:
        """Start Python with some words behind it, through another program if one is given."""
        return self.launch(
            [*through, sys.executable, *words],
            env=self.environment | environment,
            stdout=stdout,
            stderr=stderr,
        )

    def launch(self, command: Sequence[str | Path], **options: Any) -> subprocess.Popen[str]:
        """Start any program, with options of subprocess.Popen where they differ from ours.

        Ours are the folder, the environment, pipes for output and errors, and text.
        """
        ours = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        place = {"cwd": self._folder, "env": self.environment}
        process: subprocess.Popen[str] = subprocess.Popen(command, **ours | place | options)
        self.started.append(process)
        return process

    def run(
        self, *words: str, timeout_s: float = 60.0, through: Sequence[str] = ()
    ) -> subprocess.CompletedProcess[str]:
        """Run Python with some words behind it to its end.

        Raises:
            subprocess.TimeoutExpired: it went on for longer, and was killed.
        """
        return subprocess.run(
            [*through, sys.executable, *words],
            cwd=self._folder,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=timeout_s,
            check=False,
        )

    def close(self, number: int = signal.SIGINT) -> None:
        """End all that still live: a killed one leaves shared memory behind."""
        for process in self.started:
            if process.poll() is None:
                process.send_signal(number)
        for process in self.started:
            wait(process)

    def __enter__(self) -> Processes:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class Caller:
    """A node of one's own in a domain: listens, and calls services."""

    def __init__(self, domain: int, name: str, executor: Callable[..., Any] | None = None) -> None:
        """Join the domain, on this machine only; with another kind of executor if one is given."""
        import rclpy
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor

        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        self.context = Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        self.node = rclpy.create_node(name, context=self.context, enable_rosout=False)
        self.executor = (executor or SingleThreadedExecutor)(context=self.context)
        self.executor.add_node(self.node)

    def spin(self, seconds: float) -> None:
        """Listen for a time."""
        self.spin_until(lambda: False, seconds)

    def spin_until(self, done: Callable[[], bool], timeout_s: float = 15.0) -> bool:
        """Listen until something is so; False if it is not within the time."""
        until = time.monotonic() + timeout_s
        while not done():
            left = until - time.monotonic()
            if left <= 0.0:
                return False
            self.executor.spin_once(timeout_sec=min(left, 0.02))
        return True

    def ask(
        self,
        kind: Any,
        name: str,
        request: Any = None,
        timeout_s: float = 90.0,
        answer_s: float = ANSWER_TIMEOUT_S,
    ) -> Any:
        """Call a service, again while an answer is lost; None without an answer in time.

        Args:
            kind: type of the service.
            name: its name.
            request: an empty one if None.
            timeout_s: for the service to be there, and for the answer.
            answer_s: after so long the answer counts as lost.
        """
        from hc_msgs_py.qos import SERVICE_QOS

        client = self.node.create_client(kind, name, qos_profile=SERVICE_QOS)
        try:
            until = time.monotonic() + timeout_s
            while (left := until - time.monotonic()) > 0.0:
                if not self.spin_until(client.service_is_ready, left):
                    return None
                future = client.call_async(kind.Request() if request is None else request)
                if self.spin_until(future.done, min(left, answer_s)):
                    return future.result()
            return None
        finally:
            self.node.destroy_client(client)

    def call(
        self,
        kind: Any,
        name: str,
        request: Any = None,
        timeout_s: float = 90.0,
        answer_s: float = ANSWER_TIMEOUT_S,
    ) -> Any:
        """Call a service; as `ask`.

        Raises:
            AssertionError: there is no answer in time.
        """
        answer = self.ask(kind, name, request, timeout_s, answer_s)
        if answer is None:
            raise AssertionError(f"no answer of service {name} within {timeout_s:g} s")
        return answer

    def close(self) -> None:
        """Leave the domain."""
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()
