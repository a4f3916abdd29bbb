"""Bags with known content, and node processes that always end."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hc_logger.convert import csv_to_bag
from hc_logger.definitions import installed_definition
from hc_logger.layout import encode
from hc_logger.writer import BagWriter
from hc_msgs_py.node_processes import Caller, Processes, end, ros_arguments, wait

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
    """A node of this package as a process; keeps what it said."""

    def __init__(self, processes: Processes, module: str, **parameters: Any) -> None:
        words = ("-m", module, *ros_arguments(parameters))
        self.process = processes.start(*words, stdout=subprocess.DEVNULL)
        self.error = ""

    def end(self, number: int = signal.SIGINT, timeout: float = 15.0) -> int:
        status, _, self.error = end(self.process, number, timeout)
        return status

    def wait(self, timeout: float = 20.0) -> int:
        status, _, self.error = wait(self.process, timeout)
        return status


@pytest.fixture
def domain(ros_domain: int) -> int:
    """A ROS domain of its own for every test."""
    return ros_domain


@pytest.fixture
def start_node(processes: Processes) -> Callable[..., NodeProcess]:
    """Start nodes, which end with the test."""
    return lambda module, **parameters: NodeProcess(processes, module, **parameters)


@pytest.fixture
def graph(domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A node of the test itself, in the same domain as the processes that it starts."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    caller = Caller(domain, "test")

    def call(kind: Any, name: str, request: Any = None, timeout: float = 30.0) -> Any:
        return caller.call(kind, name, request, timeout, answer_s=min(timeout, 10.0))

    caller.node.spin_until = lambda done, timeout=15.0: caller.spin_until(done, timeout)
    caller.node.call = call
    yield caller.node
    caller.close()


@pytest.fixture
def play_and_record(
    start_node: Callable[..., NodeProcess], graph: Any, tmp_path: Path
) -> Callable[..., tuple[Path, list[NodeProcess]]]:
    """Begin to play samples of a CSV to an estimator, and to record both: bag and nodes."""
    from std_srvs.srv import SetBool, Trigger

    def begin(csv: Path, **parameters: Any) -> tuple[Path, list[NodeProcess]]:
        csv_to_bag(csv, tmp_path / "samples")
        bag = tmp_path / "bag"
        topics = "[indenter/sample, hc/estimate, hc/configuration]"
        nodes = [
            start_node("hc_logger.player_node", bag=tmp_path / "samples", start_paused=True),
            start_node("hc_estimator.node", filter="ukf", **parameters),
            start_node("hc_logger.recorder_node", output=bag, expected_topics=topics),
        ]
        for name in ("estimator", "recorder"):
            assert graph.spin_until(
                lambda name=name: graph.call(Trigger, f"/{name}/ready", timeout=150).success, 150
            )
        time.sleep(0.5)
        graph.call(SetBool, "/player/run", SetBool.Request(data=True))
        return bag, nodes

    return begin


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


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A tmpfs of 1 MiB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(folder)]
    try:
        mounted = subprocess.run(command, capture_output=True, text=True, timeout=10)
    except FileNotFoundError:
        pytest.skip("there is no mount command")
    if mounted.returncode:
        pytest.skip(f"a tmpfs cannot be mounted here: {mounted.stderr.strip()}")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True, timeout=10)
