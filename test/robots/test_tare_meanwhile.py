"""A surface looked for while it is recorded: the doctor names it, and judges what is alike."""

import json
import signal
import time

import pytest
import yaml

pytestmark = [pytest.mark.slow, pytest.mark.process, pytest.mark.timeout(600)]

INPUT = {
    "source": "sensors",
    "force": {"topic": "ft_sensor/wrench", "sign": 1},
    "position": {"type": "pose", "topic": "tool_pose", "sign": -1, "zero": -195.0},
}


def test_a_bag_with_two_zeros_is_said_to_have_them_and_gives_the_tissue_all_the_same(bench):
    """Regression: both parts were judged as one, K = 0.0004 for 0.5, and no word of the tare."""
    bench.robot(rest_s=0.5, force={"bias": [0.0, 0.0, 0.7]})
    path = bench.folder / "node.yaml"
    path.write_text(yaml.safe_dump({"estimator": {"ros__parameters": {"input": INPUT}}}))
    bench.start("-m", "hc_estimator.node", "--ros-args", "--params-file", str(path))
    assert bench.patiently("reset").returncode == 0
    recorder = bench.start("-m", "hc_bringup", "record", "-a", "-o", "bag")
    time.sleep(4.0)
    done = bench.patiently("find-surface", "--timeout", "60")
    assert done.returncode == 0, done.stderr
    time.sleep(18.0)  # longer than what came before, the search for the surface with it
    recorder.send_signal(signal.SIGINT)
    assert recorder.wait(60) == 0

    done = bench.hc("doctor", "bag", "--json")
    verdict = json.loads(done.stdout)
    # At most the little that the search for the surface left open.
    for finding in verdict["findings"]:
        assert all(abs(value) < 0.1 for value in finding["settings"].values()), verdict
    first, judged, *_ = verdict["notes"]
    assert first.startswith("the sensors were read otherwise from "), verdict
    assert "input.force.zero = 0.7" in first
    assert judged.startswith("judged is the longest part that was read alike, ")
    error = verdict["parameters"]["stiffness"] - 0.5
    assert abs(error) < 4.0 * verdict["parameters_std"]["stiffness"], verdict
    assert abs(error) < 0.05

    done = bench.hc("estimate", "bag")
    assert "the sensors were read otherwise from " in done.stderr
    assert "no recording of one tissue" in done.stderr
    done = bench.hc("estimate", "bag", "--verify")
    assert ", 0 different" in done.stdout, done.stdout + done.stderr
