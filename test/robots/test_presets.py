"""The presets in config/robots against fakes that publish what each robot does."""

import json
from pathlib import Path

import pytest

from hc_bringup.paths import config_folder
from hc_bringup.plan import load_plan
from hc_logger.recording import read_recording
from hc_logger.verify import verify

TIME_S = 14
TURNED = [1.0, 0.0, 0.0, 0.0]  # the sensor's z points down, into the tissue

# What the real robot publishes: topics, rates, frames, signs, delays and jitter.
ROBOTS = {
    "universal_robots": {
        "force": {
            "topic": "force_torque_sensor_broadcaster/wrench",
            "frame": "tool0",
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
        "force": {
            "topic": "franka_robot_state_broadcaster/external_wrench_in_base_frame",
            "rate_hz": 1000.0,
            "mounting": TURNED,
            "in_base": True,
        },
        "position": {
            "topic": "franka_robot_state_broadcaster/current_pose",
            "rate_hz": 1000.0,
        },
    },
    "dvrk_crtk": {
        "force": {"topic": "force_sensor/measured_cf", "jitter_s": 0.002},
        "position": {"topic": "PSM1/measured_cp", "rate_hz": 200.0, "jitter_s": 0.002},
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
SURFACE_MM = dict.fromkeys(ROBOTS, -200.0) | {"daq": 250.0}


def test_every_preset_has_a_fake_and_says_what_it_is():
    files = sorted((config_folder() / "robots").glob("*.yaml"))
    assert [file.stem for file in files] == sorted(ROBOTS)
    for file in files:
        plan = load_plan(file)
        estimator = plan.node("estimator")
        told = ROBOTS[file.stem]
        for sensor in ("force", "position"):
            assert estimator.parameters[f"input.{sensor}.topic"] == told[sensor]["topic"]
        assert estimator.parameters["input.position.type"] == told["position"].get("type", "pose")
        assert f"hc run robots/{file.stem}" in file.read_text()


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.timeout(240)
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
