"""Recovery: cut and damaged bags become clean ones, and what was lost is said truly."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from hc_logger.definitions import installed_definition
from hc_logger.errors import BagError, BagExistsError
from hc_logger.info import bag_info
from hc_logger.reader import BagReader
from hc_logger.recording import read_recording
from hc_logger.recover import recover_bag

MakeBag = Callable[..., Path]


def all_messages(path: Path) -> list[tuple[str, int, bytes]]:
    with BagReader(path) as reader:
        return [(m.topic, m.log_time, m.data) for m in reader.messages()]


def test_a_whole_bag_is_copied_and_nothing_was_lost(make_bag: MakeBag, tmp_path: Path) -> None:
    source = make_bag(count=500, custom_data={"seed": "3"})
    report = recover_bag(source, tmp_path / "new")
    assert report.clean
    assert report.recovered == {"/header": 50, "/indenter/sample": 500}
    assert report.lines()[-1] == "nothing was lost: the bag was whole"
    assert all_messages(tmp_path / "new") == all_messages(source)
    with BagReader(tmp_path / "new") as reader:
        assert reader.custom_data == {"seed": "3", "recovered_from": "bag"}
    with pytest.raises(BagExistsError):
        recover_bag(source, tmp_path / "new")


@pytest.mark.parametrize(
    "text",
    [
        "{{{:::",
        "",
        "rosbag2_bagfile_information: {}",
        "rosbag2_bagfile_information: {storage_identifier: mcap,"
        " relative_file_paths: [../other_0.mcap]}",
    ],
)
def test_metadata_that_are_no_use_are_left_out_of_account(
    make_bag: MakeBag, tmp_path: Path, text: str
) -> None:
    """Regression: hc bag recover said that the bag can be rebuilt with hc bag recover."""
    source = make_bag(count=500)
    whole = all_messages(source)
    (source / "metadata.yaml").write_text(text)
    with pytest.raises(BagError):
        BagReader(source)
    report = recover_bag(source, tmp_path / "new")
    assert len(report.problems) == 1
    assert "metadata.yaml" in report.problems[0]
    assert report.lines()[-1] == "lost 0 bytes"
    assert all_messages(tmp_path / "new") == whole


def test_a_cut_bag_becomes_clean(make_bag: MakeBag, tmp_path: Path) -> None:
    """Cut at 30 places, with and without metadata.yaml: every whole chunk is kept."""
    source = make_bag(count=1000, chunk_bytes=4096)
    whole = all_messages(source)
    with BagReader(source) as reader:
        first = reader.files[0].scan.chunks[0]
    first_chunk_end = first.offset + first.length
    data = (source / "bag_0.mcap").read_bytes()
    rng = random.Random(5)
    for number in range(30):
        cut = tmp_path / "cut"
        cut.mkdir()
        at = rng.randrange(60, len(data))
        (cut / "cut_0.mcap").write_bytes(data[:at])
        if number % 2:
            shutil.copy(source / "metadata.yaml", cut)  # names a file that is not there
        if at < first_chunk_end:
            with pytest.raises(BagError, match="nothing can be recovered"):
                recover_bag(cut, tmp_path / "new")
            shutil.rmtree(cut)
            continue
        report = recover_bag(cut, tmp_path / "new")
        got = all_messages(tmp_path / "new")
        assert got == whole[: len(got)]
        assert sum(report.recovered.values()) == len(got)
        assert len(report.problems) == 1
        assert report.lost_bytes <= 5000 or len(got) == len(whole)
        assert bag_info(tmp_path / "new").problems == []
        shutil.rmtree(cut)
        shutil.rmtree(tmp_path / "new")


def test_a_damaged_chunk_costs_only_itself(make_bag: MakeBag, tmp_path: Path) -> None:
    source = make_bag(count=1000, chunk_bytes=4096)
    whole = all_messages(source)
    file = source / "bag_0.mcap"
    with BagReader(source) as reader:
        place = reader.files[0].scan.chunks[4]
        held = reader.files[0].read_chunk(place)
    assert held is not None
    data = bytearray(file.read_bytes())
    data[place.offset + place.length // 2] ^= 1
    file.write_bytes(data)
    report = recover_bag(source, tmp_path / "new")
    got = all_messages(tmp_path / "new")
    lost = [m for m in whole if m not in set(got)]
    assert [time for _, time, _ in lost] == held.log_time.tolist()
    assert sum(report.lost.values()) == len(lost) == len(held.log_time)
    assert report.lost["/indenter/sample"] == sum(t == "/indenter/sample" for t, _, _ in lost)
    assert report.lost_spans == [(int(held.log_time[0]), int(held.log_time[-1]))]
    assert report.lost_bytes == place.length


def test_any_flipped_bit_is_survived(make_bag: MakeBag, tmp_path: Path) -> None:
    """Whatever byte is damaged: no exception but BagError, no wrong message, one chunk at most."""
    source = make_bag(count=600, chunk_bytes=4096)
    whole = set(all_messages(source))
    data = (source / "bag_0.mcap").read_bytes()
    with BagReader(source) as reader:
        largest = max(len(m.log_time) for m in reader.files[0].chunks())
    rng = random.Random(11)
    path = tmp_path / "flipped.mcap"
    places = [*range(8, 300, 2), *(rng.randrange(len(data)) for _ in range(150))]
    for place in places:
        flipped = bytearray(data)
        flipped[place] ^= 1 << rng.randrange(8)
        path.write_bytes(flipped)
        with BagReader(path) as reader:
            got = [(m.topic, m.log_time, m.data) for m in reader.messages()]
        assert set(got) <= whole, place
        assert len(whole) - len(got) <= largest, place
        assert len(set(got)) == len(got), place


def test_a_record_whose_length_is_damaged_does_not_hide_the_rest(
    make_bag: MakeBag, tmp_path: Path
) -> None:
    source = make_bag(count=1000, chunk_bytes=4096)
    file = source / "bag_0.mcap"
    with BagReader(source) as reader:
        places = reader.files[0].scan.chunks
        third, chunks = places[2], len(places)
    data = bytearray(file.read_bytes())
    for length in (3, 10**6, 2**63):
        data[third.offset + 1 : third.offset + 9] = length.to_bytes(8, "little")
        file.write_bytes(data)
        with BagReader(source) as reader:
            assert len(reader.files[0].scan.chunks) == chunks - 1
            assert any("damaged from byte" in problem for problem in reader.problems)
        shutil.rmtree(tmp_path / "new", ignore_errors=True)
        report = recover_bag(source, tmp_path / "new")
        assert report.lost_bytes >= third.length
        assert 1000 > report.recovered["/indenter/sample"] > 900


def test_the_first_chunk_may_be_lost_when_the_end_is_there(
    make_bag: MakeBag, tmp_path: Path
) -> None:
    """The topics' descriptions stand in the first chunk and again at the end of the file."""
    source = make_bag(count=1000, chunk_bytes=4096)
    file = source / "bag_0.mcap"
    with BagReader(source) as reader:
        first = reader.files[0].scan.chunks[0]
    data = bytearray(file.read_bytes())
    data[first.offset + 100] ^= 1
    file.write_bytes(data)
    assert len(read_recording(source).time_s) > 900
    # with the end cut off as well the rest has no description any more, and that is said
    (source / "metadata.yaml").unlink()
    file.write_bytes(data[: len(data) // 2])
    with pytest.raises(BagError, match=r"nothing can be recovered.*is damaged"):
        recover_bag(source, tmp_path / "new")


def test_split_bags_lose_only_the_damaged_file(make_bag: MakeBag, tmp_path: Path) -> None:
    source = make_bag(count=3000, chunk_bytes=2048, max_file_duration_s=1.0)
    names = sorted(p.name for p in source.glob("*.mcap"))
    assert names == ["bag_0.mcap", "bag_1.mcap", "bag_2.mcap"]
    np.testing.assert_array_equal(read_recording(source).sequence, np.arange(3000))
    (source / "bag_1.mcap").write_bytes(b"")
    recording = read_recording(source)
    assert 1900 < len(recording.sequence) < 2100
    assert any("bag_1.mcap is empty" in line for line in recording.findings.problems)
    report = recover_bag(source, tmp_path / "new")
    assert report.recovered["/indenter/sample"] == len(recording.sequence)
    assert any("bag_1.mcap" in line for line in report.lines())


def test_files_are_split_by_size(make_bag: MakeBag) -> None:
    source = make_bag(count=5000, chunk_bytes=4096, max_file_bytes=30_000)
    files = sorted(source.glob("*.mcap"))
    assert len(files) > 3
    assert all(f.stat().st_size < 30_000 + 20_000 for f in files)  # a chunk and the index more
    np.testing.assert_array_equal(read_recording(source).sequence, np.arange(5000))
    from rosbags.highlevel import AnyReader

    with AnyReader([source]) as theirs:
        assert theirs.message_count == 5500
        assert sum(1 for _ in theirs.messages()) == 5500


def test_of_a_bag_whose_every_chunk_is_damaged_there_is_no_new_one(
    make_bag: MakeBag, tmp_path: Path
) -> None:
    """Regression: "recovered 0 messages of 2 topics", a bag without one, and status 0."""
    source = make_bag(count=200)
    with BagReader(source) as reader:
        chunks = list(reader.files[0].scan.chunks)
    data = bytearray((source / "bag_0.mcap").read_bytes())
    for chunk in chunks:
        middle = slice(chunk.offset + 60, chunk.offset + chunk.length - 1)
        data[middle] = b"\xff" * (middle.stop - middle.start)
    (source / "bag_0.mcap").write_bytes(data)
    with pytest.raises(BagError, match=r"nothing can be recovered.*is damaged"):
        recover_bag(source, tmp_path / "new")
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("compression", list(CompressionType))
def test_of_a_chunk_that_is_cut_what_was_before_the_cut_is_recovered(
    tmp_path: Path, compression: CompressionType
) -> None:
    """Regression: of a file that is one chunk, cut in its middle, nothing was readable."""
    definition = installed_definition("std_msgs/msg/Header")
    rng = random.Random(3)
    data = [rng.randbytes(200) for _ in range(3000)]  # some blocks of any compression
    with open(tmp_path / "whole.mcap", "wb") as stream:
        writer = Writer(stream, chunk_size=10**9, compression=compression)
        writer.start("ros2")
        schema = writer.register_schema(definition.name, "ros2msg", definition.text.encode())
        channel = writer.register_channel("/a", "cdr", schema)
        for k, one in enumerate(data):
            writer.add_message(channel, 10**18 + k * 1000, one, 10**18 + k * 1000, k)
        writer.finish()
    whole = (tmp_path / "whole.mcap").read_bytes()
    with BagReader(tmp_path / "whole.mcap") as reader:
        (place,) = reader.files[0].scan.chunks
    for number, share in enumerate((0.5, 0.9, 0.97)):
        cut = tmp_path / f"cut{number}.mcap"
        cut.write_bytes(whole[: place.offset + int(share * place.length)])
        report = recover_bag(cut, tmp_path / f"new{number}")
        got = [message for _, _, message in all_messages(tmp_path / f"new{number}")]
        assert got == data[: len(got)]
        # A block is at most 128 KiB, a record 231 bytes.
        assert share * len(data) - 131072 / 231 - 2 < len(got) <= share * len(data)
        (line,) = report.problems
        assert report.lines()[-1] == "lost 0 bytes, and the rest of a chunk that was cut"
        assert line.endswith(f": the first {len(got)} messages of it can be read")
        with BagReader(cut) as reader:  # what is said of its length is true
            assert reader.time_range() == (10**18, 10**18 + 1000 * (len(got) - 1))
    (tmp_path / "head.mcap").write_bytes(whole[: place.offset + 100])
    with pytest.raises(BagError, match="cut off at byte"):
        recover_bag(tmp_path / "head.mcap", tmp_path / "nothing")
