"""Bags written and read back: every message, order, damage, counts."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hc_msgs.msg import TactileSample
from rclpy.serialization import serialize_message

from hc_logger.definitions import installed_definition
from hc_logger.errors import BagError, BagExistsError, UnknownTypeError
from hc_logger.info import bag_info
from hc_logger.layout import records, stamps
from hc_logger.numbered_bags import new_numbered_bag, numbered_bags
from hc_logger.reader import BagReader
from hc_logger.recording import read_recording
from hc_logger.writer import BagWriter

MakeBag = Callable[..., Path]
SAMPLE = "hc_msgs/msg/IndenterSample"


def record_ends(data: bytes) -> list[int]:
    """Where each record of an MCAP file ends, by the specification alone."""
    position, ends = 8, []
    while position + 9 <= len(data):
        (length,) = struct.unpack_from("<Q", data, position + 1)
        if position + 9 + length > len(data):
            break
        position += 9 + length
        ends.append(position)
        if data[ends[-2] if len(ends) > 1 else 8] == 2:  # footer
            break
    return ends


def test_every_message_comes_back_in_order(make_bag: MakeBag, start_ns: int) -> None:
    path = make_bag(count=5000, chunk_bytes=4096)
    with BagReader(path) as reader:
        assert reader.complete
        messages = list(reader.messages())
        table = records(
            reader.topics["/indenter/sample"].definition, reader.columns("/indenter/sample")
        )
    assert len(messages) == 5500
    assert [m.log_time for m in messages] == sorted(m.log_time for m in messages)
    np.testing.assert_array_equal(table["sequence"], np.arange(5000))
    np.testing.assert_array_equal(stamps(table), start_ns + np.arange(5000) * 1_000_000)
    np.testing.assert_array_equal(table["displacement"], np.arange(5000) * 1e-6)
    np.testing.assert_array_equal(table["force"], np.sin(np.arange(5000) * 0.01))


def test_a_time_window_and_topics_are_chosen(make_bag: MakeBag, start_ns: int) -> None:
    with BagReader(make_bag(count=2000, chunk_bytes=4096)) as reader:
        first, last = start_ns + 500_000_000, start_ns + 700_000_000
        got = list(reader.messages({"/header"}, first, last))
    assert [m.log_time for m in got] == list(range(first, last + 1, 10_000_000))


def test_messages_are_ordered_by_time_across_overlapping_chunks(
    tmp_path: Path, sample_messages: Any
) -> None:
    """Others write chunks whose times overlap; a player must still get them in order."""
    rng = np.random.default_rng(3)
    times = np.arange(4000) * 1000 + rng.integers(0, 40_000, 4000)
    data = sample_messages(np.arange(4000), times)
    with BagWriter(tmp_path / "bag", chunk_bytes=2048) as writer:
        topic = writer.add_topic("indenter/sample", SAMPLE)
        for time, message in zip(times.tolist(), data, strict=True):
            writer.write(topic, time, message)
    with BagReader(tmp_path / "bag") as reader:
        assert [m.log_time for m in reader.messages()] == sorted(times.tolist())
        table = records(installed_definition(SAMPLE), reader.columns("/indenter/sample"))
    np.testing.assert_array_equal(stamps(table), np.sort(times))


def test_nothing_is_overwritten(make_bag: MakeBag) -> None:
    path = make_bag()
    before = (path / "bag_0.mcap").read_bytes()
    with pytest.raises(BagExistsError, match="exists already"):
        BagWriter(path)
    assert (path / "bag_0.mcap").read_bytes() == before


def test_bags_are_numbered_where_the_name_is_taken(tmp_path: Path) -> None:
    for _ in range(3):
        new_numbered_bag(tmp_path / "bag").close()
    assert [path.name for path in numbered_bags(tmp_path / "bag")] == ["bag", "bag_2", "bag_3"]
    assert numbered_bags(tmp_path / "other") == []


@pytest.mark.parametrize("name", [".", "/", "a/.."])
def test_a_name_that_cannot_be_numbered_is_one_line(name: str) -> None:
    """Regression: it was an error of Python's about an empty name."""
    with pytest.raises(BagError, match="is no name that a new bag can have"):
        new_numbered_bag(name)


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BagError, match="cannot make the bag folder"):
        BagWriter(tmp_path / "file" / "bag")


