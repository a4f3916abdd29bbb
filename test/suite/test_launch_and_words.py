"""The launch file with stand-ins of launch; the warnings and words that docs/guide explains."""

import ast
import re
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from hc_bringup.cli import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
ROBOT = (ROOT / "docs/guide/own_robot.md").read_text(encoding="utf-8")
WARNINGS = (ROOT / "docs/guide/warnings.md").read_text(encoding="utf-8")
SOURCES = (
    "hc_estimator/hc_estimator/stream/sanity.py",
    "hc_estimator/hc_estimator/stream/sign_checks.py",
    "hc_estimator/hc_estimator/stream/exchanged.py",
    "hc_estimator/hc_estimator/stream/channel_checks.py",
    "hc_estimator/hc_estimator/stream/friction_checks.py",
    "hc_estimator/hc_estimator/stream/smoothing_checks.py",
    "hc_estimator/hc_estimator/stream/tool_motion_checks.py",
    "hc_estimator/hc_estimator/stream/both_channels.py",
    "hc_estimator/hc_estimator/stream/range_checks.py",
    "hc_estimator/hc_estimator/stream/stamp_checks.py",
    "hc_estimator/hc_estimator/stream/readings.py",
    "hc_estimator/hc_estimator/stream/rigid_press.py",
    "hc_bringup/hc_bringup/robot_mechanics.py",
    "hc_bringup/hc_bringup/live_check.py",
    "hc_bringup/hc_bringup/diagnosis.py",
    "hc_bringup/hc_bringup/channel_findings.py",
    "hc_bringup/hc_bringup/other_damping.py",
    "hc_bringup/hc_bringup/held_tool.py",
    "hc_bringup/hc_bringup/play.py",
    "hc_bringup/hc_bringup/sticking.py",
    "hc_bringup/hc_bringup/sensor_effect.py",
    "hc_bringup/hc_bringup/wandering_zero.py",
    "hc_bringup/hc_bringup/tried_on_law.py",
    "hc_bringup/hc_bringup/vibration.py",
    "hc_bringup/hc_bringup/yielding.py",
    "hc_bringup/hc_bringup/force_error.py",
    "hc_logger/hc_logger/sensors.py",
    "hc_logger/hc_logger/press_direction.py",
    "hc_logger/hc_logger/cross_talk.py",
    "hc_logger/hc_logger/findings.py",
    "hc_estimator/hc_estimator/ros/zero_setting.py",
    "hc_estimator/hc_estimator/stream/stamp_watch.py",
    "hc_estimator/hc_estimator/stream/session.py",
    "hc_estimator/hc_estimator/ros/clock_jumps.py",
    "hc_estimator/hc_estimator/ros/moving_surface.py",
    "hc_estimator/hc_estimator/ros/sensors.py",
    "hc_estimator/hc_estimator/ros/status.py",
    "hc_estimator/hc_estimator/ros/namesakes.py",
    "hc_estimator/hc_estimator/stream/array_status.py",
    "hc_estimator/hc_estimator/stream/array_watch.py",
    "hc_estimator/hc_estimator/ros/inputs.py",
    "hc_estimator/hc_estimator/stream/zero_steps.py",
    "hc_bringup/hc_bringup/read_otherwise.py",
    "hc_bringup/hc_bringup/real_readings.py",
    "hc_bringup/hc_bringup/reading_changes.py",
    "hc_bringup/hc_bringup/run_clock.py",
    "hc_bringup/hc_bringup/stopped_processes.py",
    "hc_bringup/hc_bringup/summary.py",
    "hc_bringup/hc_bringup/commands/estimate.py",
    "hc_bringup/hc_bringup/commands/compliance.py",
    "hc_bringup/hc_bringup/topic_tools.py",
)
WARNERS = tuple(
    s
    for s in SOURCES
    if not s.endswith(
        (
            "hc_logger/sensors.py",
            "zero_setting.py",
            "robot_mechanics.py",
            "hc_logger/findings.py",
            "session.py",
            "clock_jumps.py",
            "read_otherwise.py",
            "real_readings.py",
            "rigid_press.py",
            "topic_tools.py",
            "summary.py",
            "estimate.py",
            "compliance.py",
        )
    )
)
"""Those whose every sentence is a warning, but for the ones here: parts, costs and counters."""
NO_WARNINGS = (
    "N over ",
    "the \0 is noise alone (",  # a part of a sentence
    "the \0 reads \0 \0 all the time",
    "or in gram-force",
    "of a topic that is in millimetres",
    "the clocks of sensor and computer differ",  # the second half
    "cannot be said, and neither can delay",
    "little: no parameter changes",
    "nothing was known; with it",
    "known from the data",
    " was \0, is ",
    "a reading is no finite number",
    "their stamp ",
    "a reading beyond force_limit",
    "messages of other publishers on",
    "most messages waiting on",
    "no usable \0 for",
    "waits for the first sample",
    "\0 of \0 publishers",  # who is waited for, while a node starts
    "listening to \0: ",
    "recording is played",  # what follows a warning that the page explains
    "recording that is played at another rate",
    "a moving mean over \0 s",  # parts of a sentence
    "with a corner at",
    "; with it in the law K = ",
    "(hc doctor says the others)",
)


