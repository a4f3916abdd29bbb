"""hc run and hc replay with real nodes: nothing lost, nothing left behind, faults in one line."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import yaml

from hc_bringup import heartbeat
from hc_bringup.plan import load_plan
from hc_logger.recording import read_recording
from hc_logger.verify import verify

HC = [sys.executable, "-m", "hc_bringup"]
ROOT = Path(__file__).resolve().parents[2]
SHARED_DATA = Path(os.environ.get("HC_SHARED_DATA", ROOT.parent / "shared" / "data"))

pytestmark = [pytest.mark.process, pytest.mark.timeout(300)]


def children_of_domain(domain_id: str) -> list[int]:
    """Ids of all processes that run a node of ours in this ROS domain."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            command = (folder / "cmdline").read_bytes()
            environment = (folder / "environ").read_bytes()
        except OSError:
            continue
        if b"--ros-args" in command and f"ROS_DOMAIN_ID={domain_id}\0".encode() in environment:
            found.append(int(folder.name))
    return found


def wait_for_start(process: subprocess.Popen[str]) -> None:
    """Read the live lines of a run until the first samples have come."""
    lines = []
    for line in process.stderr:
        if "Hz" in line:
            return
        lines.append(line)
    raise AssertionError(f"the run ended early: {lines}")


def assert_clean(command_line) -> None:
    domain_id = command_line.environment["ROS_DOMAIN_ID"]
    assert children_of_domain(domain_id) == []


def test_the_main_job_until_it_is_interrupted(command_line, shell) -> None:
    """With --duration it is one of the README's commands (test_readme.py)."""
    process = command_line.start("run", "--scenario", "multisine", "--json")
    wait_for_start(process)
    time.sleep(3.0)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    summary = json.loads(out)
    assert summary["lost"] == 0
    assert summary["estimates"] == summary["samples"] > 2500
    assert summary["rejected"] == {}
    truth = {
        "stiffness": 0.2,
        "damping": 0.008,
        "displacement_exponent": 1.8,
        "velocity_exponent": 1.05,
    }
    for name, value in truth.items():
        assert summary["parameters"][name] == pytest.approx(value, rel=0.02)
    assert_clean(command_line)

    bag = Path(summary["bag"])
    assert bag.parent == command_line.folder / "bags"
    _, info, _ = shell("bag", "info", bag)
    for topic in ("/indenter/sample", "/hc/estimate", "/indenter/truth", "/hc/configuration"):
        assert topic in info
    assert "scenario:" in info
    assert "seed:" in info
    recorded = yaml.safe_load((bag / "metadata.yaml").read_text())
    counts = {
        t["topic_metadata"]["name"]: t["message_count"]
        for t in recorded["rosbag2_bagfile_information"]["topics_with_message_count"]
    }
    assert counts["/indenter/sample"] == counts["/hc/estimate"] == summary["samples"]

    report = verify(read_recording(bag))
    assert report.compared == summary["samples"]
    assert report.different == 0
    estimated = json.loads(shell("estimate", bag, "--json")[1])
    for name, value in summary["parameters"].items():
        assert estimated["parameters"][name] == pytest.approx(value, rel=1e-9)
    for name in ("stiffness_if_position_off", "stiffness_if_force_zero_off"):
        assert summary[name] == pytest.approx(estimated[name], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "number"),
    [
        ((), signal.SIGTERM),
        (("--headless",), signal.SIGTERM),
        ((), signal.SIGHUP),
    ],
    ids=["page", "headless", "terminal closed"],
)
def test_a_termination_ends_the_run_cleanly_with_a_summary(
    command_line, words, number: int, tmp_path: Path
) -> None:
    command_line.environment["TMPDIR"] = str(temporary := tmp_path / "temporary")
    temporary.mkdir()
    process = command_line.start("run", "--json", *words)
    if words:  # without a display nothing is said
        while not any(f.stat().st_size > 100_000 for f in command_line.folder.glob("bags/*/*")):
            time.sleep(0.1)
    else:
        wait_for_start(process)
    time.sleep(1.0)
    assert [*temporary.glob("hc_run_*")]
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert not [*temporary.glob("hc_run_*")]
    summary = json.loads(out)
    assert summary["lost"] == 0
    assert summary["estimates"] > 500
    assert Path(summary["bag"], "metadata.yaml").is_file()
    assert_clean(command_line)


