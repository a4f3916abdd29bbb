"""Statistics of a stream of estimates: quantiles, losses, force error, summaries."""

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hc_bringup import live
from hc_bringup.conclusion import conclude
from hc_bringup.errors import UserError
from hc_bringup.run_state import RunState
from hc_bringup.statistics import PARAMETERS, EstimateStatistics
from hc_bringup.summary import run_summary, run_text, to_json
from hc_bringup.terminal.numbers import NOTHING, engineering


def estimate(sequence: int, **fields: Any) -> Any:
    values = dict.fromkeys(PARAMETERS, 1.0)
    values |= {f"{name}_std": 0.1 for name in PARAMETERS}
    values |= {f"{name}_identifiability": 0.5 for name in PARAMETERS}
    flags = {"contact": True, "change_detected": False, "model_mismatch": False, "rejected": 0}
    numbers = {"latency": 1e-3, "innovation_force": 0.0, "displacement": 0.0, "force_measured": 0.0}
    numbers |= {"force_predicted": 0.0, "configuration_revision": 1}
    numbers |= {"channel_delay": 0.002, "channel_delay_std": 0.0001}
    numbers |= {"contact_position": 0.0, "contact_position_std": math.nan}
    numbers |= {"force_zero": 0.0, "force_zero_std": math.nan}
    stamp = SimpleNamespace(sec=sequence, nanosec=0)  # a sample a second
    header = SimpleNamespace(stamp=stamp)
    content = values | flags | numbers | {"header": header} | fields
    return SimpleNamespace(**content, sequence=sequence)


def test_gaps_in_the_sequence_are_losses() -> None:
    statistics = EstimateStatistics()
    for sequence in (5, 6, 9, 10):
        statistics.add(estimate(sequence))
    assert statistics.estimates == 4
    assert statistics.lost == 2


def test_estimates_of_two_estimators_are_said() -> None:
    """Regression: "121140 estimates of 121140 samples, lost ? (the sequence numbers ...)"."""
    state = RunState(EstimateStatistics(), 0.0, elapsed_s=1.0)
    for sequence in range(200):
        state.statistics.add(estimate(sequence))
        if sequence >= 100:
            state.statistics.add(estimate(sequence - 3))
    assert state.statistics.mixed
    assert live._lost(state) == "? (estimates of several estimators)"
    with pytest.raises(UserError, match="another estimator of the name estimator"):
        conclude(state, ["estimator"], None, as_json=True, with_latency=True)


def test_a_replay_that_loops_is_one_estimator() -> None:
    statistics = EstimateStatistics()
    for sequence in [*range(1500)] * 3:
        statistics.add(estimate(sequence))
    assert not statistics.mixed


def test_what_the_display_missed_is_not_lost() -> None:
    """Regression: a terminal that was blocked (Ctrl-S) counted its own loss as samples lost."""
    state = RunState(EstimateStatistics(), 0.0, elapsed_s=1.0, samples=104)
    for sequence in (0, 1, 2, 100, 103):
        state.statistics.add(estimate(sequence))
    assert live._lost(state) == "99"
    state.diagnostics["estimator"] = {"estimates": "102.0"}
    assert live._lost(state) == "2 (97 not seen here)"
    summary = run_summary(state, None)
    assert (summary["estimates"], summary["not_seen"], summary["lost"]) == (5, 97, 2)
    assert "97 more estimates were made while this display stood still" in run_text(summary)
    state.diagnostics["estimator"] = {"estimates": "3"}  # started again
    assert (state.unseen, live._lost(state)) == (0, "99")


def test_without_an_estimator_no_sample_is_lost() -> None:
    """Regression: of hc run master "0 estimates of 18103 samples in 18.1 s; lost 18103"."""
    state = RunState(EstimateStatistics(), 0.0, elapsed_s=18.1, samples=18103, estimating=False)
    summary = run_summary(state, None)
    assert (summary["lost"], summary["estimating"]) == (None, False)
    assert run_text(summary).startswith("18103 samples in 18.1 s, and no estimator\n")
    state.statistics.add(estimate(0))  # of one that was started otherwise
    assert run_text(run_summary(state, None)).startswith("1 estimates of 18103 samples")


def test_a_sequence_that_starts_again_is_a_restart_and_no_loss() -> None:
    statistics = EstimateStatistics()
    for sequence in (0, 1, 2, 0, 1, 2):
        statistics.add(estimate(sequence))
    assert statistics.lost == 0
    assert statistics.restarts == 1


