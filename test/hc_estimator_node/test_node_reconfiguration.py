"""Every setting while it runs: validated, atomic, applied between two samples, told."""

import random
import threading

import numpy as np
import pytest
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters, ListParameters

from hc_estimator import available_filters

pytestmark = pytest.mark.process


@pytest.fixture
def node(start_process, probe):
    process = start_process(filter="ukf")
    probe.wait_ready()
    return process


def test_settings_change_under_the_stream_and_a_switch_of_filter_keeps_what_is_known(
    node, probe, plant, end_process
):
    number = probe.stream(plant.samples(1500))
    before = probe.estimates[-1]

    # Refused with the reason, and nothing of it applied.
    answer = probe.set(atomically=True, outlier_gate=9.0, filter="nonsense")
    assert not answer.successful
    assert "filter = 'nonsense' is not one of" in answer.reason
    assert probe.get("outlier_gate", "filter") == [12.0, "ukf"]
    (answer,) = probe.set(autostart=False)
    assert not answer.successful
    assert "read-only" in answer.reason.lower()

    (answer,) = probe.set(filter="ekf")
    assert answer.successful
    probe.stream(plant.samples(300, start=1500), first=number)
    probe.wait(lambda: len(probe.estimates) == 1800, what="all estimates")
    switched = next(m for m in probe.estimates if m.configuration_revision == 2)
    assert switched.stiffness == pytest.approx(before.stiffness, rel=0.02)
    assert switched.stiffness_std == pytest.approx(before.stiffness_std, rel=0.2)
    configuration = probe.configurations[-1]
    assert (configuration.filter, configuration.cause) == ("ekf", configuration.RECONFIGURED)
    assert configuration.valid_from_sequence == switched.sequence

    probe.set(carry_over=False)
    probe.set(filter="ukf")
    probe.stream(plant.samples(10, start=1900), first=1900)
    probe.wait(lambda: probe.configurations[-1].filter == "ukf", what="the configuration")
    probe.wait(lambda: probe.estimates[-1].configuration_revision > 2, what="new estimates")
    assert probe.configurations[-1].cause == configuration.RESET
    assert probe.estimates[-1].stiffness_std > 10 * before.stiffness_std
    assert end_process(node)[0] == 0


def test_every_parameter_describes_itself_and_a_dump_loads_back(node, probe):
    names = probe.call("list_parameters", ListParameters).result.names
    descriptors = probe.call(
        "describe_parameters", DescribeParameters, DescribeParameters.Request(names=names)
    ).descriptors
    own = [d for d in descriptors if d.name != "use_sim_time" and "." not in d.name[:4]]
    for descriptor in own:
        if descriptor.name.startswith(("start_type_description", "qos_overrides")):
            continue
        assert descriptor.description, descriptor.name
        if descriptor.type == ParameterType.PARAMETER_DOUBLE:
            assert descriptor.floating_point_range, descriptor.name
        if descriptor.type == ParameterType.PARAMETER_INTEGER:
            assert descriptor.integer_range, descriptor.name

    settable = [d.name for d in own if not d.read_only and "type_description" not in d.name]
    probe.set(atomically=True, filter="raukf", state_space="paper", outlier_gate=7.5)
    dumped = dict(zip(settable, probe.get(*settable), strict=True))
    probe.set(atomically=True, filter="ukf", state_space="kinematic", outlier_gate=30.0)
    assert probe.get("outlier_gate") == [30.0]
    for answer in probe.set(**dumped):  # one at a time, in alphabetical order: as a client does
        assert answer.successful, answer.reason
    assert dict(zip(settable, probe.get(*settable), strict=True)) == dumped


