"""The experiments as data: complete, sound, and with the papers' figures unchanged."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import yaml

from hc_estimator import parameter_specifications
from hc_estimator.contact.arrays import adhesive_force, hunt_crossley_force
from hc_evaluation.reproduction import (
    ExperimentError,
    available_experiments,
    experiment,
    load_experiment,
)
from hc_evaluation.reproduction.position_filters import FILTERS
from hc_evaluation.reproduction.published import published_papers, published_value
from hc_evaluation.reproduction.signals import make_signal
from hc_evaluation.reproduction.trace import make_estimator

ROOT = Path(__file__).resolve().parents[2]


def _expected() -> set[tuple[str, str]]:
    paper_a = [
        *(("A", f"table {k}") for k in range(1, 5)),
        *(("A", f"figure {k}") for k in (2, 3, 4, 6)),
    ]
    paper_b = [("B", f"table {k}") for k in range(1, 7)]
    paper_b += [("B", f"figure {k}") for k in (*range(1, 11), 12)]
    paper_c = [("C", "table III"), *(("C", f"figure {k}") for k in range(2, 6))]
    return {*paper_a, *paper_b, *paper_c}


def test_every_table_and_figure_is_covered() -> None:
    covered = set()
    for name in available_experiments():
        found = load_experiment(name)
        covered |= {(found.paper, what) for what in found.covers}
        figures = {what for what in found.covers if what.startswith("figure")}
        assert {p["covers"] for p in found.pictures} == figures
    assert covered == _expected()


@pytest.mark.parametrize("name", available_experiments())
def test_an_experiment_is_complete(name: str) -> None:
    found = load_experiment(name)
    settings = {column.setting for column in found.columns}
    assert settings == {"paper", "ours"} | (set() if found.variant_of else {"practical"})
    assert "default" in [column.filter for column in found.columns]
    assert len(found.readings) >= (2 if found.variant_of else 5)
    assert found.claim
    assert found.remarks
    for column in found.columns:
        if column.setting == "ours":  # one common default: nothing may be set
            assert not column.parameters
            assert not column.start_state
            assert not column.process_noise
        elif column.filter not in FILTERS:
            names = {s.name for s in parameter_specifications(column.filter, column.state_space)}
            assert set(column.parameters) <= names
    for row, score in found.published_rows.items():
        values = [published_value(found.published, c.published, row) for c in found.columns]
        assert any(value is not None for value in values), (row, score)


VARIANTS = [name for name in available_experiments() if load_experiment(name).variant_of]


def test_both_readings_of_the_noise_are_there_for_both_papers() -> None:
    read = {load_experiment(name).variant_of for name in VARIANTS}
    assert read == {f"a_table_{k}" for k in (1, 2, 3)} | {f"b_table_{k}" for k in (1, 2, 3, 4)}


@pytest.mark.parametrize("name", VARIANTS)
def test_a_variant_differs_in_its_noise_alone(name: str) -> None:
    variant = load_experiment(name)
    base = load_experiment(variant.variant_of)
    first, other = base.signal["noise"], variant.signal["noise"]
    if variant.paper == "A":  # a variance in mN^2 there, a standard deviation in mN here
        printed = 1e3 * other["force_std_n"]
        assert (1e3 * first["force_std_n"]) ** 2 == pytest.approx(printed, rel=1e-3)
    else:  # a standard deviation in N there, a variance in N^2 here
        assert other["force_std_n"] ** 2 == pytest.approx(first["force_std_n"], rel=1e-3)
        if "jump" in first:
            jumps = first["jump"]["force_std_n"], other["jump"]["force_std_n"]
            assert jumps[1] ** 2 == pytest.approx(jumps[0], rel=1e-3)
    for key in ("time_step_s", "duration_s", "motion", "tissue"):
        assert variant.signal[key] == base.signal[key]
    for column in variant.columns:
        same = base.column(column.name)
        assert column.filter == same.filter
        assert column.parameters == same.parameters
        assert column.start_state == same.start_state


@pytest.mark.parametrize("name", available_experiments())
def test_no_plant_of_an_experiment_has_to_pull(name: str) -> None:
    signal = make_signal(load_experiment(name).signal, 1)
    assert np.min(signal.true_force) >= 0.0
    if load_experiment(name).signal["kind"] == "hunt_crossley":
        bare = adhesive_force(signal.true_displacement, signal.true_velocity, signal.parameters)
        np.testing.assert_array_equal(bare, signal.true_force)


def test_the_papers_filters_have_the_papers_law_and_ours_the_unilateral_one() -> None:
    for name in available_experiments():
        for column in load_experiment(name).columns:
            assert column.adhesive == (column.setting != "ours")
            if column.filter not in FILTERS:
                estimator = make_estimator(column, 0.0, 0.01)
                expected = "adhesive" if column.adhesive else "hunt_crossley"
                assert estimator.contact_model == expected


@pytest.mark.parametrize("name", ["b_table_1", "b_table_4", "b_table_5", "b_table_6"])
def test_the_literal_filters_of_paper_b_have_2n_equal_sigma_points(name: str) -> None:
    """Eq. 9 with a = 1: the centre has no weight, in the mean or in the covariance."""
    for column in load_experiment(name).columns:
        if column.setting == "paper":
            found = make_estimator(column, 0.0, 0.01).configuration
            assert (found["alpha"], found["beta"], found["kappa"]) == (1.0, 0.0, 0.0)


def test_the_folder_of_the_checkout_is_the_packages() -> None:
    assert (ROOT / "config/experiments").resolve() == experiment.EXPERIMENT_FOLDER.resolve()


def test_the_papers_figures_are_those_of_the_reference() -> None:
    shared = Path(os.environ.get("HC_SHARED_DATA", ROOT.parent / "shared/data")).parent
    reference = shared / "reference/paper_tables.yaml"
    if not reference.is_file():
        pytest.skip(f"{reference} is not here")
    ours = dict(published_papers())
    sources = ours.pop("sources")
    assert ours == yaml.safe_load(reference.read_text(encoding="utf-8"))
    assert set(sources) == set(ours)


def test_an_unknown_experiment_names_the_known_ones() -> None:
    with pytest.raises(ExperimentError, match=r"no experiment 'a_table_9'; known: a_table_1, "):
        load_experiment("a_table_9")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"colour": 1}, "unknown key 'colour'"),
        ({"columns": [{"name": "x", "setting": "best", "filter": "ukf"}]}, "must be one of paper"),
        (
            {
                "columns": [
                    {"name": "x", "setting": "paper", "filter": "ukf", "process_noise": [1.0]}
                ]
            },
            "process_noise of column 'x' has 1 numbers, must have 7",
        ),
        ({"columns": [{"name": "x", "setting": "paper"}]}, "a column is incomplete"),
        ({"columns": [{"name": "x", "setting": "ours", "filter": "ukf"}] * 2}, "the same name"),
    ],
)
def test_a_file_that_cannot_be_is_refused(
    change: dict[str, object],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    text = (experiment.EXPERIMENT_FOLDER / "a_table_1.yaml").read_text(encoding="utf-8")
    (tmp_path / "broken.yaml").write_text(
        yaml.safe_dump(yaml.safe_load(text) | change), encoding="utf-8"
    )
    monkeypatch.setattr(experiment, "EXPERIMENT_FOLDER", tmp_path)
    with pytest.raises(ExperimentError, match=message):
        load_experiment("broken")


def test_the_signal_is_the_contact_law_with_noise_that_jumps() -> None:
    settings = load_experiment("b_table_4").signal
    signal = make_signal(settings, 5)
    d, v = signal.true_displacement, signal.true_velocity
    assert np.allclose(np.gradient(d, signal.time_s)[1:-1], v[1:-1], atol=1e-3)
    for k in (10, 1234, 6000):
        force = 0.2 * d[k] ** 1.8 + 0.05 * d[k] ** 1.8 * np.sign(v[k]) * abs(v[k]) ** 1.05
        assert signal.true_force[k] == pytest.approx(force, rel=1e-12)
    noise = signal.force_n - signal.true_force
    before = signal.time_s <= 32.0
    assert np.std(noise[before]) == pytest.approx(0.036, rel=0.1)
    assert np.std(noise[~before]) == pytest.approx(0.576, rel=0.1)
    again, other = make_signal(settings, 5), make_signal(settings, 6)
    assert np.array_equal(signal.force_n, again.force_n)
    assert not np.array_equal(signal.force_n, other.force_n)


def test_no_force_without_contact() -> None:
    depth = np.array([-1.0, 0.0, 1.0])
    force = hunt_crossley_force(depth, np.full(3, -1.0), np.array([2.0, 0.5, 1.5, 1.0]))
    assert force.tolist() == [0.0, 0.0, 1.5]


def test_an_unknown_kind_of_signal_is_named() -> None:
    with pytest.raises(ValueError, match=r"signal\.kind = 'tape'"):
        make_signal({"kind": "tape"}, 1)
