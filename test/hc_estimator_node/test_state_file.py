"""Saving a state and going on from it, in one folder and nowhere else."""

import json
import os
import time

import numpy as np
import pytest

from hc_estimator import create_estimator
from hc_estimator.ros.state_keeper import StateKeeper, parameters_of
from hc_estimator.stream import state_file
from hc_estimator.stream.session import EstimationSession
from hc_estimator.stream.state_file import (
    ON_TRIAL,
    RUNNING,
    SAVED,
    SET_ASIDE,
    StateFolder,
    freeze,
    sealed,
)
from hc_estimator.stream.vocabulary import Cause, EventKind

START = 1_700_000_000_000_000_000


def feed(session, samples, first=0):
    for number, (time_s, displacement, force) in enumerate(samples, first):
        session.process(START + round(time_s * 1e9), number, displacement, force)


def resealed(data):
    """Data of a state file that were changed, as a state that was written so."""
    return sealed({name: value for name, value in data.items() if name != "checksum"})


@pytest.fixture
def session(recorder, plant):
    session = EstimationSession(create_estimator("ukf"), recorder)
    feed(session, plant.samples(500))
    return session


def test_a_loaded_session_goes_on_as_if_it_had_never_stopped(tmp_path, session, recorder, plant):
    folder = StateFolder(tmp_path / "new" / "folder")
    folder.save(SAVED, session)
    saved = folder.load(SAVED)
    other = EstimationSession(
        create_estimator("ukf"), type(recorder)(), revisions_before=saved.revision
    )
    other.load(saved.estimator, saved.time_origin_ns)
    assert other.revision.cause == Cause.STATE_LOADED
    assert other.revision.number == session.revision.number + 1
    samples = list(plant.samples(200, start=500))
    feed(session, samples, first=500)
    feed(other, samples, first=500)
    np.testing.assert_array_equal(session.last_estimate.parameters, other.last_estimate.parameters)
    np.testing.assert_array_equal(session.last_estimate.covariance, other.last_estimate.covariance)
    assert EventKind.STATE_LOADED in other._listener.kinds()


def test_nothing_to_save_is_said(tmp_path, recorder):
    session = EstimationSession(create_estimator("ukf"), recorder)
    with pytest.raises(ValueError, match="no sample came yet"):
        StateFolder(tmp_path).save(SAVED, session)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        '{"format": 1}',
        '{"format": 99}',
        "\x00",
        "[" * 100_000,
        '"' + "9" * 5000 + '"',
    ],
)
def test_a_damaged_file_is_named_and_changes_nothing(tmp_path, text):
    (tmp_path / SAVED).write_text(text)
    with pytest.raises(ValueError, match=SAVED):
        StateFolder(tmp_path).load(SAVED)


@pytest.mark.parametrize("text", ["null", "[1, 2]", "{}", '"format"', "3"])
def test_a_file_of_something_else_is_answered_in_words(tmp_path, text):
    (tmp_path / SAVED).write_text(text)
    with pytest.raises(ValueError, match="no state of an estimator: it says no format"):
        StateFolder(tmp_path).load(SAVED)


def test_a_state_with_damaged_numbers_is_refused_and_changes_nothing(tmp_path, session, plant):
    path = StateFolder(tmp_path).save(SAVED, session)
    data = json.loads(path.read_text())
    data["estimator"]["memory"]["state"] = [1.0, 2.0]
    path.write_text(resealed(data))
    saved = StateFolder(tmp_path).load(SAVED)
    before = session.estimator.state()
    with pytest.raises(ValueError, match="damaged"):
        session.load(saved.estimator, saved.time_origin_ns)
    assert session.estimator.state() == before


@pytest.mark.parametrize(
    "damage",
    [
        {"revision": 2**32},  # no message holds it: every start ended there
        {"revision": -1},
        {"revision": 1.5},
        {"time_origin_ns": 2**62},
        {"time_origin_ns": -1},
        {"saved_at_s": float("nan")},
        {"configuration": [1]},  # an error of its own kind, which ended the start
        {"memory": None},
        {"filter": ["ukf"]},
    ],
    ids=str,
)
def test_what_no_message_holds_is_refused_and_set_aside(tmp_path, session, damage):
    folder = StateFolder(tmp_path)
    path = folder.save(RUNNING, session)
    state = json.loads(path.read_text())
    for name, value in damage.items():
        (state if name in state else state["estimator"])[name] = value
    path.write_text(resealed(state))
    said = []
    assert StateKeeper(str(tmp_path)).resume(1e9, lambda _state: None, said.append) is None
    (line,) = said
    assert next(iter(damage)) in line
    assert folder.exists(SET_ASIDE)
    assert not folder.exists(RUNNING)


