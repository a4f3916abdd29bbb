"""A rig node as a real process, and a listener in this process, in a ROS domain of their own."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hc_msgs_py.node_processes import Caller, Processes, ros_arguments
from hc_sim_rig.bilateral.datagrams import MASTER, SLAVE
from hc_sim_rig.bilateral.udp_link import Added, UdpLink

TIMEOUT_S = 40.0


class Listener(Caller):
    """A node in this process: collects messages and calls services."""

    def __init__(self, domain: int) -> None:
        from rclpy.experimental import EventsExecutor

        super().__init__(domain, "listener", EventsExecutor)

    def collect(self, kind: Any, topic: str, profile: Any, convert: Callable[[Any], Any]) -> list:
        found: list = []
        self.node.create_subscription(kind, topic, lambda m: found.append(convert(m)), profile)
        return found

    def spin(self, seconds: float = 0.0, until: Callable[[], bool] | None = None) -> bool:
        """Listen for a time, or until something is so: False if it is not in time."""
        reached = self.spin_until(until or (lambda: False), seconds or TIMEOUT_S)
        return until is None or reached


class RigProcess:
    """`python -m hc_sim_rig.node` with parameters."""

    def __init__(self, processes: Processes, folder: Path, parameters: dict[str, Any]) -> None:
        words = ros_arguments(parameters, "-r", "__node:=indenter")
        self.errors = folder / "stderr.txt"
        with self.errors.open("w") as errors:
            self.process = processes.start(
                "-m", "hc_sim_rig.node", *words, stdout=errors, stderr=errors
            )

    def stop(self, number: int = signal.SIGINT) -> int:
        # The interpreter of the wheels may start a child of the same name: it passes signals on.
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.wait()

    def wait(self) -> int:
        return self.process.wait(timeout=TIMEOUT_S)

    def output(self) -> str:
        return self.errors.read_text()


@pytest.fixture
def start_rig(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ros_domain: int
) -> Iterator[Callable[..., tuple[RigProcess, Listener]]]:
    """Start a rig node with parameters; gives the process and a listener in its domain."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    started: list[RigProcess] = []
    listeners: list[Listener] = []

    def start(**parameters: Any) -> tuple[RigProcess, Listener]:
        started.append(RigProcess(processes, tmp_path, parameters))
        if not listeners:
            listeners.append(Listener(ros_domain))
        return started[-1], listeners[0]

    with Processes(ros_domain) as processes:
        yield start
        for listener in listeners:
            listener.close()


@pytest.fixture
def listener(monkeypatch: pytest.MonkeyPatch, ros_domain: int) -> Iterator[Listener]:
    """A listener for processes that a test starts itself."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    node = Listener(ros_domain)
    yield node
    node.close()


@pytest.fixture
def links() -> Iterator[tuple[UdpLink, UdpLink]]:
    """Master's and slave's end, on ports that are free."""
    first = UdpLink(MASTER, "127.0.0.1", 0, "127.0.0.1", 1, Added(), 1)
    port = first.port
    second = UdpLink(SLAVE, "127.0.0.1", 0, "127.0.0.1", port, Added(), 1)
    first.close()
    first = UdpLink(MASTER, "127.0.0.1", port, "127.0.0.1", second.port, Added(), 1)
    yield first, second
    first.close()
    second.close()
