"""Messages as text: what hc topic echo prints."""

import pytest
import yaml
from hc_msgs.msg import EstimatorConfiguration, HuntCrossleyEstimate
from rclpy.parameter import Parameter

from hc_bringup.errors import UserError
from hc_bringup.message_text import as_csv, as_yaml, field, plain


def estimate() -> HuntCrossleyEstimate:
    message = HuntCrossleyEstimate(stiffness=0.25, contact=True, rejected=4)
    message.header.frame_id = "indenter_tip"
    message.covariance = [float(i) for i in range(16)]
    return message


def test_yaml_reads_back_in_the_order_of_the_message() -> None:
    data = yaml.safe_load(as_yaml(estimate()))
    assert list(data) == list(estimate().get_fields_and_field_types())
    assert data["stiffness"] == 0.25
    assert data["contact"] is True
    assert data["covariance"] == [float(i) for i in range(16)]
    assert data["header"]["frame_id"] == "indenter_tip"


def test_arrays_can_be_left_out() -> None:
    assert plain(estimate(), arrays=False)["covariance"] == "<array of 16>"


def test_csv_has_every_scalar() -> None:
    scalars = as_csv(estimate()).split(",")
    fields = estimate().get_fields_and_field_types()
    # A header has three, the covariance sixteen, the hypotheses have six scores.
    assert len(scalars) == len(fields) - 3 + 3 + 16 + 6


def test_fields_by_path() -> None:
    message = EstimatorConfiguration(parameters=[Parameter("a", value=2.5).to_parameter_msg()])
    assert field(message, "parameters[0].value.double_value") == 2.5
    assert field(message, "header.stamp.sec") == 0
    assert yaml.safe_load(as_yaml(field(message, "parameters")))[0]["name"] == "a"


def test_a_field_that_is_not_there_is_missed_where_it_should_be() -> None:
    """Regression: "no field 'nosuch' in 'nosuch'"."""
    for path, told in (
        ("nosuch", "no field 'nosuch' in hc_msgs/HuntCrossleyEstimate; fields there: header, "),
        ("header.nix", "no field 'nix' in std_msgs/Header; fields there: stamp, frame_id"),
        ("stiffness.nix", "no field 'nix' in stiffness.nix; fields there: none"),
    ):
        with pytest.raises(UserError) as caught:
            field(estimate(), path)
        assert str(caught.value).startswith(told)


@pytest.mark.parametrize("path", ["nix", "header.nix", "covariance[99]", "covariance[x]"])
def test_wrong_paths_are_told_in_one_line(path: str) -> None:
    with pytest.raises(UserError) as caught:
        field(estimate(), path)
    assert caught.value.status == 2
