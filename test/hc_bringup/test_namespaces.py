"""Two estimators in one run, each in a namespace: what is started, and what is said of each."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from rclpy.task import Future
from rich.console import Console
from std_srvs.srv import Trigger

from hc_bringup.commands import dashboard as dashboard_command
from hc_bringup.commands import run as run_command
from hc_bringup.conclusion import conclude
from hc_bringup.errors import UserError
from hc_bringup.estimate_listener import EstimateListener
from hc_bringup.live import Display, _line_of_other
from hc_bringup.monitor import Monitor
from hc_bringup.plan import NodePlan, RunPlan, load_plan
from hc_bringup.processes import NodeProcess
from hc_bringup.run_state import RunState
from hc_bringup.statistics import EstimateStatistics
from hc_bringup.terminal.panel import PanelPainter
from hc_bringup.terminal.view import PanelView

TWO_ARMS = """
nodes:
  - {name: estimator, namespace: left, module: hc_estimator.node, parameter_files: [p.yaml]}
  - {name: estimator, namespace: /right, module: hc_estimator.node}
  - {name: recorder, module: hc_logger.recorder_node}
"""


@pytest.fixture
def two_arms(tmp_path: Path) -> RunPlan:
    (tmp_path / "p.yaml").write_text(
        "left: {estimator: {ros__parameters: {filter: ekf}}}\n"
        "/**: {ros__parameters: {filter: ukf, state.folder: s}}\n"
        "estimator: {ros__parameters: {filter: sir_pf}}\n"
    )
    path = tmp_path / "run.yaml"
    path.write_text(TWO_ARMS)
    return load_plan(path)


def options(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    run_command.configure(parser)
    return parser.parse_args(words)


def test_nodes_are_called_by_their_full_names(two_arms: RunPlan) -> None:
    assert [n.name for n in two_arms.nodes] == ["left/estimator", "right/estimator", "recorder"]
    assert [n.namespace for n in two_arms.nodes] == ["left", "right", ""]
    assert two_arms.node("estimator") is None
    assert two_arms.of_kind("estimator") == two_arms.nodes[:2]


def test_a_file_is_read_for_the_node_of_the_namespace(two_arms: RunPlan) -> None:
    """What is for it alone wins; what is for an estimator outside of namespaces is not for it."""
    assert run_command.file_parameters(two_arms.nodes[0]) == {"filter": "ekf", "state.folder": "s"}


def test_parameters_without_a_node_are_for_all_estimators(two_arms: RunPlan) -> None:
    words = ("--filter", "raukf", "--param", "output.estimates=arrays")
    found = run_command.given_parameters(
        two_arms, options(*words, "--param", "right/estimator.initial_stiffness=2")
    )
    both = {"filter": "raukf", "output.estimates": "arrays"}
    assert found == {"left/estimator": both, "right/estimator": both | {"initial_stiffness": 2}}


def test_the_pace_is_that_of_one_rig() -> None:
    def rigs(*names: str) -> RunPlan:
        return RunPlan(tuple(NodePlan(name, "a_node") for name in names))

    half = options("--rate", "0.5")
    found = run_command.given_parameters(rigs("left/indenter", "left/estimator"), half)
    assert found == {
        "left/indenter": {"rate": 0.5, "time": "simulated"},
        "left/estimator": {"use_sim_time": True},
    }
    with pytest.raises(UserError, match="left/indenter and right/indenter would each tell"):
        run_command.given_parameters(rigs("left/indenter", "right/indenter"), half)


def test_two_do_not_keep_their_states_in_one_folder(two_arms: RunPlan) -> None:
    run_command.check_state_folders(two_arms)
    same = run_command.with_parameters(two_arms, "right/estimator", {"state.folder": "./s"})
    with pytest.raises(UserError, match="keep their states in one folder"):
        run_command.check_state_folders(same)


def test_the_page_is_served_where_the_first_estimator_is(two_arms: RunPlan) -> None:
    page = run_command.with_dashboard(two_arms, options("--dashboard")).nodes[-1]
    assert page.name == "left/dashboard"


def test_a_page_of_another_namespace(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: `hc dashboard` showed what is in no namespace, and nothing else could be."""
    pytest.importorskip("aiohttp")
    words: list[str] = []
    monkeypatch.setattr("hc_msgs_py.node_main.run_node", lambda _make, args: words.extend(args))
    parser = argparse.ArgumentParser()
    dashboard_command.configure(parser)
    dashboard_command.run(parser.parse_args(["--namespace", "/right"]))
    assert words[:3] == ["--ros-args", "-r", "__ns:=/right"]
    with pytest.raises(SystemExit):
        parser.parse_args(["--namespace", "a b"])


def test_the_node_is_started_in_its_namespace(tmp_path: Path) -> None:
    plan = NodePlan("left/estimator", "a_node_of_ours", parameters={"filter": "ekf"})
    process = NodeProcess(plan, tmp_path)
    process.stop()
    words = process._arguments()
    assert words[:5] == ["--ros-args", "-r", "__node:=estimator", "-r", "__ns:=/left"]
    section = yaml.safe_load(Path(words[-1]).read_text())
    assert section == {"/left/estimator": {"ros__parameters": {"filter": "ekf"}}}


@pytest.mark.parametrize(
    ("name", "topic"),
    [("estimator", "/hc/estimate"), ("left/estimator", "/left/hc/estimate")],
)
def test_estimates_are_heard_in_the_namespace(name: str, topic: str) -> None:
    assert EstimateListener(name).full_name("hc/estimate") == topic


