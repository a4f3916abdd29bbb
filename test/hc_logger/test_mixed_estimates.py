"""Estimates of two estimators of one name, mixed in a bag: it is said, and none is passed off."""

from pathlib import Path

import numpy as np
import pytest

from hc_bringup.run_data import recorded
from hc_logger.errors import BagError
from hc_logger.mixed_estimates import are_mixed, mixture_in
from hc_logger.reader import BagReader
from hc_logger.recording import read_recording
from hc_logger.verify import verify
from hc_logger.writer import BagWriter

EXAMPLE = Path(__file__).parents[2] / "bags/example"


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example with every estimate told a second time, some samples later."""
    target = tmp_path_factory.mktemp("mixed") / "bag"
    with BagReader(EXAMPLE) as reader, BagWriter(target) as writer:
        topics = {
            name: writer.add_topic(name, topic.definition.name, definition=topic.definition)
            for name, topic in reader.topics.items()
        }
        late = []
        for message in reader.messages():
            number = topics[message.topic]
            told = [message.data]
            if message.topic == "/hc/estimate":
                late.append(message.data)
                told += late[-8:-7]
            for data in told:
                writer.write(number, message.log_time, data, message.publish_time, 0)
    return target


def test_estimates_of_two_are_not_verified_as_those_of_one(mixed: Path) -> None:
    """Regression: "revision 1 began at sample 3042, the first recorded estimate is of sample 0"."""
    recording = read_recording(mixed)
    assert are_mixed(recording.estimates)
    with pytest.raises(BagError, match=r"two or more estimators of one name, mixed"):
        verify(recording)


def test_a_report_does_not_show_them_as_one_run(mixed: Path) -> None:
    """Regression: of 62 s "length 469.83 s", 296 contacts and 24 changes of the tissue."""
    assert recorded(read_recording(mixed)) is None


def test_one_estimator_is_one() -> None:
    recording = read_recording(EXAMPLE)
    assert not mixture_in(recording)
    estimates = recording.estimates
    assert not are_mixed(estimates[:0])
    assert not are_mixed(np.concatenate([estimates, estimates]))  # a player that loops
