"""Two more robots that no preset describes, and each with sign, delay and unit wrong at once."""

import json

import pytest
import yaml

pytestmark = [pytest.mark.slow, pytest.mark.process, pytest.mark.timeout(600)]

HALF_TURN = [0.0, 0.7071067811865476, 0.0, 0.7071067811865476]
GRAMS = 101.9716  # in a newton
ROBOTS = {
    # An arm that presses from the side: external wrench in millinewtons in the base frame, told 40
    # ms late, that of the tool on the tissue; the tool's pose as a transform at 100 Hz.
    "side": {
        "tissue": [0.6, 0.05, 1.6, 0.9],
        "normal": [-1.0, 0.0, 0.0],
        "attitude": HALF_TURN,
        "force": {
            "topic": "lbr/external_wrench",
            "frame": "lbr_link_0",
            "rate_hz": 400.0,
            "in_base": True,
            "reaction": -1,
            "scale": 1000.0,
            "late_s": 0.04,
            "noise": 0.03,
            "bias": [3.0, -2.0, 1.0],
        },
        "position": {
            "type": "transform",
            "topic": "lbr/tool",
            "frame": "lbr_link_0",
            "child": "probe",
            "rate_hz": 100.0,
            "delay_s": 0.01,
        },
    },
    # A gantry whose joints are called x, y and z and are told in millimetres, with a load cell in
    # grams at 80 Hz, 60 ms late: nobody can know grams from newtons.
    "gantry": {
        "tissue": [0.35, 0.02, 1.8, 0.8],
        "force": {
            "topic": "load_cell/wrench",
            "frame": "cell",
            "rate_hz": 80.0,
            "reaction": -1,
            "scale": GRAMS,
            "late_s": 0.06,
            "step": 0.02,
            "bias": [0.0, 0.0, 1.5],
            "jitter_s": 0.004,
        },
        "position": {
            "type": "joint",
            "topic": "gantry/joint_states",
            "rate_hz": 200.0,
            "joints": ["x", "y", "z"],
            "moving": "z",
            "unit_per_m": -1000.0,
            "noise_mm": 0.01,
        },
    },
}
FOUND = {
    "side": {"force": {"axis": "x", "scale": 0.001}, "position": {"axis": "x", "sign": 1}},
    "gantry": {
        "force": {"axis": "z", "sign": -1},
        "position": {"joint": "z", "sign": -1, "scale": 0.001},
    },
}
UNIT_OF_K = {"side": 1.0, "gantry": GRAMS}  # in what was taken for newtons
SAID = {
    "side": "would be if the force were in millinewtons",
    "gantry": "would be if the displacement were in micrometres",
}


def spoilt(settings):
    """The settings with the force's sign turned, its delay forgotten and no scales."""
    force, position = dict(settings["force"]), dict(settings["position"])
    force["sign"] = -force["sign"]
    force["time_offset"] = 0.0
    for sensor in (force, position):
        sensor.pop("scale", None)
    return {"source": "sensors", "force": force, "position": position}


@pytest.mark.parametrize("name", ROBOTS)
def test_sign_delay_and_unit_are_found_by_setup_and_wrong_ones_by_run_and_doctor(bench, name):
    bench.robot(rest_s=0.5, **ROBOTS[name])
    done = bench.patiently("setup", "--yes", "--no-run", "--seconds", "12", "-o", "arm")
    assert done.returncode == 0, done.stdout + done.stderr
    assert SAID[name] in " ".join(done.stdout.split())
    told = yaml.safe_load((bench.folder / "arm.yaml").read_text())
    settings = told["estimator"]["ros__parameters"]["input"]
    for sensor, wanted in FOUND[name].items():
        assert {key: settings[sensor].get(key) for key in wanted} == wanted
    late_s = ROBOTS[name]["force"]["late_s"]
    assert settings["force"]["time_offset"] == pytest.approx(-late_s, abs=0.004)
    # What was allowed for in words is written, and readings wait long enough for the late ones.
    assert settings["pairing"]["maximum_wait"] > late_s + 1.0 / 80.0
    stiffness = ROBOTS[name]["tissue"][0] * UNIT_OF_K[name]
    run = ("--json", "--no-dashboard", "--duration", "15")
    done = bench.hc("run", "arm_run.yaml", *run, "--bag", "bag", timeout=300)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["suspicions"] == {}
    assert summary["parameters"]["stiffness"] == pytest.approx(stiffness, rel=0.1)

    told["estimator"]["ros__parameters"]["input"] = spoilt(settings)
    (bench.folder / "bad.yaml").write_text(yaml.safe_dump(told))
    run_file = (bench.folder / "arm_run.yaml").read_text().replace("arm", "bad")
    (bench.folder / "bad_run.yaml").write_text(run_file)
    done = bench.hc("run", "bad_run.yaml", *run, "--bag", "bad_bag", timeout=300)
    assert done.returncode == 1
    assert "not the parameters of the tissue" in done.stderr
    assert SAID[name] in " ".join(json.loads(done.stdout)["suspicions"].values())
    verdict = json.loads(bench.hc("doctor", "bad_bag", "--json", timeout=200).stdout)
    changed = {}
    for finding in verdict["findings"]:
        changed |= finding["settings"]
    assert changed["input.force.sign"] == -1
    scaled = "force" if name == "side" else "position"
    assert changed[f"input.{scaled}.scale"] == 0.001
    assert changed["input.force.time_offset"] == pytest.approx(-late_s, abs=0.005)
    assert verdict["parameters"]["stiffness"] == pytest.approx(stiffness, rel=0.12)
