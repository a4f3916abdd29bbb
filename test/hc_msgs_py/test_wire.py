"""Bytes made and read without message objects are those of rclpy's own serialisation."""

import struct

import numpy as np
import pytest
from hc_msgs.msg import EstimatorEvent, HuntCrossleyEstimate, IndenterSample, IndenterTruth
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from hc_estimator import Estimate
from hc_estimator import estimate as columns
from hc_estimator.ros.estimate_messages import EstimateEncoder
from hc_msgs_py import conversion, wire

stamps = st.integers(-(2**31) * 10**9, (2**31) * 10**9 - 1)
numbers = st.floats(-1e6, 1e6)
sequences = st.integers(0, 2**64 - 1)
frames = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=40)


def sample_message(stamp, sequence, displacement, force, frame):
    message = conversion.new_sample_message(frame)
    conversion.fill_sample(message, stamp, sequence, displacement, force)
    return message


def assert_same_bytes(encoded, message):
    """Equal but for the padding, which in rclpy's bytes is whatever the memory held before."""
    expected = serialize_message(message)
    assert len(encoded) == len(expected)
    assert encoded[:4] == expected[:4]
    assert deserialize_message(encoded, type(message)) == message


@given(stamps, sequences, numbers, numbers, frames)
def test_a_sample_is_encoded_as_rclpy_does(stamp, sequence, displacement, force, frame):
    message = sample_message(stamp, sequence, displacement, force, frame)
    encoded = wire.SampleEncoder(frame).encode(stamp, sequence, displacement, force)
    assert_same_bytes(encoded, message)


@given(st.lists(st.tuples(stamps, sequences, numbers, numbers, frames), min_size=1, max_size=6))
def test_samples_whose_frame_changes_are_decoded(samples):
    decoder = wire.SampleDecoder()
    for sample in [s for s in samples for _ in range(2)]:  # twice: first and known frame
        message = sample_message(*sample)
        assert decoder.decode(serialize_message(message)) == conversion.sample_from_message(message)
        assert decoder.frame_id == sample[-1]


def test_a_big_endian_sample_is_decoded_too():
    values = (5, 6, 1, b"\0", 7, 0.008, 9.0)
    big = b"\0\0\0\0" + struct.pack(">iII1s3xQdd", *values)
    little = wire.SampleEncoder("").encode(5 * 10**9 + 6, 7, 8.0, 9.0)
    decoder = wire.SampleDecoder()
    assert decoder.decode(big) == decoder.decode(little) == (5 * 10**9 + 6, 7, 8.0, 9.0)


@pytest.mark.parametrize("known_frame", [False, True])
def test_bytes_that_are_no_sample_are_refused_and_the_next_sample_is_read(known_frame):
    good = wire.SampleEncoder("tip").encode(1, 2, 3.0, 4.0)
    decoder = wire.SampleDecoder()
    if known_frame:
        decoder.decode(good)
    for length in range(len(good)):
        with pytest.raises(ValueError, match="no IndenterSample"):
            decoder.decode(good[:length])
    with pytest.raises(ValueError, match="no IndenterSample"):
        decoder.decode(good[:12] + b"\xff\xff\xff\xff" + good[16:])
    assert decoder.decode(good).sequence == 2


@given(stamps, sequences, st.lists(numbers, min_size=7, max_size=7), st.booleans(), frames)
def test_the_truth_is_encoded_in_si_as_rclpy_does(stamp, sequence, values, contact, frame):
    displacement, velocity, force, *parameters = values
    message = IndenterTruth()
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    message.sequence = sequence
    message.displacement, message.velocity = displacement / 1000.0, velocity / 1000.0
    message.force, message.contact = force, contact
    message.stiffness, message.damping = parameters[:2]
    message.displacement_exponent, message.velocity_exponent = parameters[2:]
    encoder = wire.TruthEncoder()
    encoder.set_frame(frame)
    encoded = encoder.encode(
        stamp, sequence, displacement, velocity, force, tuple(parameters), contact
    )
    assert_same_bytes(encoded, message)


@given(stamps, sequences, frames, st.integers(0, 2**32 - 1))
def test_an_estimate_fills_every_field_of_its_message(stamp, sequence, frame, seed):
    generator = np.random.default_rng(seed)
    row = generator.random(columns.COLUMNS) + 1
    row[columns.INNOVATION : columns.INNOVATION + 2] = 3.0, 4.0
    row[columns.DISPLACEMENT], row[columns.VELOCITY] = 5.0, 6.0
    row[columns.DISPLACEMENT_NOISE_STD] = 11.0
    row[columns.CONTACT_POSITION], row[columns.CONTACT_POSITION_STD] = 17.0, 18.0
    row[columns.CONTACT] = 1.0
    row[columns.CHANGE_DETECTED], row[columns.MODEL_MISMATCH] = bool(seed & 1), bool(seed & 2)
    row[columns.REJECTED], row[columns.HYPOTHESIS] = 4, 5
    estimate = Estimate(row)
    expected = HuntCrossleyEstimate()
    expected.header.frame_id = frame
    expected.header.stamp.sec, expected.header.stamp.nanosec = divmod(stamp, 10**9)
    expected.sequence = sequence
    expected.configuration_revision = 14
    for i, name in enumerate(conversion.PARAMETER_FIELDS):
        setattr(expected, name, estimate.parameters[i])
        setattr(expected, f"{name}_std", estimate.parameters_std[i])
        setattr(expected, f"{name}_identifiability", estimate.identifiability[i])
    expected.displacement, expected.velocity = 0.005, 0.006
    expected.force_measured = 13.0
    expected.innovation_displacement, expected.innovation_force = 0.003, 4.0
    for name in ("force_predicted", "force_reconstructed", "nis", "force_noise_std"):
        setattr(expected, name, getattr(estimate, name))
    expected.displacement_noise_std = 0.011
    for name in ("channel_delay", "channel_delay_std", "force_zero", "force_zero_std"):
        setattr(expected, name, getattr(estimate, name))
    expected.contact_position, expected.contact_position_std = 0.017, 0.018
    expected.hypothesis_scores = estimate.hypothesis_scores
    for name in ("contact", "change_detected", "model_mismatch", "rejected", "hypothesis"):
        setattr(expected, name, getattr(estimate, name))
    expected.computation_time, expected.latency = 15.0, 16.0
    expected.covariance = estimate.covariance.ravel()
    encoded = EstimateEncoder(frame).encode(estimate, stamp, sequence, 13.0, 14, 15.0, 16.0)
    assert_same_bytes(encoded, expected)


@given(frames)
def test_every_field_has_its_place_whatever_the_length_of_the_frame(frame):
    frame_bytes = len(frame.encode()) + 1
    for kind in (IndenterSample, IndenterTruth, HuntCrossleyEstimate):
        message = kind()
        message.header.frame_id = frame
        layout = wire.stamped_layout(kind, frame_bytes)
        assert layout.size == len(serialize_message(message))


def test_a_message_with_parts_of_varying_length_is_refused():
    with pytest.raises(ValueError, match=r"EstimatorEvent.reason is string.*no fixed place"):
        wire.stamped_layout(EstimatorEvent, 1)
