"""Bags that rosbag2 wrote in other ways: sqlite3, compressed, older metadata."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from hc_logger.convert import bag_to_bag, bag_to_csv
from hc_logger.definitions import installed_definition
from hc_logger.errors import BagError
from hc_logger.foreign import open_bag
from hc_logger.foreign_bag import ForeignBag
from hc_logger.info import bag_info
from hc_logger.playback import Playback
from hc_logger.reader import BagReader
from hc_logger.recording import read_recording
from hc_logger.selection import TopicSelection

SAMPLE = "hc_msgs/msg/IndenterSample"
TIME = QosTime(2147483647, 4294967295)
BEST_EFFORT = Qos(
    QosHistory.KEEP_LAST,
    10,
    QosReliability.BEST_EFFORT,
    QosDurability.VOLATILE,
    TIME,
    TIME,
    QosLiveliness.AUTOMATIC,
    TIME,
    False,
)


def write_with_rosbags(
    path: Path,
    messages: list[bytes],
    stamps: Any,
    *,
    storage: StoragePlugin,
    version: Any = 9,
    compression: CompressionMode = CompressionMode.NONE,
) -> None:
    definition = installed_definition(SAMPLE)
    writer = Writer(path, version=version, storage_plugin=storage)
    writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection(
            "/indenter/sample",
            SAMPLE,
            msgdef=definition.text,
            rihs01=definition.type_hash,
            offered_qos_profiles=[BEST_EFFORT],
        )
        for stamp, data in zip(stamps.tolist(), messages, strict=True):
            writer.write(connection, stamp, data)


@pytest.mark.parametrize(
    ("storage", "version", "compression"),
    [
        (StoragePlugin.SQLITE3, 9, CompressionMode.NONE),
        (StoragePlugin.SQLITE3, 8, CompressionMode.NONE),
        (StoragePlugin.SQLITE3, 8, CompressionMode.FILE),
        (StoragePlugin.SQLITE3, 8, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, 9, CompressionMode.NONE),
        (StoragePlugin.MCAP, 8, CompressionMode.NONE),
        (StoragePlugin.MCAP, 9, CompressionMode.STORAGE),
        (StoragePlugin.MCAP, 8, CompressionMode.MESSAGE),
    ],
)
def test_it_is_read_converted_and_looked_into(
    tmp_path: Path,
    sample_messages: Any,
    start_ns: int,
    storage: StoragePlugin,
    version: int,
    compression: CompressionMode,
) -> None:
    sequence = np.arange(700)
    stamps = start_ns + sequence * 1_000_000
    messages = sample_messages(sequence, stamps)
    source = tmp_path / "source"
    write_with_rosbags(
        source, messages, stamps, storage=storage, version=version, compression=compression
    )
    recording = read_recording(source)
    np.testing.assert_array_equal(recording.sequence, sequence)
    np.testing.assert_array_equal(recording.stamps, stamps)
    with open_bag(source) as bag:
        got = list(bag.messages(None, start_ns + 100_000_000, start_ns + 199_000_000))
        assert [m.data for m in got] == messages[100:200]
        assert bag.time_range() == (start_ns, start_ns + 699_000_000)
        (profile,) = bag.topics["/indenter/sample"].qos_profiles
        definition = bag.topics["/indenter/sample"].definition
    assert definition.type_hash == installed_definition(SAMPLE).type_hash
    assert profile["reliability"] in ("best_effort", 2)
    (info,) = bag_info(source).topics
    assert (info.message_count, info.lost) == (700, 0)
    shares: list[float] = []
    counts, problems = bag_to_bag(source, tmp_path / "target", progress=shares.append)
    assert (counts, problems, shares[-1]) == ({"/indenter/sample": 700}, [], 1.0)
    with BagReader(tmp_path / "target") as target:
        assert target.complete
        assert [m.data for m in target.messages()] == messages
        assert target.topics["/indenter/sample"].definition == definition
    assert bag_to_csv(source, tmp_path / "out.csv") == (700, [])


def test_an_old_bag_without_definitions_takes_the_installed_ones(
    tmp_path: Path, sample_messages: Any, start_ns: int
) -> None:
    """Before Iron sqlite3 bags held neither definitions nor hashes."""
    import sqlite3

    sequence = np.arange(50)
    stamps = start_ns + sequence * 1_000_000
    messages = sample_messages(sequence, stamps)
    source = tmp_path / "source"
    write_with_rosbags(source, messages, stamps, storage=StoragePlugin.SQLITE3, version=8)
    with sqlite3.connect(source / "source.db3") as database:
        database.execute("DROP TABLE message_definitions")
        database.execute("DROP TABLE schema")
        database.execute("ALTER TABLE topics DROP COLUMN type_description_hash")
    metadata = yaml.safe_load((source / "metadata.yaml").read_text())
    information = metadata["rosbag2_bagfile_information"]
    information["version"] = 4
    del information["custom_data"], information["ros_distro"]
    del information["topics_with_message_count"][0]["topic_metadata"]["type_description_hash"]
    (source / "metadata.yaml").write_text(yaml.safe_dump(metadata))
    np.testing.assert_array_equal(read_recording(source).sequence, sequence)
    with open_bag(source) as bag:
        assert isinstance(bag, ForeignBag)
        assert bag.topics["/indenter/sample"].definition == installed_definition(SAMPLE)


@pytest.mark.clock
def test_a_database_is_played(tmp_path: Path, sample_messages: Any, start_ns: int) -> None:
    """It is opened in one thread and read in another."""
    stamps = start_ns + np.arange(500) * 1_000_000
    messages = sample_messages(np.arange(500), stamps)
    write_with_rosbags(tmp_path / "bag", messages, stamps, storage=StoragePlugin.SQLITE3)
    got: list[bytes] = []
    with open_bag(tmp_path / "bag") as bag:
        playback = Playback(bag, lambda m: got.append(m.data), TopicSelection(["*"]), rate=20.0)
        playback.resume()
        end = time.monotonic() + 20
        while not playback.finished and time.monotonic() < end:
            time.sleep(0.01)
        playback.stop()
        assert playback.error is None
    assert got == messages


def test_chosen_topics_are_copied(make_bag: Any, tmp_path: Path) -> None:
    source = make_bag(count=100)
    counts, _ = bag_to_bag(source, tmp_path / "some", selection=TopicSelection(["/head*"]))
    assert counts == {"/header": 10}
    with pytest.raises(BagError, match="no such topic; it has /header, /indenter/sample"):
        bag_to_bag(source, tmp_path / "none", selection=TopicSelection(["/x"]))
    assert not (tmp_path / "none").exists()


def test_a_broken_database_is_one_line(tmp_path: Path, sample_messages: Any) -> None:
    stamps = np.arange(5)
    write_with_rosbags(
        tmp_path / "bag", sample_messages(stamps, stamps), stamps, storage=StoragePlugin.SQLITE3
    )
    (tmp_path / "bag" / "bag.db3").write_bytes(b"not a database at all" * 100)
    with pytest.raises(BagError) as caught:
        read_recording(tmp_path / "bag")
    assert "\n" not in str(caught.value)
    with pytest.raises(BagError, match="give the folder"):
        open_bag(tmp_path / "bag" / "bag.db3")
    (tmp_path / "bag" / "metadata.yaml").write_text("rosbag2_bagfile_information: 3")
    with pytest.raises(BagError, match="is damaged"):
        open_bag(tmp_path / "bag")


def test_what_can_be_done_about_a_bag_that_was_cut_off_is_said(
    tmp_path: Path, sample_messages: Any
) -> None:
    """Regression: of a folder without metadata.yaml it said that it holds no bag."""
    stamps = np.arange(3000)
    messages = sample_messages(stamps, stamps)
    for name, storage, compression, size, advice in (
        ("base", StoragePlugin.SQLITE3, CompressionMode.NONE, 50_000, r"sqlite3 OLD.db3 \.dump"),
        ("file", StoragePlugin.SQLITE3, CompressionMode.FILE, 5_000, "zstd -dc OLD > NEW"),
        ("mcap", StoragePlugin.MCAP, CompressionMode.MESSAGE, 50_000, "mcap recover OLD.mcap"),
    ):
        bag = tmp_path / name
        write_with_rosbags(
            bag, messages, stamps, storage=storage, version=8, compression=compression
        )
        (file,) = bag.glob(f"{name}.*")
        with file.open("r+b") as cut:
            cut.truncate(size)
        with pytest.raises(BagError, match=advice) as caught:
            read_recording(bag)
        assert "\n" not in str(caught.value)
    (tmp_path / "base" / "metadata.yaml").unlink()
    with pytest.raises(BagError, match=r"ros2 bag reindex .*base writes it"):
        read_recording(tmp_path / "base")
