"""Recorders that are killed at any moment: what they had is there, and little of it is missing."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_logger.errors import BagError
from hc_logger.info import bag_info
from hc_logger.reader import BagReader
from hc_logger.recording import read_recording
from hc_logger.recover import recover_bag
from hc_msgs_py.node_processes import Processes

RECORDER = "hc_logger.recorder_node"
SAMPLE = "hc_msgs/msg/IndenterSample"
Start = Callable[..., Any]


class Flow(threading.Thread):
    """Four topics of samples at 1 kHz from a thread; remembers when each sample went out."""

    def __init__(self, publishers: list[Any]) -> None:
        super().__init__()
        self.publishers = publishers
        self.times_ns: list[int] = []
        self.stop = threading.Event()

    def run(self) -> None:
        from hc_msgs_py.wire import SampleEncoder

        encoder = SampleEncoder()
        begin = time.monotonic()
        while not self.stop.is_set():
            number = len(self.times_ns)
            while (left := begin + number * 1e-3 - time.monotonic()) > 0:
                time.sleep(left)
            now = time.time_ns()
            data = encoder.encode(now, number, 1.0, 1.0)
            for publisher in self.publishers:
                publisher.publish(data)
            self.times_ns.append(now)


def lost_s(bag: Path, killed_ns: int, times_ns: list[int]) -> float:
    """How much of what was published before the kill is not in the bag [s]; none in its middle."""
    published = [t for t in times_ns if t < killed_ns]
    try:
        recording = read_recording(bag)
    except BagError:  # killed before the first flush
        return (killed_ns - times_ns[0]) * 1e-9
    sequence = recording.sequence.astype(np.int64)
    assert sequence[0] == 0
    assert np.all(np.diff(sequence) == 1)
    (problem,) = recording.findings.problems
    assert "cut off" in problem
    return max(0.0, (published[-1] - int(recording.stamps[-1])) * 1e-9)


def check_recovery(bag: Path) -> None:
    clean = bag.with_name(bag.name + "_clean")
    report = recover_bag(bag, clean)
    assert report.recovered["/indenter/sample"] == len(read_recording(bag).sequence)
    info = bag_info(clean)
    assert (info.problems, info.message_count) == ([], sum(report.recovered.values()))


def test_recorders_killed_at_random_moments_lose_a_tenth_of_a_second(
    start_node: Start, graph: Any, tmp_path: Path
) -> None:
    """Most of them in the first moments of the recording, which once left 38 bytes."""
    from hc_msgs.msg import IndenterSample

    from hc_msgs_py.qos import SAMPLE_PUBLISHER_QOS

    rng = random.Random(2)
    names = ["indenter/sample", "b", "c", "d"]
    publishers = [graph.create_publisher(IndenterSample, n, SAMPLE_PUBLISHER_QOS) for n in names]
    nodes = {
        tmp_path / f"bag{i}": start_node(
            RECORDER, output=tmp_path / f"bag{i}", topics=f"[{', '.join(names)}]"
        )
        for i in range(6)
    }
    assert graph.spin_until(
        lambda: all(p.get_subscription_count() == len(nodes) for p in publishers), timeout=60
    )
    graph.spin_until(lambda: False, timeout=0.5)  # discovery is one-sided
    flow = Flow(publishers)
    flow.start()
    begin = time.monotonic()
    killed = {}
    moments = sorted(rng.uniform(0.02, 0.6) for _ in nodes)
    for moment, (bag, node) in zip(moments, nodes.items(), strict=True):
        time.sleep(max(0.0, begin + moment - time.monotonic()))
        killed[bag] = time.time_ns()
        node.process.send_signal(signal.SIGKILL)
    flow.stop.set()
    flow.join()
    for node in nodes.values():
        assert node.wait() == -signal.SIGKILL
    losses = sorted(lost_s(bag, when, flow.times_ns) for bag, when in killed.items())
    # The median: a busy machine keeps single processes from running for longer than that.
    assert losses[len(losses) // 2] < 0.1, losses
    assert losses[-1] < 0.5, losses
    check_recovery(max(killed, key=lambda bag: killed[bag]))


SESSIONS = """
import os, sys, time
import numpy as np
from hc_logger.definitions import installed_definition
from hc_logger.layout import encode
from hc_logger.session import RecordingSession, TopicCount
from hc_logger.writer import BagWriter
numbers = np.arange(8000)
rows = encode(installed_definition("hc_msgs/msg/IndenterSample"), "tip", sequence=numbers)
rows = [row.tobytes() for row in rows]

def record(path):
    session = RecordingSession(BagWriter(path), fsync_interval_s=0.2)
    names = ("indenter/sample", "b", "c", "d")
    topics = [session.add_topic(name, "hc_msgs/msg/IndenterSample", []) for name in names]
    start = time.monotonic()
    for number, row in enumerate(rows):
        while (wait := start + number * 1e-3 - time.monotonic()) > 0:
            time.sleep(wait)
        for topic in topics:
            session.add_many(topic, [time.time_ns()], [row], [0], [number])
        session.flush_if_due()

for line in sys.stdin:
    child = os.fork()
    if child == 0:
        record(line.strip())
        os._exit(0)  # or it would tell 0, and to kill that is to kill the test's own group
    print(child, flush=True)
"""


@pytest.mark.slow
def test_sessions_killed_at_random_moments_at_4_khz(tmp_path: Path) -> None:
    """What the recorder keeps, without ROS around it: twenty processes."""
    losses = []
    rng = random.Random(4)
    with Processes(None) as processes:
        parent = processes.launch(
            [sys.executable, "-c", SESSIONS], stdin=subprocess.PIPE, stderr=None, bufsize=1
        )
        assert parent.stdin is not None
        assert parent.stdout is not None
        for batch in range(5):
            children = {}
            for i in range(4):
                bag = tmp_path / f"bag{batch}_{i}"
                parent.stdin.write(f"{bag}\n")
                children[bag] = int(parent.stdout.readline())
            time.sleep(0.1)
            killed = {}
            for bag, child in children.items():
                time.sleep(rng.uniform(0.0, 0.1))
                killed[bag] = time.time_ns()
                os.kill(child, signal.SIGKILL)
            time.sleep(0.02)
            for bag, when in killed.items():  # after all kills: a recording ends after 8 s
                with BagReader(bag) as reader:
                    span = reader.time_range()
                assert span is not None
                losses.append((when - span[1]) * 1e-9)
                check_recovery(bag)
        parent.stdin.close()
        assert parent.wait(10) == 0
    losses.sort()
    assert losses[len(losses) // 2] < 0.1, losses
    assert losses[-1] < 0.5, losses
