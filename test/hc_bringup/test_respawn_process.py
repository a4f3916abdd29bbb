"""A node that was killed is started again by the runner, and goes on from what it had learnt."""

import json
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
import yaml

from hc_logger.recording import read_recording

ROOT = Path(__file__).resolve().parents[2]
TRUE_STIFFNESS = 0.2

pytestmark = [pytest.mark.process, pytest.mark.timeout(300)]


def plan_with_respawn(folder: Path) -> Path:
    """Write the shipped configuration with an estimator that keeps its state and comes again."""
    plan = yaml.safe_load((ROOT / "config" / "run.yaml").read_text(encoding="utf-8"))
    for node in plan["nodes"]:
        files = node["parameter_files"]
        node["parameter_files"] = [str(ROOT / "config" / file) for file in files]
        if node["name"] == "estimator":
            node["respawn"] = True
            node["parameters"]["state.folder"] = str(folder / "state")
            node["parameters"]["state.autosave_period"] = 0.1
    path = folder / "respawn.yaml"
    path.write_text(yaml.safe_dump(plan), encoding="utf-8")
    return path


def estimator_process(domain_id: str) -> int | None:
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            command = (folder / "cmdline").read_bytes()
            environment = (folder / "environ").read_bytes()
        except OSError:
            continue
        mine = f"ROS_DOMAIN_ID={domain_id}\0".encode() in environment
        if mine and b"hc_estimator.node\0" in command:
            return int(folder.name)
    return None


def test_a_killed_estimator_comes_again_and_knows_the_tissue(command_line) -> None:
    process = command_line.start("run", str(plan_with_respawn(command_line.folder)), "--json")
    live = list(iter_until_samples(process, 2))
    first = estimator_process(command_line.environment["ROS_DOMAIN_ID"])
    assert first is not None, live
    os.kill(first, signal.SIGKILL)
    deadline = time.monotonic() + 60.0
    while (second := estimator_process(command_line.environment["ROS_DOMAIN_ID"])) in (None, first):
        assert time.monotonic() < deadline, "no second estimator"
        time.sleep(0.1)
    estimates = command_line.folder / "bags"
    time.sleep(6.0)  # the second one compiles nothing, but has to be found by the others
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    summary = json.loads(out)
    assert summary["respawns"] == 1
    assert second != first
    assert estimates.is_dir()

    table = read_recording(summary["bag"]).estimates
    gap = int(np.argmax(np.diff(table["sequence"].astype(np.int64))))
    before, after = table[gap], table[gap + 1]
    assert after["sequence"] - before["sequence"] > 100
    assert after["configuration_revision"] > before["configuration_revision"]
    assert after["stiffness"] == pytest.approx(TRUE_STIFFNESS, rel=0.05)
    assert after["stiffness_std"] < 3.0 * before["stiffness_std"]


def iter_until_samples(process, seconds):
    """Read the live lines of a run until samples have come for so long."""
    seen = 0
    for line in process.stderr:
        yield line
        seen += "Hz" in line
        if seen > seconds:
            return
    raise AssertionError("the run ended early")
