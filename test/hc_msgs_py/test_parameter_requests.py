"""What a client can ask of parameters that rclpy cannot answer: false, and the node lives."""

import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically

from hc_msgs_py.node_processes import Caller, ros_arguments

pytestmark = pytest.mark.process

NO_TYPE, NOT_SET = 77, 0


@pytest.fixture
def ask(ros_domain, processes):
    """Start a rig and return a function that calls its services."""
    node = processes.start("-m", "hc_sim_rig.node", *ros_arguments({}))
    caller = Caller(ros_domain, "asking")

    def call(kind, name, request):
        answer = caller.call(kind, f"/indenter/{name}", request, 60.0, answer_s=10.0)
        assert node.poll() is None
        return answer

    yield call
    caller.close()


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
