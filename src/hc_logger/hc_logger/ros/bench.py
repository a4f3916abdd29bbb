"""Measures bags: speed of files, cost and losses of the recorder, timing of the player.

The recorder and the player run as processes of their own, fed by the simulated rig at 4 kHz in
total (samples, truth, wrench and joints at 1 kHz each), in a ROS domain of their own.
"""

from __future__ import annotations

import os
import random
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from hc_logger.definitions import installed_definition
from hc_logger.errors import BagError
from hc_logger.foreign import open_bag
from hc_logger.info import bag_info
from hc_logger.layout import encode, records
from hc_logger.reader import BagReader
from hc_logger.recording import read_recording
from hc_logger.type_names import SAMPLE_TYPE
from hc_logger.writer import BagWriter
from hc_msgs_py.node_processes import Caller, Processes, ros_arguments
from hc_msgs_py.topics import JOINT_STATES, NODE_PLAYER, NODE_RECORDER, SAMPLE, TRUTH, WRENCH

FILE_MESSAGES = 200_000
KILLS = 100
KILLED_TOGETHER = 4
FLOW = (SAMPLE, TRUTH, WRENCH, JOINT_STATES)
START_TIMEOUT_S = 90.0
"""The first start on a machine compiles the rig."""


def bench_bags(
    duration_s: float = 20.0, *, progress: Callable[[str], None] | None = None
) -> dict[str, Any]:
    """Measure everything that `hc bench bags` says.

    Args:
        duration_s: how long the recorder and the player are watched.
        progress: told what is measured now.

    Returns:
        write_messages_per_s: samples into a bag.
        read_messages_per_s: the same as arrays, from opening the file on.
        ordered_messages_per_s: the same one by one in the order of time.
        read_times_as_fast_as_rosbags, read_times_as_fast_as_mcap: the arrays, against decoding
        every message with rosbags and with mcap-ros2-support, in the same run.
        recorder: messages, lost, cpu_percent (of a core), bytes_per_hour, megabytes_per_hour.
        sigkill_loss_s: what killed recorders lost, in seconds: kills, p50, p95, max.
        player: messages, lost, delay_us {p50, p99, max}, cpu_percent.

    Raises:
        BagError: if a node does not start or a file does not give back what went in.
    """
    tell = progress or (lambda _text: None)
    with tempfile.TemporaryDirectory(prefix="hc_bench_bags_") as folder:
        tell("files")
        results = _bench_files(Path(folder))
        tell("recorder")
        bag = Path(folder, "run")
        results["recorder"] = _bench_recorder(bag, duration_s)
        tell("killed recorders")
        results["sigkill_loss_s"] = _bench_kills(Path(folder))
        tell("player")
        results["player"] = _bench_player(bag)
    return results


def _seconds(action: Callable[[], Any]) -> tuple[float, Any]:
    start = time.perf_counter()
    result = action()
    return time.perf_counter() - start, result


