"""hc run on a robot's own topics: it ends when it is to, and says when the robot falls silent."""

import json
import re
import time
from pathlib import Path

import pytest

from hc_msgs_py.node_processes import Processes

pytestmark = [pytest.mark.slow, pytest.mark.process, pytest.mark.timeout(600)]

AS_CONFIGURED = {"force": {"reaction": -1}}
"""A sensor that reads a push as negative, as config/robot_arm.yaml says."""
CONFIG = str(Path(__file__).resolve().parents[2] / "config" / "robot_run.yaml")


class Run:
    """`hc run` with its lines as they come."""

    def __init__(self, bench, *words):
        self.process = Processes.start(bench, "-m", "hc_bringup", "run", CONFIG, *words)

    def line_with(self, pattern):
        """Read on to a line, and return it with the time at which it came."""
        seen = []
        for line in self.process.stderr:
            seen.append(line)
            if re.search(pattern, line):
                return line, time.monotonic()
        raise AssertionError(f"no line with {pattern}: {seen}")


def test_a_robot_that_goes_on_does_not_keep_the_run_waiting(bench):
    """Regression: estimates of a robot never cease, and were waited for for ten seconds."""
    bench.robot(**AS_CONFIGURED)
    run = Run(bench, "--duration", "5", "--json")
    _line, stopped_at = run.line_with("^(stopping|waiting for the last)")
    out, err = run.process.communicate(timeout=60)
    assert run.process.returncode == 0, err
    assert time.monotonic() - stopped_at < 5.0
    summary = json.loads(out)
    assert summary["silent_s"] is None
    # All of them are of the time that is told.
    assert summary["estimates"] / summary["duration_s"] < 1.1 * (500.0 + 125.0)


def test_a_robot_that_falls_silent_is_told_within_two_seconds_and_in_the_end(bench):
    robot = bench.robot(**AS_CONFIGURED)
    run = Run(bench, "--duration", "10")
    run.line_with("[1-9] Hz")
    time.sleep(3.0)
    robot.kill()
    killed_at = time.monotonic()
    line, told_at = run.line_with("s: silent for")
    assert told_at - killed_at < 2.0
    assert "ft_sensor/wrench" in line
    out, err = run.process.communicate(timeout=60)
    assert run.process.returncode == 0, err
    assert re.search(r"silent at the end, for [2-9]\.\d s: .*ft_sensor/wrench", out), out


def test_a_robot_that_is_read_wrongly_is_told_while_it_runs_and_in_the_end(bench):
    """Regression: pull for push and mN for N gave K = 0.00003 and status 0 without a word."""
    bench.robot(force={"scale": 1000.0})
    run = Run(bench, "--duration", "20", "--param", "input.position.zero=-200.0")
    line, _told_at = run.line_with("turn its sign|is no soft tissue")
    assert "docs/guide/warnings.md" in line
    out, err = run.process.communicate(timeout=90)
    assert run.process.returncode == 1, err
    assert "what cannot be right: the force falls to " in out
    assert "if the force were in millinewtons" in out
    for wrong in ("the sign of a channel is wrong", "the unit of a channel is wrong"):
        assert wrong in err


def test_a_robot_whose_clock_is_two_hours_ahead_is_told_and_its_tissue_is_found_all_the_same(bench):
    """Regression: latencies below zero counted as zero, and "in the future" was never said."""
    bench.robot(**AS_CONFIGURED, clock_s=7200.0)
    run = Run(bench, "--duration", "15", "--json", "--param", "input.position.zero=-200.0")
    said = "samples are stamped 7200 s in the future: the clocks of sensor and computer differ"
    run.line_with(said)
    doctor = bench.hc("doctor", "--seconds", "3")
    assert doctor.returncode == 1
    assert f"the node says: {said}" in doctor.stdout, doctor.stdout
    out, err = run.process.communicate(timeout=90)
    assert run.process.returncode == 0, err
    summary = json.loads(out)
    assert summary["suspicions"] == {"clock of samples": f"{said} (use PTP or chrony)"}
    assert summary["parameters"]["stiffness"] == pytest.approx(0.5, rel=0.05)
