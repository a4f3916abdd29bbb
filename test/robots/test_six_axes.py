"""A tool askew over a slanted surface, with a weight at its sensor, read along the normal."""

import json
import re
import time

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

pytestmark = [pytest.mark.process, pytest.mark.timeout(600)]

NORMAL = [0.2, -0.1, 1.0]
DOWN = Rotation.from_euler("xy", [170, 10], degrees=True)
MOUNTING = Rotation.from_euler("z", 45, degrees=True).as_quat().tolist()
PAYLOAD = {"mass": 0.7, "center": [0.0, 0.01, 0.06]}
ROBOT = {
    "rest_s": 0.5,
    "normal": NORMAL,
    "attitude": DOWN.as_quat().tolist(),
    "rocking_deg": 5.0,
    "tip": [0.0, 0.0, 0.12],
    "force": {"bias": [0.3, -1.1, 4.2], "mounting": MOUNTING},
    "payload": PAYLOAD,
}


def estimator(bench, **more):
    """Start an estimator that reads along the surface's normal."""
    settings = {
        "tool": {"tip": ROBOT["tip"]},
        "contact": {"frame": "surface", "normal": NORMAL, "point": [0.4, 0.1, 0.2]},
        "source": "sensors",
        "force": {"topic": "ft_sensor/wrench", "mounting": MOUNTING},
        "position": {"type": "pose", "topic": "tool_pose"},
    }
    for group, values in more.items():
        settings[group] = settings.get(group, {}) | values
    path = bench.folder / "six.yaml"
    path.write_text(yaml.safe_dump({"estimator": {"ros__parameters": {"input": settings}}}))
    return bench.start("-m", "hc_estimator.node", "--ros-args", "--params-file", str(path))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pose", "tf"])
def test_doctor_says_that_the_tool_turns_where_it_is_read_along_an_axis(bench, kind):
    """Regression: only hc setup did; read along the normal it is nothing wrong."""
    frames = {"type": "tf", "topic": "/tf"} if kind == "tf" else {}
    bench.robot(rest_s=0.5, rocking_deg=24.0, position=frames)
    settings = {
        "source": "sensors",
        "force": {"topic": "ft_sensor/wrench"},
        "position": frames | {"child_frame": "tool", "base_frame": "base"}
        if frames
        else {"topic": "tool_pose"},
    }
    settings["position"].setdefault("type", "pose")
    path = bench.folder / "axis.yaml"
    path.write_text(yaml.safe_dump({"estimator": {"ros__parameters": {"input": settings}}}))
    bench.start("-m", "hc_estimator.node", "--ros-args", "--params-file", str(path))
    verdict = json.loads(bench.patiently("doctor", "--seconds", "6", "--json").stdout)
    assert any(f["what"].startswith("the tool turned by up to") for f in verdict["findings"])


@pytest.mark.slow
def test_along_the_normal_the_tissue_is_found_whatever_the_attitude(bench):
    # 0.5 rad/s to and fro, and poses 20 ms late: the attitude at a wrench's stamp counts.
    position = {"delay_s": 0.02}
    bench.robot(**(ROBOT | {"rocking_deg": 15.0, "rocking_rate": 2.0, "position": position}))
    payload = {"mass": 0.7, "force_bias": ROBOT["force"]["bias"]}
    node = estimator(bench, payload=payload)
    verdict = json.loads(bench.patiently("doctor", "--seconds", "7", "--json").stdout)
    assert not any(f["settings"] for f in verdict["findings"]), verdict
    assert not any("turned" in f["what"] for f in verdict["findings"]), verdict
    assert verdict["parameters"]["stiffness"] == pytest.approx(0.5, rel=0.03)
    assert verdict["parameters"]["displacement_exponent"] == pytest.approx(1.5, rel=0.03)

    # Point and normal from one approach, starting from a wrong guess.
    for name, value in (
        ("input.contact.normal_from", "find_surface"),
        ("input.contact.normal", "[0.0, 0.0, 1.0]"),
        ("input.contact.point", "[0.4, 0.1, 0.25]"),
    ):
        done = bench.hc("param", "set", "estimator", name, value)
        assert done.returncode == 0, done.stderr
    done = bench.hc("find-surface", "--timeout", "15")
    assert done.returncode == 0, done.stderr
    known = float(re.search(r"\) known to ([0-9.]+) degrees", done.stdout)[1])
    told = bench.hc("param", "get", "estimator", "input.contact.normal", "--hide-type").stdout
    normal = np.array(yaml.safe_load(told))
    truth = np.array(NORMAL) / np.linalg.norm(NORMAL)
    assert np.degrees(np.arccos(normal @ truth)) < min(4.0 * known, 3.0)
    told = bench.hc("param", "get", "estimator", "input.contact.point", "--hide-type").stdout
    height = (np.array(yaml.safe_load(told)) - [0.4, 0.1, 0.2]) @ truth
    assert height == pytest.approx(0.0, abs=5e-4)
    assert node.poll() is None