def test_each_estimator_is_summed_up_and_judged(capsys: pytest.CaptureFixture[str]) -> None:
    state = RunState(EstimateStatistics(), 0.0, elapsed_s=3.0, estimator="left/estimator")
    state.add_other("right/estimator", EstimateStatistics())
    state.others[0].elapsed_s = 3.0
    names = ["left/estimator", "right/estimator"]
    with pytest.raises(UserError) as raised:
        conclude(state, names, None, as_json=True, with_latency=True)
    for name in names:
        assert f"{name}: no estimate came in 3 s" in str(raised.value)
    summary: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert summary["estimator"] == "left/estimator"
    assert [other["estimator"] for other in summary["others"]] == ["right/estimator"]
    state.failures.clear()
    with pytest.raises(UserError):
        conclude(state, names, None, as_json=False, with_latency=True)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(" ")[0] for line in lines if " estimates of " in line] == [
        "left/estimator:",
        "right/estimator:",
    ]


def test_the_line_of_another_estimator_says_why_it_is_silent() -> None:
    """And not that its source has ended, where the run has."""
    said = {"right/estimator": {"level": "2", "message": "no usable sample for 1.0 s"}}
    state = RunState(EstimateStatistics(), 0.0, diagnostics=said)
    state.add_other("right/estimator", EstimateStatistics())
    other = state.others[0]
    assert _line_of_other(other).startswith("right/estimator: (no usable sample for 1.0 s) lost")
    other.statistics.estimates, other.silent_s = 5, 0.1
    assert _line_of_other(other).startswith("right/estimator: lost")
    other.silent_s = 2.0
    assert "silent for 2.0 s (no usable sample for 1.0 s) lost" in _line_of_other(other)


def of_two(display: Display) -> RunState:
    state = RunState(EstimateStatistics(), 0.0, phase="running", estimator="left/estimator")
    state.add_other("right/estimator", EstimateStatistics())
    display.show(state)
    return state


def test_keys_are_for_the_estimator_that_was_chosen(capsys: pytest.CaptureFixture[str]) -> None:
    """Regression: a tare of the second arm's sensors went to the first one, without a word."""
    display = Display(enabled=True)
    state = of_two(display)
    display._take_keys(state, ["tare", "2", "tare", "mark", "9", "1", "reset"])
    assert state.requests == [
        ("tare", "left/estimator"),
        ("tare", "right/estimator"),
        ("mark", "right/estimator"),
        ("reset", "left/estimator"),
    ]
    state.page = "http://127.0.0.1:8765/#token=x"
    display.show(state)
    said = capsys.readouterr().err
    assert "live page of left/estimator (of another one: hc dashboard --namespace right): " in said


def test_the_panel_says_whom_the_keys_are_for() -> None:
    keys = (("q", "stop"), ("t", "tare"))
    both = ("left/estimator", "right/estimator")
    view = PanelView("running", keys=keys, keys_for=1, estimators=both)
    wanted = "the keys are for right/estimator; for another one: [1] left/estimator"
    assert view.choice() == wanted
    console = Console(width=100, color_system=None)
    with console.capture() as capture:
        console.print(PanelPainter().draw(view, 100))
    assert wanted in capture.get()
    for alone in (PanelView("running", keys=keys, estimators=both[:1]), PanelView("running")):
        assert alone.choice() == ""


def test_an_estimator_that_was_asked_is_named_in_its_answer() -> None:
    asked: list[str] = []
    monitor = Monitor(estimators=["left/estimator", "right/estimator"])

    class Client:
        def service_is_ready(self) -> bool:
            return True

        def call_async(self, _request: Any) -> Future:
            future: Future = Future()
            future.set_result(Trigger.Response(success=True, message="done"))
            return future

    def client(_kind: Any, name: str) -> Client:
        asked.append(name)
        return Client()

    monitor._client = client  # type: ignore[method-assign]
    monitor.ask("find_surface", "right/estimator")
    assert asked == ["/right/estimator/find_surface"]
    assert monitor.answer == "right/estimator: find surface: done"
    monitor.ask("mark", "right/estimator")
    assert monitor.answer == "right/estimator: nothing to mark yet"


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.timeout(300)
def test_two_rigs_and_two_estimators_in_one_run(command_line: Any, tmp_path: Path) -> None:
    nodes = []
    for space, stiffness in (("left", 0.2), ("right", 0.5)):
        nodes += [
            {
                "name": "indenter",
                "namespace": space,
                "module": "hc_sim_rig.node",
                "source": True,
                "parameters": {
                    "scenario": "multisine",
                    "start_paused": True,
                    "stiffness": stiffness,
                    "expected_sample_subscribers": 2,
                },
            },
            {
                "name": "estimator",
                "namespace": space,
                "module": "hc_estimator.node",
                "parameters": {"expected_estimate_subscribers": 2},
            },
        ]
    nodes.append({"name": "recorder", "module": "hc_logger.recorder_node"})
    (tmp_path / "two.yaml").write_text(yaml.safe_dump({"nodes": nodes}))
    done = command_line.run(
        "run", str(tmp_path / "two.yaml"), "--duration", "6", "--json", timeout=200
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    both = [summary, *summary["others"]]
    assert [one["estimator"] for one in both] == ["left/estimator", "right/estimator"]
    for one, stiffness in zip(both, (0.2, 0.5), strict=True):
        assert one["estimates"] == one["samples"] > 4000
        assert one["lost"] == 0
        assert one["parameters"]["stiffness"] == pytest.approx(stiffness, rel=0.03)