def _turned(text, place, bit):
    raw = bytearray(text.encode())
    raw[place] ^= 1 << bit
    return bytes(raw)


@pytest.mark.parametrize("is_packed", [True, False], ids=["kept", "saved"])
def test_no_turned_bit_is_gone_on_from(tmp_path, session, is_packed):
    """Regression: 1.3 N of a zero became 1.7 N, and any digit of a state another one."""
    folder = StateFolder(tmp_path)
    if is_packed:
        path = folder.write_frozen(RUNNING, freeze(session, {"input.force.zero": 1.3}))
    else:
        path = folder.save(RUNNING, session)
    whole, wanted = path.read_text(), folder.load(RUNNING)._replace(age_s=0.0)
    draws = np.random.default_rng(3)
    places = [*draws.integers(0, len(whole), 300), *range(20), *range(len(whole) - 90, len(whole))]
    for place in places:
        path.write_bytes(_turned(whole, place, int(draws.integers(8))))
        try:
            found = folder.load(RUNNING)._replace(age_s=0.0)
        except ValueError as error:
            assert str(path) in str(error)  # noqa: PT017
        else:  # white space of another kind: the same data
            assert found == wanted


def test_a_file_that_was_edited_is_refused_and_says_what_to_do(tmp_path, session):
    folder = StateFolder(tmp_path)
    path = folder.save(SAVED, session)
    path.write_text(json.dumps(json.loads(path.read_text()), indent=1))
    folder.load(SAVED)  # written otherwise, with the same content
    data = json.loads(path.read_text())
    data["estimator"]["configuration"]["force_limit"] = 999.0
    path.write_text(json.dumps(data))
    with pytest.raises(ValueError, match=r"its checksum is of other numbers.*remove it"):
        folder.load(SAVED)
    del data["checksum"]
    path.write_text(json.dumps(data))
    with pytest.raises(ValueError, match="its checksum is of other numbers"):
        folder.load(SAVED)


def test_a_file_of_a_version_without_checksums_is_read(tmp_path, session):
    folder = StateFolder(tmp_path)
    path = folder.save(SAVED, session)
    wanted = folder.load(SAVED).estimator
    data = json.loads(path.read_text()) | {"format": 1}
    path.write_text(json.dumps(data))
    with pytest.raises(ValueError, match="checksum"):
        folder.load(SAVED)  # one bit makes a 1 of a 3, say: where there is one, it counts
    del data["checksum"]
    path.write_text(json.dumps(data))
    assert folder.load(SAVED).estimator == wanted


def test_no_other_name_than_the_two_is_a_state_file(tmp_path, session):
    with pytest.raises(ValueError, match="no state file"):
        StateFolder(tmp_path).save("../elsewhere.json", session)


