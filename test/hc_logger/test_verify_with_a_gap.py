"""Estimates behind a gap of the bag (a full disk) cannot be recomputed, and are not "different"."""

from pathlib import Path

import numpy as np
import pytest

from hc_logger.decoder import decoder
from hc_logger.missing_estimates import rows_behind_missing
from hc_logger.reader import BagReader
from hc_logger.recording import read_recording
from hc_logger.verify import verify
from hc_logger.writer import BagWriter

EXAMPLE = Path(__file__).parents[2] / "bags/example"
LACKING = {"/hc/estimate", "/indenter/sample"}


def without(first: int, end: int, target: Path, *, counters: bool = True) -> Path:
    """Copy the example without samples, and their estimates, of some numbers."""
    with BagReader(EXAMPLE) as reader, BagWriter(target) as writer:
        topics = {
            name: (
                writer.add_topic(name, topic.definition.name, definition=topic.definition),
                decoder(topic.definition),
            )
            for name, topic in reader.topics.items()
        }
        for message in reader.messages():
            number, decode = topics[message.topic]
            if message.topic in LACKING and first <= decode(message.data).sequence < end:
                continue
            counter = message.sequence if counters else 0
            writer.write(number, message.log_time, message.data, message.publish_time, counter)
    return target


def test_what_comes_behind_a_gap_is_not_comparable(tmp_path: Path) -> None:
    """Regression: "11944 estimates recomputed, 8575 different" of a disk that was full for 9 s."""
    whole = read_recording(EXAMPLE)
    numbers = whole.estimates["sequence"]
    assert not len(rows_behind_missing(whole))
    first, end = int(numbers[2000]), int(numbers[3000])
    recording = read_recording(without(first, end, tmp_path / "gap"))
    assert rows_behind_missing(recording).tolist() == [2000]
    report = verify(recording)
    assert (report.compared, report.different) == (2000, 0)
    assert report.not_comparable == len(numbers) - 3000
    assert report.notes == [
        f"{len(numbers) - 3000} estimates: estimates and samples before them were not recorded"
    ]


@pytest.mark.parametrize("counters", [True, False])
def test_a_bag_that_ends_early_or_has_no_counters_has_no_gap(
    tmp_path: Path, counters: bool
) -> None:
    numbers = read_recording(EXAMPLE).estimates["sequence"]
    end = int(np.max(numbers)) + 1
    bag = without(int(numbers[2000]), end, tmp_path / "early", counters=counters)
    recording = read_recording(bag)
    assert not len(rows_behind_missing(recording))
    report = verify(recording)
    assert (report.compared, report.different, report.not_comparable) == (2000, 0, 0)
