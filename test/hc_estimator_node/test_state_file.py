"""Saving a state and going on from it, in one folder and nowhere else."""

import json

import numpy as np
import pytest

from hc_estimator import create_estimator
from hc_estimator.online.session import EstimationSession
from hc_estimator.online.state_file import RUNNING, SAVED, StateFolder
from hc_estimator.online.vocabulary import Cause, EventKind

START = 1_700_000_000_000_000_000


def feed(session, samples, first=0):
    for number, (time_s, displacement, force) in enumerate(samples, first):
        session.process(START + round(time_s * 1e9), number, displacement, force)


@pytest.fixture
def session(recorder, plant):
    session = EstimationSession(create_estimator("ukf"), recorder)
    feed(session, plant.samples(500))
    return session


def test_a_loaded_session_goes_on_as_if_it_had_never_stopped(tmp_path, session, recorder, plant):
    folder = StateFolder(tmp_path / "new" / "folder")
    folder.save(SAVED, session)
    saved = folder.load(SAVED)
    other = EstimationSession(create_estimator("ukf"), type(recorder)())
    other.load(saved.estimator, saved.time_origin_ns, saved.revision)
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


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": 1}', '{"format": 99}', "\x00"])
def test_a_damaged_file_is_named_and_changes_nothing(tmp_path, text):
    (tmp_path / SAVED).write_text(text)
    with pytest.raises(ValueError, match=SAVED):
        StateFolder(tmp_path).load(SAVED)


def test_a_state_with_damaged_numbers_is_refused_and_changes_nothing(tmp_path, session, plant):
    path = StateFolder(tmp_path).save(SAVED, session)
    data = json.loads(path.read_text())
    data["estimator"]["memory"]["state"] = [1.0, 2.0]
    path.write_text(json.dumps(data))
    saved = StateFolder(tmp_path).load(SAVED)
    before = session.estimator.state()
    with pytest.raises(ValueError, match="damaged"):
        session.load(saved.estimator, saved.time_origin_ns)
    assert session.estimator.state() == before


def test_no_other_name_than_the_two_is_a_state_file(tmp_path, session):
    with pytest.raises(ValueError, match="no state file"):
        StateFolder(tmp_path).save("../elsewhere.json", session)


def test_saving_leaves_one_file_and_removing_none(tmp_path, session):
    folder = StateFolder(tmp_path)
    for _ in range(3):
        folder.save(RUNNING, session)
    assert [p.name for p in tmp_path.iterdir()] == [RUNNING]
    folder.remove(RUNNING)
    folder.remove(RUNNING)
    assert not folder.exists(RUNNING)