def _bench_files(folder: Path) -> dict[str, Any]:
    rng = np.random.default_rng(1)
    sequence = np.arange(FILE_MESSAGES)
    stamps = 1_700_000_000_000_000_000 + sequence * 1_000_000
    definition = installed_definition(SAMPLE_TYPE)
    matrix = encode(
        definition,
        "indenter_tip",
        header__stamp__sec=stamps // 10**9,
        header__stamp__nanosec=stamps % 10**9,
        sequence=sequence,
        displacement=rng.normal(1e-3, 1e-4, FILE_MESSAGES),
        force=rng.normal(1.0, 0.1, FILE_MESSAGES),
    )
    messages = [row.tobytes() for row in matrix]
    path = folder / "samples"

    def write() -> None:
        with BagWriter(path) as writer:
            topic = writer.add_topic(SAMPLE, SAMPLE_TYPE)
            for stamp, message in zip(stamps.tolist(), messages, strict=True):
                writer.write(topic, stamp, message)

    def read() -> int:
        with BagReader(path) as reader:
            return len(records(definition, reader.columns("/" + SAMPLE)))

    def read_in_order() -> int:
        with BagReader(path) as reader:
            return sum(1 for _ in reader.messages())

    def read_with_rosbags() -> int:
        from rosbags.highlevel import AnyReader

        with AnyReader([path]) as reader:
            return sum(
                1
                for connection, _, data in reader.messages()
                if reader.deserialize(data, connection.msgtype)
            )

    def read_with_mcap() -> int:
        from mcap.reader import make_reader
        from mcap_ros2.decoder import DecoderFactory

        with open(path / "samples_0.mcap", "rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            return sum(1 for _ in reader.iter_decoded_messages())

    write_s, _ = _seconds(write)
    read()  # loads the compiled loop
    times = {}
    for action in (read, read_in_order, read_with_rosbags, read_with_mcap):
        times[action.__name__], count = _seconds(action)
        if count != FILE_MESSAGES:
            raise BagError(f"{action.__name__} gave {count} of {FILE_MESSAGES} messages")
    return {
        "write_messages_per_s": FILE_MESSAGES / write_s,
        "read_messages_per_s": FILE_MESSAGES / times["read"],
        "ordered_messages_per_s": FILE_MESSAGES / times["read_in_order"],
        "read_times_as_fast_as_rosbags": times["read_with_rosbags"] / times["read"],
        "read_times_as_fast_as_mcap": times["read_with_mcap"] / times["read"],
    }


@contextmanager
def _node(
    module: str, domain: int, *, name: str = "", **parameters: Any
) -> Iterator[subprocess.Popen[str]]:
    """Run a node as a process; it is ended with SIGINT, or killed if that does not help."""
    renamed = ("-r", f"__node:={name}") if name else ()
    with Processes(domain) as processes:
        yield processes.start(
            "-m", module, *ros_arguments(parameters, *renamed), stdout=subprocess.DEVNULL
        )


def _cpu_s(process: subprocess.Popen[str]) -> float:
    fields = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class _Graph(Caller):
    """The benchmark's own node: calls services and reads diagnostics."""

    def __init__(self, domain: int) -> None:
        from diagnostic_msgs.msg import DiagnosticArray

        super().__init__(domain, "bench")
        self.status: dict[str, dict[str, str]] = {}
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._keep, 100)

    def _keep(self, message: Any) -> None:
        for status in message.status:
            values = {value.key: value.value for value in status.values}
            self.status[status.name] = values | {"message": status.message}

    def wait_until_ready(self, name: str) -> None:
        from std_srvs.srv import Trigger

        until = time.monotonic() + START_TIMEOUT_S
        said = "it does not answer"
        while (left := until - time.monotonic()) > 0.0:
            answer = self.ask(Trigger, f"/{name}/ready", timeout_s=left, answer_s=2.0)
            if answer is not None and answer.success:
                return
            if answer is not None:
                said = answer.message
            self.spin(0.1)
        raise BagError(f"the benchmark's node {name} does not get ready: {said}")

    def run(self, name: str) -> None:
        from std_srvs.srv import SetBool

        request = SetBool.Request(data=True)
        if self.ask(SetBool, f"/{name}/run", request, START_TIMEOUT_S, answer_s=2.0) is None:
            raise BagError(f"the benchmark's node {name} does not start")


@contextmanager
def _graph() -> Iterator[tuple[_Graph, int]]:
    domain = random.randint(1, 101)
    graph = _Graph(domain)
    try:
        yield graph, domain
    finally:
        graph.close()


_FLOW_PARAMETER = "[" + ", ".join(FLOW) + "]"