def test_a_link_is_neither_followed_nor_kept(tmp_path, session):
    """Where somebody else may write into the folder, a prepared link must not lead elsewhere."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_text("untouched")
    folder = StateFolder(tmp_path / "states")
    for name in (SAVED, "saved_state.tmp"):
        (tmp_path / "states" / name).symlink_to(elsewhere)
    with pytest.raises(OSError, match="symbolic links"):
        folder.load(SAVED)
    folder.save(SAVED, session)
    assert elsewhere.read_text() == "untouched"
    assert not (tmp_path / "states" / SAVED).is_symlink()
    assert (tmp_path / "states" / SAVED).stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_failed_write_leaves_the_old_state_and_nothing_else(
    tmp_path, session, monkeypatch, call, plant
):
    folder = StateFolder(tmp_path)
    path = folder.save(RUNNING, session)
    before = path.read_text()
    feed(session, plant.samples(10, start=500), first=500)

    def full(*_arguments):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, call, full)
        with pytest.raises(OSError, match="No space left"):
            folder.save(RUNNING, session)
    assert path.read_text() == before
    assert [p.name for p in tmp_path.iterdir()] == [RUNNING]


def test_a_state_on_trial_that_ends_the_process_is_set_aside_at_the_next_start(tmp_path, session):
    StateFolder(tmp_path).save(RUNNING, session)
    first = StateKeeper(str(tmp_path))
    assert first.set_aside() is None
    assert first.kept(30.0) is not None
    # The process dies here; the next one begins afresh, and so does every one after it.
    second = StateKeeper(str(tmp_path))
    assert second.set_aside() == tmp_path / SET_ASIDE
    assert second.kept(30.0) is None
    assert [p.name for p in tmp_path.iterdir()] == [SET_ASIDE]


def test_a_kept_state_is_on_trial_again_with_the_first_samples_and_passes(tmp_path, session):
    StateFolder(tmp_path).save(RUNNING, session)
    first = StateKeeper(str(tmp_path))
    first.kept(30.0)
    first.wait_for_samples()
    # A process that is killed before a sample came did not die of the state.
    second = StateKeeper(str(tmp_path))
    assert second.set_aside() is None
    assert second.kept(30.0) is not None
    second.wait_for_samples()
    second.on_sample()
    assert [p.name for p in tmp_path.iterdir()] == [ON_TRIAL]
    while second.on_trial:
        second.on_sample()
    assert [p.name for p in tmp_path.iterdir()] == [RUNNING]
    second.keep(session, 0.0, 1.0)
    second.finish()
    assert [p.name for p in tmp_path.iterdir()] == [RUNNING]
    second.forget_kept()
    assert not list(tmp_path.iterdir())


def test_an_old_state_is_not_gone_on_from_and_not_set_aside(tmp_path, session):
    StateFolder(tmp_path).save(RUNNING, session)
    keeper = StateKeeper(str(tmp_path))
    assert keeper.kept(0.0) is None
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("moved_s", [-86_400.0, 86_400.0], ids=["back", "forward"])
def test_a_clock_that_is_set_makes_no_state_older_or_younger(
    tmp_path, session, monkeypatch, moved_s
):
    """Regression: set forward by a day (from 1970 by NTP, say) a state of now was too old."""
    StateFolder(tmp_path).save(RUNNING, session)
    now = time.time
    monkeypatch.setattr(state_file.time, "time", lambda: now() + moved_s)
    state = StateFolder(tmp_path).load(RUNNING)
    assert 0.0 <= state.age_s < 30.0
    assert StateKeeper(str(tmp_path)).kept(30.0) is not None


@pytest.mark.parametrize(("since_s", "is_used"), [(-86_400.0, False), (5.0, True), (60.0, False)])
def test_of_a_machine_that_began_anew_the_clock_counts(
    tmp_path, session, monkeypatch, since_s, is_used
):
    """Regression: of a clock set back by a day a state of yesterday was one of this moment."""
    StateFolder(tmp_path).save(RUNNING, session)
    now = time.time
    monkeypatch.setattr(state_file.time, "time", lambda: now() + since_s)
    monkeypatch.setattr(state_file, "boot_name", lambda: "another boot")
    assert (StateKeeper(str(tmp_path)).kept(30.0) is not None) == is_used


def test_saving_leaves_one_file_and_removing_none(tmp_path, session):
    folder = StateFolder(tmp_path)
    for _ in range(3):
        folder.save(RUNNING, session)
    assert [p.name for p in tmp_path.iterdir()] == [RUNNING]
    folder.remove(RUNNING)
    folder.remove(RUNNING)
    assert not folder.exists(RUNNING)


def test_zeros_that_were_taken_while_it_ran_are_kept_with_the_state_and_not_saved(
    tmp_path, session
):
    """A node that was started again read a tool at 412 mm as one 412 mm deep in the tissue."""
    normal = [0.0, 0.6, 0.8]
    zeros = {"input.position.zero": 412.0, "input.contact.normal": normal}
    first = StateKeeper(str(tmp_path), lambda: zeros)
    first.keep(session, 0.0, 1.0)
    first.finish()
    kept = StateKeeper(str(tmp_path)).kept(30.0)
    given = {p.name: p.value for p in parameters_of(kept)}
    assert given["input.position.zero"] == 412.0
    assert list(given["input.contact.normal"]) == normal
    assert given["filter"] == session.estimator.filter
    first.save(session)  # to be loaded when the sensors may have other zeros
    assert StateFolder(tmp_path).load(SAVED).settings == {}
    damaged = json.loads((tmp_path / SAVED).read_text()) | {"settings": [1]}
    (tmp_path / SAVED).write_text(resealed(damaged))
    with pytest.raises(ValueError, match="settings is"):
        StateFolder(tmp_path).load(SAVED)
