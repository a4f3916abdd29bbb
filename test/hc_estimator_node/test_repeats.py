"""Of a channel that repeats its last reading until there is a new one, each reading counts once."""

import numpy as np

from hc_estimator.stream.repeats import LONGEST_S, Repeats, new_readings, once_each


def test_a_reading_counts_once_and_again_where_the_channel_rests():
    stamps = np.arange(0, 400_000_000, 2_000_000, dtype=np.int64)
    values = np.repeat(np.arange(50.0), 4)
    assert new_readings(stamps, values).tolist() == [True, False, False, False] * 50
    at_rest = new_readings(stamps, np.zeros(200))
    assert np.diff(stamps[at_rest]).tolist() == [round(LONGEST_S * 1e9)] * 4


def test_a_vector_is_new_where_any_component_is_and_a_clock_set_back_begins_anew():
    repeats = Repeats()
    assert not repeats.is_one(10, (1.0, 2.0))
    assert repeats.is_one(20, (1.0, 2.0))
    assert not repeats.is_one(30, (1.0, 3.0))
    assert not repeats.is_one(5, (1.0, 3.0))
    repeats.forget()
    assert not repeats.is_one(6, (1.0, 3.0))


def test_a_repeated_reading_counts_once_where_others_are_missing_between():
    """As in a table whose rows hold one reading each: NaN took the next one for a new reading."""
    values = np.full(12, np.nan)
    values[::2] = [1.0, 1.0, 1.0, 2.0, 2.0, 1.0]
    left = once_each(np.arange(12) * 1_000_000, values)
    assert np.flatnonzero(~np.isnan(left)).tolist() == [0, 6, 10]
    assert left[[0, 6, 10]].tolist() == [1.0, 2.0, 1.0]
