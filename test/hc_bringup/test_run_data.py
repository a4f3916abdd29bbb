"""What was recorded belongs together: sample, estimate and truth of one instant."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hc_bringup.report.run_page import _figure_table, begins_at
from hc_bringup.run_data import _EARLIEST_NS, estimated, recorded
from hc_bringup.sample_places import places_of
from hc_estimator import create_estimator
from hc_logger.recording import read_recording

EXAMPLE = Path(__file__).resolve().parents[2] / "bags" / "example"


@pytest.mark.parametrize("later_first", [False, True])
def test_a_source_that_was_started_again_has_samples_of_its_own(later_first):
    """Regression: estimates were given to the samples of the same number after a restart."""
    once = read_recording(EXAMPLE)
    alone = recorded(once)
    assert alone is not None
    assert alone.truth is not None

    def both(first, again):
        parts = [again, first] if later_first else [first, again]
        return np.concatenate(parts)

    twice = dataclasses.replace(
        once,
        stamps=both(once.stamps, once.stamps + 100 * 10**9),
        sequence=both(once.sequence, once.sequence),
        time_s=both(once.time_s, once.time_s + 100.0),
        displacement_mm=both(once.displacement_mm, once.displacement_mm + 5.0),
        force_n=both(once.force_n, once.force_n + 1.0),
    )
    data = recorded(twice)
    assert data is not None
    np.testing.assert_array_equal(data.displacement_mm, alone.displacement_mm)
    np.testing.assert_array_equal(data.force_n, alone.force_n)
    np.testing.assert_array_equal(data.truth, alone.truth)


pairs = st.lists(st.tuples(st.integers(0, 4), st.integers(0, 2**64 - 1) | st.integers(0, 3)))


@given(pairs, pairs)
def test_places_are_those_of_stamp_and_number(there, wanted):
    def columns(rows):
        stamps = np.array([row[0] for row in rows], np.int64)
        return stamps, np.array([row[1] for row in rows], np.uint64)

    wanted = [*wanted, *there[:3]]
    found = places_of(*columns(wanted), *columns(there))
    last = {pair: place for place, pair in enumerate(there)}
    assert found.tolist() == [last.get(pair, -1) for pair in wanted]


def test_a_run_says_when_it_began_where_its_times_do():
    """Regression: a report that was mailed did not say of which day it was."""
    once = read_recording(EXAMPLE)
    assert once.stamps[0] > _EARLIEST_NS
    data = recorded(once)
    assert data is not None
    assert data.begins_ns == once.stamps[0]
    date = re.search(r"<td>begins</td><td>([^<]*)</td>", _figure_table(data))
    assert date is not None
    assert date[1] == begins_at(int(once.stamps[0]))
    assert begins_at(1796029915 * 10**9 + 238_373_000) == "2026-11-30 09:11:55 UTC"
    since_start = dataclasses.replace(once, stamps=once.stamps - once.stamps[0])
    of_a_file = estimated(dataclasses.replace(since_start, is_bag=False), create_estimator("ukf"))
    assert of_a_file.begins_ns is None
    assert "begins" not in _figure_table(of_a_file)