def _bench_recorder(bag: Path, duration_s: float) -> dict[str, Any]:
    with (
        _graph() as (graph, domain),
        _node("hc_sim_rig.node", domain, start_paused=True) as _rig,
        _node(
            "hc_logger.recorder_node",
            domain,
            output=bag,
            topics=_FLOW_PARAMETER,
            expected_topics=_FLOW_PARAMETER,
        ) as recorder,
    ):
        graph.wait_until_ready(NODE_RECORDER)
        graph.run("indenter")
        graph.spin_until(lambda: False, 1.0)
        cpu, start = _cpu_s(recorder), time.monotonic()
        graph.spin_until(lambda: False, duration_s)
        cpu_percent = 100.0 * (_cpu_s(recorder) - cpu) / (time.monotonic() - start)
    info = bag_info(bag)
    with open_bag(bag) as reader:
        lost = int(reader.custom_data["dropped"])
    bytes_per_hour = info.size_bytes / info.duration_s * 3600.0
    return {
        "messages": info.message_count,
        "messages_per_s": info.message_count / info.duration_s,
        "lost": lost,
        "cpu_percent": cpu_percent,
        "bytes_per_hour": bytes_per_hour,
        "megabytes_per_hour": bytes_per_hour / 1e6,
    }


def _bench_kills(folder: Path) -> dict[str, float]:
    """Kill recorders at random moments of their first two seconds; say what each lost."""
    rng = random.Random(1)
    losses: list[float] = []
    with _graph() as (graph, domain), _node("hc_sim_rig.node", domain) as _rig:
        while len(losses) < KILLS:
            losses += _kill_some(folder / f"batch{len(losses)}", graph, domain, rng)
    return {
        "kills": len(losses),
        "p50": float(np.quantile(losses, 0.5)),
        "p95": float(np.quantile(losses, 0.95)),
        "max": max(losses),
    }


def _kill_some(folder: Path, graph: _Graph, domain: int, rng: random.Random) -> list[float]:
    """Start some recorders under names of their own and kill each at a moment of its own."""
    folder.mkdir()
    with ExitStack() as stack:
        recorders = {}
        for number in range(KILLED_TOGETHER):
            name, bag = f"killed{number}", folder / str(number)
            recorders[name] = (
                bag,
                stack.enter_context(
                    _node(
                        "hc_logger.recorder_node",
                        domain,
                        name=name,
                        output=bag,
                        topics=_FLOW_PARAMETER,
                        expected_topics=_FLOW_PARAMETER,
                    )
                ),
            )
        for name in recorders:
            graph.wait_until_ready(name)
        begin = time.monotonic()
        moments = sorted((rng.uniform(0.0, 2.0), name) for name in recorders)
        killed = {}
        for moment, name in moments:
            graph.spin_until(lambda: False, begin + moment - time.monotonic())
            killed[name] = time.time_ns()
            recorders[name][1].kill()
    return [
        max(0.0, (killed[name] - int(read_recording(bag).stamps[-1])) * 1e-9)
        for name, (bag, _) in recorders.items()
    ]


def _bench_player(bag: Path) -> dict[str, Any]:
    expected = bag_info(bag)
    copy = bag.with_name("replayed")
    with (
        _graph() as (graph, domain),
        _node(
            "hc_logger.recorder_node",
            domain,
            output=copy,
            topics=_FLOW_PARAMETER,
            expected_topics=_FLOW_PARAMETER,
        ),
        _node(
            "hc_logger.player_node",
            domain,
            bag=bag,
            start_paused=True,
            expected_sample_subscribers=1,
        ) as player,
    ):
        graph.wait_until_ready(NODE_RECORDER)
        graph.wait_until_ready(NODE_PLAYER)
        cpu, start = _cpu_s(player), time.monotonic()
        graph.run(NODE_PLAYER)
        ended = graph.spin_until(
            lambda: graph.status.get(NODE_PLAYER, {}).get("message") == "finished",
            expected.duration_s + START_TIMEOUT_S,
        )
        if not ended:
            raise BagError("the player does not get to the end of the bag")
        cpu_percent = 100.0 * (_cpu_s(player) - cpu) / (time.monotonic() - start)
        values = graph.status[NODE_PLAYER]
        graph.spin_until(lambda: False, 0.5)
    played = int(values["messages"])
    return {
        "messages": played,
        "lost": played - bag_info(copy).message_count,
        "cpu_percent": cpu_percent,
        "delay_us": {
            "p50": float(values["delay_p50_us"]),
            "p99": float(values["delay_p99_us"]),
            "max": float(values["delay_max_us"]),
        },
    }