@pytest.mark.parametrize(
    "after_s", [0.1, 0.9, *(pytest.param(s, marks=pytest.mark.slow) for s in (0.3, 0.6, 1.2, 1.6))]
)
def test_a_signal_during_the_start_ends_the_run_without_a_word_too_much(
    command_line, after_s: float
) -> None:
    # As ./hc does: until it can answer an interrupt, Python tells of one with a traceback.
    block = ("env", "--block-signal=INT")
    process = command_line.start("run", "--json", "--headless", through=block)
    time.sleep(after_s)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode in (0, 130, -signal.SIGINT), err
    assert "was ended by" not in err
    if process.returncode == 130:
        assert out == ""
        said = err.strip().partition("; what was recorded is in ")[0]
        assert said in ("", "hc run: stopped before the first sample")
    assert_clean(command_line)


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ("run", "--headless", "--duration", "1"),
        ("replay", str(ROOT / "bags/example")),
    ],
    ids=["run", "replay"],
)
def test_a_second_run_in_the_domain_is_refused_with_the_way_out(command_line, words) -> None:
    first = command_line.start("run")
    wait_for_start(first)
    done = command_line.run(*words)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    domain = command_line.environment["ROS_DOMAIN_ID"]
    assert f"process {first.pid} (hc run)" in done.stderr
    assert f"in ROS domain {domain} already" in done.stderr
    free = int(done.stderr.partition("ROS_DOMAIN_ID=")[2].split()[0])
    assert free != int(domain)
    first.send_signal(signal.SIGINT)
    out, err = first.communicate(timeout=60)
    assert first.returncode == 0, err
    assert "lost 0" in out


@pytest.mark.slow
def test_a_run_beside_a_node_started_by_hand_is_refused(command_line) -> None:
    words = ("--ros-args", "-r", "__node:=indenter")
    node = command_line.start(*words, module="hc_sim_rig.node")
    done = command_line.run("run", "--headless", "--duration", "1", timeout=240)
    assert done.returncode == 1
    assert "there is another node indenter in ROS domain" in done.stderr
    node.send_signal(signal.SIGINT)
    node.communicate(timeout=20)
    assert_clean(command_line)


