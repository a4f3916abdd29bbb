"""The indenter node as a process: what it publishes, how it is steered, how it ends."""

from __future__ import annotations

import itertools
import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from hc_msgs.msg import (
    HuntCrossleyEstimate,
    HuntCrossleyEstimates,
    IndenterSample,
    IndenterTruth,
)
from rcl_interfaces.srv import DescribeParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from hc_msgs_py import qos
from hc_msgs_py.background import STARTING
from hc_msgs_py.wire_arrays import MOST_SAMPLES
from hc_sim_rig import Rig
from hc_sim_rig.scenario import SCENARIO_FOLDER

pytestmark = pytest.mark.process

WHOLE_STREAM = qos.SAMPLE_PUBLISHER_QOS
"""As a recorder subscribes: what a busy machine delays is sent again (best effort loses it)."""


def nanoseconds(message: Any) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def set_parameter(listener: Any, name: str, value: Any) -> Any:
    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    return listener.call(SetParameters, "indenter/set_parameters", request).results[0]


def answer_of_ready(listener: Any) -> Any:
    """Return what the rig's ~/ready says once it is compiled; it answers before."""
    answers: list[Any] = []

    def is_compiled() -> bool:
        answers.append(listener.call(Trigger, "indenter/ready", Trigger.Request()))
        return not answers[-1].message.startswith(STARTING)

    assert listener.spin(until=is_compiled)
    return answers[-1]


