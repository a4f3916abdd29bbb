"""A misspelt parameter of any node is refused with the nearest name: ROS passes over it."""

import importlib
import os

import pytest

from hc_bringup.errors import UserError
from hc_bringup.param_target import targets
from hc_bringup.plan import NodePlan, RunPlan

NODES = (
    ("hc_sim_rig.node", "IndenterNode", ("stifness:=1.0",), "did you mean stiffness?"),
    ("hc_sim_rig.node", "IndenterNode", ("damping:=1.0", "scenario:=relaxation"), "it has: amp"),
    ("hc_sim_rig.master_node", "MasterNode", ("device.sing:=1",), "did you mean device.sign?"),
    ("hc_sim_rig.slave_node", "SlaveNode", ("qqq:=1",), "docs/reference/parameters.md lists its "),
    ("hc_logger.recorder_node", "RecorderNode", ("topcis:=a", "output:={}/bag"), "mean topics?"),
    ("hc_logger.player_node", "PlayerNode", ("lop:=true", "bag:={}/bag.mcap"), "mean loop?"),
    ("hc_bringup.dashboard.node", "DashboardNode", ("prot:=1",), "did you mean port?"),
    ("hc_estimator.ros.array_node", "ArrayEstimatorNode", ("thread:=1",), "mean threads?"),
    ("hc_estimator.node", "EstimatorNode", ("filtre:=ukf",), "did you mean filter?"),
)


@pytest.mark.parametrize(("module", "kind", "given", "hint"), NODES)
def test_it_is_one_line_with_the_nearest(
    ros_domain, monkeypatch, tmp_path, module, kind, given, hint
):
    import rclpy
    from mcap.writer import Writer

    from hc_msgs_py.node_main import NodeStartError

    with (tmp_path / "bag.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
        channel = writer.register_channel("/some", "cdr", schema)
        writer.add_message(channel, 0, b"\x00\x01\x00\x00\x00", 0)
        writer.finish()
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "log"))
    words = [word for text in given for word in ("-p", text.format(tmp_path))]
    node = getattr(importlib.import_module(module), kind)
    rclpy.init(args=["--ros-args", *words])
    try:
        with pytest.raises((ValueError, NodeStartError)) as raised:
            node()
    finally:
        rclpy.shutdown()
    name = given[0].partition(":=")[0]
    assert str(raised.value).startswith(f"unknown parameter {name} for node ")
    assert hint in str(raised.value)
    assert "bag" not in os.listdir(tmp_path)  # nothing was begun


def plan_of(*names):
    return RunPlan(tuple(NodePlan(name, "a_node") for name in names))


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("recorder.nope", (["recorder"], "nope")),
        ("filter", (["estimator"], "filter")),
        ("input.force.sign", (["estimator"], "input.force.sign")),
        ("state.folder", (["estimator"], "state.folder")),
    ],
)
def test_whom_a_parameter_is_for(text, found):
    assert targets(text, plan_of("indenter", "estimator", "recorder")) == found


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("recoder.nope", "did you mean recorder.nope?"),
        ("indentor.stiffness", "did you mean indenter.stiffness?"),
        ("player.loop", "the configuration starts indenter, estimator, recorder"),
    ],
)
def test_a_misspelt_node_is_not_taken_for_a_part_of_a_name(text, line):
    """They went to the estimator, which said that it had no parameter recoder.nope."""
    with pytest.raises(UserError) as raised:
        targets(text, plan_of("indenter", "estimator", "recorder"))
    assert str(raised.value) == f"--param {text}: {line}"


def test_a_node_without_its_namespace_is_each_of_them():
    two = plan_of("left/estimator", "right/estimator", "recorder")
    both = ["left/estimator", "right/estimator"]
    assert targets("estimator.filter", two) == targets("filter", two) == (both, "filter")
    assert targets("right/estimator.filter", two) == (["right/estimator"], "filter")
    with pytest.raises(UserError, match=r"did you mean right/estimator\.filter"):
        targets("rihgt/estimator.filter", two)
    with pytest.raises(UserError, match=r"starts recorder$"):
        targets("filter", plan_of("recorder"))
