"""The accuracy experiments in quick form: honest on simulated tissue and on recordings."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hc_evaluation import metrics
from hc_evaluation.accuracy import catalogue, measure, possible
from hc_evaluation.accuracy.bench import target
from hc_evaluation.accuracy.columns import COLUMNS
from hc_evaluation.accuracy.contacts import CONTACTS
from hc_evaluation.accuracy.measure import Setup, Task
from hc_evaluation.accuracy.misfit import MOTIONS, MisfitTask, misfit_contact, misfit_run
from hc_evaluation.accuracy.recorded import RecordingTask, recording_run
from hc_evaluation.accuracy.recordings import RECORDINGS, batch_fit, causal_fit, data_folder
from hc_evaluation.accuracy.run import EXPERIMENTS, run_accuracy
from hc_evaluation.accuracy.scenarios import simulate
from hc_evaluation.accuracy.simulated import quiet_rows
from hc_evaluation.accuracy.table import OLDER, markdown_tables, text_table, write_tables

needs_recordings = pytest.mark.skipif(
    data_folder() is None, reason="the recordings in ../shared/data are absent"
)
SEEDS = range(700, 706)
QUICK = ("reference", "soft_100hz", "tapping")  # one of each kind; the others are `slow`
CHANGED = ("reference_15_percent", "stiff_softer")


def columns(function, scenario, seeds=SEEDS):
    runs = [function(Task(Setup(), scenario, seed)) for seed in seeds]
    return {key: np.array([r[key] for r in runs]) for key in runs[0]}


@pytest.mark.parametrize(
    "scenario",
    [
        pytest.param(s, id=s.name, marks=[] if s.name in QUICK else [pytest.mark.slow])
        for s in catalogue.TISSUES
    ],
)
def test_quiet_tissue_is_found_near_the_bound_and_with_honest_uncertainty(scenario):
    runs = columns(measure.quiet_run, scenario, range(700, 704))
    row = quiet_rows([scenario], [runs])[0]
    # Four runs of four errors: the root mean square over the bound lies in a chi-square band.
    low, high = metrics.chi_square_band(16, 4)
    assert np.sqrt(np.mean(np.square(row["ratio"]))) < 1.5 * np.sqrt(high / 16)
    assert low / 16 * 4 * 0.5 < row["nees"] < high / 16 * 6
    assert 1.6 < row["nis"] < 2.4
    assert row["within"] > 0.95
    assert row["changes"] == 0


@pytest.mark.parametrize(
    "scenario",
    [
        pytest.param(s, id=s.name, marks=[] if s.name in CHANGED else [pytest.mark.slow])
        for s in catalogue.CHANGES[:4]
    ],
)
def test_changed_tissue_is_found_again(scenario):
    runs = columns(measure.change_run, scenario)
    assert np.median(runs["settling_s"]) < 0.5
    assert np.median(runs["error_after_2s"]) < 0.01
    assert np.all(runs["calls"] == 1)
    assert not np.any(runs["early_calls"])


@pytest.mark.parametrize("scenario", catalogue.NOISE_JUMPS[6:9], ids=lambda s: s.name)
def test_noisier_sensor_is_no_change(scenario):
    runs = columns(measure.noise_run, scenario)
    assert 1.6 < np.mean(runs["nis_after"]) < 2.4
    assert np.median(runs["worst_error"]) < 0.02
    assert not np.any(runs["changes"])


@pytest.mark.parametrize("scenario", catalogue.WEAK_MOTIONS, ids=lambda s: s.name)
def test_what_a_weak_motion_hides_is_told(scenario):
    runs = columns(measure.weak_run, scenario, range(700, 703))
    assert np.mean(runs["nees"]) < 12.0
    assert np.all(runs["free_drift"] < 1e-6)
    assert not np.any(runs["changes"])
    if scenario.name == "constant_velocity":  # only K + B v^p and n can be seen
        assert np.all(runs["identifiability_2"] > 0.99)
        assert np.all(runs["identifiability_3"] < 0.05)
        assert np.all(runs["deviation_1"] > 0.5)
    if scenario.name == "free_motion":
        assert max(np.max(runs[f"identifiability_{i}"]) for i in range(4)) == 0.0


@needs_recordings
@pytest.mark.parametrize("name", ["sine_soft", "sine_hard", "sine_horse_raw"])
def test_real_recordings_are_predicted_as_well_as_least_squares_does(name):
    recording = next(r for r in RECORDINGS if r.name == name)
    row = recording_run(RecordingTask(Setup(), recording, str(data_folder())))
    # The floor has the channels as they are logged, 31 ms out of step; so have its parameters.
    assert row["ratio"] < 1.1
    assert row["changes"] <= 1


def test_batch_fit_finds_the_tissue_and_the_causal_fit_ends_in_it():
    contact = simulate(replace(catalogue.REFERENCE, duration_s=4.0), 1)
    fit = batch_fit(contact.displacement, contact.velocity, contact.force_n)
    np.testing.assert_allclose(fit.parameters, catalogue.REFERENCE_TISSUE.as_array(), rtol=3e-3)
    assert fit.residual_rms == pytest.approx(0.010, rel=0.05)
    tissue = replace(catalogue.REFERENCE_TISSUE, velocity_exponent=1.0)
    contact = simulate(replace(catalogue.REFERENCE, tissue=tissue, duration_s=3.0), 1)
    signals = contact.time_s, contact.displacement, contact.velocity, contact.force_n
    causal = causal_fit(*signals, start_s=1.0, stride_s=0.5)
    assert np.all(np.isnan(causal[contact.time_s < 0.999]))
    np.testing.assert_allclose(causal[-1], tissue.as_array(), rtol=5e-3)


def test_a_target_is_met_inside_its_range_only():
    assert target("x", 1.0, 0.5, 1.5)["met"]
    assert not target("x", 1.6, 0.5, 1.5)["met"]
    assert not target("x", float("nan"), 0.5, 1.5)["met"]
    assert target("x", 1e9, low=0.0)["met"]


def test_unknown_experiments_and_no_seeds_are_refused():
    with pytest.raises(ValueError, match="'tissue' is not one of tissues"):
        run_accuracy(["tissue"])
    with pytest.raises(ValueError, match="seeds = 0"):
        run_accuracy(["noise"], seeds=0)


@pytest.fixture(scope="module")
def small_result():
    told = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hc_evaluation.accuracy.run.WORKERS", 1)
        result = run_accuracy(["excitation"], seeds=1, progress=lambda *step: told.append(step))
    assert told[-1] == ("excitation", 7, 7)
    return result


def test_tables_hold_every_row_and_target(small_result, tmp_path: Path):
    experiment = small_result["experiments"]["excitation"]
    text = text_table(small_result)
    for row in experiment["rows"]:
        assert row["scenario"] in text
    for entry in experiment["targets"]:
        assert entry["name"] in text
    document = tmp_path / "page.md"
    document.write_text("before\n<!-- accuracy excitation -->\nreplace me\n<!-- end -->\nafter")
    assert write_tables(small_result, document) == ("excitation",)
    page = document.read_text()
    assert page.startswith("before\n")
    assert page.endswith("<!-- end -->\nafter")
    assert "replace me" not in page
    assert "\n\n".join(markdown_tables("excitation", experiment).values()) in page
    write_tables(small_result, document)
    assert document.read_text() == page
    document.write_text("<!-- accuracy excitation -->\n")
    with pytest.raises(ValueError, match="no line <!-- end -->"):
        write_tables(small_result, document)


def test_the_table_of_all_experiments_keeps_its_origin_beside_an_ablation(tmp_path, small_result):
    document = tmp_path / "page.md"
    places = ("summary", "ablation", "excitation")
    document.write_text("".join(f"<!-- accuracy {p} -->\nold\n<!-- end -->\n" for p in places))
    ablation = {"names": ["tissues"], "rows": [], "targets": []}
    write_tables({**small_result, "experiments": {"ablation": ablation}}, document, "by one")
    assert document.read_text().startswith("<!-- accuracy summary -->\nold\n")
    write_tables(small_result, document, "by another")
    assert document.read_text().startswith("<!-- accuracy summary -->\nby another\n")
    # What others gave is not called measured by this command.
    with document.open("a") as page:
        page.write("<!-- accuracy tissues -->\nold\n<!-- end -->\n")
    write_tables(small_result, document, "by another")
    assert f"<!-- accuracy summary -->\n{OLDER}by another\n" in document.read_text()


def test_every_experiment_has_its_columns():
    assert set(COLUMNS) == set(EXPERIMENTS)


@pytest.mark.parametrize("motion", MOTIONS)
def test_contact_outside_the_law_is_reproducible_and_does_not_fit(motion):
    time, displacement, force = misfit_contact(motion, 7)
    for first, again in zip((time, displacement, force), misfit_contact(motion, 7), strict=True):
        np.testing.assert_array_equal(first, again)
    assert not np.array_equal(force, misfit_contact(motion, 8)[2])
    assert np.any(displacement < 0.0) == (motion != "sines")
    assert np.all(np.abs(force[displacement < -0.5]) < 0.05 * np.max(force))


def test_the_estimate_holds_where_the_contact_law_does_not_fit():
    runs = [misfit_run(MisfitTask(Setup(), "press", seed)) for seed in range(700, 708)]
    assert np.median([r["ratio"] for r in runs]) < 2.7
    assert not any(r["changes"] for r in runs)


@pytest.mark.parametrize(
    "seed",
    [
        # The zero found anew, and a pair of forces 14 N too low: at an unknown velocity they passed
        # for the tool's and took it to 126 mm/s; 73 N were foretold where 3 N were felt.
        100011,
        100037,  # a zero found, K guessed from a force at next to no depth: 10 times what was felt
        100043,  # K went on growing by its rate in the air, from 30 to 125
    ],
)
def test_an_arm_at_66_hz_foretells_no_force_that_was_never_felt(seed):
    readings = possible.arm_readings(seed)
    one_step, _ = possible.force_factors(readings, Setup().create().run(*readings))
    assert one_step < possible.LARGEST_FACTOR


def test_noise_in_the_displacement_is_no_speed_that_was_felt():
    # 0.1 mm/s with 4 um of noise at 1 kHz: differences of readings are up to 10 mm/s, at which a
    # damping that such a motion cannot show says anything.
    time, depth, force = CONTACTS["corners"][1](0, 100001)
    series = Setup().create().run(time, depth, force)
    assert possible.force_factors((time, depth, force), series)[1] < possible.LARGEST_FACTOR
