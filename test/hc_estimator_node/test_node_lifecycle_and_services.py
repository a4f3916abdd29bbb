"""A managed node, its services, and a state that outlives the process."""

import json
import signal
import time

import numpy as np
import pytest
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState

from hc_estimator import DEFAULT_FILTER, create_estimator

pytestmark = pytest.mark.process


def change(probe, transition):
    request = ChangeState.Request()
    request.transition.id = transition
    return probe.call("change_state", ChangeState, request).success


def state(probe):
    return probe.call("get_state", GetState).current_state.id


def test_a_manager_takes_it_through_its_states_and_impossible_ones_are_refused(
    start_process, end_process, probe, plant
):
    process = start_process(autostart=False)
    assert not probe.call("ready").success
    assert state(probe) == State.PRIMARY_STATE_UNCONFIGURED
    assert not change(probe, Transition.TRANSITION_ACTIVATE)
    assert change(probe, Transition.TRANSITION_CONFIGURE)
    assert not probe.call("reset").success
    assert change(probe, Transition.TRANSITION_ACTIVATE)
    assert not change(probe, Transition.TRANSITION_ACTIVATE)
    assert state(probe) == State.PRIMARY_STATE_ACTIVE
    probe.wait_ready()
    number = probe.stream(plant.samples(1000))
    probe.wait(lambda: len(probe.estimates) == 1000, what="estimates")
    known = probe.estimates[-1].stiffness_std

    assert change(probe, Transition.TRANSITION_DEACTIVATE)
    probe.stream(plant.samples(50), first=number, in_step=False)
    probe.spin(0.2)
    assert len(probe.estimates) == 1000  # inactive: nobody listens
    assert change(probe, Transition.TRANSITION_ACTIVATE)
    probe.wait_ready()
    probe.stream(plant.samples(50, start=1000), first=number)
    probe.wait(lambda: len(probe.estimates) == 1050, what="more estimates")
    assert probe.estimates[-1].stiffness_std < 2 * known  # what it knew it still knows

    assert change(probe, Transition.TRANSITION_DEACTIVATE)
    assert change(probe, Transition.TRANSITION_CLEANUP)
    assert state(probe) == State.PRIMARY_STATE_UNCONFIGURED
    assert change(probe, Transition.TRANSITION_CONFIGURE)
    assert change(probe, Transition.TRANSITION_ACTIVATE)
    probe.wait_ready()
    probe.stream(plant.samples(5))
    probe.wait(lambda: len(probe.estimates) == 1055, what="estimates of a fresh start")
    assert probe.estimates[-1].stiffness_std > 10 * known
    assert end_process(process)[0] == 0


def test_reset_tare_save_and_load(start_process, end_process, probe, plant, tmp_path):
    folder = tmp_path / "states"
    process = start_process(filter="ukf", state__folder=folder, tare__samples=100)
    probe.wait_ready()
    answer = probe.call("save")
    assert (answer.success, answer.message) == (False, "nothing to save: no sample came yet")
    assert not probe.call("load").success
    number = probe.stream(plant.samples(1500))
    probe.wait(lambda: len(probe.estimates) == 1500, what="estimates")
    known = probe.estimates[-1]
    assert probe.call("save").message == f"saved to {folder / 'saved_state.json'}"

    assert probe.call("reset").success
    number = probe.stream(plant.samples(3, start=1500), first=number)
    probe.wait(lambda: len(probe.estimates) == 1503, what="estimates")
    assert probe.estimates[-1].stiffness_std > 10 * known.stiffness_std

    assert probe.set(filter="ekf")[0].successful
    answer = probe.call("load")
    assert answer.success, answer.message
    assert probe.get("filter") == ["ukf"]  # the saved one
    number = probe.stream(plant.samples(3, start=1503), first=number)
    probe.wait(lambda: len(probe.estimates) == 1506, what="estimates")
    assert probe.estimates[-1].stiffness == pytest.approx(known.stiffness, rel=0.05)
    assert probe.configurations[-1].cause == probe.configurations[-1].STATE_LOADED

    # The tool rests 0.25 mm away from what the sensor calls zero, with 0.5 N of bias.
    assert probe.call("tare").success
    rest = [(i * 1e-3, 0.25, 0.5) for i in range(110)]
    number = probe.stream(rest, first=number)
    probe.wait(lambda: probe.events and 15 in probe.kinds(), what="the tare's event")
    assert probe.get("input.force.zero", "input.position.zero") == pytest.approx([0.5, 0.25])
    probe.wait(lambda: len(probe.estimates) == 1616, what="estimates")
    assert probe.estimates[-1].force_measured == pytest.approx(0.0, abs=1e-9)
    parameters = {p.name: p.value.double_value for p in probe.configurations[-1].parameters}
    assert parameters["input.force.zero"] == 0.5

    (folder / "saved_state.json").write_text("{}")
    answer = probe.call("load")
    assert not answer.success
    assert "is no state of an estimator" in answer.message
    status, _output, errors = end_process(process)
    assert status == 0
    assert "Traceback" not in errors
    assert sorted(p.name for p in folder.iterdir()) == ["saved_state.json"]