def test_all_topics_carry_the_rig_sample_by_sample(start_rig: Any) -> None:
    rig, listener = start_rig(
        scenario="teleoperation",
        seed=9,
        start_paused=True,
        expected_sample_subscribers=1,
        expected_truth_subscribers=1,
    )
    answer = answer_of_ready(listener)
    assert not answer.success
    assert "indenter/sample has 0 of 1 subscribers" in answer.message
    assert "indenter/truth has 0 of 1 subscribers" in answer.message
    keep = lambda message: message  # noqa: E731
    samples = listener.collect(IndenterSample, "indenter/sample", WHOLE_STREAM, keep)
    profile = qos.SAMPLE_QOS
    truths = listener.collect(IndenterTruth, "indenter/truth", profile, keep)
    wrenches = listener.collect(WrenchStamped, "indenter/wrench", profile, keep)
    joints = listener.collect(JointState, "indenter/joint_states", profile, keep)
    status = listener.collect(DiagnosticArray, "/diagnostics", qos.DIAGNOSTICS_QOS, keep)

    def ready() -> bool:
        request = Trigger.Request()
        return listener.call(Trigger, "indenter/ready", request).success

    assert listener.spin(until=ready)
    listener.spin(0.5)
    assert not samples
    answer = listener.call(SetBool, "indenter/run", SetBool.Request(data=True))
    assert answer.success
    assert listener.spin(until=lambda: len(samples) >= 1500 and len(status) >= 2)
    assert rig.stop() == 0
    listener.spin(0.3)
    stamps = np.array([nanoseconds(m) for m in samples])
    assert np.all(np.diff(stamps) == 1_000_000)
    assert [m.sequence for m in samples] == list(range(len(samples)))
    assert abs(stamps[0] - time.time_ns()) < 60e9
    series = Rig("teleoperation", seed=9).run(len(samples) / 1000.0)
    np.testing.assert_array_equal([m.displacement for m in samples], series.displacement_mm / 1000)
    np.testing.assert_array_equal([m.force for m in samples], series.force_n)
    assert wrenches[0].header.frame_id == samples[0].header.frame_id == "indenter_tip"
    assert list(joints[0].name) == ["master", "slave"]
    # What goes out without a guarantee: whatever came belongs to the sample of its stamp.
    for messages in (truths, wrenches, joints):
        found = [(nanoseconds(m) - int(stamps[0])) // 1_000_000 for m in messages]
        assert found == sorted(set(found))
        assert [nanoseconds(m) for m in messages] == stamps[found].tolist()
        if messages is truths:
            assert [m.sequence for m in messages] == found
            np.testing.assert_array_equal(
                [(m.velocity, m.stiffness) for m in messages],
                np.c_[series.truth.velocity_mm_s / 1000, series.truth.parameters[:, 0]][found],
            )
        elif messages is wrenches:
            np.testing.assert_array_equal(
                [m.wrench.force.z for m in messages], series.force_n[found]
            )
        else:
            np.testing.assert_array_equal(
                [list(m.position) for m in messages],
                np.c_[series.master.position_mm, series.slave.position_mm][found] / 1000,
            )
    values = {pair.key: pair.value for pair in status[-1].status[0].values}
    assert int(values["samples"]) > 0
    assert values["nominal_rate_hz"] == "1000"
    assert "forward_overtaken" in values


@pytest.mark.slow
def test_a_stopped_process_catches_up_without_a_gap(start_rig: Any) -> None:
    rig, listener = start_rig(scenario="multisine", start_paused=True)
    found = listener.collect(
        IndenterSample,
        "indenter/sample",
        WHOLE_STREAM,
        lambda m: (m.sequence, nanoseconds(m)),
    )
    listener.call(SetBool, "indenter/run", SetBool.Request(data=True))
    assert listener.spin(until=lambda: len(found) > 300)
    os.kill(rig.process.pid, signal.SIGSTOP)
    listener.spin(0.4)
    os.kill(rig.process.pid, signal.SIGCONT)
    assert listener.spin(until=lambda: len(found) > 1200)
    assert rig.stop(signal.SIGTERM) == 0
    sequences, stamps = np.array(found).T
    assert np.all(np.diff(sequences) == 1)
    assert np.all(np.diff(stamps) == 1_000_000)


def test_the_scenario_changes_while_the_rig_runs(start_rig: Any, tmp_path: Path) -> None:
    rig, listener = start_rig(scenario="multisine")
    samples = listener.collect(
        IndenterSample, "indenter/sample", WHOLE_STREAM, lambda m: (m.sequence, nanoseconds(m))
    )
    found = listener.collect(
        IndenterTruth, "indenter/truth", qos.SAMPLE_QOS, lambda m: m.displacement_exponent
    )
    assert listener.spin(until=lambda: len(found) > 100)

    def names() -> set[str]:
        request = ListParameters.Request()
        return set(listener.call(ListParameters, "indenter/list_parameters", request).result.names)

    assert "damping" in names()
    assert set_parameter(listener, "scenario", "lump").successful
    assert listener.spin(until=lambda: found[-1] == 1.6)
    assert set_parameter(listener, "stiffness", 0.7).successful
    assert set_parameter(listener, "scenario", "relaxation").successful
    assert listener.spin(until=lambda: np.isnan(found[-1]))
    assert listener.spin(until=lambda: "damping" not in names())
    assert set_parameter(listener, "scenario", "multisine").successful
    assert listener.spin(until=lambda: found[-1] == 1.8)
    assert listener.spin(until=lambda: "damping" in names())
    slow = tmp_path / "slow.yaml"
    slow.write_text(
        (SCENARIO_FOLDER / "multisine.yaml").read_text().replace("rate_hz: 1000", "rate_hz: 500")
    )
    for name, says in ((str(slow), "500 Hz"), ("nowhere", "multisine")):
        refused = set_parameter(listener, "scenario", name)
        assert not refused.successful
        assert says in refused.reason
    assert rig.stop() == 0
    pairs = itertools.pairwise(samples)
    assert [(a, b) for a, b in pairs if (b[0] - a[0], b[1] - a[1]) != (1, 1_000_000)] == []


@pytest.mark.slow
def test_parameters_steer_and_are_checked(start_rig: Any) -> None:
    rig, listener = start_rig(scenario="multisine", amplitude=0.5)
    found = listener.collect(
        IndenterTruth,
        "indenter/truth",
        qos.SAMPLE_QOS,
        lambda m: (m.displacement * 1000, m.velocity * 1000, m.stiffness),
    )
    request = DescribeParameters.Request(names=["stiffness", "seed"])
    described = listener.call(DescribeParameters, "indenter/describe_parameters", request)
    stiffness = described.descriptors[0]
    assert "K" in stiffness.description
    assert "N/mm^n" in stiffness.description
    assert stiffness.floating_point_range[0].to_value == 1e6
    assert described.descriptors[1].read_only
    assert listener.spin(until=lambda: len(found) > 100)
    assert set_parameter(listener, "stiffness", 0.9).successful
    refused = set_parameter(listener, "stiffness", -1.0)
    assert not refused.successful
    assert "stiffness" in refused.reason
    assert not set_parameter(listener, "seed", 3).successful
    assert listener.spin(until=lambda: found[-1][2] == 0.9)
    found.clear()
    assert listener.spin(until=lambda: len(found) > 1600)
    assert 0.7 < np.abs(np.array(found)[:, 0] - 3.0).max() < 1.2  # half of 1.6 + 0.8 mm
    answer = listener.call(SetBool, "indenter/run", SetBool.Request(data=False))
    assert "rest" in answer.message
    listener.spin(1.5)
    found.clear()
    assert listener.spin(until=lambda: len(found) > 100)
    assert np.abs([v for _, v, _ in found]).max() < 1e-3
    assert set_parameter(listener, "pause", False).successful
    assert listener.spin(until=lambda: abs(found[-1][1]) > 1.0)
    assert rig.stop() == 0


@pytest.mark.slow
def test_it_stops_publishing_at_the_end_and_may_end_itself(start_rig: Any, tmp_path: Any) -> None:
    short = (SCENARIO_FOLDER / "multisine.yaml").read_text().replace("60.0", "0.3")
    (tmp_path / "short.yaml").write_text(short)
    rig, listener = start_rig(scenario=tmp_path / "short.yaml", start_paused=True, exit_at_end=True)
    found = listener.collect(IndenterSample, "indenter/sample", WHOLE_STREAM, lambda m: m.sequence)
    listener.call(SetBool, "indenter/run", SetBool.Request(data=True))
    assert listener.spin(until=lambda: len(found) == 300)
    assert rig.wait() == 0
    listener.spin(0.2)
    assert found == list(range(300))


@pytest.mark.slow
def test_simulated_time_runs_at_its_pace(start_rig: Any) -> None:
    rig, listener = start_rig(
        scenario="multisine", time="simulated", rate=4.0, start_paused=True, use_sim_time=True
    )
    found = listener.collect(
        IndenterSample,
        "indenter/sample",
        WHOLE_STREAM,
        lambda m: (nanoseconds(m), time.monotonic()),
    )
    clock = listener.collect(Clock, "/clock", 100, lambda m: m.clock.sec * 10**9 + m.clock.nanosec)
    assert listener.spin(until=lambda: len(clock) > 2)
    assert len(set(clock)) == 1  # stands still before the first sample
    listener.call(SetBool, "indenter/run", SetBool.Request(data=True))
    assert listener.spin(until=lambda: len(found) > 4000)
    stamps, received = np.array(found, dtype=object).T
    assert np.all(np.diff(stamps.astype(np.int64)) == 1_000_000)
    pace = (stamps[-1] - stamps[0]) * 1e-9 / (received[-1] - received[0])
    assert 3.0 < pace < 5.0
    assert stamps[0] == clock[0]
    assert np.all(np.diff(clock) >= 0)
    assert rig.stop() == 0


def estimates_of(first: int, count: int) -> HuntCrossleyEstimates:
    """Return a message of estimates; only their sequences say something."""
    message = HuntCrossleyEstimates()
    for name, kind in message.get_fields_and_field_types().items():
        if kind.startswith("sequence<"):
            width = int(kind.rstrip(">").partition(",")[2]) // MOST_SAMPLES
            value = False if "boolean" in kind else 0.0 if "double" in kind else 0
            setattr(message, name, [value] * (width * count))
    message.sequence = list(range(first, first + count))
    return message


@pytest.mark.parametrize("arrays", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_lockstep_waits_for_every_estimate(start_rig: Any, arrays: bool) -> None:
    """Whether the estimator tells them one by one or in arrays."""
    rig, listener = start_rig(
        scenario="multisine", time="lockstep", rate=1000.0, start_paused=True, lockstep_timeout=20.0
    )
    answer = answer_of_ready(listener)
    assert "hc/estimate has no publisher" in answer.message
    publisher = listener.node.create_publisher(
        HuntCrossleyEstimate, "hc/estimate", qos.ESTIMATE_QOS
    )
    several = listener.node.create_publisher(
        HuntCrossleyEstimates, "hc/estimates", qos.ESTIMATE_QOS
    )
    found: list[int] = []

    def answer_to(sequence: int) -> None:
        if arrays:
            several.publish(estimates_of(sequence, 1))
        else:
            publisher.publish(HuntCrossleyEstimate(sequence=sequence))

    ahead: list[int] = []

    def on_sample(message: Any) -> None:
        found.append(message.sequence)
        if message.sequence == 100:
            return  # keep this one back
        answer_to(message.sequence)

    listener.node.create_subscription(IndenterSample, "indenter/sample", on_sample, WHOLE_STREAM)

    def ready() -> bool:
        request = Trigger.Request()
        return listener.call(Trigger, "indenter/ready", request).success

    def heard() -> bool:
        return publisher.get_subscription_count() == several.get_subscription_count() == 1

    assert listener.spin(until=lambda: ready() and heard())
    listener.call(SetBool, "indenter/run", SetBool.Request(data=True))
    assert listener.spin(until=lambda: len(found) == 101)
    listener.spin(0.5)
    ahead = list(found)
    assert ahead == list(range(101))  # it waits
    answer_to(100)
    assert listener.spin(until=lambda: len(found) > 300)
    assert found == list(range(len(found)))
    assert rig.stop() == 0


@pytest.mark.parametrize(
    ("parameters", "needles"),
    [
        ({"scenario": "nowhere"}, ["nowhere", "multisine"]),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ({"rate": 2.0}, ["rate", "simulated"]),
                ({"seed": -3}, ["seed", "-3"]),
                ({"stiffness": -1.0}, ["stiffness", "-1"]),
                ({"use_sim_time": True}, ["use_sim_time", "simulated"]),
                ({"time": "lunar"}, ["time", "lunar", "lockstep"]),
            )
        ),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(
    start_rig: Any, parameters: dict[str, Any], needles: list[str]
) -> None:
    rig, _ = start_rig(**parameters)
    assert rig.wait() == 2
    output = rig.output().strip()
    assert "\n" not in output
    for needle in needles:
        assert needle in output


def test_a_loop_that_runs_away_ends_the_node_with_a_line(start_rig: Any, tmp_path: Any) -> None:
    text = (SCENARIO_FOLDER / "teleoperation.yaml").read_text()
    text = text.replace("[0.2, 2.0]", "[0.2, 20.0]")
    text = text.replace("kind: hunt_crossley", "kind: adhesive")
    (tmp_path / "wild.yaml").write_text(text)
    rig, _ = start_rig(scenario=tmp_path / "wild.yaml", time="simulated", rate=5.0)
    assert rig.wait() == 1
    assert "has run away" in rig.output()
    assert "Traceback" not in rig.output()
