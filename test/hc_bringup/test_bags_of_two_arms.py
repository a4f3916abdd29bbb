"""A bag of two arms, each in a namespace: what belongs to an arm is found, whoever reads."""

import json
from pathlib import Path

import numpy as np
import pytest

from hc_bringup.cli import main
from hc_bringup.run_data import recorded
from hc_bringup.run_ending import show_ending
from hc_logger.edit import filter_bag
from hc_logger.foreign import open_bag
from hc_logger.recording import read_recording
from hc_logger.selection import TopicSelection
from hc_logger.writer import BagWriter

EXAMPLE = Path(__file__).parents[2] / "bags" / "example"
OF_AN_ARM = ("/hc/", "/indenter/")


def copy_of_example(target: Path, *namespaces: str) -> Path:
    """Write the example as a bag of several arms; what is common to all stays as it is."""
    with open_bag(EXAMPLE) as bag, BagWriter(target) as writer:
        numbers: dict[str, list[int]] = {}
        for topic in bag.topics.values():
            spaces = namespaces if topic.name.startswith(OF_AN_ARM) else ("",)
            numbers[topic.name] = [
                writer.add_topic(
                    f"{space}{topic.name}",
                    topic.definition.name,
                    qos_profiles=topic.qos_profiles,
                    definition=topic.definition,
                )
                for space in spaces
            ]
        for message in bag.messages():
            for number in numbers[message.topic]:
                writer.write(number, message.log_time, message.data, message.publish_time)
    return target


@pytest.mark.parametrize("namespace", ["/left", "/right", "/room", "/room/left"])
def test_everything_of_an_arm_is_found(tmp_path: Path, namespace: str) -> None:
    bag = copy_of_example(tmp_path / "both", "/left", "/right", "/room", "/room/left")
    found = recorded(read_recording(bag, namespace=namespace))
    alone = recorded(read_recording(EXAMPLE))
    assert found is not None
    assert alone is not None
    assert found.estimates.tobytes() == alone.estimates.tobytes()
    assert found.events == alone.events
    assert found.truth is not None
    assert found.tip is not None
    assert alone.tip is not None
    np.testing.assert_array_equal(found.tip.position_mm, alone.tip.position_mm)


def test_a_bag_of_one_of_the_arms_has_its_events_and_its_tip(tmp_path: Path) -> None:
    """Regression: they were looked for without the namespace: no map, no tare, no change."""
    both = copy_of_example(tmp_path / "both", "/left", "/right")
    part = tmp_path / "left"
    filter_bag(both, part, selection=TopicSelection(["/left/*"]))
    recording = read_recording(part)
    found, alone = recorded(recording), recorded(read_recording(EXAMPLE))
    assert recording.namespace == "/left"
    assert found is not None
    assert alone is not None
    assert found.events == alone.events
    assert found.tip is not None


def test_one_arm_beside_one_without_a_namespace(tmp_path: Path) -> None:
    bag = copy_of_example(tmp_path / "both", "", "/other")
    assert read_recording(bag).namespace == ""
    other = read_recording(bag, namespace="/other")
    assert other.namespace == "/other"
    assert other.estimates["sequence"].size == read_recording(bag).estimates["sequence"].size


def test_which_of_two_estimators_is_read_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Regression: --verify said that all estimates are the same, and saw those of one of two."""
    bag = copy_of_example(tmp_path / "both", "", "/other")
    said = (
        f"read is /indenter/sample, and not /other/indenter/sample (hc bag filter {bag} NEW "
        "--topics '/other/*' makes a bag of that)"
    )
    assert read_recording(bag).findings.notes == (said,)
    assert read_recording(bag, namespace="/other").findings.notes == ()
    assert read_recording(EXAMPLE).findings.notes == ()
    assert main(["estimate", str(bag), "--verify"]) == 0
    told = capsys.readouterr()
    assert told.err.splitlines() == [f"{bag}: {said}"]
    count = len(read_recording(EXAMPLE).estimates)
    assert f"{count} estimates recomputed, 0 different" in told.out
    assert main(["estimate", str(bag), "--verify", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["notes"] == [said]


def test_a_run_of_two_ends_with_a_picture_of_each(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Regression: "no picture of this run: it has several topics of type IndenterSample"."""
    monkeypatch.chdir(tmp_path)
    copy_of_example(Path("both"), "/left", "/right")
    show_ending(Path("both"), ["left", "right"])
    said = capsys.readouterr().out
    assert "no picture" not in said
    assert said.count("█") > 200
    lines = said.splitlines()
    assert [line.split()[0] for line in lines if "stiffness at 2 mm" in line] == ["left:", "right:"]
    assert "-0 mm" not in said
    for arm in ("left", "right"):
        assert (
            f"Look closer: hc bag filter both both_{arm} --topics '/{arm}/*', "
            f"then hc report both_{arm} -o both_{arm}.html" in lines
        )
