"""The presets in config/robots against fakes that publish what each robot does."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from hc_bringup.cli import main
from hc_bringup.paths import config_folder
from hc_bringup.plan import load_plan
from hc_estimator.contact.hunt_crossley import hunt_crossley_force
from hc_logger.recording import read_recording
from hc_logger.verify import verify

TIME_S = 14
TURNED = [1.0, 0.0, 0.0, 0.0]  # the sensor's z points down, into the tissue

# What the real robot publishes: topics, rates, frames, signs, delays and jitter.
ROBOTS = {
    "universal_robots": {
        "force": {
            "topic": "force_torque_sensor_broadcaster/wrench",
            "frame": "tool0_controller",
            "mounting": TURNED,
            "jitter_s": 0.001,
        },
        "position": {"topic": "tcp_pose_broadcaster/pose", "rate_hz": 500.0, "jitter_s": 0.001},
    },
    "ur3e_bota": {
        "force": {
            "topic": "bota_ft_sensor/wrench",
            "rate_hz": 800.0,
            "mounting": TURNED,
            "jitter_s": 0.001,
        },
        "position": {"topic": "tcp_pose_broadcaster/pose", "rate_hz": 500.0, "delay_s": 0.004},
    },
    "franka": {
        "reliable": False,
        "force": {
            "topic": "franka_robot_state_broadcaster/external_wrench_in_base_frame",
            "rate_hz": 1000.0,
            "mounting": TURNED,
            "in_base": True,
            "reaction": -1,  # the force of the arm on what it touches
        },
        "position": {
            "topic": "franka_robot_state_broadcaster/current_pose",
            "rate_hz": 1000.0,
        },
    },
    "dvrk_crtk": {
        "force": {"topic": "force_sensor/measured_cf", "jitter_s": 0.002},
        "position": {"topic": "PSM1/local/measured_cp", "rate_hz": 100.0, "jitter_s": 0.002},
    },
    "ati_tracker": {
        "force": {"topic": "netft_data", "rate_hz": 1000.0, "mounting": TURNED},
        "position": {
            "type": "transform",
            "topic": "tracker/probe",
            "rate_hz": 40.0,
            "noise_mm": 0.05,
            "delay_s": 0.03,
            "jitter_s": 0.005,
        },
    },
    "daq": {
        "force": {"topic": "daq/wrench", "rate_hz": 1000.0, "scale": 0.2},
        "position": {
            "type": "joint",
            "topic": "daq/displacement",
            "rate_hz": 1000.0,
            "moving": "stage",
            "unit_per_m": 500.0,
        },
    },
}
# What machines that write files export: header, columns, signs; the travel counts from its start.
FILES = {
    "texture_analyser": (
        "Force,Distance,Time\n(g),(mm),(sec)\n",
        lambda t, d, f: f"{f / 9.80665e-3:.3f},{d + 2.5:.4f},{t:.3f}\n",
    ),
    "bench_indenter": (
        '"Time";"Extension";"Load"\n"(s)";"(mm)";"(N)"\n',
        lambda t, d, f: f'"{t:.3f}";"{-d - 7.1:.4f}";"{-f + 0.3:.5f}"\n'.replace(".", ","),
    ),
}
SURFACE_MM = dict.fromkeys(ROBOTS, -200.0) | {"daq": 250.0}


def test_every_preset_has_a_fake_and_says_what_it_is():
    files = sorted((config_folder() / "robots").glob("*.yaml"))
    assert [file.stem for file in files] == sorted([*ROBOTS, *FILES])
    for file in files:
        if file.stem in FILES:
            assert f"--preset robots/{file.stem}" in file.read_text()
            continue
        plan = load_plan(file)
        estimator = plan.node("estimator")
        told = ROBOTS[file.stem]
        for sensor in ("force", "position"):
            assert estimator.parameters[f"input.{sensor}.topic"] == told[sensor]["topic"]
        assert estimator.parameters["input.position.type"] == told["position"].get("type", "pose")
        assert f"hc run robots/{file.stem}" in file.read_text()


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", ROBOTS)
def test_a_preset_reads_its_robot(bench, name):
    bench.robot(rest_s=1.0, tissue=[0.8, 0.05, 1.4, 1.0], **ROBOTS[name])
    done = bench.hc(
        *("run", f"robots/{name}", "--json", "--no-dashboard", "--duration", str(TIME_S)),
        *("--param", f"input.position.zero={SURFACE_MM[name]}"),
        timeout=150,
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["estimates"] > 1000
    found, deviation = summary["parameters"], summary["parameters_std"]
    assert found["stiffness"] == pytest.approx(0.8, abs=max(0.08, 5 * deviation["stiffness"]))
    spread = max(0.1, 4.0 * deviation["displacement_exponent"])
    assert found["displacement_exponent"] == pytest.approx(1.4, abs=spread), summary
    assert summary["identifiability"]["stiffness"] > 0.9
    bag = Path(summary["bag"])
    # The robot spoke before the recorder listened: the bag has the first sample all the same.
    report = verify(read_recording(bench.folder / bag))
    assert report.equal, report.lines()
    assert report.not_comparable == 0, report.lines()


def press(path, head, row):
    """Write what a machine exports: presses from 2.5 mm above the tissue, 4 mm deep."""
    generator = np.random.default_rng(4)
    lines = [head]
    for k in range(5000):
        t = 2e-3 * k
        after = max(t - 0.5, 0.0)
        depth = -2.5 + 3.25 * (1.0 - math.cos(2.0 * after)) + 0.2 * math.sin(9.0 * after)
        rate = 6.5 * math.sin(2.0 * after) + 1.8 * math.cos(9.0 * after)
        force = hunt_crossley_force(depth, rate, 0.8, 0.05, 1.4, 1.0) if depth > 0.0 else 0.0
        noise = generator.normal(0.0, (0.002, 0.01))
        lines.append(row(t, depth + noise[0], force + noise[1]))
    path.write_text("".join(lines))


@pytest.mark.parametrize("name", FILES)
def test_a_preset_reads_the_files_of_its_machine(tmp_path, capsys, name):
    path = tmp_path / "export.csv"
    press(path, *FILES[name])
    assert main(["estimate", str(path), "--preset", f"robots/{name}", "--json"]) == 0
    told = capsys.readouterr()
    summary = json.loads(told.out)
    assert summary["parameters"]["stiffness"] == pytest.approx(0.8, rel=0.06), told.err
    assert summary["parameters"]["displacement_exponent"] == pytest.approx(1.4, abs=0.05)
    assert summary["suspicions"] == []
    assert "surface found at" in told.err

    # Without it nobody knows the signs and where the tissue begins, and that is said.
    main(["estimate", str(path), "--json"])
    assert json.loads(capsys.readouterr().out)["suspicions"]


def test_a_preset_for_files_and_one_for_a_robot_are_not_mixed_up(tmp_path, capsys):
    path = tmp_path / "export.csv"
    press(path, *FILES["texture_analyser"])
    own = tmp_path / "own.yaml"
    own.write_text("find_surfac: true\n")
    for words, told in (
        (["run", "robots/texture_analyser"], "is of files, not of a robot: hc estimate FILE"),
        (["estimate", str(path), "--preset", "robots/franka"], "start it with hc run"),
        (["estimate", str(path), "--preset", "robots/texture"], "did you mean robots/texture_an"),
        (["estimate", str(path), "--preset", str(own)], "did you mean find_surface?"),
        (["estimate", str(path), "--verify", "--preset", "texture_analyser"], "from the bag"),
    ):
        assert main(words) == 2
        err = capsys.readouterr().err
        assert told in err
        assert err.count("\n") == 1


def test_what_is_given_goes_before_the_preset(tmp_path, capsys):
    path = tmp_path / "export.csv"
    press(path, *FILES["bench_indenter"])
    words = ["--preset", "robots/bench_indenter", "--input", "force.sign=1", "--json"]
    assert main(["estimate", str(path), *words]) == 1
    assert "as the displacement grows: it reads a push" in capsys.readouterr().err
