"""Sensors read otherwise in the middle of a recording: said, and judged in one piece."""

from types import SimpleNamespace

import numpy as np
import pytest

from hc_bringup.reading_changes import (
    change_lines,
    judged_line,
    judged_stretch,
    longest_stretch,
    read_alike,
    unexplained,
)
from hc_bringup.unusable import say_unusable
from hc_estimator.stream.readings import Check, Suspicion
from hc_logger.events import ReadingChange, RecordedEvent, reading_changes

SECOND = 1_000_000_000
TARED = ReadingChange(
    12 * SECOND, "input.force.zero = 1.149223159696371, input.position.zero = -200.8"
)


def test_of_the_events_of_a_bag_those_count_that_name_settings_of_the_sensors():
    afresh = "the estimator was started afresh"
    events = [
        RecordedEvent(1 * SECOND, 6, "contact_position_std = 0.0586"),
        RecordedEvent(2 * SECOND, 5, afresh),
        RecordedEvent(3 * SECOND, 5, f"{afresh}: filter = ukf"),
        RecordedEvent(12 * SECOND, 5, f"{afresh}: {TARED.settings}"),
        RecordedEvent(13 * SECOND, 15, "force zero 1.14922 N, contact at -200.8 mm"),
        RecordedEvent(14 * SECOND, 19, "see input.force.zero"),
    ]
    assert reading_changes(events) == [TARED]


def test_time_and_settings_are_said_in_figures_that_can_be_read():
    assert change_lines([TARED], 2 * SECOND) == [
        "the sensors were read otherwise from 10.00 s on: input.force.zero = 1.14922, "
        "input.position.zero = -200.8"
    ]


def test_the_longest_part_is_judged_and_the_sample_of_the_change_belongs_to_before():
    stamps = np.arange(0, 30) * SECOND
    changes = [TARED, ReadingChange(25 * SECOND, "input.force.sign = -1")]
    stretch = longest_stretch(stamps, stamps * 1e-9, changes)
    assert (stretch.begin_s, stretch.end_s) == (0.0, 12.0)
    assert stretch.chosen.sum() == 13
    stretch = longest_stretch(stamps, stamps * 1e-9, changes[:1])
    assert judged_line(stretch).endswith("13.00 to 29.00 s")


@pytest.mark.parametrize(("at_s", "left"), [(10.01, 0), (4.0, 1)])
def test_a_zero_of_which_it_is_known_who_took_it_is_not_doubted_as_well(at_s, left):
    before = Suspicion(Check.ZERO_STEP, "force", "", 1.0, until_s=at_s)
    after = Suspicion(Check.ZERO_STEP, "force", "", 1.0, since_s=at_s)
    for doubt in (before, after):
        assert len(unexplained([doubt], [TARED], 2 * SECOND)) == left
    other = Suspicion(Check.SIGN, "force", "")
    assert unexplained([other], [TARED], 2 * SECOND) == [other]


def recorded(changes, *, pressed_until_s=40.0):
    """A tool in the air and, from 10 s on, presses that count from another place."""
    time_s = np.arange(0.0, 40.0, 0.01)
    depth = 2.0 - 3.0 * np.cos(time_s)
    depth[(time_s <= 10.0) | (time_s > pressed_until_s)] = -1.0
    force = 0.5 * np.maximum(depth, 0.0) ** 1.5
    draw = np.random.default_rng(1)
    place = depth - np.where(time_s <= 10.0, 200.0, 0.0) + 0.002 * draw.standard_normal(4000)
    return SimpleNamespace(
        stamps=np.round((time_s + 2.0) * SECOND).astype(np.int64),
        time_s=time_s,
        displacement_mm=place,
        force_n=force + 0.01 * draw.standard_normal(4000),
        reading_changes=changes,
        counted_once=(),
    )


def test_what_is_told_of_a_recording_is_told_of_its_last_part_with_a_press(capsys):
    """Regression: after a search for the surface "would be if it were in micrometres", and 1."""
    recording = recorded([TARED])
    assert say_unusable("bag", recorded([]))
    assert "micrometres" in capsys.readouterr().err
    assert say_unusable("bag", recording) == ""
    assert capsys.readouterr().err == ""
    time_s, place, _ = read_alike(recording)
    assert time_s[0] == pytest.approx(10.01)
    assert len(time_s) == len(place) == 2999


def test_a_last_part_without_a_press_says_nothing_of_what_came_before():
    later = ReadingChange(32 * SECOND, "input.force.presliding = 0.05")
    stretch = judged_stretch(recorded([TARED, later], pressed_until_s=29.0))
    assert (stretch.begin_s, stretch.end_s) == pytest.approx((10.01, 30.0))
    stretch = judged_stretch(recorded([TARED], pressed_until_s=-1.0))
    assert stretch.begin_s == pytest.approx(10.01)
    assert judged_stretch(recorded([])) is None
