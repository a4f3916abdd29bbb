"""A rig node as a real process, and a listener in this process, in a ROS domain of their own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

TIMEOUT_S = 40.0


class Listener:
    """A node in this process: collects messages and calls services."""

    def __init__(self, domain: int) -> None:
        import rclpy
        from rclpy.context import Context
        from rclpy.experimental import EventsExecutor

        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.clients: dict[str, Any] = {}
        self.node = rclpy.create_node("listener", context=self.context)
        self.executor = EventsExecutor(context=self.context)
        self.executor.add_node(self.node)

    def collect(self, kind: Any, topic: str, profile: Any, convert: Callable[[Any], Any]) -> list:
        found: list = []
        self.node.create_subscription(kind, topic, lambda m: found.append(convert(m)), profile)
        return found

    def spin(self, seconds: float = 0.0, until: Callable[[], bool] | None = None) -> bool:
        end = time.monotonic() + (seconds or TIMEOUT_S)
        while time.monotonic() < end:
            if until is not None and until():
                return True
            self.executor.spin_once(timeout_sec=0.02)
        return until is None

    def call(self, kind: Any, name: str, request: Any) -> Any:
        if name not in self.clients:
            self.clients[name] = self.node.create_client(kind, name)
        client = self.clients[name]
        assert self.spin(until=client.service_is_ready), f"no service {name}"
        # Discovery is one-sided: an answer can be lost, so ask again.
        for _ in range(10):
            future = client.call_async(request)
            if self.spin(TIMEOUT_S / 10.0, until=future.done):
                return future.result()
        raise AssertionError(f"no answer from {name}")

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


class RigProcess:
    """`python -m hc_sim_rig.node` with parameters."""

    def __init__(self, domain: int, folder: Path, parameters: dict[str, Any]) -> None:
        command = [sys.executable, "-m", "hc_sim_rig.node", "--ros-args", "-r", "__node:=indenter"]
        for name, value in parameters.items():
            text = str(value).lower() if isinstance(value, bool) else str(value)
            command += ["-p", f"{name}:={text}"]
        environment = dict(os.environ)
        environment["ROS_DOMAIN_ID"] = str(domain)
        environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        self.errors = folder / "stderr.txt"
        with self.errors.open("w") as errors:
            self.process = subprocess.Popen(
                command, env=environment, stderr=errors, stdout=errors, text=True
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
    processes: list[RigProcess] = []
    listeners: list[Listener] = []

    def start(**parameters: Any) -> tuple[RigProcess, Listener]:
        processes.append(RigProcess(ros_domain, tmp_path, parameters))
        if not listeners:
            listeners.append(Listener(ros_domain))
        return processes[-1], listeners[0]

    yield start
    for listener in listeners:
        listener.close()
    for process in processes:
        if process.process.poll() is None:
            process.process.kill()
            process.process.wait()
