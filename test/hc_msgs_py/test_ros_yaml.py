"""What is written for ROS's own reader of parameter files comes back as it was."""

from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context

from hc_msgs_py.parameters import declare
from hc_msgs_py.ros_yaml import dump_for_ros, scalar_for_ros

TEXTS = [
    "x",
    "y",
    "Y",
    "n",
    "N",
    "yes",
    "No",
    "on",
    "OFF",
    "true",
    "null",
    "1e5",
    "7",
    "0x1f",
    ".inf",
    "nan",
    "inf",
    "~",
    "-",
    "#",
    "/tf",
    "/arm/tcp",
    "tool0",
    "a.b-c_d",
    "",
    "tool: 1",
    "two words",
    'quo"te',
    "it's",
    " lead",
    "back\\slash",
    "Prüfkopf",
    "[a]",
]


@pytest.fixture
def read(tmp_path: Path):
    """Read a parameter file as nodes do; gives a node that has what is in it."""
    context = Context()
    nodes = []

    def start(text: str) -> rclpy.node.Node:
        path = tmp_path / "given.yaml"
        path.write_text(text, encoding="utf-8")
        rclpy.init(args=["--ros-args", "--params-file", str(path)], context=context)
        nodes.append(rclpy.create_node("given", context=context, enable_rosout=False))
        return nodes[-1]

    yield start
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()


@pytest.mark.usefixtures("ros_domain")
def test_every_text_comes_back_as_the_text_it_was(read) -> None:
    tree = {f"p{number}": text for number, text in enumerate(TEXTS)}
    lines = [f"    q{number}: {scalar_for_ros(text)}\n" for number, text in enumerate(TEXTS)]
    node = read(dump_for_ros({"given": {"ros__parameters": tree}}) + "".join(lines))
    for number, text in enumerate(TEXTS):
        for name in (f"p{number}", f"q{number}"):
            assert (name, node._parameter_overrides[name].value) == (name, text)


@pytest.mark.usefixtures("ros_domain")
def test_an_axis_that_ros_takes_for_a_boolean_is_the_axis(read) -> None:
    """Regression: `axis: y`, as hc setup wrote it, ended the node: "axis = True is not one of"."""
    node = read("given:\n  ros__parameters: {axis: y, other: n, joint: y}\n")
    assert declare(node, "axis", "z", "which", choices=("x", "y", "z")) == "y"
    with pytest.raises(ValueError, match="put it in quotation marks"):
        declare(node, "other", "z", "which", choices=("x", "y", "z"))
    with pytest.raises(ValueError, match=r"joint = True is not a text .*quotation marks"):
        declare(node, "joint", "", "which")
