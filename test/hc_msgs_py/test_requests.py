"""What no node expects of a client, and much at once: all is answered, and the node lives."""

import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from hc_msgs_py.node_processes import Caller, ros_arguments

pytestmark = pytest.mark.process

NO_TYPE, NOT_SET = 77, 0


@pytest.fixture
def rig(ros_domain, processes):
    """A rig that runs to the end of the test."""
    node = processes.start("-m", "hc_sim_rig.node", *ros_arguments({}))
    yield node
    assert node.poll() is None


@pytest.fixture
def caller(ros_domain):
    """Calls its services."""
    caller = Caller(ros_domain, "asking")
    yield caller
    caller.close()


@pytest.fixture
def ask(caller, rig):
    """Function (kind, name, request) -> the rig's answer."""

    def call(kind, name, request):
        return caller.call(kind, f"/indenter/{name}", request, 60.0, answer_s=10.0)

    return call


def value(kind, **fields):
    return Parameter(name="speed", value=ParameterValue(type=kind, **fields))


def test_a_type_that_does_not_exist_is_refused_and_the_others_are_set(ask):
    """Regression: one request with a value of type 77 ended any node of the suite."""
    impossible, right = value(NO_TYPE), value(3, double_value=1.5)
    request = SetParameters.Request(parameters=[impossible, right, value(NOT_SET)])
    results = ask(SetParameters, "set_parameters", request).results
    assert [one.successful for one in results] == [False, True, False]
    assert results[0].reason == "77 is not a valid Parameter.Type"
    request = SetParametersAtomically.Request(parameters=[value(3, double_value=3.0), impossible])
    result = ask(SetParametersAtomically, "set_parameters_atomically", request).result
    assert (result.successful, result.reason) == (False, "77 is not a valid Parameter.Type")
    values = ask(GetParameters, "get_parameters", GetParameters.Request(names=["speed"])).values
    assert values[0].double_value == 1.5


def test_a_parameter_that_is_not_there_is_named(ask):
    """Regression: rqt and Foxglove were told "Invalid access to undeclared parameter(s): []"."""
    misspelt = Parameter(name="sped", value=ParameterValue(type=3, double_value=1.5))
    said = "unknown parameter sped for node indenter: did you mean speed?"
    request = SetParameters.Request(parameters=[misspelt, value(3, double_value=2.5)])
    results = ask(SetParameters, "set_parameters", request).results
    assert [(one.successful, one.reason) for one in results] == [(False, said), (True, "")]
    request = SetParametersAtomically.Request(parameters=[value(3, double_value=3.0), misspelt])
    result = ask(SetParametersAtomically, "set_parameters_atomically", request).result
    assert (result.successful, result.reason) == (False, said)


def test_what_a_parameter_may_be_is_said_with_its_name_and_unit(ask):
    """Regression: rclpy's words reached whoever asked, and none of them said which parameter."""
    given = {
        "another type": value(4, string_value="nan"),
        "out of range": value(3, double_value=-1.0),
        "null": value(NOT_SET),
        "fixed": Parameter(name="seed", value=ParameterValue(type=2, integer_value=1)),
        "right": value(3, double_value=1.5),
    }
    answers = ask(
        SetParameters, "set_parameters", SetParameters.Request(parameters=list(given.values()))
    ).results
    said = {name: one.reason for name, one in zip(given, answers, strict=True)}
    assert said["another type"].startswith("parameter speed = 'nan' is not a number from ")
    assert said["out of range"].startswith("parameter speed = -1.0 is not a number from ")
    assert said["null"].startswith("parameter speed takes a value (a number from ")
    assert said["fixed"].startswith("parameter seed is read-only: give it when the node starts")
    assert [one.successful for one in answers] == [False, False, False, False, True]
    request = SetParametersAtomically.Request(parameters=[given["right"], given["out of range"]])
    result = ask(SetParametersAtomically, "set_parameters_atomically", request).result
    assert (result.successful, result.reason) == (False, said["out of range"])


def test_a_whole_number_is_a_number(ask):
    """Regression: `ros2 param set /indenter speed 2` and Foxglove's panel were refused."""
    request = SetParameters.Request(parameters=[value(2, integer_value=2)])
    assert ask(SetParameters, "set_parameters", request).results[0].successful
    values = ask(GetParameters, "get_parameters", GetParameters.Request(names=["speed"])).values
    assert (values[0].type, values[0].double_value) == (3, 2.0)


def test_a_hundred_calls_at_once_are_all_answered(caller, rig):
    """Regression: 42 of them were; whoever asked the others waited without an end."""
    deep = QoSProfile(depth=1000)
    client = caller.node.create_client(Trigger, "/indenter/ready", qos_profile=deep)
    assert caller.spin_until(client.service_is_ready, 60.0)
    caller.spin(1.0)  # the rig has to have found this client, too
    answers = [client.call_async(Trigger.Request()) for _ in range(100)]
    assert caller.spin_until(lambda: all(one.done() for one in answers), 30.0)
