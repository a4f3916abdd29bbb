"""Run configurations: what is read, and what is refused with which words."""

import os
from pathlib import Path

import pytest

from hc_bringup.errors import UserError
from hc_bringup.paths import find_config
from hc_bringup.plan import load_plan
from hc_sim_rig.scenario import ScenarioError, load_scenario

ROOT = Path(__file__).resolve().parents[2]


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "run.yaml"
    path.write_text(text)
    return path


def test_the_shipped_configuration_is_valid() -> None:
    plan = load_plan(ROOT / "config" / "run.yaml")
    assert [node.name for node in plan.nodes] == ["indenter", "estimator", "recorder"]
    assert [node.source for node in plan.nodes] == [True, False, False]
    assert all(f.is_file() for node in plan.nodes for f in node.parameter_files)


def test_the_configuration_for_a_robot_is_valid_and_has_no_source() -> None:
    plan = load_plan(ROOT / "config" / "robot_run.yaml")
    assert [node.name for node in plan.nodes] == ["estimator", "recorder"]
    assert not any(node.source for node in plan.nodes)
    assert plan.nodes[0].respawn


def test_reads_every_key(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("a: {ros__parameters: {x: 1}}")
    path = write(
        tmp_path,
        """
duration_s: 2.5
nodes:
  - {name: a, module: pkg.node, parameter_files: [p.yaml], parameters: {k: 3}, source: true}
  - {name: b, module: other, respawn: true}
""",
    )
    plan = load_plan(path)
    assert plan.duration_s == 2.5
    first, second = plan.nodes
    assert first.parameter_files == (tmp_path / "p.yaml",)
    assert first.parameters == {"k": 3}
    assert first.source
    assert not first.respawn
    assert second.respawn
    assert not second.source
    assert plan.node("b") is second
    assert plan.node("c") is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "must have the keys duration_s, nodes"),
        ("[1, 2]", "must have the keys"),
        ("nodes: {", "not valid YAML"),
        ("durations: 1", "unknown key 'durations'; did you mean duration_s?"),
        ("duration_s: 1", "nodes must list at least one node"),
        ("duration_s: -1\nnodes: [{name: a, module: b}]", "duration_s is -1; give seconds >= 0"),
        ("duration_s: .nan\nnodes: [{name: a, module: b}]", "duration_s is nan"),
        ("duration_s: .inf\nnodes: [{name: a, module: b}]", "duration_s is inf"),
        (f"duration_s: {10**400}\nnodes: [{{name: a, module: b}}]", "duration_s is 1000000"),
        ("duration_s: true\nnodes: [{name: a, module: b}]", "duration_s is True"),
        ("nodes: [3]", "node 1 must have the keys"),
        ("nodes: [{module: b}]", "name is None"),
        ("nodes: [{name: a b, module: b}]", "name is 'a b'"),
        ("nodes: [{name: a}]", "module is None"),
        ("nodes: [{name: a, modul: b}]", "did you mean module?"),
        ("nodes: [{name: a, module: b}, {name: a, module: c}]", "two nodes have the same name"),
        ("nodes: [{name: a, module: b, parameter_files: [no.yaml]}]", "there is no parameter file"),
        ("nodes: [{name: a, module: b, parameter_files: no.yaml}]", "must be a list of files"),
        ("nodes: [{name: a, module: b, parameters: 3}]", "must be names with values"),
        ("nodes: [{name: a, module: b, source: yes please}]", "give true or false"),
        ("nodes: [{name: a, module: b, namespace: 3}]", "namespace is 3; give a name, like left"),
        ("nodes: [{name: a, module: b, namespace: to the left}]", "namespace is 'to the left'"),
        ("nodes: [{name: a, module: b, namespace: a//b}]", "namespace is 'a//b'"),
        (
            "nodes: [{name: recorder, module: b, namespace: c}]",
            "a recorder is for the topics of all namespaces",
        ),
        (
            "nodes: [{name: a, module: b, namespace: c}, {name: a, module: c, namespace: /c/}]",
            "two nodes have the same name among c/a, c/a",
        ),
    ],
)
def test_refuses_with_one_line_that_names_the_problem(
    tmp_path: Path, text: str, words: str
) -> None:
    path = write(tmp_path, text)
    with pytest.raises(UserError) as caught:
        load_plan(path)
    message = str(caught.value)
    assert words in message
    assert str(path) in message
    assert "\n" not in message
    assert caught.value.status == 2


