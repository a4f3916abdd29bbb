"""A series as a table: columns by name, a DataFrame where pandas is there, and its repr."""

import sys
from types import ModuleType

import numpy as np
import pytest

from hc_estimator import create_estimator
from hc_estimator.estimate import Estimate, EstimateSeries


@pytest.fixture(scope="module")
def presses():
    time_s = np.arange(0.0, 2.0, 0.002)
    depth = 2.0 - 2.0 * np.cos(5.0 * time_s)
    force = 0.5 * depth**1.5 * (1.0 + 0.05 * 10.0 * np.sin(5.0 * time_s))
    force[700] = np.inf
    return time_s, depth, force


def test_columns_are_those_of_the_series(presses):
    series = create_estimator("rls").run(*presses)
    table = series.columns()
    assert {len(column) for column in table.values()} == {len(series)}
    np.testing.assert_array_equal(table["stiffness"], series.parameters[:, 0])
    np.testing.assert_array_equal(table["damping_std"], series.parameters_std[:, 1])
    np.testing.assert_array_equal(table["innovation_force_N"], series.innovation[:, 1])
    np.testing.assert_array_equal(
        table["velocity_exponent_identifiability"], series.identifiability[:, 3]
    )
    np.testing.assert_array_equal(table["model_mismatch"], series.model_mismatch)
    np.testing.assert_array_equal(table["force_zero_std_N"], series.force_zero_std)
    np.testing.assert_array_equal(table["contact_position_std_mm"], series.contact_position_std)
    assert table["contact"].dtype == bool
    assert table["rejected"][700] == "not_finite"
    assert table["rejected"][699] == ""


def test_a_series_says_what_it_is(presses):
    estimator = create_estimator("rls")
    series = estimator.run(*presses)
    used = int((series.rejected == 0).sum())
    assert 900 < used < 1000
    assert repr(series).startswith(f"EstimateSeries(1000 samples, {used} used; last stiffness=0.")
    assert repr(estimator.run(*(c[:0] for c in presses))) == "EstimateSeries(0 samples)"


def test_a_part_of_a_series_is_a_series(presses):
    """Regression: series[100:200] was one estimate, with numbers of several."""
    series = create_estimator("rls").run(*presses)
    touched = series.contact
    for index in (slice(100, 200), slice(None, None, -3), touched, [3, -5], np.array([7, 7]), []):
        part = series[index]
        assert isinstance(part, EstimateSeries)
        rows = series.values[np.array(index, int) if isinstance(index, list) else index]
        np.testing.assert_array_equal(part.values, rows)
        assert len(part) == len(rows)
    for index in (5, -1, np.int64(7)):
        one = series[index]
        assert isinstance(one, Estimate)
        np.testing.assert_array_equal(one.parameters, series.parameters[index])
    assert len(list(series[:4])) == 4


@pytest.mark.parametrize(
    "index", ["5", 5.0, None, True, (1, 2), ..., [1.5], np.zeros((2, 2), int), {3}]
)
def test_what_is_no_index_is_a_type_error(presses, index):
    series = create_estimator("rls").run(*presses)
    with pytest.raises(TypeError, match="estimates are chosen by"):
        series[index]
    with pytest.raises(IndexError):
        series[len(series)]


def test_a_dataframe_needs_pandas_and_says_so(presses, monkeypatch):
    series = create_estimator("rls").run(*presses)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="pip install pandas"):
        series.to_dataframe()
    made = []

    class Frame(dict):
        def set_index(self, index):
            made.append(index)
            return self

    stand_in = ModuleType("pandas")
    stand_in.DataFrame = Frame
    stand_in.Index = lambda values, name: (name, values)
    monkeypatch.setitem(sys.modules, "pandas", stand_in)
    assert series.to_dataframe().keys() == series.columns().keys()
    assert not made
    series.to_dataframe(presses[0])
    assert made[0][0] == "time_s"
    assert made[0][1] is presses[0]