@pytest.mark.slow
@pytest.mark.parametrize("given", ["auto", 0.02, 0])
def test_the_delay_is_a_word_or_a_number_from_the_start_and_while_it_runs(
    start_process, probe, plant, given
):
    start_process(channel_delay=given)
    probe.wait_ready()
    assert probe.get("channel_delay") == [given]
    number = probe.stream(plant.samples(300))
    probe.wait(lambda: len(probe.estimates) == 300, what="all estimates")
    values = {p.name: p.value for p in probe.configurations[-1].parameters}["channel_delay"]
    if given == "auto":
        assert values.string_value == "auto"
    else:
        assert values.double_value == given
        assert probe.estimates[-1].channel_delay == given
    (answer,) = probe.set(channel_delay=-0.004)
    assert answer.successful
    probe.stream(plant.samples(300, start=300), first=number)
    probe.wait(lambda: len(probe.estimates) == 600, what="the new estimates")
    assert probe.estimates[-1].channel_delay == -0.004
    (answer,) = probe.set(channel_delay="soon")
    assert not answer.successful
    assert "channel_delay = 'soon' is not 'auto' or a number" in answer.reason
    (answer,) = probe.set(channel_delay="auto")
    assert answer.successful


@pytest.mark.slow
def test_a_setting_that_nobody_gave_follows_the_default_of_the_filter(node, probe):
    from hc_estimator import parameter_specifications

    defaults = {
        kind: {s.name: s.default for s in parameter_specifications(*kind)}
        for kind in (("ukf", "kinematic"), ("ukf", "paper"))
    }
    name = next(
        n
        for n, value in defaults["ukf", "kinematic"].items()
        if defaults["ukf", "paper"].get(n, value) != value
    )
    assert probe.get(name) == [defaults["ukf", "kinematic"][name]]
    probe.set(state_space="paper")
    assert probe.get(name) == [defaults["ukf", "paper"][name]]
    probe.set(state_space="kinematic")
    probe.set(**{name: defaults["ukf", "kinematic"][name]})  # given, though it is the default
    probe.set(state_space="paper")
    assert probe.get(name) == [defaults["ukf", "kinematic"][name]]


@pytest.mark.slow
def test_random_reconfigurations_lose_no_sample_and_leave_no_invalid_state(
    node, probe, plant, end_process
):
    generator = random.Random(7)
    settings = {
        "filter": lambda: generator.choice(available_filters()),
        "state_space": lambda: generator.choice(["kinematic", "paper"]),
        "outlier_gate": lambda: generator.uniform(2.0, 40.0),
        "force_noise_std": lambda: 10 ** generator.uniform(-3, 0),
        "displacement_noise_std": lambda: 10 ** generator.uniform(-4, -1),
        "displacement_exponent_walk": lambda: 10 ** generator.uniform(-9, -3),
        "input.silence_timeout": lambda: generator.uniform(0.005, 2.0),
        "contact.minimum_duration": lambda: generator.uniform(-0.1, 0.2),
        "carry_over": lambda: generator.random() < 0.8,
    }
    done = threading.Event()
    answers = []

    from rcl_interfaces.srv import SetParametersAtomically
    from rclpy.parameter import Parameter

    client = probe.node.create_client(
        SetParametersAtomically, "/estimator/set_parameters_atomically"
    )
    probe.wait(client.service_is_ready, what="the service")

    def ask():
        names = generator.sample(list(settings), generator.randint(1, 3))
        request = SetParametersAtomically.Request()
        request.parameters = [
            Parameter(name, value=settings[name]()).to_parameter_msg() for name in names
        ]
        client.call_async(request).add_done_callback(heard)

    def heard(future):
        answers.append(future.result().result.successful)
        if not done.is_set():
            ask()

    ask()
    probe.stream(plant.samples(2000))
    done.set()
    probe.wait(lambda: len(probe.estimates) == 2000, what="2000 estimates")
    assert [m.sequence for m in probe.estimates] == list(range(2000))
    assert sum(answers) > 50
    assert not all(answers)
    numbers = np.array(
        [
            [m.stiffness, m.damping, m.displacement_exponent, m.velocity_exponent, *m.covariance]
            for m in probe.estimates
        ]
    )
    assert np.isfinite(numbers).all()
    assert (numbers[:, 4::5] >= 0.0).all()  # variances
    revisions = [m.configuration_revision for m in probe.estimates]
    assert revisions == sorted(revisions)
    assert node.poll() is None
    assert end_process(node)[0] == 0
