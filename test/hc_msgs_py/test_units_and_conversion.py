"""SI on topics, millimetres in the core, and nothing lost on the way."""

from types import SimpleNamespace

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import WrenchStamped
from hc_msgs.msg import (
    ContactSummary,
    EstimatorConfiguration,
    EstimatorEvent,
)
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from hc_estimator.ros.estimate_messages import fill_contact
from hc_msgs_py import conversion, units

stamps = st.integers(-(2**31) * 10**9, (2**31) * 10**9 - 1)
readings = st.floats(-1e6, 1e6)


@given(stamps)
def test_a_stamp_is_whole_nanoseconds_there_and_back(nanoseconds):
    stamp = Time()
    units.set_stamp(stamp, nanoseconds)
    assert units.nanoseconds_from_stamp(stamp) == nanoseconds
    assert 0 <= stamp.nanosec < 10**9


@given(stamps, st.integers(0, 2**64 - 1), readings, readings)
def test_a_sample_survives_the_wire_in_si(stamp, sequence, displacement, force):
    message = conversion.new_sample_message()
    conversion.fill_sample(message, stamp, sequence, displacement, force)
    assert message.displacement == displacement / 1000.0
    received = deserialize_message(serialize_message(message), type(message))
    sample = conversion.sample_from_message(received)
    assert (sample.stamp_ns, sample.sequence, sample.force_n) == (stamp, sequence, force)
    assert sample.displacement_mm == pytest.approx(displacement, rel=1e-15)


def test_a_force_fills_a_wrench():
    wrench = WrenchStamped()
    conversion.fill_force(wrench, 7_000_000_001, 2.5)
    assert wrench.wrench.force.z == 2.5
    assert (wrench.header.stamp.sec, wrench.header.stamp.nanosec) == (7, 1)


def test_a_contact_fills_every_field_of_its_message_in_si():
    contact = SimpleNamespace(
        number=1, start_ns=10**9, end_ns=3 * 10**9, first_sequence=2, last_sequence=3, samples=4,
        rejected=5, tissue_changes=6, model_mismatch=True, parameters=np.arange(1.0, 5.0),
        covariance=np.diag([4.0, 9.0, 16.0, 25.0]) + 0.5, identifiability=np.full(4, 0.5),
        peak_force=7.0, peak_displacement=8.0, peak_speed=9.0, energy_in=10.0, energy_loss=11.0,
        position_m=(0.1, 0.2, 0.3), position_frame_id="base", duration_s=2.0, force_rmse=0.5,
    )  # fmt: skip
    message = ContactSummary()
    message.header.frame_id = "tip"
    fill_contact(message, contact, 12)
    empty = ContactSummary()
    for field in ContactSummary.get_fields_and_field_types():
        left_out = np.array_equal(getattr(message, field), getattr(empty, field))
        assert not left_out, f"{field} was not filled"
    assert message.stiffness_std == pytest.approx(4.5**0.5)
    assert (message.peak_displacement, message.peak_speed) == (0.008, 0.009)
    assert (message.energy_in, message.energy_loss) == (0.01, 0.011)
    assert message.header.stamp.sec == 3


def test_an_event_cuts_a_reason_that_is_too_long():
    message = EstimatorEvent()
    conversion.fill_event(message, 3, 10**9, 4, 5, "x" * 1000)
    assert len(message.reason) == 255
    assert message.reason.endswith("...")
    conversion.fill_event(message, 3, 10**9, 4, 5, "short")
    assert message.reason == "short"
    deserialize_message(serialize_message(message), EstimatorEvent)


def test_a_configuration_survives_the_wire_with_every_type_of_parameter():
    configuration = conversion.Configuration(
        1, 2, 3, 4, 1, "ukf", "kinematic", "hunt_crossley", "0.1.0",
        {"b": True, "i": 3, "f": 0.5, "s": "text", "a": [1.0, 2.0]},
    )  # fmt: skip
    message = conversion.message_from_configuration(configuration)
    assert [p.name for p in message.parameters] == ["a", "b", "f", "i", "s"]
    received = deserialize_message(serialize_message(message), EstimatorConfiguration)
    assert conversion.configuration_from_message(received) == configuration
