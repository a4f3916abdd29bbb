"""Recorded estimates are recomputed bit by bit, and what differs or cannot be known is said."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_logger.csv_file import write_csv
from hc_logger.errors import BagError
from hc_logger.reader import BagReader
from hc_logger.recording import read_recording
from hc_logger.verify import verify
from hc_logger.writer import BagWriter
from hc_msgs_py.node_processes import Processes

pytestmark = pytest.mark.process


def samples(path: Path) -> None:
    """Three seconds at 1 kHz of a tip going in and out, with missing and bad readings."""
    rng = np.random.default_rng(8)
    t = np.arange(3000) * 1e-3
    d = 2.0 + 1.5 * np.sin(2 * np.pi * 1.5 * t) + 0.4 * np.sin(2 * np.pi * 4.1 * t)
    v = np.gradient(d, t)
    touching = np.maximum(d, 0.0)
    force = 0.5 * touching**1.4 + 0.005 * touching**1.4 * v + rng.normal(0, 0.02, len(t))
    force[700] = np.inf
    force[710:720] = d[720:725] = np.nan
    t[900] = t[899]
    write_csv(path, [np.column_stack([t, d, force])])


def ask(graph: Any, node: str, **parameters: Any) -> None:
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    values = [Parameter(k.replace("__", "."), value=v) for k, v in parameters.items()]
    request = SetParameters.Request(parameters=[v.to_parameter_msg() for v in values])
    results = graph.call(SetParameters, f"/{node}/set_parameters", request).results
    assert all(r.successful for r in results), results


def copy_with(source: Path, target: Path, change: Callable[[Any], Any]) -> Path:
    """Copy a bag; change(message) gives the new bytes or None to leave the message out."""
    with BagReader(source) as reader, BagWriter(target) as writer:
        numbers = {
            name: writer.add_topic(name, topic.definition.name, definition=topic.definition)
            for name, topic in reader.topics.items()
        }
        for message in reader.messages():
            data = change(message)
            if data is not None:
                writer.write(numbers[message.topic], message.log_time, data)
    return target


@pytest.mark.timeout(300)  # where the filters have to be compiled first
def test_a_live_run_is_recomputed_to_the_last_bit(
    play_and_record: Callable[..., Any], graph: Any, tmp_path: Path
) -> None:
    """Parameters, filter, state space, zero, a reset and a jump back, all while it runs."""
    from hc_msgs.msg import EstimatorConfiguration, HuntCrossleyEstimate, IndenterSample
    from rclpy.serialization import deserialize_message, serialize_message
    from std_srvs.srv import Trigger

    samples(tmp_path / "samples.csv")
    bag, nodes = play_and_record(tmp_path / "samples.csv")

    def later(seconds: float = 0.35) -> None:
        graph.spin_until(lambda: False, timeout=seconds)

    later()
    ask(graph, "estimator", force_noise_std=0.05)
    later()
    ask(graph, "estimator", input__force__zero=0.01)
    later()
    ask(graph, "estimator", filter="ekf")
    later()
    graph.call(Trigger, "/estimator/reset")
    later()
    ask(graph, "estimator", state_space="paper", filter="ukf")
    later()
    ask(graph, "player", position=0.5)
    later()
    for node in nodes:
        assert node.end() == 0, node.error

    recording = read_recording(bag)
    causes = {c.cause for c in recording.configurations}
    assert causes == {0, 1, 2, 3}
    report = verify(recording)
    assert report.differences == []
    assert report.equal
    assert report.compared == len(recording.estimates) > 1500
    assert report.not_comparable == 0
    assert {0, 1, 2} <= set(recording.estimates["rejected"].tolist())

    # one last bit changed in one estimate is found, and nothing else
    victim = int(recording.estimates["sequence"][1200])
    changed = []

    def spoil(message: Any) -> bytes:
        if message.topic == "/hc/estimate" and not changed:
            estimate = deserialize_message(message.data, HuntCrossleyEstimate)
            if estimate.sequence == victim:
                estimate.damping = float(np.nextafter(estimate.damping, np.inf))
                changed.append(estimate.damping)
                return bytes(serialize_message(estimate))
        return bytes(message.data)

    report = verify(read_recording(copy_with(bag, tmp_path / "spoiled", spoil)))
    assert (report.different, report.compared) == (1, len(recording.estimates))
    (difference,) = report.differences
    assert (difference.sequence, difference.field, difference.recorded) == (
        victim,
        "damping",
        changed[0],
    )
    assert 0.0 < report.largest < 1e-15
    assert "rounding, of another processor" in report.lines()[1]
    report.largest = 1e-6
    assert "rounding" not in "".join(report.lines())

    # a configuration that is missing makes what follows unknown, until the next fresh start
    def forget(message: Any) -> bytes | None:
        if message.topic == "/hc/configuration":
            configuration = deserialize_message(message.data, EstimatorConfiguration)
            if configuration.revision == 2:
                return None
        return bytes(message.data)

    report = verify(read_recording(copy_with(bag, tmp_path / "forgotten", forget)))
    fresh = next(c.revision for c in recording.configurations if c.cause == 2)
    unknown = recording.estimates["configuration_revision"]
    assert report.not_comparable == np.count_nonzero((unknown >= 2) & (unknown < fresh))
    assert report.compared == len(recording.estimates) - report.not_comparable
    assert report.different == 0
    assert any("revision 2 was not recorded" in note for note in report.notes)

    # one sample that is missing leaves what was before it known
    gone = int(recording.sequence[700])

    def lose(message: Any) -> bytes | None:
        if message.topic != "/indenter/sample":
            return bytes(message.data)
        sample = deserialize_message(message.data, IndenterSample)
        return None if sample.sequence == gone else bytes(message.data)

    report = verify(read_recording(copy_with(bag, tmp_path / "lost", lose)))
    before = int(np.count_nonzero(recording.estimates["sequence"] < gone))
    assert report.different == 0
    assert before <= report.compared < len(recording.estimates)
    assert report.not_comparable == len(recording.estimates) - report.compared > 0
    assert any("1 of their samples was not recorded" in note for note in report.notes)

    # a recorder that came late has no beginning to go on from
    with BagReader(bag) as reader:
        first_log = next(iter(reader.messages({"/indenter/sample"}))).log_time

    def late(message: Any) -> bytes | None:
        early = message.log_time < first_log + 100_000_000
        return None if early and message.topic != "/hc/configuration" else bytes(message.data)

    report = verify(read_recording(copy_with(bag, tmp_path / "late", late)))
    assert report.different == 0
    assert report.not_comparable > 0
    assert any("began at sample 0, the first recorded" in note for note in report.notes)


@pytest.mark.slow
def test_a_run_with_sensors_of_ones_own_is_recomputed_to_the_last_bit(
    start_node: Callable[..., Any], processes: Processes, graph: Any, tmp_path: Path
) -> None:
    """Tares, a reading that changes, a reset, a saved state and a node that is killed, besides."""
    from std_srvs.srv import Trigger

    bag = tmp_path / "bag"
    script = Path(__file__).parents[1] / "hc_estimator_node" / "stream_source.py"
    source = processes.launch([sys.executable, script, "0"], stdout=subprocess.DEVNULL)

    def estimator() -> Any:
        return start_node(
            "hc_estimator.node",
            **{
                "filter": "ukf",
                "input.source": "sensors",
                "input.force.topic": "a/wrench",
                "input.position.topic": "a/arm",
                "input.position.type": "pose",
                "tare.samples": 50,
                "tare.force": "true",
                "state.folder": tmp_path / "state",
                "state.autosave_period": 0.1,
            },
        )

    def later(seconds: float = 0.35) -> None:
        graph.spin_until(lambda: False, timeout=seconds)

    def is_ready(name: str) -> bool:
        """Ask a node; a question that goes to one that was killed has no answer."""
        try:
            return bool(graph.call(Trigger, f"/{name}/ready", timeout=3).success)
        except AssertionError:
            return False

    def ready(*names: str) -> None:
        for name in names:
            assert graph.spin_until(lambda name=name: is_ready(name), 100)

    try:
        topics = "[indenter/sample, hc/estimate, hc/configuration]"
        node = estimator()
        recorder = start_node("hc_logger.recorder_node", output=bag, expected_topics=topics)
        ready("estimator", "recorder")
        later()
        graph.call(Trigger, "/estimator/reset")  # what came before the recorder was there
        later()
        assert graph.call(Trigger, "/estimator/tare").success
        later()
        ask(graph, "estimator", force_noise_std=0.05)
        later()
        assert graph.call(Trigger, "/estimator/save").success
        later()
        ask(graph, "estimator", input__force__scale=2.0)
        later()
        ask(graph, "estimator", filter="ekf")
        later()
        assert graph.call(Trigger, "/estimator/load").success
        later()
        node.process.kill()
        node.wait()
        node = estimator()
        later(2.0)
        ready("estimator")
        later(0.5)
    finally:
        source.terminate()
        source.wait(20)
    for process in (node, recorder):
        assert process.end() == 0, process.error

    recording = read_recording(bag)
    causes = [c.cause for c in recording.configurations]
    assert causes.count(4) >= 2  # loaded by hand, and by the node that was started again
    assert causes.count(2) >= 3
    report = verify(recording)
    assert report.different == 0, report.lines()
    # The recorder came late, and samples go out without a guarantee: a busy machine may lose some.
    assert report.compared > 0.5 * len(recording.estimates) > 700, report.lines()
    last = recording.estimates["configuration_revision"][-1]
    assert not any(f"revision {last} " in note for note in report.notes)


def test_what_cannot_be_verified_is_one_line(make_bag: Any, tmp_path: Path) -> None:
    with pytest.raises(BagError, match="no recorded estimates"):
        verify(read_recording(make_bag(count=10)))
    samples(tmp_path / "samples.csv")
    with pytest.raises(BagError, match="is a CSV file"):
        verify(read_recording(tmp_path / "samples.csv"))


def test_a_bag_of_another_version_says_so_in_one_line() -> None:
    """A setting that the filter has no more: nothing is compared, and the reason is named."""
    recording = read_recording(Path(__file__).resolve().parents[2] / "bags" / "example")
    for configuration in recording.configurations:
        configuration.parameters["an_old_setting"] = 1.0
    report = verify(recording)
    assert report.compared == 0
    (note,) = report.notes
    assert "another version of the suite" in note
    assert note.endswith("had an_old_setting: only that one can repeat it")
    assert "\n" not in note
