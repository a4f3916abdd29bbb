"""A storm of requests under a stream of 1 kHz kills nothing, loses nothing, and spoils nothing.

Two clients set parameters at random, a manager walks the node through its life and back, and
services are called meanwhile. No revision of the configuration is lost, and the estimates are right
afterwards.
"""

import random
import time

import numpy as np
import pytest
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import (
    DescribeParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

pytestmark = pytest.mark.process

TRANSITIONS = (
    Transition.TRANSITION_CONFIGURE,
    Transition.TRANSITION_ACTIVATE,
    Transition.TRANSITION_DEACTIVATE,
    Transition.TRANSITION_CLEANUP,
)
WORDS = {
    "input.source": ["sample", "sensors", "effort"],
    "input.position.type": ["joint", "pose", "transform"],
    "input.force.topic": ["a/wrench", "b/wrench", "not a name", ""],
    "input.position.topic": ["a/arm", "b/arm", "1/2", "indenter/sample"],
    "filter": ["ukf", "ekf", "rls", "rwstukf", "raukf", "sir_pf", "rbpf", "self_tuning_ukf"],
    "state_space": ["kinematic", "paper"],
    "contact_model": ["hunt_crossley", "kelvin_voigt"],
}
TROUBLESOME = (*WORDS, "input.publish_samples", "carry_over", "use_sim_time")


class Storm:
    """Random sets of parameters: some right, some out of range, some of the wrong type."""

    def __init__(self, descriptors, seed):
        self.random = random.Random(seed)
        self.descriptors = {d.name: d for d in descriptors}
        self.names = sorted(self.descriptors)

    def parameters(self):
        count = self.random.choice((1, 1, 2, 5, 20))
        names = set(self.random.sample(self.names, count - 1)) if count > 1 else set()
        names.add(self.random.choice(TROUBLESOME))
        return [Parameter(name, value=self.value(name)) for name in sorted(names)]

    def value(self, name):
        draw = self.random.random()
        if draw < 0.1:
            return self.random.choice((True, -7, 3.5, "nonsense", [1.0, 2.0], float("nan")))
        descriptor = self.descriptors[name]
        if descriptor.type == ParameterType.PARAMETER_BOOL:
            return self.random.random() < 0.5
        if descriptor.type == ParameterType.PARAMETER_STRING:
            return self.random.choice(WORDS.get(name, ["", "x", "a b"]))
        if descriptor.type == ParameterType.PARAMETER_INTEGER:
            low, high = _range(descriptor.integer_range, 1000)
            return self.random.randint(max(low - 1, -(2**63)), min(low + 50, high + 1))
        if descriptor.type == ParameterType.PARAMETER_DOUBLE:
            low, high = _range(descriptor.floating_point_range, 10.0)
            return self.random.uniform(low - 0.01, min(high, low + 10.0) + 0.01)
        return [0.0, self.random.random(), 1.0]


def _range(ranges, default):
    if not ranges:
        return -default, default
    return ranges[0].from_value, ranges[0].to_value


class Client:
    """Asks again and again, the next question as soon as the last one is answered."""

    def __init__(self, node, kinds, make, count):
        self.clients = {
            name: node.create_client(kind, f"/estimator/{name}") for name, kind in kinds
        }
        self.make, self.left = make, count
        self.answers = []
        self.asked = 0.0

    def ready(self):
        return all(client.service_is_ready() for client in self.clients.values())

    def ask(self):
        name, request = self.make()
        self.asked = time.monotonic()
        self.pending = self.clients[name].call_async(request)
        self.pending.add_done_callback(self.heard)

    def heard(self, future):
        self.answers.append(future.result())
        self.left -= 1
        if self.left > 0:
            self.ask()

    def unanswered_s(self):
        return time.monotonic() - self.asked if self.left > 0 else 0.0


def storm(start_process, start_script, end_process, probe, plant, tmp_path, *, sets, transitions):
    options = {"state__folder": tmp_path / "state", "state__autosave_period": 0.1}
    stream = start_script("stream_source.py", "0")
    # Nobody reads its standard error meanwhile: warnings would fill the pipe and hold the node up.
    process = start_process("hc_estimator.node", "--log-level", "error", **options)
    probe.wait_ready()
    names = probe.call("list_parameters", ListParameters).result.names
    request = DescribeParameters.Request(names=names)
    descriptors = probe.call("describe_parameters", DescribeParameters, request).descriptors

    settable = [d.name for d in descriptors if not d.read_only]
    untouched = dict(zip(settable, probe.get(*settable), strict=True)) | {"filter": "ukf"}

    def setter(seed):
        source = Storm(descriptors, seed)

        def make():
            kind = (SetParameters, SetParametersAtomically)[source.random.random() < 0.5]
            message = kind.Request()
            message.parameters = [p.to_parameter_msg() for p in source.parameters()]
            atomically = kind is SetParametersAtomically
            return "set_parameters_atomically" if atomically else "set_parameters", message

        return make

    generator = random.Random(5)

    def transition():
        if generator.random() < 0.3:
            name = generator.choice(("ready", "reset", "tare", "find_surface", "save", "load"))
            return name, Trigger.Request()
        message = ChangeState.Request()
        message.transition.id = generator.choice(TRANSITIONS)
        return "change_state", message

    kinds = (
        ("set_parameters", SetParameters),
        ("set_parameters_atomically", SetParametersAtomically),
    )
    services = [(n, Trigger) for n in ("ready", "reset", "tare", "find_surface", "save", "load")]
    clients = [
        Client(probe.node, kinds, setter(1), sets // 2),
        Client(probe.node, kinds, setter(2), sets - sets // 2),
        Client(probe.node, [("change_state", ChangeState), *services], transition, transitions),
    ]
    probe.wait(lambda: all(c.ready() for c in clients), what="the services")
    for client in clients:
        client.ask()
    while any(c.left > 0 for c in clients):
        probe.spin(0.2)
        assert process.poll() is None, process.stderr.read()
        assert all(c.unanswered_s() < 20.0 for c in clients)
    stream.terminate()
    assert stream.wait(20.0) == 0
    answers = [r for c in clients[:2] for a in c.answers for r in getattr(a, "results", [None])]
    assert len(clients[0].answers) + len(clients[1].answers) == sets
    assert len(answers) > sets

    # Back to something known, whatever it is now.
    for name in (
        Transition.TRANSITION_DEACTIVATE,
        Transition.TRANSITION_CLEANUP,
        Transition.TRANSITION_CONFIGURE,
    ):
        message = ChangeState.Request()
        message.transition.id = name
        probe.call("change_state", ChangeState, message)
    answer = probe.set(atomically=True, **untouched)
    assert answer.successful, answer.reason
    message = ChangeState.Request()
    message.transition.id = Transition.TRANSITION_ACTIVATE
    probe.call("change_state", ChangeState, message)
    assert probe.call("get_state", GetState).current_state.id == State.PRIMARY_STATE_ACTIVE
    probe.wait_ready()
    assert probe.call("reset").success
    known = len(probe.estimates)
    probe.stream(plant.samples(4000))
    probe.wait(lambda: len(probe.estimates) >= known + 4000, what="estimates of good samples")
    last = probe.estimates[-1]
    found = (last.stiffness, last.damping, last.displacement_exponent, last.velocity_exponent)
    np.testing.assert_allclose(found, plant.parameters, rtol=0.1)
    revisions = [c.revision for c in probe.configurations]
    assert revisions == sorted(revisions)
    assert sorted(set(revisions)) == list(range(1, revisions[-1] + 1))
    assert len(set(revisions)) > sets // 10
    used = [m.configuration_revision for m in probe.estimates]
    assert used == sorted(used)
    status, _output, errors = end_process(process)
    assert (status, "Traceback" in errors) == (0, False), errors


@pytest.mark.slow
def test_a_storm_of_parameters_and_transitions_kills_nothing(
    start_process, start_script, end_process, probe, plant, tmp_path
):
    storm(
        *(start_process, start_script, end_process, probe, plant, tmp_path),
        sets=200,
        transitions=60,
    )


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_long_storm_of_parameters_and_transitions_kills_nothing(
    start_process, start_script, end_process, probe, plant, tmp_path
):
    storm(
        *(start_process, start_script, end_process, probe, plant, tmp_path),
        sets=2000,
        transitions=500,
    )
