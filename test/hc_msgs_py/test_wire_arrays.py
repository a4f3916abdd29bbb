"""Messages of arrays, and many messages at once, are to the byte and the bit those of rclpy."""

from types import SimpleNamespace

import numpy as np
import pytest
from hc_msgs.msg import (
    HuntCrossleyEstimate,
    HuntCrossleyEstimates,
    IndenterSamples,
    TactileEstimate,
    TactileSample,
)
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from hc_estimator.ros.estimate_messages import EstimateEncoder
from hc_msgs_py import wire
from hc_msgs_py.wire_arrays import (
    ArraysDecoder,
    ArraysEncoder,
    Samples,
    SamplesDecoder,
    SamplesEncoder,
    decode_samples,
    encode_estimates,
    record_layout,
)

START = 1_700_000_000_000_000_000
numbers = st.floats(-1e6, 1e6)
frames = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=40)
readings = st.lists(st.tuples(st.integers(0, 10**9), numbers, numbers), min_size=1, max_size=20)


@given(readings, st.integers(0, 2**62), frames)
def test_samples_go_out_and_come_in_as_rclpy_has_them(rows, sequence, frame):
    offsets, depths, forces = (list(column) for column in zip(*rows, strict=True))
    stamps = [START + offset for offset in offsets]
    data = SamplesEncoder(frame).encode(stamps, sequence, depths, forces)
    message = deserialize_message(data, IndenterSamples)
    assert len(serialize_message(message)) == len(data)
    assert message.header.frame_id == frame
    assert message.sequence == sequence
    assert list(message.time_offset) == [stamp - stamps[0] for stamp in stamps]
    np.testing.assert_array_equal(message.displacement, np.array(depths) / 1000.0)
    decoder = SamplesDecoder()
    samples = decoder.decode(serialize_message(message))
    assert decoder.frame_id == frame
    assert samples.stamps_ns.tolist() == stamps
    assert samples.sequences.tolist() == list(range(sequence, sequence + len(stamps)))
    np.testing.assert_array_equal(samples.displacements_mm, np.array(depths) / 1000.0 * 1000.0)
    assert samples.forces_n.tolist() == forces


@pytest.mark.parametrize(
    "message_type", [IndenterSamples, HuntCrossleyEstimates, TactileSample, TactileEstimate]
)
@pytest.mark.parametrize("frame", ["", "tip", "indenter_tip"])
@pytest.mark.parametrize("count", [1, 2, 5, 64])
def test_every_field_of_a_record_has_rclpys_place(message_type, frame, count):
    random = np.random.default_rng(count)
    record = ArraysEncoder(message_type, frame).record(count, START + 5)
    names = [n for n in message_type.get_fields_and_field_types() if n != "header"]
    for name in names:
        field = record[name]
        field[...] = random.integers(0, 2, field.shape)
    message = deserialize_message(record.tobytes(), message_type)
    assert len(serialize_message(message)) == record.nbytes
    stamp, found = ArraysDecoder(message_type).decode(serialize_message(message))
    assert stamp == START + 5
    for name in names:
        np.testing.assert_array_equal(getattr(message, name), record[0][name], err_msg=name)
        np.testing.assert_array_equal(found[name], record[0][name], err_msg=name)


def test_many_messages_of_one_sample_are_read_as_one_by_one():
    encoder, decoder = wire.SampleEncoder("tip"), wire.SampleDecoder()
    messages = [encoder.encode(START + i, i, 0.1 * i, 0.3 * i) for i in range(50)]
    one_by_one = [decoder.decode(message) for message in messages]
    samples = decode_samples(decoder, messages)
    assert list(zip(*(c.tolist() for c in samples), strict=True)) == one_by_one


def test_messages_that_differ_are_left_to_be_read_one_by_one():
    decoder = wire.SampleDecoder()
    one = wire.SampleEncoder("tip").encode(START, 0, 1.0, 2.0)
    decoder.decode(one)
    assert decode_samples(decoder, [one, wire.SampleEncoder("top").encode(START, 1, 1, 2)]) is None
    assert decode_samples(decoder, [one, wire.SampleEncoder("").encode(START, 1, 1, 2)]) is None
    assert decode_samples(decoder, [one, one[:-3]]) is None
    assert decode_samples(decoder, [one, b"\0\0" + one[2:]]) is None


def test_a_big_endian_message_is_read_too():
    message = deserialize_message(
        SamplesEncoder("a").encode([START, START + 7], 3, [1.0, 2.0], [3.0, 4.0]), IndenterSamples
    )
    big = record_layout(IndenterSamples, 2, 2).newbyteorder(">")
    record = np.zeros(1, big)
    record["encapsulation"] = (0, 0, 0, 0)
    record["sec"], record["nanosec"] = message.header.stamp.sec, message.header.stamp.nanosec
    record["frame_length"], record["frame"] = 2, (97, 0)
    for name in ("time_offset", "displacement", "force"):
        record[name], record[f"{name}_length"] = getattr(message, name), 2
    record["sequence"] = 3
    samples = SamplesDecoder().decode(record.tobytes())
    assert samples.stamps_ns.tolist() == [START, START + 7]
    assert samples.forces_n.tolist() == [3.0, 4.0]


def test_bytes_that_are_no_samples_are_refused():
    good = SamplesEncoder("tip").encode([START, START + 1], 0, [1.0, 2.0], [3.0, 4.0])
    random = np.random.default_rng(4)
    decoder = SamplesDecoder()
    for end in range(len(good)):
        with pytest.raises(ValueError, match="IndenterSamples"):
            decoder.decode(good[:end])
    for _ in range(500):
        broken = bytearray(good)
        broken[int(random.integers(2, len(good)))] = int(random.integers(256))
        try:
            samples = decoder.decode(bytes(broken))
        except ValueError:
            continue
        assert len(samples.stamps_ns) == len(samples.forces_n) <= 2
    assert decoder.decode(good).forces_n.tolist() == [3.0, 4.0]
    empty = serialize_message(IndenterSamples())
    with pytest.raises(ValueError, match="IndenterSamples"):
        decoder.decode(empty)


def test_estimates_of_a_batch_have_the_bytes_of_each():
    hc = pytest.importorskip("hc_estimator")
    time = np.arange(40) / 1000.0
    depth, force = 2.0 + np.sin(time), 1.0 + np.sin(time)
    force[7] = np.nan
    series = hc.create_estimator("ekf").run(time, depth, force)
    stamps = START + np.arange(40) * 1_000_000
    samples = Samples(stamps, np.arange(40, dtype=np.uint64), depth, force)
    now = int(stamps[-1]) + 300_000
    together = encode_estimates(series, samples, "tip", 3, 1e-6, now)
    encoder = EstimateEncoder("tip")
    for i, data in enumerate(together):
        stamp = int(stamps[i])
        one = encoder.encode(series[i], stamp, i, force[i], 3, 1e-6, (now - stamp) * 1e-9)
        assert len(one) == len(data)
        as_text = [str(deserialize_message(d, HuntCrossleyEstimate)) for d in (one, data)]
        assert as_text[0] == as_text[1]


def test_a_message_with_other_parts_is_refused():
    odd = SimpleNamespace(
        __name__="Odd",
        get_fields_and_field_types=lambda: {"header": "std_msgs/Header", "a": "string"},
    )
    with pytest.raises(ValueError, match="no number"):
        record_layout.__wrapped__(odd, 1, 1)
    odd.get_fields_and_field_types = lambda: {"a": "double"}
    with pytest.raises(ValueError, match="does not begin"):
        record_layout.__wrapped__(odd, 1, 1)
