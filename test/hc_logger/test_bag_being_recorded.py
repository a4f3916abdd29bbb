"""A bag that is being recorded is said to be so, and is no damaged one."""

from __future__ import annotations

import errno
import fcntl
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_logger.info import bag_info
from hc_logger.reader import BagReader
from hc_logger.recover import recover_bag
from hc_logger.writer import BagWriter

START_NS = 1_700_000_000_000_000_000


def growing(path: Path, sample_messages: Any, count: int = 3000) -> BagWriter:
    """Return a writer that has written so many samples, and is not closed."""
    writer = BagWriter(path, chunk_bytes=20_000)
    topic = writer.add_topic("indenter/sample", "hc_msgs/msg/IndenterSample")
    times_ns = START_NS + 1_000_000 * np.arange(count)
    for time_ns, data in zip(times_ns, sample_messages(np.arange(count), times_ns), strict=True):
        writer.write(topic, int(time_ns), data)
    writer.flush()
    return writer


def test_a_bag_that_is_being_recorded_is_said_to_be_so(
    tmp_path: Path, sample_messages: Any
) -> None:
    """Regression: "cut off after byte 3451322: its end is missing" of a bag that was growing."""
    writer = growing(tmp_path / "bag", sample_messages)
    size = (tmp_path / "bag" / "bag_0.mcap").stat().st_size
    told = [f"bag_0.mcap: is being recorded: its first {size} bytes were read"]
    assert bag_info(tmp_path / "bag").problems == told
    with BagReader(tmp_path / "bag") as one, BagReader(tmp_path / "bag") as other:
        assert one.problems == other.problems == told
        assert sum(1 for _ in other.messages()) == 3000
    report = recover_bag(tmp_path / "bag", tmp_path / "new")
    assert report.problems == told
    assert report.recovered == {"/indenter/sample": 3000}
    writer.close()
    assert bag_info(tmp_path / "bag").problems == []


def test_the_record_that_is_being_written_is_no_damage(
    tmp_path: Path, sample_messages: Any
) -> None:
    writer = growing(tmp_path / "bag", sample_messages)
    file = tmp_path / "bag" / "bag_0.mcap"
    whole = file.read_bytes()
    for left_out in (5, 3000, 15_000):  # as a writer on a slow disk leaves it
        with open(file, "r+b") as stream:
            stream.truncate(len(whole) - left_out)
        (problem,) = bag_info(tmp_path / "bag").problems
        assert problem.endswith(
            f"is being recorded: its first {len(whole) - left_out} bytes were read"
        )
    writer.abandon()
    (problem,) = bag_info(tmp_path / "bag").problems
    assert "is being recorded" not in problem
    assert "cut off" in problem


def test_what_others_write_may_be_either(tmp_path: Path, sample_messages: Any) -> None:
    """Other recorders lock nothing."""
    writer = growing(tmp_path / "bag", sample_messages)
    shutil.copytree(tmp_path / "bag", tmp_path / "copy")
    (problem,) = bag_info(tmp_path / "copy").problems
    assert "cut off after byte" in problem
    assert "or being recorded: its end is missing" in problem
    writer.close()


def test_file_systems_without_locks_are_recorded_to(
    tmp_path: Path, sample_messages: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(number: int, operation: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", none)
    writer = growing(tmp_path / "bag", sample_messages)
    (problem,) = bag_info(tmp_path / "bag").problems
    assert "or being recorded" in problem
    writer.close()
    assert bag_info(tmp_path / "bag").problems == []
