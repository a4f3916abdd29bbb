"""Readings that come late: whatever the order of arrival, the numbers are those of the right."""

import numpy as np
import pytest

import hc_estimator as hc

PARAMETERS = (0.2, 0.009, 1.8, 1.05)
LATE = {"missing_readings": True, "reorder_window": 0.05}


def two_channels(plant, seconds=2.0, pose_rate=250.0, wrench_rate=500.0):
    """Pose and wrench, each at stamps of its own: time, displacement or NaN, force or NaN."""
    pose = np.arange(round(seconds * pose_rate)) / pose_rate
    wrench = np.arange(round(seconds * wrench_rate)) / wrench_rate + 0.37e-3
    d, _ = plant.noisy(*plant.motion(pose), seed=3)
    _, force = plant.noisy(wrench, plant.force(*plant.motion(wrench), *PARAMETERS), seed=4)
    time = np.concatenate([pose, wrench])
    order = np.argsort(time, kind="stable")
    d = np.concatenate([d, np.full(wrench.size, np.nan)])[order]
    force = np.concatenate([np.full(pose.size, np.nan), force])[order]
    return time[order], d, force


def arrival(time, d, seed, latest):
    """Order in which the readings arrive: poses late by up to `latest`, each by its own time."""
    rng = np.random.default_rng(seed)
    delay = np.where(np.isnan(d), 0.0, rng.uniform(0.0, latest, time.size))
    delay[0] = 0.0  # nothing can be used before the first pose
    return np.argsort(time + delay, kind="stable")


def numbers(series):
    return np.column_stack(
        [series.parameters, series.parameters_std, series.displacement, series.force_reconstructed]
    )


@pytest.mark.parametrize("filter_name", ["self_tuning_ukf", "ukf", "sir_pf"])
@pytest.mark.parametrize("pieces", [1, 7, 10_000], ids=["run", "pieces", "step"])
def test_late_readings_within_the_window_change_no_bit(filter_name, pieces, plant):
    time, d, force = two_channels(plant, seconds=0.6 if filter_name == "sir_pf" else 2.0)
    order = arrival(time, d, 5, 0.03)
    assert np.mean(np.diff(time[order]) < 0.0) > 0.2  # most poses are late
    in_order = hc.create_estimator(filter_name, **LATE)
    expected = in_order.run(time, d, force)
    late = hc.create_estimator(filter_name, **LATE)
    parts = [
        late.run(time[k], d[k], force[k]) for k in np.array_split(order, min(pieces, time.size))
    ]
    rejected = np.concatenate([part.rejected for part in parts])
    np.testing.assert_array_equal(rejected, expected.rejected[order])
    assert late.state()["memory"] == in_order.state()["memory"]
    np.testing.assert_array_equal(numbers(parts[-1])[-1], numbers(expected)[-1])


def test_a_reading_beyond_the_window_is_refused_and_changes_nothing(plant):
    time, d, force = two_channels(plant)
    estimator = hc.create_estimator("self_tuning_ukf", **LATE)
    estimator.run(time, d, force)
    before = estimator.state()["memory"]
    late = estimator.step(time[-1] - 0.06, 3.0, None)
    assert late.rejected is hc.Rejection.TIME_BACKWARD
    after = estimator.state()["memory"]
    for name in set(before) - {"clock"}:  # which counts how many came
        if name == "change":
            continue  # whether one was detected is told of the present sample
        assert after[name] == before[name], name


def test_a_late_reading_that_is_nonsense_is_refused_in_its_place(plant):
    time, d, force = two_channels(plant)
    clean = hc.create_estimator("self_tuning_ukf", **LATE)
    clean.run(time, d, force)
    dirty = hc.create_estimator("self_tuning_ukf", **LATE)
    dirty.run(time[:800], d[:800], force[:800])
    assert dirty.step(time[799] - 0.0101, 5000.0, None).rejected is hc.Rejection.OUT_OF_RANGE
    dirty.run(time[800:], d[800:], force[800:])
    assert dirty.state()["memory"]["rows"] == clean.state()["memory"]["rows"]


def pose_at(at, time, d):
    """Where the tool was, by the poses around a time."""
    known = ~np.isnan(d)
    return float(np.interp(at, time[known], d[known]))


@pytest.mark.parametrize("filter_name", ["self_tuning_ukf", "ukf"])
def test_what_was_reconfigured_holds_after_a_late_reading(filter_name, plant):
    """Regression of 2026-11-26: the memory gone back to brought the noise of before with it."""
    time, d, force = two_channels(plant)
    estimator = hc.create_estimator(filter_name, noise_adaptation="fixed", **LATE)
    estimator.run(time[:1000], d[:1000], force[:1000])
    estimator.reconfigure(force_noise_std=0.5, displacement_noise_std=0.1)
    at = time[999] - 0.0101
    late = estimator.step(at, pose_at(at, time, d), None)
    assert late.rejected is hc.Rejection.ACCEPTED
    series = estimator.run(time[1000:], d[1000:], force[1000:])
    np.testing.assert_allclose(series.displacement_noise_std, 0.1)
    assert (series.force_noise_std >= 0.5 * (1.0 - 1e-12)).all()


def test_a_delay_that_is_given_holds_after_a_late_reading(plant):
    time, d, force = two_channels(plant)
    estimator = hc.create_estimator("self_tuning_ukf", **LATE)
    estimator.run(time[:1000], d[:1000], force[:1000])
    estimator.reconfigure(channel_delay=0.01)
    at = time[999] - 0.0101
    assert estimator.step(at, pose_at(at, time, d), None).rejected is hc.Rejection.ACCEPTED
    assert estimator.run(time[1000:], d[1000:], force[1000:]).channel_delay[-1] == 0.01


