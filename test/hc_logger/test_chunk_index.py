"""The index of the chunks, packed while a file is written."""

from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import ChunkIndex

from hc_logger.chunk_index import PackedChunkIndex
from hc_logger.writer import BagWriter


def entry(k: int) -> ChunkIndex:
    offsets = {channel: 100_000 * k + 500 * channel for channel in range(1, 13)}
    return ChunkIndex(
        chunk_length=9000 + k % 7,
        chunk_start_offset=100_000 * k,
        compression="zstd",
        compressed_size=8900,
        message_end_time=50_000_000 * (k + 1),
        message_index_length=2000,
        message_index_offsets=offsets,
        message_start_time=50_000_000 * k,
        uncompressed_size=40_000,
    )


def test_the_packed_index_is_the_same_bytes_in_less_memory() -> None:
    packed, plain, again = PackedChunkIndex(), RecordBuilder(), RecordBuilder()
    for k in range(2000):
        packed.append(entry(k))
        entry(k).write(plain)
    for record in packed:
        record.write(again)
    assert again.end() == plain.end()
    assert packed.memory_bytes() < 150_000  # 61 bytes an entry; as objects 1.4 kB


def test_a_writer_keeps_its_index_packed_and_the_file_has_it(tmp_path: Path) -> None:
    """The list of the mcap package grew by 40 kB a second in the recorder."""
    with BagWriter(tmp_path / "bag") as writer:
        index = writer._writer._Writer__chunk_indices
        assert isinstance(index, PackedChunkIndex)
        topic = writer.add_topic("a", "std_msgs/msg/String")
        for k in range(50):
            writer.write(topic, 10**9 + k, b"\0\1\0\0\2\0\0\0a\0")
            writer.flush()
        assert index.memory_bytes() > 50 * 60  # the package still fills what was put in its place
    (path,) = (tmp_path / "bag").glob("*.mcap")
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == 50
    assert [c.message_start_time for c in summary.chunk_indexes] == [10**9 + k for k in range(50)]
