"""The live palpation map: what was felt comes out where it was felt, with honest uncertainty."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hc_bringup.dashboard.columns import COLUMNS, INDEX
from hc_bringup.dashboard.palpation import MAP_COLUMNS, PalpationMap

PLACE = {name: index for index, name in enumerate(MAP_COLUMNS)}


def row(time_s: float, stiffness: float, deviation: float, **more: float) -> np.ndarray:
    values = dict.fromkeys(COLUMNS, 0.0)
    values |= {"time": time_s, "K": stiffness, "K_std": deviation, "n": 1.5, "n_std": 0.1}
    values |= {"contact": 1.0, "samples": 20.0, "displacement_max": 3.0, **more}
    return np.array([values[name] for name in COLUMNS])


def test_a_lump_shows_where_it_is() -> None:
    felt = PalpationMap(cell_mm=1.0)
    speed = 10.0  # mm/s
    felt.add_tip(0.0, 0.0, 0.0)
    for number in range(1, 200):
        time_s = 0.02 * number
        stiffness = 0.2 + 0.4 * math.exp(-(((speed * time_s - 20.0) / 4.0) ** 2))
        felt.add_rows(row(time_s, stiffness, 0.002)[None])
        felt.add_tip(time_s + 0.005, speed * (time_s + 0.005), 0.0)
    table = felt.table()
    table = table[np.argsort(table[:, PLACE["x"]])]
    assert len(table) == 41
    peak = table[np.argmax(table[:, PLACE["ln_K"]])]
    assert abs(peak[PLACE["x"]] - 20.0) < 1.0
    expected = 0.2 + 0.4 * np.exp(-(((table[:, PLACE["x"]] - 20.0) / 4.0) ** 2))
    np.testing.assert_allclose(np.exp(table[:, PLACE["ln_K"]]), expected, rtol=0.05)


def test_rows_wait_for_the_position_and_are_dropped_without_one() -> None:
    felt = PalpationMap(cell_mm=1.0)
    felt.add_rows(row(1.0, 0.2, 0.01)[None])
    assert len(felt.table()) == 0
    felt.add_tip(0.9, 0.0, 0.0)
    felt.add_tip(1.1, 4.2, 0.0)
    assert felt.table()[0, PLACE["x"]] == 2.0  # the cell in the middle between 0 and 4.2 mm
    felt.add_rows(row(2.0, 0.2, 0.01)[None])
    felt.add_rows(row(5.0, 0.2, 0.01)[None])
    felt.add_tip(5.5, 9.0, 0.0)
    assert felt.table()[:, PLACE["count"]].sum() == 2.0


def test_estimates_may_come_later_than_the_position() -> None:
    felt = PalpationMap(cell_mm=1.0)
    for number in range(200):
        felt.add_tip(0.01 * number, 0.1 * number, 0.0)
    for number in range(10, 90):
        felt.add_rows(row(0.02 * number, 0.2, 0.01)[None])
    table = felt.table()
    assert table[:, PLACE["count"]].sum() == 80.0
    assert len(table) == 17  # 2 to 18 mm


@pytest.mark.parametrize(
    "bad",
    [
        {"contact": 0.0},
        {"rejected": 20.0},
        {"K": math.nan},
        {"K": -1.0},
        {"K_std": math.inf},
        {"K_std": 1.0},
        {"n": math.nan},
    ],
)
def test_what_says_nothing_is_left_out(bad: dict[str, float]) -> None:
    felt = PalpationMap()
    felt.add_tip(0.0, 0.0, 0.0)
    felt.add_rows(row(0.5, 0.2, 0.01, **bad)[None])
    felt.add_tip(1.0, 0.0, 0.0)
    assert len(felt.table()) == 0


@given(st.lists(st.tuples(st.floats(0.05, 2.0), st.floats(0.001, 0.5)), min_size=1, max_size=30))
def test_deviation_covers_scatter_and_does_not_shrink_with_number(
    estimates: list[tuple[float, float]],
) -> None:
    felt = PalpationMap(cell_mm=100.0)
    felt.add_tip(0.0, 1.0, 1.0)
    for number, (stiffness, relative) in enumerate(estimates, 1):
        felt.add_rows(row(0.1 * number, stiffness, relative * stiffness)[None])
        felt.add_tip(0.1 * number + 0.01, 1.0, 1.0)
    (cell,) = felt.table()
    logs = np.log([stiffness for stiffness, _ in estimates])
    weights = np.array([1.0 / max(relative**2, 1e-6) for _, relative in estimates])
    mean = np.average(logs, weights=weights)
    scatter = np.average((logs - mean) ** 2, weights=weights)
    assert cell[PLACE["ln_K"]] == pytest.approx(mean, abs=1e-9)
    assert cell[PLACE["var_ln_K"]] >= scatter - 1e-9
    assert cell[PLACE["var_ln_K"]] >= min(relative for _, relative in estimates) ** 2 - 1e-9


def test_cells_are_bounded() -> None:
    felt = PalpationMap(cell_mm=0.5, most_cells=50)
    for number in range(500):
        felt.place_contact(float(number), -3.0, np.array([0.0, 1.5, 0.01, 0.01, 0.0]), 2.0)
    table = felt.table()
    assert len(table) <= 50
    assert table[:, PLACE["count"]].sum() == 500.0
    assert felt.cell_mm == 16.0
    felt.clear()
    assert len(felt.table()) == 0
    assert felt.cell_mm == 0.5


def test_columns_of_the_page_are_those_of_the_digest() -> None:
    assert len(set(COLUMNS)) == len(COLUMNS)
    assert INDEX["time"] == 0
