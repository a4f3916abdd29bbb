"""Bags that lack something, or hold more than one would think: never half of it without a word."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.writer import Writer as OtherWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from hc_bringup.cli import main
from hc_logger.decoder import decoder
from hc_logger.definitions import TypeDefinition, installed_definition, same_definition
from hc_logger.edit import merge_bags
from hc_logger.errors import BagError
from hc_logger.info import bag_info
from hc_logger.reader import BagReader
from hc_logger.recover import recover_bag
from hc_logger.writer import BagWriter

HEADER = b"\0\1\0\0" + bytes(8) + b"\2\0\0\0a\0"
TYPE = "std_msgs/msg/Header"
MakeBag = Callable[..., Path]


def test_a_file_of_several_that_is_missing_is_named(make_bag: MakeBag, tmp_path: Path) -> None:
    """Regression: the others were read, and `hc bag recover` said that nothing was lost."""
    bag = make_bag(count=2000, max_file_bytes=4000, chunk_bytes=2048)
    files = [bag / f"bag_{k}.mcap" for k in range(4)]
    files[1].unlink()
    report = recover_bag(bag, tmp_path / "new")
    assert not report.clean
    assert report.problems == ["bag_1.mcap, named in metadata.yaml, is missing"]
    assert bag_info(bag).problems == report.problems
    files[2].rename(bag / "renamed.mcap")  # one of the two missing ones has another name
    assert bag_info(bag).problems == [
        f"{name}, named in metadata.yaml, is missing" for name in ("bag_1.mcap", "bag_2.mcap")
    ]


def test_topics_in_another_encoding_or_of_two_types_are_named(tmp_path: Path) -> None:
    """Regression: they were left out, and nothing was said to be lost."""
    path = tmp_path / "mixed.mcap"
    definition = installed_definition(TYPE)
    with open(path, "wb") as stream:
        writer = OtherWriter(stream)
        writer.start("ros2")
        schema = writer.register_schema(TYPE, "ros2msg", definition.text.encode())
        other = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        json = writer.register_schema("note", "jsonschema", b"{}")
        channels = [
            writer.register_channel("/a", "cdr", schema),
            writer.register_channel("/note", "json", json),
            writer.register_channel("/a", "cdr", other),
        ]
        for k in range(30):
            writer.add_message(channels[k % 3], k, HEADER, k)
        writer.finish()
    report = recover_bag(path, tmp_path / "new")
    assert report.recovered == {"/a": 10}
    assert report.problems == [
        "/note cannot be read: its messages are 'json', not 'cdr'",
        "/a cannot be read: some of its messages are of another type (std_msgs/msg/String)",
    ]


def test_bags_are_not_merged_where_a_definition_changed(tmp_path: Path) -> None:
    """Regression: messages of the second stood under the definition of the first."""
    installed = installed_definition(TYPE)
    spaced = "# a comment\n\n" + installed.text.replace("string frame_id", "string  frame_id # x")
    definitions = {
        "one": installed,
        "same": TypeDefinition(TYPE, spaced, "another tool's hash"),
        "older": TypeDefinition(TYPE, f"uint32 seq\n{installed.text}", "RIHS01_" + "0" * 64),
    }
    for name, definition in definitions.items():
        with BagWriter(tmp_path / name) as writer:
            writer.write(writer.add_topic("/h", TYPE, definition=definition), 1, HEADER)
    assert same_definition(definitions["one"], definitions["same"])
    assert merge_bags([tmp_path / "one", tmp_path / "same"], tmp_path / "all") == (2, [])
    with pytest.raises(BagError, match=r"/h is std_msgs/msg/Header in one bag and another def"):
        merge_bags([tmp_path / "one", tmp_path / "older"], tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_definitions_that_differ_in_a_dependency_are_not_the_same() -> None:
    pose = installed_definition("geometry_msgs/msg/PoseStamped")
    changed = pose._replace(text=pose.text.replace("float64 w", "float32 w"), type_hash="")
    assert changed.text != pose.text
    assert not same_definition(pose, changed)
    assert same_definition(pose, pose._replace(type_hash=""))


@pytest.mark.parametrize("damage", [("uint8 KIND=1", "uint8 KI D=1"), ("string", "stRing")])
def test_a_definition_that_cannot_be_read_is_one_line(
    capsys: pytest.CaptureFixture[str], damage: tuple[str, str]
) -> None:
    """Regression: the library printed a line of its own beside ours."""
    text = "uint8 KIND=1\nstring reason\n".replace(*damage)
    with pytest.raises(BagError, match="definition of 'a_msgs/msg/Note' in the bag cannot be und"):
        decoder(TypeDefinition("a_msgs/msg/Note", text, ""))
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("words", [["filter"], ["split", "--every", "10"], ["merge", "-o"]])
def test_what_edits_a_damaged_bag_says_what_is_missing(
    make_bag: MakeBag, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    """Regression: a part of a damaged bag looked like a part of a whole one."""
    bag = make_bag(count=1000, chunk_bytes=4096)
    file = bag / "bag_0.mcap"
    with BagReader(bag) as reader:
        place = reader.files[0].scan.chunks[3]
    data = bytearray(file.read_bytes())
    data[place.offset + place.length // 2] ^= 1
    file.write_bytes(data)
    action, *options = words
    target = str(tmp_path / "part")
    if action == "merge":
        sources = [str(make_bag("whole", count=10)), str(bag), "-o", target]
    else:
        sources = [str(bag), target, *options]
    assert main(["bag", action, *sources]) == 0
    first, *rest = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{bag}: bag_0.mcap: the chunk at byte {place.offset} is damaged")
    assert "written to" in rest[0]


def test_messages_that_rosbag2_compressed_are_not_recovered_as_they_are(tmp_path: Path) -> None:
    """Regression: compressed bytes went into the new bag as if they were messages."""
    writer = Writer(tmp_path / "packed", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        store = get_typestore(Stores.ROS2_JAZZY)
        connection = writer.add_connection("/h", TYPE, typestore=store)
        for k in range(10):
            writer.write(connection, k, HEADER)
    with pytest.raises(BagError, match=r"is compressed, each message by itself; convert it with"):
        recover_bag(tmp_path / "packed", tmp_path / "new")
    assert not (tmp_path / "new").exists()
    assert main(["bag", "convert", str(tmp_path / "packed"), str(tmp_path / "new")]) == 0
    with BagReader(tmp_path / "new") as reader:
        assert {m.data for m in reader.messages()} == {HEADER}


def test_any_name_of_a_file_is_a_name(make_bag: MakeBag, tmp_path: Path) -> None:
    """Regression: a superscript two passed for a number, and ended in a traceback."""
    source = make_bag(count=10) / "bag_0.mcap"
    folder = tmp_path / "²10 \n x"
    folder.mkdir()
    for name in ("²10.mcap", "²9.mcap", "x 1_\n٣.mcap"):
        shutil.copy(source, folder / name)
    with BagReader(folder) as reader:
        assert [path.name for path in reader.paths] == ["x 1_\n٣.mcap", "²9.mcap", "²10.mcap"]
    assert bag_info(folder).message_count == 33