def test_sequence_numbers_that_do_not_count_are_no_losses() -> None:
    """Random numbers once gave "lost 7e10"."""
    generator = np.random.default_rng(1)
    statistics = EstimateStatistics()
    for sequence in generator.integers(0, 2**63, 1000).tolist():
        statistics.add(estimate(sequence, header=estimate(0).header))
    assert statistics.lost == 0
    assert not statistics.counts
    unknown = RunState(statistics, 0.0, elapsed_s=1.0)
    assert run_summary(unknown, None)["lost"] is None
    assert "lost ? (the sequence numbers of the samples do not count)" in run_text(
        run_summary(unknown, None)
    )
    known = RunState(statistics, 0.0, elapsed_s=1.0, samples=1002)
    assert run_summary(known, None)["lost"] == 2


def test_why_samples_were_lost_is_told() -> None:
    statistics = EstimateStatistics()
    for sequence in (*range(100), *range(1600, 1700)):
        statistics.add(estimate(sequence, header=estimate(0).header))
    said = {"skipped": "1490", "pairing_unpaired": "10", "level": "1"}
    state = RunState(statistics, 0.0, elapsed_s=1.0, diagnostics={"estimator": said})
    summary = run_summary(state, None)
    assert (summary["lost"], summary["left_out"]) == (1500, {"skipped": 1490, "alone": 10})
    text = run_text(summary)
    assert "of these 1490 skipped, for more than input.maximum_backlog waited" in text
    assert "of these 10 of a sensor without the other" in text
    state = RunState(statistics, 0.0, elapsed_s=1.0, diagnostics={"estimator": {"skipped": "0"}})
    assert run_summary(state, None)["left_out"] == {}
    assert "of these" not in run_text(run_summary(state, None))


def test_samples_before_the_first_that_was_heard_are_told_apart() -> None:
    """Regression: "lost 1206" of a plan written by hand, whose rig began alone, without a why."""
    statistics = EstimateStatistics()
    for sequence in range(1206, 2000):
        statistics.add(estimate(sequence, header=estimate(0).header))
    state = RunState(statistics, 0.0, elapsed_s=1.0, samples=2000)
    summary = run_summary(state, None)
    assert (summary["lost"], summary["left_out"]) == (1206, {"before_the_first": 1206})
    said = run_text(summary)
    assert "of these 1206 before the first that was heard" in said
    assert "start_paused, expected_sample_subscribers and expected_estimate_subscribers" in said
    replayed = run_summary(state, None, with_latency=False)  # a bag may begin with any number
    assert replayed["left_out"] == {}
    state.samples = 794  # counted from the first that was heard
    assert run_summary(state, None)["left_out"] == {}


def test_one_jump_of_a_counter_is_a_restart() -> None:
    statistics = EstimateStatistics()
    for sequence in (*range(100), *range(10**9, 10**9 + 50)):
        statistics.add(estimate(sequence, header=estimate(0).header))
    assert (statistics.lost, statistics.restarts, statistics.since_restart) == (0, 1, 50)
    assert statistics.counts


def test_force_error_counts_used_samples_in_contact_after_the_first_second() -> None:
    statistics = EstimateStatistics()
    statistics.add(estimate(0, force_measured=99.0))
    errors = np.array([0.3, -0.4])
    for sequence, error in enumerate(errors, 1):
        statistics.add(
            estimate(
                sequence,
                force_measured=2.0 + error,
                force_predicted=2.0,
                innovation_force=0.5 * error,  # of a reading that was held back
            )
        )
    statistics.add(estimate(3, force_measured=50.0, contact=False))
    statistics.add(estimate(4, force_measured=math.nan, rejected=1))
    assert statistics.force_rmse_n == pytest.approx(np.sqrt(np.mean(errors**2)))
    assert statistics.force_aligned_rmse_n == pytest.approx(0.5 * statistics.force_rmse_n)
    assert statistics.rejected == {"not_finite": 1}


def test_a_force_beyond_all_numbers_ends_no_viewer() -> None:
    """Its square is no number: once an OverflowError in whoever watched the run."""
    statistics = EstimateStatistics()
    for sequence in range(3):
        statistics.add(estimate(sequence, force_predicted=-1e200, innovation_force=1e200))
    assert statistics.recent_force_rmse_n == math.inf
    assert engineering(statistics.recent_force_rmse_n, "N") == NOTHING
    assert statistics.force_aligned_rmse_n == math.inf
    state = RunState(statistics, 0.0, elapsed_s=2.0, samples=3)
    assert json.loads(to_json(run_summary(state, None)))