@pytest.mark.slow
def test_the_surface_is_found_while_the_tool_presses(start_process, end_process, probe, plant):
    """Sensors that read 0.7 N and 6 mm at the surface; the service finds both from an approach."""
    process = start_process()
    probe.wait_ready()
    assert "press from free motion" in probe.call("find_surface").message
    time_s = np.arange(3000) * 1e-3
    depth = 5.0 * time_s - 5.0
    noise = np.random.default_rng(4).normal(0.0, 1.0, (2, 3000))
    force = np.array([plant.force(d, 5.0) if d > 0.0 else 0.0 for d in depth.tolist()])
    readings = zip(
        time_s, depth + 6.0 + 0.002 * noise[0], force + 0.7 + 0.01 * noise[1], strict=True
    )
    probe.stream([(float(t), float(d), float(f)) for t, d, f in readings])
    probe.wait(lambda: 15 in probe.kinds(), what="the event of the surface")
    zeros = probe.get("input.force.zero", "input.position.zero")
    assert zeros[0] == pytest.approx(0.7, abs=0.005)
    assert zeros[1] == pytest.approx(6.0, abs=0.1)
    probe.wait(lambda: len(probe.estimates) == 3000, what="all estimates")
    last = probe.estimates[-1]
    assert last.displacement == pytest.approx(0.010, abs=2e-4)  # 10 mm deep, told in metres
    assert end_process(process)[0] == 0


@pytest.mark.slow
def test_a_node_that_was_killed_goes_on_where_it_was(
    start_process, end_process, probe, plant, tmp_path
):
    options = {
        "state__folder": tmp_path,
        "state__autosave_period": 0.1,
        "expected_estimate_subscribers": 1,
    }
    process = start_process(**options)
    probe.wait_ready()
    probe.set(outlier_gate=9.5, input__force__zero=0.05, input__position__zero=0.02)
    number = probe.stream(plant.samples(1500))
    probe.wait(lambda: len(probe.estimates) == 1500, what="estimates")
    probe.spin(0.3)
    known = probe.estimates[-1]
    revision = probe.configurations[-1].revision
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert json.loads((tmp_path / "running_state.json").read_text())["revision"] == revision

    # The middleware takes twenty seconds to notice the death; the new process comes before.
    process = start_process(**options)
    probe.wait(lambda: probe.samples.get_subscription_count() == 2, 90.0, "the second process")
    probe.wait_ready()
    # What was set while it ran, too: with other zeros it would be another tissue.
    changed = ("outlier_gate", "input.force.zero", "input.position.zero")
    assert probe.get(*changed) == [9.5, 0.05, 0.02]
    probe.stream(plant.samples(20, start=1500), first=number)
    probe.wait(lambda: len(probe.estimates) == 1520, what="estimates of the second process")
    assert probe.estimates[-1].stiffness == pytest.approx(known.stiffness, rel=0.05)
    assert probe.estimates[-1].stiffness_std < 3 * known.stiffness_std
    assert probe.estimates[-1].configuration_revision > revision
    assert end_process(process)[0] == 0
    assert not list(tmp_path.iterdir())  # a clean end leaves nothing to go on from


@pytest.mark.slow
def test_a_state_that_kills_does_so_once_at_most(
    start_process, end_process, probe, plant, tmp_path
):
    """An index far out of range made compiled code write anywhere: exit 139 at every start."""
    estimator = create_estimator(DEFAULT_FILTER)
    for time_s, displacement, force in plant.samples(100):
        estimator.step(time_s, displacement, force)
    state = estimator.state()
    state["memory"]["maneuver"]["since_member"] = -1_000_000_000
    (tmp_path / "running_state.json").write_text(
        json.dumps(
            {
                "format": 1,
                "time_origin_ns": time.time_ns(),
                "revision": 7,
                "saved_at_s": time.time(),
                "estimator": state,
            }
        )
    )
    first = start_process(state__folder=tmp_path)
    deadline = time.monotonic() + 60.0
    while first.poll() is None and not (tmp_path / "set_aside_state.json").exists():
        assert time.monotonic() < deadline
        time.sleep(0.05)
    if first.poll() is None:  # refused at once
        assert end_process(first)[0] == 0
    second = start_process(state__folder=tmp_path, state__autosave_period=0.1)
    probe.wait_ready()
    probe.stream(plant.samples(300))
    probe.wait(lambda: len(probe.estimates) == 300, what="estimates")
    assert (tmp_path / "set_aside_state.json").exists()
    assert end_process(second)[0] == 0
    assert [p.name for p in tmp_path.iterdir()] == ["set_aside_state.json"]


@pytest.mark.slow
def test_what_was_learnt_survives_a_failure_of_the_node(processes, probe, plant, tmp_path):
    """It was removed in a finally clause, so that a respawn began from nothing."""
    script = (
        "import sys, hc_estimator.node as node\n"
        "class Failing(node.EstimatorNode):\n"
        "    def on_contact(self, summary):\n"
        "        raise KeyError('a slip')\n"
        "node.EstimatorNode = Failing\n"
        "sys.exit(node.main())"
    )
    process = processes.start(
        "-c", script, "--ros-args", "-p", f"state.folder:={tmp_path}", "-p",
        "state.autosave_period:=0.1",
    )  # fmt: skip
    probe.wait_ready()
    number = probe.stream(plant.samples(500))
    probe.wait(lambda: len(probe.estimates) == 500, what="estimates")
    probe.spin(0.3)
    probe.stream([(i * 1e-3, -1.0, 0.0) for i in range(100)], first=number, in_step=False)
    _output, errors = process.communicate(timeout=20)
    assert process.returncode == 1
    assert "the node failed: KeyError: 'a slip'" in errors
    assert [p.name for p in tmp_path.iterdir()] == ["running_state.json"]
