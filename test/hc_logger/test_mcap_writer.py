"""Our MCAP files are those of the package's own writer, byte for byte."""

import errno
import io

from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from hc_logger.mcap_writer import McapWriter

TIMES = st.integers(0, 2**64 - 1)
MESSAGES = st.lists(
    st.tuples(
        st.integers(1, 3),
        st.lists(
            st.tuples(TIMES, st.binary(max_size=60), TIMES, st.integers(0, 2**32 - 1)), max_size=8
        ),
        st.booleans(),
    ),
    max_size=20,
)


def theirs(batches, chunk_bytes, metadata):
    """Write with the package."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_bytes, CompressionType.ZSTD, IndexType.ALL)
    writer.start(profile="ros2", library="ours")
    for topic in "abc":
        schema = writer.register_schema(f"pkg/msg/{topic}", "ros2msg", topic.encode() * 30)
        writer.register_channel(f"/{topic}", "cdr", schema, {"hash": topic})
    for channel, messages, flush in batches:
        for log_ns, data, publish_ns, sequence in messages:
            writer.add_message(channel, log_ns, data, publish_ns, sequence)
        if flush:
            writer.flush()
    writer.flush()
    for name, content in metadata.items():
        writer.add_metadata(name, content)
    writer.finish()
    return stream.getvalue()


def ours(batches, chunk_bytes, metadata):
    """Write the same; returns the file and the messages that were in whole chunks at the end."""
    stream = io.BytesIO()
    writer = McapWriter(stream, chunk_bytes)
    writer.start("ros2", "ours")
    for topic in "abc":
        schema = writer.register_schema(f"pkg/msg/{topic}", "ros2msg", topic.encode() * 30)
        writer.register_channel(f"/{topic}", "cdr", schema, {"hash": topic})
    for channel, messages, flush in batches:
        columns = list(zip(*messages, strict=True)) or [()] * 4
        writer.add_messages(channel, columns[0], columns[1], columns[2], columns[3])
        if flush:
            writer.flush()
    writer.flush()
    for name, content in metadata.items():
        writer.add_metadata(name, content)
    writer.finish()
    return stream.getvalue(), writer.written


@given(MESSAGES, st.sampled_from([100, 400, 5000]))
@settings(max_examples=60)
def test_files_are_the_packages_byte_for_byte(batches, chunk_bytes):
    metadata = {"rosbag2": {"serialized_metadata": "text"}, "second": {}}
    content, written = ours(batches, chunk_bytes, metadata)
    assert content == theirs(batches, chunk_bytes, metadata)
    expected = {}
    for channel, messages, _ in batches:
        if messages:
            expected[channel] = expected.get(channel, 0) + len(messages)
    assert written == expected


def test_a_reader_finds_every_message_by_the_index():
    batches = [
        (1 + k % 3, [(k * 10 + i, bytes([k, i]), k, i) for i in range(5)], k % 4 == 0)
        for k in range(40)
    ]
    content, _ = ours(batches, 200, {})
    reader = make_reader(io.BytesIO(content))
    found = [
        (c.id, m.log_time, m.data, m.publish_time, m.sequence)
        for _, c, m in reader.iter_messages(log_time_order=True)
    ]
    assert found == [(c, *message) for c, messages, _ in batches for message in messages]
    assert reader.get_summary().statistics.message_count == 200


class FullDisk(io.BytesIO):
    """Takes so many bytes, then none."""

    room = 2000

    def write(self, data):
        if self.tell() + len(data) > self.room:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(data)


def test_what_a_full_disk_did_not_take_does_not_count_as_written():
    writer = McapWriter(FullDisk(), 10_000)
    writer.start("ros2", "ours")
    schema = writer.register_schema("pkg/msg/A", "ros2msg", b"")
    channel = writer.register_channel("/a", "cdr", schema, {})
    writer.add_messages(channel, (1, 2), (b"x", b"y"), (1, 2), (1, 2))
    writer.flush()
    assert writer.written == {channel: 2}
    taken, told = 0, None
    while told is None:
        writer.add_messages(channel, (taken,), (bytes(range(50)),), (taken,), (0,))
        try:
            writer.flush()
        except OSError as error:
            told = error
        else:
            taken += 1
    assert told.errno == errno.ENOSPC
    assert taken > 0
    assert writer.written == {channel: 2 + taken}
