"""Why a parameter was refused, in a user's words."""

from types import SimpleNamespace

import pytest
from rclpy.parameter import Parameter

from hc_bringup.commands import param
from hc_bringup.errors import UserError


@pytest.mark.parametrize(
    ("reason", "said"),
    [
        (
            "Wrong parameter type, expected 'Type.DOUBLE' got 'Type.STRING'",
            "it takes a number, not a text",
        ),
        (
            "Wrong parameter type, expected 'Parameter.Type.BOOL' got 'Parameter.Type.BYTE_ARRAY'",
            "it takes true or false, not a list of bytes",
        ),
        (
            "Wrong parameter type, expected 'Type.DOUBLE' got 'Type.INTEGER_ARRAY'",
            "it takes a number, not a list of whole numbers",
        ),
        (
            "Trying to set a read-only parameter: seed.",
            "it is read-only: give it when the node starts (hc run --param, or its file)",
        ),
        ("Static parameter cannot be undeclared", "it takes a value, and null is none"),
        (
            "Parameter noise out of range Min: 1e-09, Max: 1000.0, value: -1.0",
            "-1 is not a number from 1e-09 to 1000",
        ),
        (
            "Parameter count out of range. Min: 1, Max: 9, value: 10",
            "10 is not a number from 1 to 9",
        ),
        ("it is not one of x, y, z", "it is not one of x, y, z"),
    ],
)
def test_types_are_told_in_plain_words(reason, said):
    assert param._plain(reason) == said


@pytest.mark.parametrize(
    ("current", "given", "like"),
    [
        (1.5, 5, 5.0),
        (1.5, True, True),
        (2, 5, 5),
        ([0.0, 0.0, -9.81], [0, 0, -9.81], [0.0, 0.0, -9.81]),
        ([0.0], [1], [1.0]),
        ([1, 2], [3, 4], [3, 4]),
        (["a"], ["b"], ["b"]),
        ("5", 5, 5),
    ],
)
def test_whole_numbers_are_taken_for_what_the_parameter_has(current, given, like):
    found = param._like(current, given)
    assert found == like
    assert repr(found) == repr(like)


@pytest.mark.parametrize(
    ("current", "typed", "sent"),
    [
        (0.5, "1e-3", 0.001),
        (0.5, "5", 5.0),
        ([0.0, 0.0, 1.0], "[0, 0, -9.81]", [0.0, 0.0, -9.81]),
        ("ukf", "1e-3", "1e-3"),
        (0.5, "auto", "auto"),
    ],
)
def test_what_was_typed_reaches_the_node(current, typed, sent):
    """Regression: to YAML 1e-3 and a list of whole and other numbers are texts."""
    client = SimpleNamespace(
        get_parameters=lambda _names: None,
        set_parameters_atomically=lambda parameters: parameters,
    )
    got = []

    class Graph:
        def require_node(self, name):
            return name

        def parameter_client(self, _name):
            return client

        def call(self, send, what):
            if what == "setting":
                got.extend(send())
                return SimpleNamespace(result=SimpleNamespace(successful=True))
            message = Parameter("x", value=current).to_parameter_msg().value
            return SimpleNamespace(values=[message])

    assert param._set(Graph(), SimpleNamespace(node="n", name="x", value=typed)) == 0
    assert got[0].value == sent


def test_of_many_parameters_it_is_said_how_to_list_them():
    """Regression: 190 names in one line, where one was misspelt beyond recognition."""
    few, many = ["a", "b"], [f"name_{i}" for i in range(21)]
    assert str(param._no_parameter("/estimator", "xyz", few)).endswith("it has: a, b")
    said = str(param._no_parameter("/estimator", "xyz", many))
    assert said.endswith("; hc param list /estimator lists its 21")


def test_the_value_that_was_refused_is_told():
    """Regression: "it takes a number, not a text" of `nan` and 1e400, which look like numbers."""
    result = SimpleNamespace(
        successful=False, reason="Wrong parameter type, expected 'Type.DOUBLE' got 'Type.STRING'"
    )
    graph = SimpleNamespace(call=lambda *_: SimpleNamespace(result=result))
    with pytest.raises(UserError, match="setting noise to 'nan' failed: it takes a number"):
        param._set_atomically(graph, None, [Parameter("noise", value="nan")])


def test_what_a_node_of_the_suite_says_stands_alone():
    """It names the parameter, its value and what it may be: nothing is said twice."""
    said = "parameter noise = -1.0 is not a number from 1e-09 to 1000 N"
    one, other = Parameter("noise", value=-1.0), Parameter("seed", value=1)
    assert param._refused([one], said) == said
    assert param._refused([other, one], said) == f"none was changed: {said}"
