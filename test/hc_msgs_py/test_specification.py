"""Limits of parameters: what lies on them, just beyond them, and far beyond all numbers."""

import pytest

from hc_msgs_py.parameters import declare_specified
from hc_msgs_py.specification import ParameterSpecification, setting

LARGEST = 2**63 - 1


def test_the_largest_integer_is_allowed_and_the_next_one_is_not() -> None:
    """Regression: compared as float64, a seed of the largest value was refused."""
    seed = setting("seed", 1, "seed", minimum=0, maximum=LARGEST)
    assert seed.accepted(LARGEST) == LARGEST
    assert seed.accepted(LARGEST + 1) is None
    assert seed.accepted(-1) is None
    assert seed.accepted(10**400) is None
    assert seed.accepted(3.0) == 3


def test_a_list_of_numbers_beyond_all_floats_is_none() -> None:
    numbers = setting("direction", (0.0, 1.0), "direction")
    assert numbers.accepted([1, 2.5]) == [1.0, 2.5]
    assert numbers.accepted([10**400]) is None


@pytest.fixture
def node(ros_domain: int, monkeypatch: pytest.MonkeyPatch):
    import rclpy
    from rclpy.parameter import Parameter

    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    rclpy.init(args=[], domain_id=ros_domain)
    overrides = [Parameter(name, value=0.0) for name in ("edge", "auto")]
    yield rclpy.create_node("limits", parameter_overrides=overrides)
    rclpy.try_shutdown()


def test_a_limit_that_is_not_itself_allowed_holds_for_a_node_too(node) -> None:
    """Regression: the node said that -1e9 was the lowest mass."""
    mass = ParameterSpecification(
        "mass", "float", 1.0, "mass", minimum=-1e9, maximum=9.0, above=0.0
    )
    assert declare_specified(node, mass) == 1.0
    (limits,) = node.describe_parameter("mass").floating_point_range
    assert (limits.from_value, limits.to_value) == (0.0, 9.0)
    edge = ParameterSpecification("edge", "float", 1.0, "mass", maximum=9.0, above=0.0)
    with pytest.raises(ValueError, match=r"edge = 0.0 is not a number above 0 to 9"):
        declare_specified(node, edge)