@pytest.fixture
def launch_stand_ins(monkeypatch):
    """The few names of launch and launch_ros that the file uses; no wheel has them."""
    names = {
        "launch": ("LaunchDescription",),
        "launch.actions": ("DeclareLaunchArgument",),
        "launch.substitutions": ("LaunchConfiguration",),
        "launch_ros": (),
        "launch_ros.actions": ("Node",),
    }
    for module_name, classes in names.items():
        module = ModuleType(module_name)
        for name in classes:
            setattr(
                module,
                name,
                lambda *words, _name=name, **values: SimpleNamespace(
                    kind=_name, words=words, **values
                ),
            )
        monkeypatch.setitem(sys.modules, module_name, module)


def test_the_launch_file_starts_what_the_packages_install(launch_stand_ins):
    path = ROOT / "src/hc_bringup/launch/robot.launch.py"
    described = runpy.run_path(str(path))["generate_launch_description"]()
    (entities,) = described.words
    nodes = [entity for entity in entities if entity.kind == "Node"]
    assert [node.name for node in nodes] == ["estimator", "recorder"]
    for node in nodes:
        setup = (ROOT / "src" / node.package / "setup.py").read_text(encoding="utf-8")
        assert re.search(rf'"{node.executable} = {node.package}\.', setup)
    arguments = {e.words[0] for e in entities if e.kind == "DeclareLaunchArgument"}
    assert arguments == {"params_file", "bag"}
    assert "launch/*.launch.py" in (ROOT / "src/hc_bringup/setup.py").read_text(encoding="utf-8")


def sentences(sources) -> list[str]:
    """All texts of some modules but docstrings; a zero character where a value is filled in."""
    parts = []
    for source in sources:
        tree = ast.parse((ROOT / "src" / source).read_text(encoding="utf-8"))
        inside = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
                inside.add(id(node.value))  # a docstring
            elif isinstance(node, ast.JoinedStr):
                inside |= {id(value) for value in node.values}
                values = (v.value if isinstance(v, ast.Constant) else "\0" for v in node.values)
                parts.append("".join(map(str, values)))
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                parts += [node.value] if id(node) not in inside else []
    return [" ".join(part.split()) for part in parts]


def phrases() -> list[tuple[str, list[str]]]:
    """What the rows of the tables name: each phrase, and its pieces around what is filled in."""
    rows = [line.split("|")[1].strip() for line in WARNINGS.splitlines() if line.startswith("| ")]
    found = []
    for phrase in (p.strip() for row in rows if row != "it says" for p in row.split(";")):
        # Numbers and units stand for what is filled in.
        pieces = re.split(r"\.\.\.|\b[0-9.]+(?: [a-zA-Z]+| %)?|largest|metres|seconds", phrase)
        found.append((phrase, [p.strip(" ,") for p in pieces if len(p.strip(" ,")) >= 8]))
    return found


def test_what_the_page_explains_is_what_the_programs_say():
    told = "\n".join(sentences(SOURCES))
    assert len(phrases()) > 40
    for phrase, pieces in phrases():
        if not phrase.startswith("two publishers"):  # SOURCE_CONFLICT of docs/node.md
            assert any(piece in told for piece in pieces), phrase


def test_what_the_programs_say_is_explained_on_the_page():
    explained = [piece for _phrase, pieces in phrases() for piece in pieces]
    explained += ["publishers on ", "late against the", *NO_WARNINGS]
    said = [s for s in sentences(WARNERS) if len(s.split()) >= 5]
    assert len(said) > 40
    assert [s for s in said if not any(piece in s for piece in explained)] == []


def test_the_words_of_ros2_that_the_page_promises_exist(capsys):
    from hc_bringup.cli import main

    table = ROBOT.split("| ros2 | hc |")[1]
    table = table.split("\n\n")[0]
    for line in table.splitlines()[2:]:
        ours = line.split("|")[2]
        for command in re.findall(r"hc ([a-z]+)", ours):
            assert command in COMMANDS
    for command, actions in re.findall(r"\| ros2 (\w+) ([a-z, ]+) \|", table):
        if command == "bag":
            continue
        with pytest.raises(SystemExit):
            main([command, "--help"])
        shown = capsys.readouterr().out
        assert all(re.search(rf"^    {action}\b", shown, re.M) for action in actions.split(", "))


def test_the_node_that_stamps_a_microcontrollers_readings(monkeypatch: pytest.MonkeyPatch) -> None:
    """The guide's: what comes in as a number goes out as what the estimator reads."""
    import rclpy
    from builtin_interfaces.msg import Time
    from std_msgs.msg import Float64

    sent: list[tuple[str, Any]] = []
    heard: dict[str, Any] = {}

    class Node:
        def __init__(self, _name: str) -> None:
            self.get_clock = self.now = lambda: self

        def to_msg(self) -> Time:
            return Time(sec=7, nanosec=8)

        def create_publisher(self, _kind: Any, topic: str, _depth: int) -> Any:
            return SimpleNamespace(publish=lambda message: sent.append((topic, message)))

        def create_subscription(self, _kind: Any, topic: str, take: Any, _depth: int) -> None:
            heard[topic] = take

    monkeypatch.setattr(rclpy, "init", lambda: None)
    monkeypatch.setattr(rclpy, "spin", lambda _node: None)
    monkeypatch.setattr("rclpy.node.Node", Node)
    (code,) = re.findall(r"```python\n(import rclpy\n.*?)```", ROBOT, re.DOTALL)
    exec(code, {})
    heard["load_cell"](Float64(data=2.5))
    heard["encoder"](Float64(data=0.003))
    (force_topic, force), (place_topic, place) = sent
    assert (force_topic, force.wrench.force.z) == ("stamped/wrench", 2.5)
    assert (place_topic, list(place.position)) == ("stamped/joint", [0.003])
    assert force.header.stamp == place.header.stamp == Time(sec=7, nanosec=8)
