"""The force error one step ahead: one figure, whether a recording is estimated or comes live."""

import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hc_bringup.commands.estimate import summarise
from hc_bringup.force_error import SETTLING_S, one_step_error, root_mean_square, settled
from hc_bringup.statistics import EstimateStatistics
from hc_estimator import create_estimator
from hc_logger.recording import read_recording
from hc_msgs_py.units import METRE_IN_MM

SHARED = Path(os.environ.get("HC_SHARED_DATA", Path(__file__).parents[3] / "shared" / "data"))


def live_figures(recording, series):
    """What a run says of the messages that the node would have published."""
    statistics = EstimateStatistics()
    for i, (time_s, force_n) in enumerate(
        zip(recording.time_s.tolist(), recording.force_n.tolist(), strict=True)
    ):
        estimate = series[i]
        nanoseconds = round(time_s * 1e9)
        stamp = SimpleNamespace(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        statistics.add(
            SimpleNamespace(
                sequence=i,
                configuration_revision=1,
                header=SimpleNamespace(stamp=stamp),
                latency=1e-3,
                rejected=int(estimate.rejected),
                displacement=estimate.displacement / METRE_IN_MM,
                change_detected=estimate.change_detected,
                model_mismatch=estimate.model_mismatch,
                contact=estimate.contact,
                force_measured=force_n,
                force_predicted=estimate.force_predicted,
                innovation_force=float(estimate.innovation[1]),
            )
        )
    return statistics


def test_a_run_and_an_estimation_give_the_same_figure_with_a_late_displacement():
    path = SHARED / "palpation_sine_soft.csv"
    if not path.exists():
        pytest.skip(f"no {path}: set HC_SHARED_DATA")
    recording = read_recording(path)
    estimator = create_estimator("self_tuning_ukf", missing_readings=True)
    series = estimator.run(recording.time_s, recording.displacement_mm, recording.force_n)
    batch = summarise(estimator, recording, series, 1.0)
    live = live_figures(recording, series)
    assert batch["channel_delay"] < -0.02
    assert live.force_rmse_n == pytest.approx(batch["force_predicted_rmse_n"], rel=1e-3)
    assert live.force_aligned_rmse_n == pytest.approx(batch["force_aligned_rmse_n"], rel=1e-3)
    # The one step ahead includes the motion that the late displacement has not told yet.
    assert batch["force_predicted_rmse_n"] > 2.0 * batch["force_aligned_rmse_n"]


def test_one_step_ahead_knows_nothing_of_the_sample_itself():
    """Changing the last force changes its error by the same amount: nothing of it was used."""
    time_s = np.arange(0.0, 3.0, 0.002)
    depth = 2.0 - 2.0 * np.cos(4.0 * time_s)
    force = 0.5 * depth**1.5 * (1.0 + 0.05 * 8.0 * np.sin(4.0 * time_s))
    errors = []
    for change in (0.0, 0.25):
        changed = force.copy()
        changed[-1] += change
        estimator = create_estimator("self_tuning_ukf", channel_delay=-0.03)
        series = estimator.run(time_s, depth, changed)
        errors.append(one_step_error(changed, series.force_predicted)[-1])
    assert errors[1] - errors[0] == pytest.approx(0.25, abs=1e-12)


def test_the_first_second_of_contact_does_not_count():
    time_s = np.arange(0.0, 4.0, 0.5)
    touching = time_s >= 1.0
    assert time_s[settled(time_s, touching)].tolist() == [2.0, 2.5, 3.0, 3.5]
    short = (time_s >= 1.0) & (time_s <= 2.0)
    assert time_s[settled(time_s, short)].tolist() == [1.5, 2.0]
    assert not settled(time_s, touching & False).any()
    assert SETTLING_S == 1.0


def test_the_root_mean_square_leaves_out_what_is_not_there():
    assert root_mean_square(np.array([3.0, np.nan, -4.0])) == pytest.approx(np.sqrt(12.5))
    assert np.isnan(root_mean_square(np.array([np.nan])))
