"""The index of a long file takes little memory and is read back whole."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import ChunkIndex

from hc_logger.chunk_indexes import PackedChunkIndexes
from hc_logger.writer import BagWriter

large = st.integers(0, 2**64 - 1)
indexes = st.builds(
    ChunkIndex,
    chunk_length=large,
    chunk_start_offset=large,
    compression=st.sampled_from(["", "zstd"]),
    compressed_size=large,
    message_end_time=large,
    message_index_length=large,
    message_index_offsets=st.dictionaries(st.integers(0, 2**16 - 1), large, max_size=12),
    message_start_time=large,
    uncompressed_size=large,
)


@given(st.lists(indexes, max_size=20))
def test_what_was_appended_comes_out_again_as_often_as_asked(appended):
    packed = PackedChunkIndexes()
    for index in appended:
        packed.append(index)
    assert len(packed) == len(appended)
    assert list(packed) == appended
    assert list(packed) == appended


def test_many_flushes_take_little_memory_and_is_all_indexed(tmp_path: Path) -> None:
    chunks = 3600
    data = bytes(48)
    tracemalloc.start()
    try:
        with BagWriter(tmp_path / "bag") as writer:
            topics = [writer.add_topic(f"/t{i}", "hc_msgs/msg/IndenterSample") for i in range(4)]
            before, _ = tracemalloc.get_traced_memory()
            for chunk in range(chunks):
                for topic in topics:
                    writer.write(topic, chunk * 250_000_000 + topic, data)
                writer.flush()
            after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < 0.3e6  # 2.3e6 with an object for each chunk
    with open(tmp_path / "bag" / "bag_0.mcap", "rb") as stream:
        summary = make_reader(stream).get_summary()
    assert len(summary.chunk_indexes) == chunks
    assert all(len(index.message_index_offsets) == 4 for index in summary.chunk_indexes)