def test_refuses_what_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "run.yaml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UserError, match="not a text file"):
        load_plan(path)


def test_a_parameter_file_that_is_a_loop_of_links_is_none(tmp_path: Path) -> None:
    (tmp_path / "loop.yaml").symlink_to("loop.yaml")
    path = write(tmp_path, "nodes: [{name: a, module: b, parameter_files: [loop.yaml]}]")
    with pytest.raises(UserError, match="there is no parameter file"):
        load_plan(path)


def test_refuses_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot read"):
        load_plan(tmp_path / "no.yaml")


def test_an_estimator_of_another_name_would_not_be_followed(tmp_path: Path) -> None:
    """Regression: its losses and parameters stood nowhere, and in one namespace both published."""
    path = tmp_path / "run.yaml"
    for space in ("", ", namespace: other"):
        path.write_text(f"nodes: [{{name: second, module: hc_estimator.node{space}}}]")
        with pytest.raises(UserError, match=r"called estimator, not second.*namespace: second"):
            load_plan(path)


@pytest.mark.parametrize(
    "text",
    [
        "a: {ros__parameters: {x: 1}}",
        "/**: {ros__parameters: {x: 1}}",
        "/**/a: {ros__parameters: {}}",
        "b: {ros__parameters: {}}\n'*': {ros__parameters: {}}",
    ],
)
def test_a_parameter_file_for_the_node_is_taken(tmp_path: Path, text: str) -> None:
    (tmp_path / "p.yaml").write_text(text)
    path = write(tmp_path, "nodes: [{name: a, module: pkg.node, parameter_files: [p.yaml]}]")
    assert load_plan(path).nodes[0].parameter_files == (tmp_path / "p.yaml",)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hello world", "is no ROS parameter file"),
        ("", "is no ROS parameter file"),
        ("- x", "is no ROS parameter file"),
        ("a: {parameters: {x: 1}}", "is no ROS parameter file"),
        ("a:\n\tx: 1", "is not valid YAML"),
        ("aa: {ros__parameters: {x: 1}}", "has no parameters for node a, only for aa: name it"),
        ("/ns: {a: {ros__parameters: {}}}", "has no parameters for node a, only for ns/a"),
        ("/ns/a: {ros__parameters: {}}", "has no parameters for node a, only for ns/a"),
    ],
)
def test_a_parameter_file_that_would_be_passed_over_is_refused(
    tmp_path: Path, text: str, words: str
) -> None:
    (tmp_path / "p.yaml").write_text(text)
    path = write(tmp_path, "nodes: [{name: a, module: pkg.node, parameter_files: [p.yaml]}]")
    with pytest.raises(UserError, match=words) as caught:
        load_plan(path)
    assert "\n" not in str(caught.value)


def test_a_file_of_parameters_is_no_run_and_the_run_is_named(tmp_path: Path) -> None:
    """Regression: `hc run my_robot.yaml` said "unknown key '/**'; allowed: duration_s, nodes"."""
    file = tmp_path / "my_robot.yaml"
    file.write_text("/**:\n  ros__parameters:\n    filter: ukf\n")
    with pytest.raises(UserError, match=r"holds parameters of nodes; .*config/robot_run.yaml"):
        load_plan(file)
    (tmp_path / "my_robot_run.yaml").write_text("nodes: []")
    with pytest.raises(UserError, match=r"hc run \S*my_robot_run.yaml") as raised:
        load_plan(file)
    assert raised.value.status == 2


@pytest.mark.timeout(20)
@pytest.mark.parametrize("name", ["pipe", "pipe.yaml"])
def test_a_pipe_is_no_configuration_and_no_scenario(tmp_path: Path, name: str) -> None:
    """Regression: "no configuration", and a scenario of a pipe was waited for without a word."""
    pipe = tmp_path / name
    os.mkfifo(pipe)
    with pytest.raises(UserError) as refused:
        find_config(str(pipe))
    assert str(refused.value) == f"{pipe} is a pipe: write it to a YAML file, and give that"
    with pytest.raises(ScenarioError) as no_scenario:
        load_scenario(pipe)
    said = f"scenario {pipe} is a pipe: write it to a .yaml file, and give that"
    assert str(no_scenario.value) == said
