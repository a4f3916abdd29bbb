"""A run that fails says where its bag is, and what to do with one that was not closed."""

import json

import pytest
import yaml

from hc_bringup.conclusion import conclude, naming_bag
from hc_bringup.errors import FAILURE, UserError
from hc_bringup.run_state import RunState
from hc_bringup.statistics import EstimateStatistics


def said_of(bag, given=None):
    with pytest.raises(UserError) as raised, naming_bag(bag, given):
        raise UserError("node recorder was ended by SIGKILL", FAILURE)
    return str(raised.value).removeprefix("node recorder was ended by SIGKILL")


def test_a_bag_that_was_closed_is_named(tmp_path):
    bag = tmp_path / "rec"
    bag.mkdir()
    (bag / "metadata.yaml").touch()
    assert said_of(bag) == f"; what was recorded is in {bag}"
    assert said_of(bag, "rec").endswith(f"{bag}; take another --bag to try again")


def test_nobody_is_told_to_delete_what_can_be_recovered(tmp_path):
    """Regression of 2026-11-26: "delete it", of 128,373 messages of a recorder that was killed."""
    bag = tmp_path / "rec"
    bag.mkdir()
    whole = f"(not closed: hc bag recover {bag} NEW makes it whole)"
    assert said_of(bag, "rec").endswith(f"in {bag} {whole}; take another --bag to try again")
    assert "delete it" not in said_of(bag)


def test_what_is_to_be_typed_can_be_pasted(tmp_path):
    """Regression: of a bag with a space in its name the command had two arguments too many."""
    bag = tmp_path / "my bag"
    bag.mkdir()
    assert f"hc bag recover '{bag}' NEW makes it whole" in said_of(bag)


def test_without_a_bag_nothing_is_added(tmp_path):
    assert said_of(None) == said_of(tmp_path / "none") == ""


def bag_with(folder, counts):
    """A closed bag that says how many messages of each topic it holds."""
    folder.mkdir()
    (folder / f"{folder.name}_0.mcap").touch()
    topics = [
        {"topic_metadata": {"name": name}, "message_count": count} for name, count in counts.items()
    ]
    information = {
        "rosbag2_bagfile_information": {
            "version": 9,
            "storage_identifier": "mcap",
            "relative_file_paths": [f"{folder.name}_0.mcap"],
            "topics_with_message_count": topics,
        }
    }
    (folder / "metadata.yaml").write_text(yaml.safe_dump(information))
    return folder


OF_NODES = {"/diagnostics": 12, "/parameter_events": 15, "/rosout": 3, "/hc/configuration": 1}


def test_a_bag_without_a_sample_is_not_left_by_a_start_that_failed(tmp_path):
    """Regression: the next try with the same --bag was told that the folder was taken."""
    bag = bag_with(tmp_path / "rec", OF_NODES | {"/indenter/sample": 0, "/hc/estimate": 0})
    assert said_of(bag, "rec") == ""
    assert not bag.exists()


@pytest.mark.parametrize("topic", ["/indenter/sample", "/wrench", "/hc/events"])
def test_one_message_of_a_sensor_or_an_estimate_is_kept(tmp_path, topic):
    bag = bag_with(tmp_path / "rec", OF_NODES | {topic: 1})
    assert said_of(bag) == f"; what was recorded is in {bag}"
    assert bag.exists()


def test_what_somebody_put_beside_the_bag_is_kept(tmp_path):
    bag = bag_with(tmp_path / "rec", OF_NODES)
    (bag / "notes.txt").write_text("of the user")
    assert said_of(bag) == f"; what was recorded is in {bag}"
    assert (bag / "notes.txt").exists()


