"""hc setup, hc run and hc doctor on robots that no preset describes: they find the tissue."""

import json

import pytest
import yaml

pytestmark = [pytest.mark.slow, pytest.mark.process, pytest.mark.timeout(600)]

TILT = [0.0, 0.25881904510252074, 0.0, 0.9659258262890683]  # 30 degrees about y
ROBOTS = {
    # A linear actuator without a force sensor: it pushes to the negative, at 200 Hz.
    "actuator": {
        "tissue": [0.4, 0.03, 1.7, 0.9],
        "force": {"topic": ""},
        "position": {
            "type": "joint",
            "topic": "actuator/joint_states",
            "rate_hz": 200.0,
            "joints": ["lift"],
            "moving": "press",
            "unit_per_m": -1.0,
            "effort": -1,
        },
    },
    # A sensor that sits askew on an arm whose poses are in /tf alone, slow and late.
    "frames": {
        "tissue": [0.8, 0.04, 1.3, 1.0],
        "force": {
            "topic": "wrist/ft",
            "frame": "tool0",
            "rate_hz": 333.0,
            "mounting": TILT,
            "bias": [1.0, -0.4, 2.0],
            "noise": 0.03,
        },
        "position": {
            "type": "tf",
            "topic": "tf",
            "rate_hz": 50.0,
            "delay_s": 0.035,
            "child": "tool0",
            "frame": "base_link",
        },
    },
    # A load cell and a laser that give volts; the laser's fall the deeper the tool is.
    "volts": {
        "tissue": [0.8, 0.03, 1.5, 0.9],
        "force": {"topic": "daq/cell", "rate_hz": 500.0, "bias": [0.0, 0.0, 30.0], "scale": 0.04},
        "position": {
            "type": "joint",
            "topic": "daq/laser",
            "rate_hz": 500.0,
            "joints": [],
            "moving": "laser",
            "unit_per_m": -200.0,
        },
    },
    # CRTK, best effort, its clock three seconds behind, the force that of the tool on the tissue.
    "clock": {
        "tissue": [0.3, 0.02, 1.9, 0.8],
        "clock_s": -3.0,
        "reliable": False,
        "force": {"topic": "PSM2/measured_cf", "rate_hz": 250.0, "reaction": -1},
        "position": {"topic": "PSM2/measured_cp", "rate_hz": 250.0, "jitter_s": 0.003},
    },
}
INPUT = {
    "actuator": {
        "source": "effort",
        "effort": {"scale": 1.0},
        "position": {"joint": "press", "sign": -1, "topic": "/actuator/joint_states"},
    },
    "frames": {
        "source": "sensors",
        "force": {"axis": "direction", "topic": "/wrist/ft"},
        "position": {"type": "tf", "base_frame": "base_link", "child_frame": "tool0", "sign": -1},
    },
    "volts": {
        "source": "sensors",
        "force": {"axis": "z", "sign": 1, "scale": 25.0},
        "position": {"type": "joint", "joint": "laser", "sign": -1, "scale": 0.005},
    },
    "clock": {
        "source": "sensors",
        "force": {"axis": "z", "sign": -1},
        "position": {"type": "pose", "axis": "z", "sign": -1},
    },
}
SAID = {"volts": ("--force-scale", "25", "--position-scale", "0.005")}
NAMES = ("stiffness", "damping", "displacement_exponent", "velocity_exponent")


def holds(found, wanted):
    """Whether what was found has everything that is wanted, at every depth."""
    return all(
        holds(found[key], value) if isinstance(value, dict) else found[key] == value
        for key, value in wanted.items()
    )


@pytest.mark.parametrize("name", ROBOTS)
def test_a_stranger_is_set_up_run_and_judged(bench, name):
    bench.robot(rest_s=0.5, **ROBOTS[name])
    said = ("--seconds", "12", "-o", "arm", *SAID.get(name, ()))
    done = bench.patiently("setup", "--yes", "--no-run", *said)
    assert done.returncode == 0, done.stdout + done.stderr
    told = yaml.safe_load((bench.folder / "arm.yaml").read_text())
    found = told["estimator"]["ros__parameters"]["input"]
    assert holds(found, INPUT[name]), found
    of_one_message = told["estimator"]["ros__parameters"].get("channel_delay")
    assert of_one_message == (0.0 if name == "actuator" else None)
    if name == "frames":  # the sensor's own frame, and the direction that it is tilted by
        assert "/tf:tool0 (tf): 50 Hz" in done.stdout
        assert found["force"]["direction"] == pytest.approx([-0.5, 0.0, 0.866], abs=0.02)
    done = bench.hc(
        *("run", "arm_run.yaml", "--json", "--no-dashboard", "--bag", "bag", "--duration", "15"),
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert ("clock of samples" in summary["suspicions"]) == (name == "clock")
    tolerance = 0.12 if name == "actuator" else 0.06
    for parameter, true in zip(NAMES, ROBOTS[name]["tissue"], strict=True):
        value, deviation = (summary[key][parameter] for key in ("parameters", "parameters_std"))
        assert value == pytest.approx(true, rel=tolerance), parameter
        assert abs(value - true) < 4.0 * deviation + 0.02 * true, parameter
    verdict = json.loads(bench.hc("doctor", "bag", "--json", timeout=200).stdout)
    # Of an observer's force a few milliseconds are said to be late, and it is.
    settings = [s for finding in verdict["findings"] for s in finding["settings"]]
    assert name == "actuator" or settings == [], verdict