def state_after(sequences: list[int], samples: int | None) -> RunState:
    statistics = EstimateStatistics()
    for sequence in sequences:
        statistics.add(estimate(sequence, force_measured=0.01, innovation_force=0.01))
    return RunState(statistics, 0.0, elapsed_s=2.0, samples=samples, cpu_percent={"estimator": 9.0})


def test_summary_counts_what_was_lost_at_the_end() -> None:
    summary = run_summary(state_after([0, 1, 2], samples=5), "bag")
    assert (summary["samples"], summary["estimates"], summary["lost"]) == (5, 3, 2)


def test_what_the_recorder_missed_is_told_with_the_bags_that_it_made(capsys) -> None:
    """Regression: 19,215 messages short, and not a word; each of two runs named both bags."""
    state = state_after([0, 1, 2], samples=3)
    state.dropped |= {"/a/bag_2": 19_000, "/a/bag_3": 215}
    assert conclude(state, ["recorder"], Path("/a/bag"), as_json=False, with_latency=False) == Path(
        "/a/bag_2"
    )
    said = capsys.readouterr().out
    assert "not in the bag: 19215 messages" in said
    assert "bags: /a/bag_2, /a/bag_3" in said
    state.dropped.clear()
    assert conclude(state, [], Path("/a/bag"), as_json=False, with_latency=False) == Path("/a/bag")
    assert "not in the bag" not in capsys.readouterr().out


@pytest.mark.parametrize("said", ["", "inf", "nan", "1e400", "many", "12 ok"])
def test_a_node_of_others_by_the_name_of_ours_ends_no_run(said: str) -> None:
    """Regression: a diagnostic of a robot's own node `estimator` ended the run in an error."""
    state = state_after([0, 1, 2], samples=3)
    names = ("estimates", "skipped", "pairing_unpaired", "dropped", "file_bytes")
    state.diagnostics["estimator"] = dict.fromkeys(names, said)
    summary = run_summary(state, None)
    assert (summary["not_seen"], summary["left_out"]) == (0, {})


def test_summary_has_the_keys_of_the_design() -> None:
    summary = json.loads(to_json(run_summary(state_after([0, 1], samples=2), "bag")))
    for key in ("samples", "lost", "estimates", "duration_s", "force_rmse_n", "bag"):
        assert key in summary
    assert set(summary["latency_us"]) == {"p50", "p99", "max"}
    assert set(summary["parameters"]) == set(PARAMETERS)
    assert set(summary["parameters_std"]) == set(PARAMETERS)
    assert summary["latency_us"]["p50"] == pytest.approx(1000.0, rel=0.02)


def test_the_delay_of_the_last_estimate_is_told_in_seconds_and_in_words() -> None:
    state = state_after([0, 1], samples=2)
    summary = json.loads(to_json(run_summary(state, None)))
    assert (summary["channel_delay"], summary["channel_delay_std"]) == (0.002, 0.0001)
    assert "the force is late by 2.00 ± 0.10 ms" in run_text(run_summary(state, None))
    state.statistics.add(estimate(2, channel_delay=-0.003))
    assert "the displacement is late by 3.00 ± 0.10 ms" in run_text(run_summary(state, None))
    state.statistics.add(estimate(3, channel_delay=0.0001, channel_delay_std=0.0004))
    said = run_text(run_summary(state, None))
    assert "no delay between force and displacement is to be seen: 0.10 ± 0.40 ms" in said
    state.statistics.add(estimate(3, channel_delay=0.0, channel_delay_std=0.0217))
    said = run_text(run_summary(state, None))
    assert "whether force and displacement are out of step is open: 0.00 ± 21.70 ms" in said
    # Regression: of a delay that was given "± 0.00 ms" was said, as of one that was found.
    state.statistics.add(estimate(3, channel_delay=-0.006, channel_delay_std=0.0))
    said = run_text(run_summary(state, None))
    assert "the displacement is taken for 6.00 ms late, as was set (channel_delay)" in said
    state.statistics.add(estimate(3, channel_delay=0.0, channel_delay_std=0.0))
    said = run_text(run_summary(state, None))
    assert "the channels are taken to be in step, as was set (channel_delay)" in said
    state.statistics.add(estimate(4, channel_delay=0.0, channel_delay_std=math.nan))
    summary = json.loads(to_json(run_summary(state, None)))
    assert (summary["channel_delay"], summary["channel_delay_std"]) == (0.0, None)
    assert " is late by " not in run_text(run_summary(state, None))