@pytest.mark.parametrize("as_json", [True, False])
def test_a_bag_cut_off_by_a_full_disk_is_told_how_to_be_made_whole(tmp_path, as_json):
    """Regression: "cannot write ...: No space left on device", and no word of what is there."""
    bag = tmp_path / "rec"
    bag.mkdir()
    state = RunState(EstimateStatistics(), 0.0, failures=[f"node recorder: cannot write {bag}"])
    with pytest.raises(UserError) as raised:
        conclude(state, [], bag, as_json=as_json, with_latency=True)
    assert str(raised.value) == (
        f"node recorder: cannot write {bag}; "
        f"{bag} was not closed: hc bag recover {bag} NEW makes it whole"
    )


def test_the_bag_of_a_recorder_that_was_killed_and_started_again_is_told(tmp_path, capsys):
    """The run is no failure; of its two bags the first one has no end."""
    cut, whole = tmp_path / "rec", tmp_path / "rec_2"
    cut.mkdir()
    whole.mkdir()
    (whole / "metadata.yaml").touch()
    state = RunState(EstimateStatistics(), 0.0, dropped={str(cut): 0, str(whole): 0})
    assert conclude(state, [], cut, as_json=True, with_latency=True) == cut
    told = capsys.readouterr().err
    assert told == f"{cut} was not closed: hc bag recover {cut} NEW makes it whole\n"


def test_the_bag_of_somebody_elses_recorder_is_none_of_this_run(tmp_path, capsys):
    """Regression: `hc record` beside it, whose bag was listed, and said not to have been closed."""
    own, theirs = tmp_path / "rec", tmp_path / "records"
    for folder in (own, theirs):
        folder.mkdir()
    (own / "metadata.yaml").touch()
    state = RunState(EstimateStatistics(), 0.0, dropped={str(theirs): 7, str(own): 0})
    assert conclude(state, [], own, as_json=True, with_latency=True) == own
    summary, complaints = capsys.readouterr()
    assert "records" not in summary + complaints
    assert json.loads(summary)["not_recorded"] == 0


@pytest.mark.parametrize(
    ("said", "respawns", "expected"),
    [
        ({"closed": "1", "/hc/estimate messages": "690", "/hc/estimate dropped": "3"}, 0, 307 + 3),
        ({"closed": "1", "/hc/estimate messages": "997", "/hc/estimate dropped": "3"}, 0, 3),
        ({"closed": "0", "/hc/estimate messages": "690"}, 0, 3),  # it may have got more since
        ({"closed": "1", "/hc/estimate messages": "690"}, 1, 3),  # of the last bag alone
        ({"closed": "1", "/hc/estimate messages": "690", "unwritten": "307"}, 0, 3),
        ({"closed": "1", "/hc/estimate messages": "0"}, 0, 3),  # estimates came in batches
        ({}, 0, 3),
    ],
)
def test_what_a_recorder_missed_at_the_end_is_not_recorded(
    tmp_path, capsys, said, respawns, expected
):
    """Regression: stopped for the last 20 s of a run, and "not_recorded": 0."""
    bag = bag_with(tmp_path / "rec", {"/hc/estimate": 690})
    state = RunState(EstimateStatistics(), 0.0, dropped={str(bag): 3}, respawns=respawns)
    state.statistics.estimates = 1000
    state.diagnostics["recorder"] = said
    conclude(state, [], bag, as_json=True, with_latency=False)
    assert json.loads(capsys.readouterr().out)["not_recorded"] == expected


def test_a_bag_that_was_renamed_meanwhile_is_named_as_it_is(tmp_path, capsys):
    """Regression: "bag: OLD", of which there was nothing."""
    bag_with(tmp_path / "new", {"/a": 3})
    old = tmp_path / "old"
    state = RunState(EstimateStatistics(), 0.0, elapsed_s=0.1, dropped={str(old): 0})
    state.diagnostics["recorder"] = {"bag": str(old), "folder": str(tmp_path / "new")}
    first = conclude(state, [], old, as_json=False, with_latency=False)
    assert first == tmp_path / "new"
    assert f"bag: {tmp_path / 'new'}" in capsys.readouterr().out
