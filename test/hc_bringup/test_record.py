"""hc record: what it is told reaches the recorder, and a bag is made."""

import signal
import time
from pathlib import Path

import pytest

pytestmark = [pytest.mark.process, pytest.mark.timeout(120)]


def test_a_bag_is_recorded_and_begins_a_new_file_when_it_is_told_to(
    command_line, tmp_path: Path
) -> None:
    """Regression: it ended at once, for -d was said by a name that the recorder does not have.

    Nor had -d any effect before the recorder refused what it does not know.
    """
    recorder = command_line.start("record", "-a", "-o", "bag", "-d", "1")
    files = tmp_path / "bag"
    deadline = time.monotonic() + 60.0
    while len(list(files.glob("bag_*.mcap"))) < 3:  # of its own diagnostics, one a second
        assert recorder.poll() is None, recorder.stderr.read()
        assert time.monotonic() < deadline
        time.sleep(0.1)
    recorder.send_signal(signal.SIGINT)
    assert recorder.wait(30) == 0
    assert "messages written to" in recorder.stdout.read()
