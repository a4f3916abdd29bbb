"""Other people's readers must see in our bags what ROS itself would have sent."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hc_logger.bag import Columns
from hc_logger.decoder import decoder
from hc_logger.definitions import installed_definition
from hc_logger.layout import encode, records, stamps
from hc_logger.reader import BagReader

MakeBag = Callable[..., Path]
doubles = st.floats(allow_nan=False, width=64)


def columns(messages: list[bytes]) -> list[Columns]:
    """Messages grouped by length, as BagReader.columns gives them."""
    lengths = np.array([len(m) for m in messages])
    result = []
    for length in np.unique(lengths).tolist():
        order = np.flatnonzero(lengths == length)
        data = np.array([np.frombuffer(messages[i], np.uint8) for i in order])
        result.append(Columns(order * 1, order * 1, data, order))
    return result


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=12),
            st.integers(0, 2**31 - 1),
            st.integers(0, 999_999_999),
            st.integers(0, 2**64 - 1),
            arrays(np.float64, 16, elements=doubles),
            st.booleans(),
        ),
        min_size=1,
        max_size=6,
    )
)
def test_records_equal_what_rclpy_serialized(values: list[Any]) -> None:
    """Any frame_id, also different ones in one recording, and every kind of field."""
    from hc_msgs.msg import HuntCrossleyEstimate
    from rclpy.serialization import serialize_message

    messages = []
    for frame, seconds, nanoseconds, sequence, covariance, flag in values:
        message = HuntCrossleyEstimate()
        message.header.frame_id = frame
        message.header.stamp.sec, message.header.stamp.nanosec = seconds, nanoseconds
        message.sequence = sequence
        message.covariance = covariance
        message.nis = float(covariance[3])
        message.contact, message.rejected = flag, 3
        messages.append(serialize_message(message))
    definition = installed_definition("hc_msgs/msg/HuntCrossleyEstimate")
    table = records(definition, columns(messages))
    decode = decoder(definition)
    for i, (_, seconds, nanoseconds, sequence, covariance, flag) in enumerate(values):
        row = table[i]
        assert stamps(table)[i] == seconds * 10**9 + nanoseconds
        assert (row["sequence"], row["contact"], row["rejected"]) == (sequence, flag, 3)
        np.testing.assert_array_equal(row["covariance"], covariance)
        assert row["nis"] == covariance[3]
        np.testing.assert_array_equal(decode(messages[i]).covariance, covariance)


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    frame=st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=9),
    numbers=arrays(np.float64, (5, 2), elements=doubles),
    sequence=arrays(np.uint64, 5, elements=st.integers(0, 2**64 - 1)),
)
def test_rclpy_reads_what_we_encode(frame: str, numbers: Any, sequence: Any) -> None:
    from hc_msgs.msg import IndenterSample
    from rclpy.serialization import deserialize_message

    rows = encode(
        installed_definition("hc_msgs/msg/IndenterSample"),
        frame,
        header__stamp__sec=np.arange(5),
        header__stamp__nanosec=np.arange(5) + 7,
        sequence=sequence,
        displacement=numbers[:, 0],
        force=numbers[:, 1],
    )
    for i, row in enumerate(rows):
        message = deserialize_message(row.tobytes(), IndenterSample)
        assert message.header.frame_id == frame
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == (i, i + 7)
        assert message.sequence == sequence[i]
        assert (message.displacement, message.force) == tuple(numbers[i])


def test_rosbags_reads_every_message_and_hash(make_bag: MakeBag) -> None:
    from rosbags.highlevel import AnyReader

    path = make_bag(count=3000, chunk_bytes=8192)
    with AnyReader([path]) as theirs, BagReader(path) as ours:
        assert {c.topic: (c.msgtype, c.digest) for c in theirs.connections} == {
            t.name: (t.definition.name, t.definition.type_hash) for t in ours.topics.values()
        }
        count = 0
        for (connection, time, data), message in zip(
            theirs.messages(), ours.messages(), strict=True
        ):
            assert (connection.topic, time, bytes(data)) == (
                message.topic,
                message.log_time,
                message.data,
            )
            decoded = theirs.deserialize(data, connection.msgtype)
            if connection.topic == "/indenter/sample":
                assert decoded.sequence == count
                assert decoded.force == np.sin(count * 0.01)
                count += 1
    assert count == 3000


def test_mcap_ros2_support_reads_every_message(make_bag: MakeBag) -> None:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    path = make_bag(count=500, chunk_bytes=8192)
    with open(path / "bag_0.mcap", "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        got = [d for _, _, _, d in reader.iter_decoded_messages(topics=["/indenter/sample"])]
    assert [m.sequence for m in got] == list(range(500))
    assert [m.force for m in got] == [float(np.sin(i * 0.01)) for i in range(500)]
    assert {m.header.frame_id for m in got} == {"indenter_tip"}


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
def test_files_of_other_writers_are_read(tmp_path: Path, compression: str) -> None:
    """Without chunks, or compressed in another way."""
    from mcap.writer import CompressionType, Writer

    path = tmp_path / "other.mcap"
    definition = installed_definition("std_msgs/msg/Header")
    with open(path, "wb") as stream:
        writer = Writer(
            stream,
            chunk_size=512,
            use_chunking=compression != "none",
            compression=CompressionType[compression.upper()],
        )
        writer.start("ros2")
        schema = writer.register_schema(definition.name, "ros2msg", definition.text.encode())
        channel = writer.register_channel("/header", "cdr", schema)
        for i in range(200):
            data = b"\0\1\0\0" + i.to_bytes(8, "little") + b"\2\0\0\0a\0"
            writer.add_message(channel, 1000 + i, data, 1000 + i)
        writer.finish()
    with BagReader(path) as reader:
        assert reader.complete
        messages = list(reader.messages())
        decode = decoder(reader.topics["/header"].definition)
    assert [m.log_time for m in messages] == list(range(1000, 1200))
    assert [decode(m.data).stamp.sec for m in messages] == list(range(200))