@pytest.mark.slow
def test_the_payload_is_identified_and_told_to_the_estimator(bench):
    attitudes = Rotation.random(6, random_state=3).as_quat().tolist()
    bench.robot(**(ROBOT | {"attitudes": attitudes, "rest_s": 1e6, "lift_mm": 50.0}))
    estimator(bench)
    done = bench.patiently("payload", "--yes", "--seconds", "13")
    assert done.returncode == 0, done.stderr
    told = next(line for line in done.stdout.splitlines() if line.startswith("mass "))
    assert float(told.split()[1]) == pytest.approx(0.7, abs=0.02)
    told = bench.hc("param", "get", "estimator", "input.payload.mass", "--hide-type").stdout
    assert float(told) == pytest.approx(0.7, abs=0.02)
    told = bench.hc("param", "get", "estimator", "input.payload.force_bias", "--hide-type").stdout
    np.testing.assert_allclose(yaml.safe_load(told), ROBOT["force"]["bias"], atol=0.1)


@pytest.mark.slow
def test_attitudes_that_are_none_are_told_in_one_line(bench):
    bench.robot(**ROBOT, tells_attitude=False)
    estimator(bench)
    assert bench.patiently("param", "get", "estimator", "filter").returncode == 0
    done = bench.patiently("doctor", "--seconds", "7")
    assert done.returncode == 1
    assert "waits for the first sample: " in done.stdout
    assert " attitudes whose quaternion has no length: let the driver fill it" in done.stdout
    assert not done.stderr


@pytest.mark.slow
def test_a_surface_that_moves_counts_where_it_was_at_the_stamps(bench):
    organ = {"topic": "organ", "breath_mm": 8.0, "rate_hz": 30.0, "delay_s": 0.03, "ends_s": 60.0}
    bench.robot(**ROBOT, organ=organ)
    payload = {"mass": 0.7, "force_bias": ROBOT["force"]["bias"]}
    contact = {"normal_from": "topic", "topic": "organ", "point": [9.0, 9.0, 9.0]}
    estimator(bench, payload=payload, contact=contact, pairing={"maximum_wait": 0.12})
    verdict = json.loads(bench.patiently("doctor", "--seconds", "8", "--json").stdout)
    assert not any(f["settings"] for f in verdict["findings"]), verdict
    assert verdict["parameters"]["stiffness"] == pytest.approx(0.5, rel=0.02)
    assert verdict["parameters"]["displacement_exponent"] == pytest.approx(1.5, rel=0.02)
    # The surface falls silent: estimates go on, and it is said.
    told = "no pose on organ for [0-9.]+ s: the surface is taken to stay where it was"
    for _ in range(40):
        time.sleep(1.0)
        done = bench.hc("topic", "echo", "/diagnostics", "--once")
        if re.search(told, done.stdout):
            break
    assert re.search(told, done.stdout), done.stdout + done.stderr