@pytest.mark.slow
def test_a_disk_that_fills_up_is_told_at_once_and_in_the_end(command_line) -> None:
    """A file size limit stands for the full disk: it needs no mount."""
    limit = 300_000
    process = command_line.launch(
        [*HC, "run", "--duration", "8", "--json", "--headless", "--bag", "bag"],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    bag = command_line.folder / "bag"
    reason = f"cannot write {bag}: File too large"
    while (line := process.stderr.readline()).startswith(heartbeat.MARK):
        pass  # a busy machine starts late
    assert line == f"recorder: {reason}\n"
    assert process.poll() is None  # the run goes on
    out, err = process.communicate(timeout=100)
    assert process.returncode == 1
    said = [line for line in err.splitlines() if not line.startswith(heartbeat.MARK)]
    how = f"; {bag} was not closed: hc bag recover {bag} NEW makes it whole"
    assert said == [f"hc run: node recorder: {reason}{how}"]
    summary = json.loads(out)
    assert summary["failures"] == [f"node recorder: {reason}"]
    assert summary["estimates"] == summary["samples"] > 7000
    info = command_line.run("bag", "info", "bag")
    assert "cut off" in info.stdout
    recorded = read_recording(bag).sequence
    assert len(recorded) > 300
    assert (np.diff(recorded.astype(np.int64)) == 1).all()
    assert_clean(command_line)


@pytest.mark.slow
@pytest.mark.slow
def test_two_runs_into_one_folder_and_a_recorder_that_stands_still(
    command_line, other_command_line
) -> None:
    """Each run names the bag that it made, and what that is short of."""
    words = ("run", "--scenario", "multisine", "--json", "--bag", "bag")
    runs = [line.start(*words) for line in (command_line, other_command_line)]
    for process in runs:
        wait_for_start(process)
    recorder = command_line.node_process("hc_logger.recorder_node")
    os.kill(recorder, signal.SIGSTOP)
    time.sleep(12.0)  # publishers keep eight seconds
    os.kill(recorder, signal.SIGCONT)
    time.sleep(2.0)
    summaries = []
    for process in runs:
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
        assert process.returncode == 0, err
        summaries.append(json.loads(out))
    assert {Path(summary["bag"]).name for summary in summaries} == {"bag", "bag_2"}
    assert [summary["further_bags"] for summary in summaries] == [[], []]
    stopped, went_on = summaries
    assert went_on["not_recorded"] == 0
    assert stopped["not_recorded"] > 1000
    assert len(read_recording(Path(stopped["bag"])).sequence) < stopped["samples"] - 1000
    assert len(read_recording(Path(went_on["bag"])).sequence) == went_on["samples"]


def test_a_run_without_samples_says_so_and_fails(command_line) -> None:
    path = command_line.folder / "silent.yaml"
    path.write_text(
        "nodes:\n- name: estimator\n  module: hc_estimator.node\n"
        "  parameters: {expected_sample_publishers: 0}\n"
    )
    done = command_line.run("run", str(path), "--headless", "--duration", "2", timeout=240)
    assert done.returncode == 1
    assert "0 estimates of 0 samples" in done.stdout
    assert "nan" not in done.stdout + done.stderr
    assert done.stderr.startswith("hc run: no estimate came in 2 s: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_a_killed_runner_leaves_no_node_behind(command_line) -> None:
    process = command_line.start("run")
    wait_for_start(process)
    process.kill()
    process.communicate(timeout=10)
    deadline = time.monotonic() + 10.0
    while children_of_domain(command_line.environment["ROS_DOMAIN_ID"]):
        assert time.monotonic() < deadline
        time.sleep(0.1)


@pytest.mark.slow
def test_a_node_that_dies_is_reported_with_its_name(command_line) -> None:
    process = command_line.start("run")
    wait_for_start(process)
    domain_id = command_line.environment["ROS_DOMAIN_ID"]
    victim = next(
        pid
        for pid in children_of_domain(domain_id)
        if b"hc_estimator.node" in Path(f"/proc/{pid}/cmdline").read_bytes()
    )
    os.kill(victim, signal.SIGKILL)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    said, bag = err.splitlines()[-1].split("; what was recorded is in ")
    assert said == "hc run: node estimator was ended by SIGKILL"
    assert len(read_recording(bag).sequence) > 0
    assert_clean(command_line)


def broken_plan(folder: Path, node: str, parameters: dict[str, object]) -> str:
    """Write the shipped configuration with some parameters of one node changed."""
    plan = load_plan(ROOT / "config" / "run.yaml")
    nodes = [
        {
            "name": n.name,
            "module": n.module,
            "source": n.source,
            "parameter_files": [str(f) for f in n.parameter_files],
            "parameters": {**n.parameters, **(parameters if n.name == node else {})},
        }
        for n in plan.nodes
    ]
    path = folder / "broken.yaml"
    path.write_text(yaml.safe_dump({"nodes": nodes}))
    return str(path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("node", "parameters", "expected"),
    [
        ("estimator", {"filter": "magic"}, "magic"),
        ("estimator", {"no_such_parameter": 1}, "no_such_parameter"),
        ("indenter", {"speed": -4.0}, "speed"),
        ("recorder", {"flush_interval": 1e9}, "flush_interval"),
    ],
)
def test_a_node_that_cannot_start_is_reported_with_what_it_said(
    command_line, node: str, parameters: dict[str, object], expected: str
) -> None:
    path = broken_plan(command_line.folder, node, parameters)
    done = command_line.run("run", path, "--headless", "--duration", "2", timeout=240)
    assert done.returncode == 2
    assert done.stdout == ""
    lines = done.stderr.splitlines()
    said, told, bag = lines[-1].partition("; what was recorded is in ")
    assert said == f"hc run: node {node} ended with exit status 2"
    there = [str(folder) for folder in command_line.folder.glob("bags/*")]
    assert there == ([bag] if told else [])
    assert expected in "\n".join(lines[:-1])
    assert "Traceback" not in done.stderr
    assert_clean(command_line)


def test_an_unknown_scenario_is_told_before_anything_starts(command_line) -> None:
    done = command_line.run("run", "--scenario", "atlantis", "--headless")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "atlantis" in done.stderr


def test_a_node_module_that_does_not_exist(command_line) -> None:
    path = command_line.folder / "run.yaml"
    path.write_text("nodes: [{name: a, module: no_such_module}]")
    done = command_line.run("run", str(path), "--headless")
    assert done.returncode == 1
    assert "No module named no_such_module" in done.stderr
    assert done.stderr.splitlines()[-1] == "hc run: node a ended with exit status 1"


@pytest.mark.slow
def test_replay_of_a_recording_gives_the_estimates_of_the_recording(command_line) -> None:
    source = SHARED_DATA / "palpation_sine_soft.csv"
    if not source.is_file():
        pytest.skip(f"needs the recordings in {SHARED_DATA}")
    command_line.run("bag", "convert", str(source), "bag")
    words = ("replay", "bag", "--estimator", "--rate", "4", "--json", "--headless")
    done = command_line.run(*words, timeout=240)
    assert done.returncode == 0, done.stderr
    replayed = json.loads(done.stdout)
    assert replayed["lost"] == 0
    assert replayed["estimates"] == replayed["samples"] == 5001
    assert "latency_us" not in replayed
    estimated = json.loads(command_line.run("estimate", "bag", "--json").stdout)
    for kind in ("parameters", "parameters_std"):
        for name, value in estimated[kind].items():
            assert replayed[kind][name] == pytest.approx(value, rel=1e-6)
    assert_clean(command_line)


@pytest.mark.slow
def test_replay_without_estimator_publishes_the_recorded_estimates(command_line) -> None:
    command_line.run("simulate", "multisine", "-o", "bag", "--duration", "2")
    done = command_line.run("replay", "bag", "--json", "--headless", "--start", "1")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["samples"] == 1000
    assert summary["estimates"] == 0
    assert_clean(command_line)
