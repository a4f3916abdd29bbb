"""A node that was killed is started again by the runner, and goes on from what it had learnt."""

import json
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
import yaml

from hc_bringup.soak import endless
from hc_logger.recording import read_recording

ROOT = Path(__file__).resolve().parents[2]
TRUE_STIFFNESS = 0.2

pytestmark = [pytest.mark.process, pytest.mark.timeout(300)]


def plan_with_respawn(folder: Path) -> Path:
    """Write the shipped configuration with nodes that come again; the estimator keeps its state."""
    plan = yaml.safe_load((ROOT / "config" / "run.yaml").read_text(encoding="utf-8"))
    for node in plan["nodes"]:
        files = node["parameter_files"]
        node["parameter_files"] = [str(ROOT / "config" / file) for file in files]
        node["respawn"] = True
        if node["name"] == "indenter":  # of one tissue, however long a busy machine takes
            node["parameters"]["scenario"] = str(endless(folder))
        if node["name"] == "estimator":
            node["parameters"]["state.folder"] = str(folder / "state")
            node["parameters"]["state.autosave_period"] = 0.1
    path = folder / "respawn.yaml"
    path.write_text(yaml.safe_dump(plan), encoding="utf-8")
    return path


@pytest.mark.slow
def test_a_killed_estimator_comes_again_and_knows_the_tissue(command_line) -> None:
    process = command_line.start("run", str(plan_with_respawn(command_line.folder)), "--json")
    live = list(iter_until_samples(process, 2))
    first = command_line.node_process()
    assert first is not None, live
    os.kill(first, signal.SIGKILL)
    deadline = time.monotonic() + 60.0
    while (second := command_line.node_process()) in (None, first):
        assert time.monotonic() < deadline, "no second estimator"
        time.sleep(0.1)
    estimates = command_line.folder / "bags"
    told = wait_for_gap_and_flow(process)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    summary = json.loads(out)
    assert summary["respawns"] == 1
    # Regression: of a node that had died only the summary told.
    assert any(" s: estimator was ended by SIGKILL, and is started again" in line for line in told)
    assert second != first
    assert estimates.is_dir()

    table = read_recording(summary["bag"]).estimates
    gap = int(np.argmax(np.diff(table["sequence"].astype(np.int64))))
    before, after = table[gap], table[gap + 1]
    assert after["sequence"] - before["sequence"] > 100
    assert after["configuration_revision"] > before["configuration_revision"]
    assert after["stiffness"] == pytest.approx(TRUE_STIFFNESS, rel=0.05)
    assert after["stiffness_std"] < 3.0 * before["stiffness_std"]


@pytest.mark.slow
def test_a_killed_recorder_and_a_killed_rig_come_again(command_line) -> None:
    """The recorder goes on in a second bag; the rig begins anew, and is told to start."""
    process = command_line.start("run", str(plan_with_respawn(command_line.folder)), "--json")
    list(iter_until_samples(process, 2))
    for module in ("hc_logger.recorder_node", "hc_sim_rig.node"):
        victim = command_line.node_process(module)
        assert victim is not None
        killed_ns = time.time_ns()
        os.kill(victim, signal.SIGKILL)
        deadline = time.monotonic() + 60.0
        while command_line.node_process(module) in (None, victim):
            assert time.monotonic() < deadline, f"no second {module}"
            time.sleep(0.1)
    wait_for_gap_and_flow(process)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    summary = json.loads(out)
    assert summary["respawns"] == 2
    (second,) = summary["further_bags"]
    assert Path(second).name == Path(summary["bag"]).name + "_2"
    first, after = read_recording(summary["bag"]), read_recording(second)
    assert first.findings.problems
    assert not after.findings.problems
    assert (np.diff(first.sequence.astype(np.int64)) == 1).all()
    # In the second bag the rig of before ends and the next one begins at 0.
    begins = np.flatnonzero(after.sequence == 0)
    assert len(begins) == 1
    assert after.stamps[begins[0]] > killed_ns
    assert len(after.sequence) - begins[0] > 1000
    assert after.estimates["stiffness"][-1] == pytest.approx(TRUE_STIFFNESS, rel=0.05)


@pytest.mark.slow
def test_what_was_learnt_survives_the_runner_that_is_killed(command_line) -> None:
    """The nodes ended by SIGTERM then, as if somebody had asked for it, and forgot the tissue."""
    plan = str(plan_with_respawn(command_line.folder))
    process = command_line.start("run", plan, "--json", "--bag", "first")
    list(iter_until_samples(process, 3))
    process.kill()
    process.communicate(timeout=10)
    wait_until_gone(command_line)
    kept = command_line.folder / "state"
    assert [file.name for file in kept.iterdir()] == ["running_state.json"]
    before = read_recording(command_line.folder / "first")
    assert not before.findings.problems  # closed in good order
    known = before.estimates[-1]

    process = command_line.start("run", plan, "--json", "--bag", "second")
    list(iter_until_samples(process, 2))
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    first = read_recording(json.loads(out)["bag"]).estimates[0]
    assert first["stiffness"] == pytest.approx(known["stiffness"], rel=0.01)
    assert first["stiffness_std"] < 3.0 * known["stiffness_std"]
    assert not list(kept.iterdir())  # that end was asked for


@pytest.mark.slow
def test_what_was_learnt_survives_a_run_that_another_node_ended(command_line) -> None:
    """The rig dies for good: the runner ends the other nodes, which nobody had asked for."""
    path = plan_with_respawn(command_line.folder)
    plan = yaml.safe_load(path.read_text(encoding="utf-8"))
    for node in plan["nodes"]:
        node["respawn"] = False
    path.write_text(yaml.safe_dump(plan), encoding="utf-8")
    process = command_line.start("run", str(path), "--json")
    list(iter_until_samples(process, 2))
    os.kill(command_line.node_process("hc_sim_rig.node"), signal.SIGKILL)
    _out, err = process.communicate(timeout=60)
    assert process.returncode == 1
    said = err.splitlines()[-1].partition("; what was recorded is in ")[0]
    assert said == "hc run: node indenter was ended by SIGKILL"
    kept = command_line.folder / "state"
    assert [file.name for file in kept.iterdir()] == ["running_state.json"]


def wait_until_gone(command_line) -> None:
    """Wait until no node of a run lives any more."""
    modules = ("hc_estimator.node", "hc_logger.recorder_node", "hc_sim_rig.node")
    deadline = time.monotonic() + 30.0
    while any(command_line.node_process(module) is not None for module in modules):
        assert time.monotonic() < deadline, "nodes were left behind"
        time.sleep(0.1)


def wait_for_gap_and_flow(process) -> list[str]:
    """Read the live lines until estimates have stood still and then come for three seconds.

    Returns what else was said.
    """
    gap, flowing = False, 0
    told = []
    for line in process.stderr:
        told.append(line)
        if "Hz" not in line:
            continue
        rate = float(line.split()[2])
        gap = gap or rate < 50.0
        flowing = flowing + 1 if gap and rate > 200.0 else 0
        if flowing >= 3:
            return told
    raise AssertionError("the run ended early")


def iter_until_samples(process, seconds):
    """Read the live lines of a run until samples have come for so long."""
    seen = 0
    for line in process.stderr:
        yield line
        seen += "Hz" in line
        if seen > seconds:
            return
    raise AssertionError("the run ended early")
