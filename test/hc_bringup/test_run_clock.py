"""A run whose clock was set back is one run, in the order in which it was recorded."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from hc_bringup.report.contacts import WORTH_A_ROW, find_contacts
from hc_bringup.report.rows import page_rows
from hc_bringup.run_clock import PAUSE_S, RunClock
from hc_bringup.run_data import estimated
from hc_estimator import create_estimator
from hc_logger.findings import findings_of
from hc_logger.recording import _set_forward, read_recording

EXAMPLE = Path(__file__).resolve().parents[2] / "bags" / "example"
STEP_S = 0.002


def test_what_comes_after_a_clock_that_was_set_back_lies_behind_what_came_before() -> None:
    """Regression: a report of -99963 s, without the rows after the driver was started again."""
    whole = read_recording(EXAMPLE)
    half = len(whole.time_s) // 2
    back = np.arange(len(whole.time_s)) >= half
    recording = dataclasses.replace(
        whole,
        is_bag=False,
        time_s=whole.time_s - 1e5 * back,
        stamps=whole.stamps - 10**14 * back,
    )
    data = estimated(recording, create_estimator("ukf"))
    steps = np.diff(data.time_s)
    assert (steps > 0.0).all()
    assert steps[half - 1] == pytest.approx(PAUSE_S)
    assert data.time_s[-1] == pytest.approx(whole.time_s[-1] - whole.time_s[0] + PAUSE_S, abs=0.01)
    assert "set back by 1e+05 s at " in data.findings[-1]
    assert page_rows(data)[-1, 0] == pytest.approx(data.time_s[-1])
    contacts = find_contacts(data, WORTH_A_ROW)
    assert len(contacts) > 1
    assert all(contact.end_s > contact.start_s >= 0.0 for contact in contacts)


def test_other_times_are_in_the_part_in_which_they_lie() -> None:
    """Events and places of the tip have stamps of their own."""
    parts = [start + STEP_S * np.arange(1000) for start in (0.0, -500.0, -900.0)]
    clock = RunClock.of(np.concatenate(parts))
    np.testing.assert_array_equal(clock.first, [0, 1000, 2000])
    known = clock.of_rows(np.concatenate(parts))
    assert (np.diff(known) > 0.0).all()
    others = np.array([0.5, -499.0, -498.0, -900.1, -899.0])
    np.testing.assert_allclose(
        clock.of_others(others), [0.5, 3.998, 4.998, 5.896, 6.996], atol=1e-9
    )
    assert len(clock.lines()) == 2


@pytest.mark.parametrize(
    "time_s",
    [
        np.arange(0.0, 2.0, STEP_S),
        np.arange(0.0, 2.0, STEP_S)[::-1],
        np.where(np.arange(1000) == 500, 0.1, STEP_S * np.arange(1000)),  # one out of place
        np.where(np.arange(1000) % 2 == 1, -STEP_S, STEP_S) + STEP_S * np.arange(1000),
        np.full(1000, np.nan),
        np.where(np.arange(1000) == 500, np.nan, STEP_S * np.arange(1000)),
        np.array([1.0]),
    ],
)
def test_times_without_a_clock_that_was_set_back_stay_as_they_are(time_s: np.ndarray) -> None:
    clock = RunClock.of(time_s)
    assert clock.is_one
    assert clock.lines() == []
    np.testing.assert_array_equal(clock.of_rows(time_s), time_s)


def test_a_clock_that_was_set_forward_does_not_stretch_a_run() -> None:
    """Regression: a report of a run of 72 s was 1796028810.61 s long, its charts empty."""
    whole = read_recording(EXAMPLE)
    half = len(whole.time_s) // 2
    ahead = np.arange(len(whole.time_s)) >= half
    recording = dataclasses.replace(
        whole,
        is_bag=False,
        time_s=whole.time_s + 3600.0 * ahead,
        stamps=whole.stamps + 3600 * 10**9 * ahead,
        set_forward_ns=(int(whole.stamps[half]) + 3600 * 10**9,),
    )
    data = estimated(recording, create_estimator("ukf"))
    assert np.diff(data.time_s)[half - 1] == pytest.approx(PAUSE_S)
    assert data.time_s[-1] == pytest.approx(whole.time_s[-1] - whole.time_s[0] + PAUSE_S, abs=0.01)
    assert "the clock was set forward by 3600 s at " in data.findings[-1]


def test_a_bag_tells_a_clock_that_was_set_forward_from_a_pause() -> None:
    step = 2_000_000
    received = np.arange(100, dtype=np.int64) * step
    received[50:] += 60 * 10**9  # nobody published for a minute
    stamps = received.copy()
    assert _set_forward(stamps, received) == ()
    stamps[70:] += 3600 * 10**9
    assert _set_forward(stamps, received) == (int(stamps[70]),)
    received[:40] = received[40]  # a recorder that stood still took many at once
    assert _set_forward(stamps, received) == (int(stamps[70]),)


def test_rows_behind_a_clock_that_was_set_back_are_not_said_to_be_rejected() -> None:
    """Regression: "1 row with a time before ...: the estimator rejects them", and it used all."""
    rows = np.ones((400, 2))
    steps = np.full(399, 0.002)
    steps[99] = -1e9
    found = findings_of(rows, steps, ())
    assert (found.backward, found.set_back) == (0, 1)
    assert found.lines() == [
        "the clock was set back (a driver that was started again, or a clock that was put right): "
        "the estimator begins anew there"
    ]
    steps[199] = -1e3
    assert "set back 2 times (" in findings_of(rows, steps, ()).lines()[0]
    steps[130] = -0.001  # before the estimator would have gone on from there
    found = findings_of(rows, steps, ())
    assert (found.backward, found.set_back) == (2, 1)
    steps[:] = 0.002
    steps[99], steps[100] = -0.5, 0.504  # a stamp out of place
    assert (findings_of(rows, steps, ())[2], findings_of(rows, steps, ()).set_back) == (1, 0)
    assert findings_of(rows, -steps, ()).set_back == 0  # from last to first
