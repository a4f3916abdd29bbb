"""The scores of bilateral teleoperation: what they call stable, and that they see what they say."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

from hc_estimator.kinds import DEFAULT_FILTER
from hc_evaluation import places
from hc_evaluation.teleoperation import bench, effort, table
from hc_evaluation.teleoperation.scores import (
    force_at_the_hand,
    hold_motion,
    score,
    transparency,
)
from hc_sim_rig.bilateral import METHODS, BilateralSeries, layout, simulate

ROW = {
    "method",
    "filter",
    "round_trip_ms",
    "stable",
    "force_error_n",
    "transparency",
    "peak_force_n",
    "lump_contrast",
}


@pytest.fixture(scope="module")
def ideal() -> BilateralSeries:
    """A run whose hand feels exactly what the tissue would answer it."""
    series, _ = bench.run_case("wave_variables", 0.0, None, 0)
    rows = series.rows.copy()
    rows[:, layout.OUT_HAND_FORCE] = force_at_the_hand(series)
    return dataclasses.replace(series, rows=rows)


def changed(series: BilateralSeries, column: int, values: np.ndarray) -> BilateralSeries:
    rows = series.rows.copy()
    rows[:, column] = values
    return dataclasses.replace(series, rows=rows)


def test_the_tissue_itself_has_full_marks(ideal: BilateralSeries) -> None:
    scores = score(ideal)
    assert scores.stable
    assert scores.force_error_n == 0.0
    assert scores.transparency == pytest.approx(1.0)
    assert scores.lump_contrast == pytest.approx(1.0)
    assert scores.first_press_contrast == pytest.approx(1.0)


def test_a_weak_force_is_seen_and_its_contrast_is_not_less(ideal: BilateralSeries) -> None:
    """Half the force: half an impedance off; the ratio of lump to tissue is the same."""
    half = changed(ideal, layout.OUT_HAND_FORCE, 0.5 * ideal.hand_force_n)
    scores = score(half)
    assert scores.transparency == pytest.approx(1.0 / 1.5)
    assert scores.force_error_n > 0.1
    assert scores.lump_contrast == pytest.approx(1.0)


def test_a_late_force_is_less_transparent(ideal: BilateralSeries) -> None:
    late = np.r_[np.zeros(150), ideal.hand_force_n[:-150]]
    scores = [
        transparency(changed(ideal, layout.OUT_HAND_FORCE, force), force_at_the_hand(ideal))
        for force in (ideal.hand_force_n, late)
    ]
    assert scores[1] < 0.7 < scores[0]


def test_a_lump_that_is_not_felt_has_no_contrast(ideal: BilateralSeries) -> None:
    tissue = dataclasses.replace(ideal.settings.tissue, lump_stiffness_factor=1.0)
    tissue = dataclasses.replace(tissue, lump_damping_factor=1.0)
    flat = dataclasses.replace(ideal, settings=dataclasses.replace(ideal.settings, tissue=tissue))
    numb = changed(ideal, layout.OUT_HAND_FORCE, force_at_the_hand(flat))
    assert score(numb).lump_contrast == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(
    ("amplitude", "growth", "stable"),
    [(0.02, 0.0, True), (0.5, 0.0, False), (0.05, 0.4, False), (0.5, -1.0, True)],
)
def test_stability_is_how_an_oscillation_goes_on(
    ideal: BilateralSeries, amplitude: float, growth: float, stable: bool
) -> None:
    """2 Hz in the hold: small, sustained, growing, dying out. The force is in phase: no energy."""
    hold = ideal.task.hold
    since = ideal.time_s - hold.begin
    wave = np.where(
        (since >= 0.0) & (ideal.time_s < hold.end),
        amplitude * np.exp(growth * since) * np.sin(4.0 * np.pi * since),
        0.0,
    )
    assert score(changed(ideal, layout.OUT_MASTER, ideal.master_mm + wave)).stable is stable


def test_a_force_that_drives_the_hand_is_not_stable(ideal: BilateralSeries) -> None:
    """The same small motion, but the force gives energy: the sign decides."""
    mask = ideal.task.hold.mask(ideal.time_s)
    sway = np.mean(ideal.master_mm[mask]) + 0.04 * np.sin(2.0 * np.pi * 3.0 * ideal.time_s)
    pushing = 0.5 * np.cos(2.0 * np.pi * 3.0 * ideal.time_s)
    for sign in (-1.0, 1.0):
        moved = changed(ideal, layout.OUT_MASTER, np.where(mask, sway, ideal.master_mm))
        moved = changed(
            moved, layout.OUT_HAND_FORCE, np.where(mask, sign * pushing, ideal.hand_force_n)
        )
        energy = hold_motion(moved)[2]
        # work on the hand in ten thirds of a second: F v over whole periods
        assert energy == pytest.approx(
            -sign * 0.5 * 0.5 * 0.04 * 6.0 * np.pi * 10.0 / 3.0, rel=0.05
        )
        assert score(moved).stable is (sign > 0.0)


def test_ringing_that_died_out_counts(ideal: BilateralSeries) -> None:
    burst = np.where(
        (ideal.time_s > 1.0) & (ideal.time_s < 4.0), np.sin(16.0 * np.pi * ideal.time_s), 0.0
    )
    assert not score(changed(ideal, layout.OUT_MASTER, ideal.master_mm + burst)).stable


def test_numbers_that_ran_away_are_unstable_and_not_numbers(ideal: BilateralSeries) -> None:
    scores = score(changed(ideal, layout.OUT_SLAVE, np.full(len(ideal.time_s), np.nan)))
    assert scores.stable is False
    assert np.isnan(scores.force_error_n)


@pytest.fixture(scope="module")
def result() -> dict:
    return bench.run_teleoperation(
        quick=True,
        round_trips_ms=(300, 1000),
        chosen=(("direct", None), ("wave_variables", None), ("model_mediated", DEFAULT_FILTER)),
    )


def test_direct_feedback_is_unstable_at_300_ms_and_waves_and_models_are_not(result: dict) -> None:
    stable = {(row["method"], row["round_trip_ms"]): row["stable"] for row in result["rows"]}
    assert stable == {
        ("direct", 300): False,
        ("direct", 1000): False,
        ("wave_variables", 300): True,
        ("wave_variables", 1000): True,
        ("model_mediated", 300): True,
        ("model_mediated", 1000): True,
    }
    text = table.text_table(result)
    assert "direct is unstable with a round trip of 300, 1000 ms" in text
    assert "model_mediated" in text
    assert "model_mediated (ukf) is unstable" not in text


def test_rows_have_the_names_of_the_design(result: dict) -> None:
    rows = json.loads(json.dumps(result, allow_nan=False))["rows"]
    assert len(rows) == 6
    for row in rows:
        assert set(row) == ROW
        assert row["method"] in METHODS
        assert isinstance(row["stable"], bool)
        assert (row["filter"] is None) == (row["method"] != "model_mediated")


def test_a_model_is_nearer_to_the_tissue_than_waves_at_long_delay(result: dict) -> None:
    rows = {(row["method"], row["round_trip_ms"]): row for row in result["rows"]}
    for delay in (300, 1000):
        model, waves = rows["model_mediated", delay], rows["wave_variables", delay]
        assert model["transparency"] > waves["transparency"]
        assert model["force_error_n"] < waves["force_error_n"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(bench.SEEDS))
@pytest.mark.parametrize("round_trip", bench.ROUND_TRIPS_MS)
def test_model_mediation_is_stable_over_all_delays(round_trip: float, seed: int) -> None:
    assert bench.run_case("model_mediated", round_trip, DEFAULT_FILTER, seed)[1].stable


@pytest.mark.slow
@pytest.mark.parametrize("filter", [name for _, name in bench.variants(quick=False) if name])
@pytest.mark.parametrize("round_trip", bench.ROUND_TRIPS_MS)
def test_the_bounds_hold_with_every_filter_over_all_delays(filter: str, round_trip: float) -> None:
    """Rate of the updates, energy budget, and what the hand got back, whatever is estimated."""
    series, scores = bench.run_case("model_mediated", round_trip, filter, 0)
    feedback = series.settings.feedback
    assert scores.largest_update_n <= feedback.update_rate_n_per_s / 1000.0 * (1.0 + 1e-12)
    assert scores.lowest_tank_mj > -1e-3
    # tremor moves the hand by the device's noise: a hundredth of a mJ in 43 s
    assert series.column(layout.OUT_HAND_ENERGY).min() >= -feedback.tank_mj - 0.02


def test_the_document_takes_the_table(result: dict, tmp_path) -> None:
    path = tmp_path / "page.md"
    path.write_text(f"before\n<!-- teleoperation -->\nold\n{places.END}\nafter\n")
    places.write_place(path, "teleoperation", "Said.", {"": table.markdown_table(result)})
    text = path.read_text()
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "old" not in text
    assert "\nSaid.\n" in text
    assert text.count("| direct |") == 2
    path.write_text("nothing")
    with pytest.raises(ValueError, match="no lines"):
        places.check_places(path, "teleoperation")


@pytest.mark.slow
def test_the_effort_in_place_of_a_sensor() -> None:
    """Without friction the observer's force is the tissue's, late; unknown friction is in it."""
    errors = {}
    for friction, known in ((0.0, 1.0), (0.3, 0.0)):
        settings = effort.settings_of("effort", 0.01, friction, known)
        series = simulate(settings, seed=1)
        errors[friction] = effort.force_read(series)
        if friction == 0.0:
            assert score(series).transparency > 0.9
            assert series.trusted_share > 0.9
    late, in_step = errors[0.0]
    assert in_step < 0.04 < late
    assert errors[0.3][1] > 0.1


def test_a_sensor_is_read_with_its_noise() -> None:
    series, _ = bench.run_case("wave_variables", 0.0, None, 0)
    assert effort.force_read(series) == (pytest.approx(0.01, rel=0.02),) * 2


def test_the_effort_tables_have_a_line_a_row() -> None:
    head = dict.fromkeys((name for _, name, _ in effort.COLUMNS), 0.5)
    row = {**head, "force_source": "effort", "stable": False}
    known = {**dict.fromkeys((name for _, name, _ in effort.KNOWN_COLUMNS), 0.5)}
    known |= {"estimator": "x", "knows_tissue": "no", "position_rmse_um": np.nan}
    text = effort.text_tables({"rows": [row, row], "known_tissue": [known]})
    assert text.count("| effort |") == 2
    assert "NO" in text
    assert "nan" not in text


PAGE = Path(__file__).parents[2] / "docs" / "teleoperation.md"


def measured_rows(chosen: list[tuple[str, str | None]], round_trip_ms: int) -> list[str]:
    """Rows of the page's table as they come out now."""
    result = bench.run_teleoperation(round_trips_ms=(round_trip_ms,), chosen=chosen)
    return table.markdown_table(result).splitlines()[2:]


def test_the_page_is_not_older_than_the_simulation() -> None:
    """Rows without a filter, to the last digit: else `hc bench teleoperation --document` anew."""
    page = PAGE.read_text(encoding="utf-8")
    chosen = [("position_position", None), ("wave_variables", None)]
    for row in measured_rows(chosen, 20):
        assert row in page


@pytest.mark.slow
def test_the_page_is_not_older_than_the_default_filter() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for row in measured_rows([("model_mediated", DEFAULT_FILTER)], 100):
        assert row in page


def test_every_table_of_the_page_says_where_it_is_from() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for name in ("teleoperation", *effort.PLACES, "impedance"):
        said = page.split(f"<!-- {name} -->\n")[1].split("\n")[0]
        assert re.match(r"\d+ seeds?\. `hc bench \w+ --document \S+`, hc \S+ \(commit \w+", said)