def test_definitions_hold_dependencies_and_the_installed_hash() -> None:
    definition = installed_definition("hc_msgs/msg/EstimatorConfiguration")
    for dependency in (
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "rcl_interfaces/Parameter",
        "rcl_interfaces/ParameterValue",
    ):
        assert f"{'=' * 80}\nMSG: {dependency}\n" in definition.text
    assert definition.type_hash.startswith("RIHS01_")
    with pytest.raises(UnknownTypeError, match="no_such_package"):
        installed_definition("no_such_package/msg/Thing")


def test_a_bag_cut_at_any_record_keeps_what_came_before(make_bag: MakeBag, tmp_path: Path) -> None:
    """Cut at every record's end and one byte beside it: all whole chunks before are there."""
    data = (make_bag(count=300, chunk_bytes=4096) / "bag_0.mcap").read_bytes()
    with BagReader(tmp_path / "bag") as reader:
        whole = [m.data for m in reader.messages()]
        chunk_ends = [p.offset + p.length for p in reader.files[0].scan.chunks]
    ends = record_ends(data)
    assert len(ends) > 30
    path = tmp_path / "cut.mcap"
    for cut in sorted({end + beside for end in ends for beside in (-1, 0, 1)}):
        path.write_bytes(data[:cut])
        with BagReader(path) as reader:
            assert not reader.complete
            assert len(reader.problems) == 1
            got = [m.data for m in reader.messages()]
        assert got == whole[: len(got)]
        chunks = sum(end <= cut for end in chunk_ends)
        assert (len(got) == 0) == (chunks == 0)
        assert (len(got) == len(whole)) == (chunks == len(chunk_ends))
    path.write_bytes(data[:5])
    with pytest.raises(BagError, match="not an MCAP file"):
        BagReader(path)


def test_a_damaged_chunk_is_named_and_the_others_are_read(make_bag: MakeBag) -> None:
    path = make_bag(count=2000, chunk_bytes=4096)
    file = path / "bag_0.mcap"
    with BagReader(path) as reader:
        place = reader.files[0].scan.chunks[3]
    data = bytearray(file.read_bytes())
    data[place.offset + 200] ^= 0x10
    file.write_bytes(data)
    with BagReader(path) as reader:
        got = len(list(reader.messages()))
        assert 2000 < got < 2200
        assert len(reader.problems) == 1
        assert f"chunk at byte {place.offset} is damaged" in reader.problems[0]
        assert not reader.complete
        assert len(list(reader.messages())) == got
        assert len(reader.problems) == 1


