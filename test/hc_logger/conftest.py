"""Bags with known content, and node processes that always end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hc_logger.definitions import installed_definition
from hc_logger.layout import encode
from hc_logger.writer import BagWriter

START_NS = 1_700_000_000_123_456_789


def sample_bytes(sequence: NDArray[np.int64], stamps: NDArray[np.int64]) -> list[bytes]:
    """Samples whose displacement is their sequence in micrometres and force its sine."""
    rows = encode(
        installed_definition("hc_msgs/msg/IndenterSample"),
        "indenter_tip",
        header__stamp__sec=stamps // 10**9,
        header__stamp__nanosec=stamps % 10**9,
        sequence=sequence,
        displacement=sequence * 1e-6,
        force=np.sin(sequence * 0.01),
    )
    return [row.tobytes() for row in rows]


@pytest.fixture
def start_ns() -> int:
    """Stamp of the first sample of every bag made here."""
    return START_NS


@pytest.fixture
def sample_messages() -> Callable[..., list[bytes]]:
    """Function (sequence, stamps) -> CDR messages."""
    return sample_bytes


@pytest.fixture
def make_bag(tmp_path: Path) -> Callable[..., Path]:
    """A bag of n samples at 1 kHz (and a second topic of headers at 100 Hz)."""

    def make(name: str = "bag", count: int = 1000, **options: Any) -> Path:
        sequence = np.arange(count)
        stamps = START_NS + sequence * 1_000_000
        path = tmp_path / name
        header = np.frombuffer(b"\0\1\0\0" + bytes(8) + b"\2\0\0\0a\0", np.uint8).tobytes()
        with BagWriter(path, **options) as writer:
            topic = writer.add_topic("indenter/sample", "hc_msgs/msg/IndenterSample")
            other = writer.add_topic("/header", "std_msgs/msg/Header")
            data = sample_bytes(sequence, stamps)
            for number, stamp, message in zip(range(count), stamps.tolist(), data, strict=True):
                writer.write(topic, stamp, message)
                if number % 10 == 0:
                    writer.write(other, stamp, header)
        return path

    return make


class NodeProcess:
    """A node of this package as a process, in a ROS domain of its own."""

    def __init__(self, module: str, domain: int, **parameters: Any) -> None:
        arguments = ["--ros-args"]
        for name, value in parameters.items():
            arguments += ["-p", f"{name}:={value}"]
        self.process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            env=environment(domain),
            stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            text=True,
        )
        self.error = ""

    def end(self, number: int = signal.SIGINT, timeout: float = 15.0) -> int:
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.wait(timeout)

    def wait(self, timeout: float = 20.0) -> int:
        try:
            _, self.error = self.process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            self.process.kill()
            _, self.error = self.process.communicate(timeout=10)
        return self.process.returncode


def environment(domain: int) -> dict[str, str]:
    return os.environ | {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }


@pytest.fixture
def domain(ros_domain: int) -> int:
    """A ROS domain of its own for every test."""
    return ros_domain


@pytest.fixture
def start_node(domain: int) -> Iterator[Callable[..., NodeProcess]]:
    """Start nodes that are killed at the end of the test if they still live."""
    started: list[NodeProcess] = []

    def start(module: str, **parameters: Any) -> NodeProcess:
        started.append(NodeProcess(module, domain, **parameters))
        return started[-1]

    yield start
    for node in started:
        if node.process.poll() is None:
            node.process.kill()
            node.process.communicate(timeout=10)


@pytest.fixture
def graph(domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A node of the test itself, in the same domain as the processes that it starts."""
    import rclpy
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor

    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("test", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin_until(condition: Callable[[], bool], timeout: float = 15.0) -> bool:
        end = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > end:
                return False
            executor.spin_once(timeout_sec=0.02)
        return True

    def call(kind: Any, name: str, request: Any = None, timeout: float = 10.0) -> Any:
        client = node.create_client(kind, name)
        try:
            assert spin_until(client.service_is_ready, timeout), f"no service {name}"
            future = client.call_async(request if request is not None else kind.Request())
            assert spin_until(future.done, timeout), f"{name} does not answer"
            return future.result()
        finally:
            node.destroy_client(client)

    node.spin_until = spin_until
    node.call = call
    yield node
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()


@pytest.fixture
def refusal(domain: int, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """What a node of this process answers to wrong parameters: one line, or the test fails.

    A process for each of them would take most of the suite's time; that run_node turns the
    exception into one line on stderr and exit status 2 is tested with a process once.
    """
    import rclpy
    from rclpy.exceptions import ParameterException

    from hc_msgs_py.node_main import NodeStartError

    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

    def refuse(factory: Callable[[], Any], **parameters: Any) -> str:
        arguments = ["--ros-args"]
        for name, value in parameters.items():
            arguments += ["-p", f"{name}:={value}"]
        rclpy.init(args=arguments, domain_id=domain)
        try:
            with pytest.raises((NodeStartError, ParameterException, ValueError)) as caught:
                factory()
        finally:
            rclpy.try_shutdown()
        line = " ".join(str(caught.value).split())
        assert line
        return line

    return refuse
