"""What `hc replay` starts for a bag: estimator and recorder take the messages that it holds."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_bringup.commands import replay
from hc_bringup.errors import UserError
from hc_estimator.ros.node_settings import LARGEST_BACKLOG
from hc_logger.recording import read_recording
from hc_logger.type_names import SAMPLE_TYPE, SAMPLES_TYPE
from hc_logger.writer import BagWriter
from hc_msgs_py.wire import SampleEncoder
from hc_msgs_py.wire_arrays import SamplesEncoder

START = 1_700_000_000_000_000_000
RATE_HZ = 4000
COUNT = 4000
TOGETHER = 4


def write_bag(folder: Path, *, arrays: bool) -> Path:
    """Write a second of pressing at 4 kHz, one by one or four in a message."""
    time = np.arange(COUNT) / RATE_HZ
    depth = 2.0 - 2.0 * np.cos(8.0 * time)
    force = 0.3 * depth**1.4
    stamps = START + np.round(time * 1e9).astype(np.int64)
    with BagWriter(folder) as writer:
        if arrays:
            topic, many = writer.add_topic("indenter/samples", SAMPLES_TYPE), SamplesEncoder()
            for i in range(0, COUNT, TOGETHER):
                part = slice(i, i + TOGETHER)
                data = many.encode(stamps[part], i, depth[part], force[part])
                writer.write(topic, int(stamps[i + TOGETHER - 1]), data)
        else:
            topic, one = writer.add_topic("indenter/sample", SAMPLE_TYPE), SampleEncoder()
            for i in range(COUNT):
                data = one.encode(int(stamps[i]), i, float(depth[i]), float(force[i]))
                writer.write(topic, int(stamps[i]), data)
    return folder


def plan_of(*words: str) -> Any:
    parser = argparse.ArgumentParser()
    replay.configure(parser)
    return replay._plan(parser.parse_args(words))[0]


@pytest.mark.parametrize(
    ("arrays", "given", "source", "form", "topics"),
    [
        (False, [], None, None, ["indenter/sample", "hc/estimate"]),
        (True, [], "samples", "arrays", ["indenter/samples", "hc/estimates"]),
        (True, ["each"], "samples", "each", ["indenter/samples", "hc/estimate"]),
        (True, ["both"], "samples", "both", ["indenter/samples", "hc/estimate"]),
        (False, ["arrays"], None, "arrays", ["indenter/sample", "hc/estimates"]),
    ],
)
def test_estimator_and_recorder_take_what_the_bag_holds(
    tmp_path: Path,
    arrays: bool,
    given: list[str],
    source: str | None,
    form: str | None,
    topics: list[str],
) -> None:
    bag = write_bag(tmp_path / "bag", arrays=arrays)
    words = [w for name in given for w in ("--param", f"output.estimates={name}")]
    plan = plan_of(str(bag), "--estimator", *words, "--bag", str(tmp_path / "out"))
    estimator = plan.node("estimator").parameters
    assert (estimator.get("input.source"), estimator.get("output.estimates")) == (source, form)
    assert plan.node("recorder").parameters["expected_topics"] == topics


@pytest.mark.parametrize(
    ("arrays", "topic"), [(False, "indenter/sample"), (True, "indenter/samples")]
)
def test_without_an_estimator_the_recorder_waits_for_what_is_played(
    tmp_path: Path, arrays: bool, topic: str
) -> None:
    bag = write_bag(tmp_path / "bag", arrays=arrays)
    plan = plan_of(str(bag), "--bag", str(tmp_path / "out"))
    assert plan.node("estimator") is None
    assert plan.node("recorder").parameters["expected_topics"] == [topic]


@pytest.mark.parametrize("given", [None, 300])
def test_a_busy_estimator_lets_a_replay_wait(tmp_path: Path, given: int | None) -> None:
    """Regression: at a load of 16 it left out 2,552 of 4,000 samples, as it does in a live run."""
    bag = write_bag(tmp_path / "bag", arrays=True)
    words = [] if given is None else ["--param", f"input.maximum_backlog={given}"]
    estimator = plan_of(str(bag), "--estimator", *words).node("estimator")
    assert estimator.parameters["input.maximum_backlog"] == (given or LARGEST_BACKLOG)


@pytest.mark.parametrize(
    "words",
    [
        ["--filter", "ukf", "--param", "filter=ekf"],
        ["--param", "initial_stiffness=1", "--param", "initial_stiffness=2"],
    ],
)
def test_what_is_given_twice_is_refused(tmp_path: Path, words: list[str]) -> None:
    bag = write_bag(tmp_path / "bag", arrays=True)
    with pytest.raises(UserError, match="given twice"):
        plan_of(str(bag), *words)


def test_what_is_no_bag_is_said_before_anything_starts(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(UserError, match="empty"):
        plan_of(str(tmp_path / "empty"))


@pytest.mark.slow
@pytest.mark.process
def test_a_replay_of_arrays_records_arrays_and_loses_nothing(command_line: Any) -> None:
    folder = Path(command_line.folder)
    write_bag(folder / "bag", arrays=True)
    words = ("replay", "bag", "--filter", "ukf", "--bag", "out", "--json", "--headless")
    done = command_line.run(*words, timeout=240)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert (summary["samples"], summary["estimates"], summary["lost"]) == (COUNT, COUNT, 0)
    recorded = read_recording(folder / "out")
    assert np.array_equal(recorded.estimates["sequence"], np.arange(COUNT))
    verified = command_line.run("estimate", "out", "--verify", "--json", timeout=240)
    assert verified.returncode == 0, verified.stderr
    checked = json.loads(verified.stdout)
    assert (checked["compared"], checked["different"]) == (COUNT, 0)