@pytest.mark.parametrize(
    ("content", "text"),
    [(b"", "empty"), (b"time_s,displacement_mm", "not an MCAP file")],
)
def test_what_is_no_bag_is_one_line(tmp_path: Path, content: bytes, text: str) -> None:
    (tmp_path / "bag_0.mcap").write_bytes(content)
    for path in (tmp_path, tmp_path / "bag_0.mcap"):
        with pytest.raises(BagError, match=text):
            BagReader(path)
    with pytest.raises(BagError, match="does not exist"):
        BagReader(tmp_path / "nothing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BagError, match="holds no bag"):
        read_recording(tmp_path / "empty")


def test_info_counts_gaps_and_losses(tmp_path: Path, sample_messages: Any, start_ns: int) -> None:
    """1 kHz with samples 300 to 399 lost on the way and one repeated."""
    sequence = np.concatenate([np.arange(300), np.arange(400, 1001), [1000]])
    times = start_ns + sequence * 1_000_000
    times[-1] += 1_000_000
    with BagWriter(tmp_path / "bag", chunk_bytes=4096, custom_data={"seed": "7"}) as writer:
        topic = writer.add_topic("indenter/sample", SAMPLE)
        for time, message in zip(times.tolist(), sample_messages(sequence, times), strict=True):
            writer.write(topic, time, message)
    info = bag_info(tmp_path / "bag")
    (one,) = info.topics
    assert one.message_count == info.message_count == 902
    assert (one.lost, one.repeated_or_backward, one.gaps) == (100, 1, 1)
    assert one.longest_interval_s == pytest.approx(0.101)
    assert one.median_interval_s == pytest.approx(1e-3, rel=0.05)
    assert one.rate_hz == pytest.approx(901 / 1.001)
    assert info.custom_data == {"seed": "7"}
    assert info.problems == []


def test_losses_of_a_tactile_array_are_counted(tmp_path: Path, start_ns: int) -> None:
    """Regression: "-", for messages with sequences were no stream of the suite."""
    with BagWriter(tmp_path / "bag") as writer:
        topic = writer.add_topic("tactile/sample", "hc_msgs/msg/TactileSample")
        for k in (*range(100), *range(130, 200)):
            message = TactileSample(sequence=k, columns=2, displacement=[0.0] * 4, force=[1.0] * 4)
            message.header.frame_id = "pad"
            writer.write(topic, start_ns + k * 1_000_000, serialize_message(message))
    (one,) = bag_info(tmp_path / "bag").topics
    assert (one.lost, one.repeated_or_backward) == (30, 0)


@pytest.mark.parametrize("kind", ["two publishers", "random", "far apart"])
def test_numbers_that_are_no_count_tell_no_losses(
    tmp_path: Path, sample_messages: Any, start_ns: int, kind: str
) -> None:
    """Regression: two rigs in a domain gave "lost 53347875"."""
    sequence = {
        "two publishers": np.column_stack([np.arange(300), 8000 + np.arange(300)]).ravel(),
        "random": np.random.default_rng(1).integers(0, 2**62, 600),
        "far apart": np.arange(600) * 10**8,
    }[kind]
    times = start_ns + np.arange(600) * 1_000_000
    with BagWriter(tmp_path / "bag") as writer:
        topic = writer.add_topic("indenter/sample", SAMPLE)
        for time, message in zip(times.tolist(), sample_messages(sequence, times), strict=True):
            writer.write(topic, time, message)
    (one,) = bag_info(tmp_path / "bag").topics
    assert one.lost is None
    assert one.is_no_count
    assert one.repeated_or_backward is not None
    assert one.repeated_or_backward > 200


def test_memory_does_not_grow_with_the_bag(make_bag: MakeBag) -> None:
    """Streaming through 6 MB of messages holds only chunks."""
    import tracemalloc

    path = make_bag(count=60_000)
    with BagReader(path) as reader:
        next(reader.messages())
        tracemalloc.start()
        count = sum(1 for _ in reader.messages())
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert count == 66_000
    assert peak < 4_000_000


def test_sync_reaches_every_file_of_a_split_bag(
    tmp_path: Path, sample_messages: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: set[int] = set()
    monkeypatch.setattr(os, "fsync", lambda number: synced.add(os.fstat(number).st_ino))
    times = np.arange(3000) * 1_000_000
    with BagWriter(tmp_path / "bag", max_file_duration_s=0.5) as writer:
        topic = writer.add_topic("indenter/sample", SAMPLE)
        for time, message in zip(times.tolist(), sample_messages(times, times), strict=True):
            writer.write(topic, time, message)
    files = list((tmp_path / "bag").glob("*.mcap"))
    assert len(files) == 6
    assert synced >= {file.stat().st_ino for file in files}


def test_qos_of_old_and_new_bags() -> None:
    """Older bags hold numbers, newer ones words; several publishers give the strictest."""
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    from hc_logger.ros.qos_profiles import (
        mapping_from_profile,
        publisher_profile,
        subscription_profile,
    )

    strict = QoSProfile(
        depth=7,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )
    loose = QoSProfile(depth=3, reliability=ReliabilityPolicy.BEST_EFFORT)
    words = mapping_from_profile(strict)
    assert (words["reliability"], words["durability"]) == ("reliable", "transient_local")
    numbers = {**words, "reliability": 1, "durability": 1}
    for recorded in ([words], [numbers], [mapping_from_profile(loose), words]):
        profile = publisher_profile(recorded, 5)
        assert profile.reliability == ReliabilityPolicy.RELIABLE
        assert profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        assert profile.depth == 7
    profile = publisher_profile([mapping_from_profile(loose)], 5)
    assert (profile.reliability, profile.depth) == (ReliabilityPolicy.BEST_EFFORT, 5)
    assert publisher_profile([], 5).reliability == ReliabilityPolicy.RELIABLE
    both = subscription_profile([strict, loose], 9)
    assert both.reliability == ReliabilityPolicy.BEST_EFFORT
    assert both.durability == DurabilityPolicy.VOLATILE
    assert subscription_profile([strict], 9).durability == DurabilityPolicy.TRANSIENT_LOCAL
