"""The shorter way of a message into MCAP gives the bytes of the package's own writer."""

from __future__ import annotations

import io
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer

from hc_logger.quick_mcap import QuickWriter

numbers = st.integers(0, 2**64 - 1)
messages = st.lists(
    st.tuples(
        st.integers(1, 3), numbers, st.binary(max_size=80), numbers, st.integers(0, 2**32 - 1)
    )
)


def written(kind: type[Any], rows: list[Any], flush_every: int) -> bytes:
    stream = io.BytesIO()
    writer = kind(stream, chunk_size=200, compression=CompressionType.ZSTD)
    writer.start(profile="ros2", library="test")
    schema = writer.register_schema("a/msg/B", "ros2msg", b"float64 c")
    for i, (topic, log_time, data, publish_time, number) in enumerate(rows):
        for channel in range(1, 4):
            if i == channel - 1:  # topics come while messages are written
                writer.register_channel(f"/topic{channel}", "cdr", schema, {"a": "b"})
        writer.add_message(min(topic, i + 1), log_time, data, publish_time, number)
        if i % flush_every == flush_every - 1:
            writer.flush()
    writer.add_metadata("name", {"key": "value"})
    writer.finish()
    return stream.getvalue()


@given(messages, st.integers(1, 9))
def test_the_file_is_that_of_the_package(rows: list[Any], flush_every: int) -> None:
    assert written(QuickWriter, rows, flush_every) == written(Writer, rows, flush_every)


def test_a_number_that_does_not_fit_is_refused() -> None:
    writer = QuickWriter(io.BytesIO())
    writer.start()
    with pytest.raises(Exception, match=r"range|format"):
        writer.add_message(1, 2**64, b"", 0)