def test_channels_keep_what_was_reconfigured_as_well(plant):
    time, d, force = two_channels(plant)
    array = hc.EstimatorArray("ukf", 2, noise_adaptation="fixed", **LATE)
    array.run(time[:1000], np.tile(d[:1000], (2, 1)), np.tile(force[:1000], (2, 1)))
    array.reconfigure(force_noise_std=0.5)
    at = time[999] - 0.0101
    array.step([at, time[1000]], [pose_at(at, time, d), np.nan], [np.nan, force[1000]])
    after = array.step(time[1001], [d[1001]] * 2, [force[1001]] * 2)
    np.testing.assert_allclose(after.force_noise_std, 0.5)


def test_a_restored_estimator_goes_back_as_far_as_its_configuration_says(plant):
    """Regression of 2026-11-26: it kept to the window of before, whatever was restored."""
    time, d, force = two_channels(plant)
    first = hc.create_estimator("self_tuning_ukf", **LATE)
    first.run(time[:1000], d[:1000], force[:1000])
    other = hc.create_estimator("self_tuning_ukf")
    other.restore(first.state())
    assert other.configuration["reorder_window"] == LATE["reorder_window"]
    for estimator in (first, other):
        estimator.restore(first.state())
        estimator.run(time[1000:1100], d[1000:1100], force[1000:1100])
    at = time[1099] - 0.0101
    late = [e.step(at, pose_at(at, time, d), None).rejected for e in (first, other)]
    assert late == [hc.Rejection.ACCEPTED] * 2
    strict = hc.create_estimator("self_tuning_ukf", missing_readings=True)
    strict.run(time[:1000], d[:1000], force[:1000])
    other.restore(strict.state())
    other.run(time[1000:1100], d[1000:1100], force[1000:1100])
    late = other.step(at, pose_at(at, time, d), None)
    assert late.rejected is hc.Rejection.TIME_BACKWARD


@pytest.mark.parametrize("step_by_step", [False, True], ids=["run", "step"])
def test_late_readings_are_used_again_after_the_clock_was_set_back(step_by_step, plant):
    """None was, until the stamps were where they had been, and every sample was kept till then."""
    time, d, force = two_channels(plant)
    estimator = hc.create_estimator("ukf", **LATE)
    estimator.run(time + 100.0, d, force)
    if step_by_step:
        for sample in zip(time + 10.0, d, force, strict=True):
            estimator.step(*sample)
    else:
        estimator.run(time + 10.0, d, force)
    kept = sum(sum(map(len, point.since)) for point in estimator._late._checkpoints)
    assert kept < 0.25 * len(time)
    at = time[-1] - 0.0202
    late = estimator.step(at + 10.0, pose_at(at, time, d), None)
    assert late.rejected is hc.Rejection.ACCEPTED


def without_poses(time, d, force, away, silent):
    """Leave the poses of a time out, and all readings of another one."""
    kept = ~((time >= away[0]) & (time < away[1]) & ~np.isnan(d))
    kept &= ~((time >= silent[0]) & (time < silent[1]))
    return time[kept], d[kept], force[kept]


@pytest.mark.parametrize("step_by_step", [False, True], ids=["run", "step"])
@pytest.mark.parametrize(
    ("away", "silent"),
    [((1.0, 1.1), (1.0, 1.07)), ((0.8, 1.5), (0.0, 0.0)), ((0.0, 0.03), (0.0, 0.0))],
    ids=["after silence", "forces went on", "at the start"],
)
def test_forces_that_waited_for_a_late_displacement_are_used(away, silent, step_by_step, plant):
    """The first pose after a gap came later than forces younger than it: those were lost."""
    time, d, force = without_poses(*two_channels(plant), away, silent)
    delay = np.where(np.isnan(d) | (time < away[1]) | (time > away[1] + 0.03), 0.0, 0.02)
    order = np.argsort(time + delay, kind="stable")
    in_order = hc.create_estimator("self_tuning_ukf", **LATE)
    expected = in_order.run(time, d, force)
    assert np.count_nonzero(expected.rejected) >= 10  # there was nothing to use them with
    late = hc.create_estimator("self_tuning_ukf", **LATE)
    if step_by_step:
        for at in order:
            late.step(time[at], d[at], force[at])
    else:
        late.run(time[order], d[order], force[order])
    assert late.state()["memory"]["rows"] == in_order.state()["memory"]["rows"]
    assert late.state()["memory"] == in_order.state()["memory"]


def test_a_stamp_from_far_ahead_that_was_refused_does_not_end_the_going_back(plant):
    time, d, force = two_channels(plant)
    estimator = hc.create_estimator("ukf", **LATE)
    for i in range(1000):
        estimator.step(time[i], d[i], force[i])
    for stamp in (1e6, np.inf):  # alone after so long a time it has no displacement to go with
        assert estimator.step(stamp, None, 1.0).rejected is hc.Rejection.NOT_FINITE
    for i in range(1000, len(time)):
        estimator.step(time[i], d[i], force[i])
    at = time[-1] - 0.0202
    late = estimator.step(at, pose_at(at, time, d), None)
    assert late.rejected is hc.Rejection.ACCEPTED


def test_what_is_kept_while_no_displacement_comes_is_bounded(plant):
    """All samples of such a time were, for as long as it lasted."""
    time, d, force = two_channels(plant)
    estimator = hc.create_estimator("ukf", **LATE)
    estimator.run(time, d, force)
    later = time[-1] + 1.0 + np.arange(2000) / 500.0
    for part in np.array_split(later, 100):
        estimator.run(part, np.full(part.size, np.nan), np.ones(part.size))
    kept = sum(sum(map(len, point.since)) for point in estimator._late._checkpoints)
    assert kept < 200
