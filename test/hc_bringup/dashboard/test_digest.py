"""Rows of the live page: nothing invented, nothing lost, however the stream is cut."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hc_bringup.dashboard.columns import COLUMNS, INDEX
from hc_bringup.dashboard.digest import ROW_NS, Digest
from hc_bringup.dashboard.history import History
from hc_bringup.dashboard.latency import EDGES_S, LatencyWindow

Make = Callable[..., Any]
PERIOD_NS = 1_000_000
START_NS = 1_700_000_000_000_000_000


def samples(count: int, first: int = 0) -> Any:
    table = np.zeros(count, [("sequence", "<u8"), ("displacement", "<f8"), ("force", "<f8")])
    table["sequence"] = np.arange(first, first + count)
    table["displacement"] = 1e-3 * np.sin(0.01 * table["sequence"])
    table["force"] = np.cos(0.01 * table["sequence"])
    return table


def stamps_of(table: Any) -> Any:
    return START_NS + table["sequence"].astype(np.int64) * PERIOD_NS


def rows_of(digest: Digest, table: Any, cuts: list[int]) -> Any:
    parts = []
    edges = sorted({0, len(table), *(cut for cut in cuts if cut < len(table))})
    for begin, end in itertools.pairwise(edges):
        part = table[begin:end]
        parts.append(digest.add(part, stamps_of(part), estimates=False))
    parts.append(digest.flush())
    return np.concatenate(parts)


@given(st.integers(1, 300), st.lists(st.integers(1, 300), max_size=12))
def test_rows_do_not_depend_on_how_the_stream_was_cut(count: int, cuts: list[int]) -> None:
    table = samples(count)
    whole = rows_of(Digest(), table, [])
    np.testing.assert_array_equal(rows_of(Digest(), table, cuts), whole)
    assert whole[:, INDEX["samples"]].sum() == count
    per_row = ROW_NS // PERIOD_NS
    for number, row in enumerate(whole):
        block = table[number * per_row : (number + 1) * per_row]
        assert row[INDEX["sequence"]] == block["sequence"][-1]
        assert row[INDEX["force"]] == block["force"][-1]
        assert row[INDEX["force_min"]] == block["force"].min()
        assert row[INDEX["force_max"]] == block["force"].max()
        assert row[INDEX["displacement_max"]] == 1000.0 * block["displacement"].max()


@given(st.sets(st.integers(0, 199), min_size=1))
def test_missing_sequence_numbers_are_counted_as_lost(kept: set[int]) -> None:
    table = samples(200)[sorted(kept)]
    rows = rows_of(Digest(), table, [])
    assert rows[:, INDEX["lost"]].sum() == max(kept) - min(kept) + 1 - len(kept)


def test_what_came_while_nobody_looked_is_not_lost() -> None:
    """Regression: a page opened a minute after the last one was closed showed 71,764 lost."""
    digest = Digest()
    before, after = samples(100), samples(100, first=72_000)
    rows = [digest.add(before, stamps_of(before), estimates=False), digest.pause()]
    rows += [digest.add(after, stamps_of(after), estimates=False), digest.flush()]
    whole = np.concatenate(rows)
    assert whole[:, INDEX["lost"]].sum() == 0
    assert whole[:, INDEX["samples"]].sum() == 200


def test_a_row_is_one_estimate(make_estimates: Make, make_stamps: Make) -> None:
    """Values without a suffix are those of the row's last estimate, in the page's units."""
    table = make_estimates(45)
    table["rejected"][[3, 4]] = 4
    table["nis"][4] = np.nan
    table["change_detected"][7] = True
    digest = Digest()
    digest.set_tip(1.5, -2.5)
    rows = digest.add(table, make_stamps(table), estimates=True)
    assert len(rows) == 2
    assert rows.shape[1] == len(COLUMNS)
    row, last = rows[0], table[19]
    expected = {
        "K": last["stiffness"],
        "p_std": last["velocity_exponent_std"],
        "n_known": last["displacement_exponent_identifiability"],
        "displacement": 1000.0 * last["displacement"],
        "contact_position_std": 1000.0 * last["contact_position_std"],
        "delay": last["channel_delay"],
        "K_n_covariance": last["covariance"][2],
        "score_5": last["hypothesis_scores"][5],
        "error": last["force_measured"] - last["force_predicted"],  # as hc run and hc report
        "error_max": (table["force_measured"] - table["force_predicted"])[:20].max(),
        "latency": table["latency"][:20].max(),
        "nis_count": 18.0,
        "rejected": 2.0,
        "change": 1.0,
        "tip_x": 1.5,
        "tip_y": -2.5,
    }
    for name, value in expected.items():
        assert row[INDEX[name]] == value, name
    used = np.delete(table["nis"][:20], [3, 4])
    assert row[INDEX["nis_sum"]] == pytest.approx(used.sum())
    assert rows[1][INDEX["change"]] == 0.0


def test_refused_samples_have_no_force_error(make_estimates: Make, make_stamps: Make) -> None:
    """Regression: what a saturated sensor says was drawn as an error of the filter."""
    table = make_estimates(400)
    table["rejected"][100:200] = 1
    table["force_measured"][100:200] = 50.0
    digest = Digest()
    rows = np.concatenate([digest.add(table, make_stamps(table), estimates=True), digest.flush()])
    error = rows[:, INDEX["error_max"]]
    assert np.isnan(error).any()
    assert np.nanmax(error) < 10.0
    assert np.nanmax(rows[:, INDEX["force_max"]]) == 50.0


def test_stamps_that_start_again_begin_an_epoch(make_estimates: Make, make_stamps: Make) -> None:
    digest = Digest()
    table = make_estimates(100)
    digest.add(table, make_stamps(table), estimates=True)
    rows = digest.add(table, make_stamps(table, START_NS - 10**12), estimates=True)
    assert digest.epoch == 1
    assert rows[0, INDEX["time"]] == pytest.approx(0.019)
    # The same stamps once more are told twice: nothing new.
    again = table[60:]
    before = digest.epoch
    assert len(digest.add(again, make_stamps(again, START_NS - 10**12), estimates=True)) == 0
    assert digest.epoch == before


@given(st.integers(1, 40), st.lists(st.integers(0, 60), max_size=20), st.integers(0, 500))
def test_history_gives_the_last_rows(capacity: int, sizes: list[int], number: int) -> None:
    history = History(capacity)
    everything = []
    for size in sizes:
        rows = np.full((size, len(COLUMNS)), float(len(everything)))
        rows[:, 0] = np.arange(len(everything), len(everything) + size)
        everything.extend(rows[:, 0].tolist())
        history.add(rows)
    first, rows = history.since(number)
    assert rows[:, 0].tolist() == everything[first:]
    assert first == min(max(number, len(everything) - capacity, 0), len(everything))


def test_latencies_of_the_last_ten_seconds() -> None:
    window = LatencyWindow()
    window.add(np.array([1e-9, 0.0005, 5.0, np.nan]), 0.5)
    assert sum(window.counts(0.6)) == 3
    counts = window.counts(5.0)
    assert counts[0] == 1
    assert counts[-1] == 1
    place = int(np.searchsorted(EDGES_S, 0.0005))
    assert counts[place] == 1
    window.add(np.array([0.001]), 9.0)
    assert sum(window.counts(11.5)) == 1
    assert sum(window.counts(1000.0)) == 0


def test_truth_is_that_of_the_estimates_stamp(make_estimates: Make, make_stamps: Make) -> None:
    """Estimates that lag behind the truth must not look as if they were late to change."""
    table = make_estimates(400)
    stamps = make_stamps(table)
    digest = Digest()
    names = ("stiffness", "damping", "displacement_exponent", "velocity_exponent")
    for place in range(0, 400, 33):  # the truth comes at the rate of the page, long before
        digest.set_truth(dict.fromkeys(names, float(place)), int(stamps[place]))
    rows = digest.add(table, stamps, estimates=True)
    shown = rows[:, INDEX["sequence"]]
    assert len(shown) == 19
    np.testing.assert_allclose(rows[:, INDEX["K_true"]], shown, atol=1e-6)
    np.testing.assert_allclose(rows[:, INDEX["p_true"]], shown, atol=1e-6)
    digest.restart()
    again = digest.add(table, stamps, estimates=True)
    assert np.isnan(again[:, INDEX["K_true"]]).all()
