"""Sources that no preset uses: a frame of /tf; and quality of service as one's driver has it."""

import json

import pytest

pytestmark = [pytest.mark.process, pytest.mark.slow, pytest.mark.timeout(600)]

TISSUE = [0.5, 0.05, 1.5, 1.0]
TOOL = {"type": "tf", "topic": "tf", "rate_hz": 125.0, "noise_mm": 0.005}


def start_node(bench, **settings):
    words = []
    for name, value in ({"input.source": "sensors"} | settings).items():
        words += ["-p", f"{name}:={value}"]
    return bench.start("-m", "hc_estimator.node", "--ros-args", *words)


def test_a_frame_of_tf_is_the_position(bench):
    """base, shoulder, wrist from one message, the tool's place in the wrist from /tf_static."""
    bench.robot(rest_s=0.5, tissue=TISSUE, reliable=True, position=TOOL)
    start_node(
        bench,
        **{
            "input.position.type": "tf",
            "input.position.topic": "tf",
            "input.position.base_frame": "base",
            "input.position.child_frame": "tool",
            "input.position.sign": -1,
            "input.position.zero": -200.0,
            "qos_overrides./ft_sensor/wrench.subscription.reliability": "reliable",
        },
    )
    done = bench.patiently("doctor", "--seconds", "8", "--json")
    verdict = json.loads(done.stdout)
    assert verdict["parameters"]["stiffness"] == pytest.approx(0.5, rel=0.1), done.stdout
    assert verdict["parameters"]["displacement_exponent"] == pytest.approx(1.5, rel=0.1)
    told = bench.hc("topic", "info", "ft_sensor/wrench", "-v")
    assert "reliable" in told.stdout.lower(), told.stdout
    name = "qos_overrides./ft_sensor/wrench.subscription.reliability"
    assert bench.hc("param", "get", "estimator", name, "--hide-type").stdout.strip() == "reliable"


def test_a_frame_or_a_quality_of_service_that_cannot_be_is_one_line(bench):
    for settings, expected in (
        ({"input.position.type": "tf"}, "needs input.position.child_frame"),
        (
            {"qos_overrides./ft_sensor/wrench.subscription.reliability": "always"},
            "ft_sensor/wrench: reliability is 'always', must be reliable or best_effort",
        ),
        (
            {"qos_overrides./ft_sensor/wrench.subscription.depth": -3},
            "cannot subscribe to ft_sensor/wrench: depth is -3, must be 1 to",
        ),
    ):
        process = start_node(bench, **settings)
        assert process.wait(60) == 2  # a run does not start it again
        log = sorted(bench.folder.glob("process_*.log"))[-1].read_text()
        assert expected in log
        assert "Traceback" not in log