def test_zeros_that_were_found_are_told_in_mm_and_n_and_in_words() -> None:
    state = state_after([0, 1], samples=2)
    found = {"contact_position": -1.84e-4, "contact_position_std": 1.6e-5, "force_zero": 0.012}
    state.statistics.add(estimate(2, **found))
    summary = json.loads(to_json(run_summary(state, None)))
    assert summary["contact_position"] == pytest.approx(-0.184)
    assert summary["contact_position_std"] == pytest.approx(0.016)
    assert (summary["force_zero"], summary["force_zero_std"]) == (0.012, None)
    said = run_text(run_summary(state, None))
    assert "contact begins at -0.184 ± 0.016 mm and the force reads 12 mN without contact" in said


def test_summary_of_a_run_without_any_estimate_is_valid_json_and_text() -> None:
    summary = run_summary(RunState(EstimateStatistics(), 0.0), None)
    assert json.loads(to_json(summary))["parameters"]["stiffness"] is None
    text = run_text(summary)
    assert "0 estimates of 0 samples" in text
    assert "nan" not in text


@pytest.mark.parametrize("age_s", [0.0003, 1.8e9])
def test_the_age_of_stamps_of_a_simulation_is_no_latency(age_s: float) -> None:
    """Regression: "p50 1000000000000000 us" of stamps that count from the start."""
    state = RunState(EstimateStatistics(), 0.0, samples=13)
    for sequence in range(13):
        state.statistics.add(estimate(sequence, latency=age_s))
    summary = run_summary(state, None)
    told = "of another clock" if age_s > 1.0 else "p50 "
    assert f"stamp to estimate: {told}" in run_text(summary).replace("the stamps are ", "")


def test_how_well_the_surface_is_known_is_told_of_the_last_contact() -> None:
    """Regression: K +- 0.5 %, and "contact begins at 0.0 +- 1.1 mm", after 5 s in the air."""
    statistics = EstimateStatistics()
    statistics.add(estimate(0, contact_position_std=1e-5, force_zero_std=0.02))
    air = {"contact": False, "contact_position_std": 1e-3, "force_zero_std": 0.01}
    statistics.add(estimate(1, **air))
    zeros = statistics.zeros()
    assert zeros["contact_position_std"] == pytest.approx(0.01)
    assert zeros["force_zero_std"] == pytest.approx(0.01)  # in the air it is known better
    # After a tare the contact before it says nothing of the new zero.
    statistics.add(estimate(2, **air, configuration_revision=2))
    assert statistics.zeros()["contact_position_std"] == pytest.approx(1.0)


def test_a_force_before_the_first_displacement_is_no_fault_of_a_sensor() -> None:
    """Regression: "rejected 1 not_finite" of a robot whose readings all were finite."""
    state = state_after([0, 1, 2], samples=3)
    assert "not_finite" not in run_text(run_summary(state, None))
    state.statistics.rejected["not_finite"] = 1
    said = run_text(run_summary(state, None))
    assert (
        "rejected 1 not_finite\nnot_finite: a reading that is no finite number, or a force" in said
    )


def test_stamps_of_another_clock_make_no_latency() -> None:
    """Regression: "p99 1000000000000000 us" after a driver that came back with stamps of 1970.

    And "p50 0 us" where its clock was an hour ahead.
    """
    state = RunState(EstimateStatistics(), 0.0, samples=30)
    for sequence in range(10):
        state.statistics.add(estimate(sequence, latency=-3600.0))
    summary = run_summary(state, None)
    assert math.isnan(summary["latency_us"]["p50"])
    assert "stamp to estimate: the stamps are of another clock" in run_text(summary)
    for sequence in range(10, 20):
        state.statistics.add(estimate(sequence, latency=1.8e9))
    for sequence in range(20, 30):
        state.statistics.add(estimate(sequence))
    summary = run_summary(state, None)
    assert (summary["foreign_stamps"], state.statistics.latency.count) == (20, 10)
    assert summary["latency_us"]["max"] == pytest.approx(1000.0, rel=0.02)
    said = run_text(summary)
    assert "max 1000 us, without 20 samples stamped by another clock" in said
