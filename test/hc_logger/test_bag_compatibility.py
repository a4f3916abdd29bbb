"""Other people's readers must see in our bags what ROS itself would have sent."""

from __future__ import annotations

import json
import shutil
import subprocess
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
from hc_logger.writer import BagWriter

MakeBag = Callable[..., Path]
doubles = st.floats(allow_nan=False, width=64)


def columns(messages: list[bytes]) -> list[Columns]:
    """Messages grouped by length, as BagReader.columns gives them."""
    lengths = np.array([len(m) for m in messages])
    result = []
    for length in np.unique(lengths).tolist():
        order = np.flatnonzero(lengths == length)
        data = np.array([np.frombuffer(messages[i], np.uint8) for i in order])
        result.append(Columns(order * 1, data, order))
    return result


@settings(max_examples=40)
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


@settings(max_examples=30, suppress_health_check=[HealthCheck.too_slow])
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


NODE_FOLDER = Path(__file__).parent / "node"


@pytest.mark.process
def test_mcap_core_for_javascript_reads_every_message_and_hash(tmp_path: Path) -> None:
    """As Foxglove's tools do: sample, estimate and configuration, every field of each."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node on this machine")
    if not (NODE_FOLDER / "node_modules").is_dir():
        pytest.skip(f"the npm packages are not there: run npm ci in {NODE_FOLDER}")
    from hc_msgs.msg import EstimatorConfiguration, HuntCrossleyEstimate, IndenterSample
    from rcl_interfaces.msg import Parameter, ParameterValue
    from rclpy.serialization import serialize_message

    with BagWriter(tmp_path / "bag", chunk_bytes=4096) as writer:
        topics = {
            kind: writer.add_topic(
                name, f"hc_msgs/msg/{kind.__name__}", qos_profiles=[{"depth": 7}]
            )
            for name, kind in (
                ("indenter/sample", IndenterSample),
                ("hc/estimate", HuntCrossleyEstimate),
                ("hc/configuration", EstimatorConfiguration),
            )
        }
        rng = np.random.default_rng(4)
        sent: list[dict[str, Any]] = []
        for k in range(300):
            displacement, force = rng.normal(size=2).tolist()
            sample = IndenterSample(sequence=2**60 + k, displacement=displacement, force=force)
            estimate = HuntCrossleyEstimate(sequence=k, rejected=k % 7)
            estimate.covariance = rng.normal(size=16)
            estimate.contact = bool(k % 2)
            value = ParameterValue(type=8, double_array_value=rng.normal(size=k % 4).tolist())
            configuration = EstimatorConfiguration(
                revision=k, filter="ukf", parameters=[Parameter(name="π", value=value)]
            )
            for message in (sample, estimate, configuration):
                writer.write(topics[type(message)], k, serialize_message(message))
            sent.append({"sample": sample, "estimate": estimate, "configuration": configuration})
    done = subprocess.run(
        [node, str(NODE_FOLDER / "read_bag.mjs"), str(tmp_path / "bag" / "bag_0.mcap")],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    head, *lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert head["profile"] == "ros2"
    with BagReader(tmp_path / "bag") as reader:
        assert {t: (c["type"], c["hash"]) for t, c in head["channels"].items()} == {
            t.name: (t.definition.name, t.definition.type_hash) for t in reader.topics.values()
        }
    assert head["channels"]["/hc/estimate"]["qos"] == "- depth: 7\n"
    assert len(lines) == 900
    for line in lines:
        name = line["topic"].rsplit("/", 1)[1]
        k, got = int(line["time"]), line["content"]
        message = sent[k][name]
        if name == "sample":
            assert int(got["sequence"]) == message.sequence
            assert (got["displacement"], got["force"]) == (message.displacement, message.force)
        elif name == "estimate":
            assert got["covariance"] == message.covariance.tolist()
            assert (got["contact"], got["rejected"]) == (message.contact, message.rejected)
        else:
            (parameter,) = got["parameters"]
            assert (got["revision"], got["filter"], parameter["name"]) == (k, "ukf", "π")
            expected = message.parameters[0].value.double_array_value
            assert parameter["value"]["double_array_value"] == list(expected)
