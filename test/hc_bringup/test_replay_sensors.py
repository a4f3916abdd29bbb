"""`hc replay` of a bag of sensors: the estimator makes samples of all of it, and counts those."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.serialization import serialize_message

from hc_bringup.commands import replay
from hc_bringup.conclusion import conclude
from hc_bringup.errors import UserError
from hc_bringup.run_state import RunState
from hc_bringup.statistics import EstimateStatistics
from hc_bringup.summary import run_summary, run_text
from hc_logger.type_names import SAMPLE_TYPE
from hc_logger.writer import BagWriter
from hc_msgs_py.units import set_stamp
from hc_msgs_py.wire import SampleEncoder

START = 1_700_000_000_000_000_000
COUNT = 2000
SENSORS = {
    "input.source": "sensors",
    "input.force.topic": "/ft",
    "input.position.type": "pose",
    "input.position.topic": "pose",
}


def write_sensors(folder: Path) -> Path:
    """Two seconds at 1 kHz, beside a pose that nobody wants and what an estimator made then."""
    with BagWriter(folder) as writer:
        forces = writer.add_topic("/ft", "geometry_msgs/msg/WrenchStamped")
        poses = writer.add_topic("/pose", "geometry_msgs/msg/PoseStamped")
        others = writer.add_topic("/camera", "geometry_msgs/msg/PoseStamped")
        samples = writer.add_topic("/indenter/sample", SAMPLE_TYPE)
        for i in range(COUNT):
            stamp = START + i * 10**6
            depth = 1e-3 * (i % 500)
            wrench, pose = WrenchStamped(), PoseStamped()
            set_stamp(wrench.header.stamp, stamp)
            set_stamp(pose.header.stamp, stamp)
            wrench.wrench.force.z = 0.5 * depth
            pose.pose.position.z = 1e-3 * depth
            writer.write(forces, stamp, serialize_message(wrench))
            writer.write(poses, stamp, serialize_message(pose))
            writer.write(others, stamp, serialize_message(pose))
            writer.write(samples, stamp, SampleEncoder().encode(stamp, i, depth, 0.1))
    return folder


def words_of(settings: dict[str, str]) -> list[str]:
    return [word for name, value in settings.items() for word in ("--param", f"{name}={value}")]


def plan_of(*words: str) -> Any:
    parser = argparse.ArgumentParser()
    replay.configure(parser)
    return replay._plan(parser.parse_args(words))[0]


def test_the_player_waits_for_the_topics_of_the_estimator(tmp_path: Path) -> None:
    bag = str(write_sensors(tmp_path / "bag"))
    plan = plan_of(bag, *words_of(SENSORS))
    player, estimator = plan.node("player").parameters, plan.node("estimator").parameters
    assert player["expected_topics"] == ["/pose", "/ft"]
    assert {"/indenter/sample", "/indenter/samples"} <= set(player["exclude"])
    assert estimator["expected_sample_subscribers"] == 0
    recorded = plan_of(bag, *words_of(SENSORS), "--bag", str(tmp_path / "out"))
    assert recorded.node("estimator").parameters["expected_sample_subscribers"] == 1
    plain = plan_of(bag, "--estimator")
    assert plain.node("player").parameters["expected_topics"] == [""]
    assert "/indenter/sample" not in plain.node("player").parameters["exclude"]
    effort = {"input.source": "effort", "input.position.topic": "/pose"}
    assert plan_of(bag, *words_of(effort)).node("player").parameters["expected_topics"] == ["/pose"]


def test_a_topic_that_the_bag_has_not_is_said_at_once(tmp_path: Path) -> None:
    """Regression: "node player does not get ready within 15 s: /ft has 0 of 1 subscribers"."""
    bag = str(write_sensors(tmp_path / "bag"))
    with pytest.raises(UserError, match=r"has no topic /ft2 \(input.force.topic\): it has /camera"):
        plan_of(bag, *words_of(SENSORS | {"input.force.topic": "ft2"}))


@pytest.mark.process
@pytest.mark.parametrize("recorded", [False, True])
def test_nothing_of_the_beginning_is_lost(command_line: Any, recorded: bool) -> None:
    """Regression: without a recorder no sample was made for 5 s ("0 estimates of 6000 samples")."""
    folder = Path(command_line.folder)
    write_sensors(folder / "bag")
    words = ["replay", "bag", *words_of(SENSORS), "--json", "--headless"]
    words += ["--bag", "out"] if recorded else []
    done = command_line.run(*words, timeout=240)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert (summary["samples"], summary["estimates"], summary["lost"]) == (COUNT, COUNT, 0)
    assert summary["messages"] == 3 * COUNT  # not what the estimator of then made


def state_of(**fields: Any) -> RunState:
    return RunState(EstimateStatistics(), 0.0, elapsed_s=3.0, **fields)


def test_messages_are_not_called_samples(capsys: pytest.CaptureFixture[str]) -> None:
    """Regression: 6000 messages of two sensors were samples, and those of other types "0"."""
    played = state_of(messages=6000, estimating=False)
    assert run_text(run_summary(played, None)).startswith("6000 messages in 3.0 s, and no estim")
    with pytest.raises(UserError, match="no estimate came of 6000 messages"):
        conclude(state_of(messages=6000), ["estimator"], None, as_json=False, with_latency=False)
    assert capsys.readouterr().out.startswith("0 estimates of 6000 messages in 3.0 s; lost 0")
