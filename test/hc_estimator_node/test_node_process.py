"""The node as a process: what it publishes, and what it refuses to start with."""

import time

import numpy as np
import pytest

from hc_estimator import DEFAULT_FILTER, create_estimator
from hc_msgs_py.conversion import configuration_from_message
from hc_msgs_py.units import nanoseconds_from_stamp

pytestmark = pytest.mark.process


def test_estimates_are_those_of_the_core_and_everything_else_is_told(
    start_process, end_process, probe, plant
):
    from geometry_msgs.msg import WrenchStamped

    process = start_process(expected_estimate_subscribers=1)
    wrenches = []
    probe.node.create_subscription(WrenchStamped, "hc/reconstructed_wrench", wrenches.append, 1500)
    probe.wait_ready()
    time.sleep(0.3)  # the node looks ten times a second who listens to the wrench
    samples = list(plant.samples(1500))
    start_ns = time.time_ns()
    probe.stream(samples, start_ns=start_ns)
    probe.wait(lambda: len(probe.estimates) == 1500, what="1500 estimates")
    probe.wait(
        lambda: any(s.level == b"\x00" and s.message == "estimating" for s in probe.statuses)
    )

    stamps = [nanoseconds_from_stamp(m.header.stamp) for m in probe.estimates]
    assert [m.sequence for m in probe.estimates] == list(range(1500))
    configuration = configuration_from_message(probe.configurations[-1])
    assert configuration.time_origin_ns == stamps[0]
    assert configuration.valid_from_sequence == 0
    # Messages carry metres: the same rounding here.
    times = [(s - stamps[0]) * 1e-9 for s in stamps]
    displacements = [d / 1000.0 * 1000.0 for _t, d, _f in samples]
    alone = create_estimator(
        configuration.filter,
        state_space=configuration.state_space,
        contact_model=configuration.contact_model,
        **configuration.parameters,
    )
    series = alone.run(times, displacements, [f for _t, _d, f in samples])
    np.testing.assert_array_equal([m.stiffness for m in probe.estimates], series.parameters[:, 0])
    np.testing.assert_array_equal(
        [m.force_predicted for m in probe.estimates], series.force_predicted
    )
    np.testing.assert_array_equal(
        np.array([m.covariance for m in probe.estimates]).reshape(-1, 4, 4), series.covariance
    )
    np.testing.assert_allclose(series.parameters[-1], plant.parameters, rtol=0.1)

    latencies = np.array([m.latency for m in probe.estimates])
    computations = np.array([m.computation_time for m in probe.estimates])
    assert (latencies > computations).all()
    assert {m.header.frame_id for m in probe.estimates} == {"indenter_tip"}
    assert len(wrenches) > 100  # from when the node has seen who listens, which may take a second
    by_stamp = dict(zip(stamps, series.force_reconstructed, strict=True))
    for wrench in wrenches:
        assert wrench.wrench.force.z == by_stamp[nanoseconds_from_stamp(wrench.header.stamp)]

    values = {v.key: v.value for v in probe.statuses[-1].values}
    assert values["lost"] == values["strays"] == values["skipped"] == "0"
    assert values["filter"] == DEFAULT_FILTER
    for key in ("latency_p50_us", "latency_p99_us_since_start", "computation_max_us_since_start"):
        assert float(values[key]) > 0.0
    assert {"rejected_outlier", "rejected_not_finite", "rate_hz", "nis_mean"} <= values.keys()

    status, output, errors = end_process(process)
    assert (status, output) == (0, "")
    assert "Traceback" not in errors


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("{filtre: ukf}", "unknown parameter filtre for node estimator: did you mean filter?"),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ("{filter: nonsense}", "parameter filter = 'nonsense' is not one of "),
                ("[", "Couldn't parse params file"),
                ("{force_noise_std: -1.0}", "parameter force_noise_std = -1.0 is not a number"),
                ("{force_noise_std: much}", "parameter force_noise_std = 'much' is not a number"),
                ("{input: {force: {sign: 0}}}", "parameter input.force.sign = 0 is not 1 or -1"),
            )
        ),
    ],
)
def test_a_wrong_parameter_file_is_one_line_and_status_2(start_process, tmp_path, text, line):
    file = tmp_path / "parameters.yaml"
    file.write_text(f"estimator: {{ros__parameters: {text}}}\n")
    process = start_process("hc_estimator.node", "--params-file", str(file))
    _output, errors = process.communicate(timeout=60)
    assert process.returncode == 2
    assert errors.startswith(line)
    assert errors.count("\n") == 1


@pytest.mark.slow
def test_the_configuration_files_of_the_project_are_taken(start_process, end_process, probe):
    from pathlib import Path

    folder = Path(__file__).parents[2] / "config"
    process = start_process("hc_estimator.node", "--params-file", str(folder / "robot_arm.yaml"))
    # It runs and waits for the robot's sensors.
    probe.wait(lambda: "publishers" in probe.call("ready").message, what="the missing sensors")
    assert probe.get("input.source") == ["sensors"]
    assert end_process(process)[0] == 0


@pytest.mark.slow
def test_it_answers_before_it_has_compiled(processes, probe, plant):
    """With an empty cache it once answered no parameter for two minutes."""
    script = (
        "import sys, time, hc_estimator.node as node, hc_estimator.ros.compilation as work\n"
        "compile = work._compile\n"
        "work._compile = lambda name: (time.sleep(0.7), compile(name))\n"
        "sys.exit(node.main())"
    )
    process = processes.start("-c", script, "--ros-args", "-p", "filter:=ukf")
    assert probe.get("filter") == ["ukf"]
    answer = probe.call("ready")
    assert not answer.success
    assert answer.message.startswith("starting: compiling the filters, ")
    assert " of 9 done" in answer.message
    assert probe.call("reset").message.startswith("starting: compiling the filters, ")
    assert probe.set(filter="ekf")[0].successful
    probe.wait(lambda: probe.statuses, what="a status")
    assert probe.statuses[-1].message.startswith("starting: compiling the filters, ")
    probe.wait_ready()
    probe.stream(plant.samples(100))
    probe.wait(lambda: len(probe.estimates) == 100, what="estimates")
    assert probe.configurations[0].filter == "ekf"
    process.send_signal(2)
    _output, errors = process.communicate(timeout=20)
    assert process.returncode == 0
    assert "compiling the filters, " in errors
    assert "compiled the filters in " in errors


def test_it_ends_at_once_though_it_still_compiles(processes, probe, tmp_path):
    process = processes.start("-c", (
        "import os, sys\n"
        f"os.environ['NUMBA_CACHE_DIR'] = {str(tmp_path)!r}\n"
        "import hc_estimator.node as node\n"
        "sys.exit(node.main())"
    ))  # fmt: skip
    assert not probe.call("ready").success
    process.send_signal(2)
    _output, errors = process.communicate(timeout=5)
    assert (process.returncode, "Traceback" in errors) == (0, False), errors
