"""Sensors read otherwise in the middle of a recording: said, and judged in one piece."""

import numpy as np
import pytest

from hc_bringup.reading_changes import (
    change_lines,
    judged_line,
    longest_stretch,
    unexplained,
)
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
