"""Time shift, force zero and contact position found between the channels."""

from dataclasses import replace

import numpy as np
import pytest

from hc_estimator import create_estimator
from hc_estimator.contact.arrays import hunt_crossley_force
from hc_evaluation.accuracy import catalogue
from hc_evaluation.accuracy.recordings import RECORDINGS, data_folder, load
from hc_evaluation.accuracy.scenarios import simulate
from hc_evaluation.accuracy.separation import SEPARATIONS
from hc_evaluation.channels import _Fit, diagnose_channels, evenly_spaced
from hc_sim_rig import Rig, load_scenario

needs_recordings = pytest.mark.skipif(
    data_folder() is None, reason="the recordings in ../shared/data are absent"
)


@pytest.mark.parametrize("scenario", catalogue.CHANNEL_FAULTS, ids=lambda s: s.name)
def test_finds_the_fault_that_was_put_in_and_the_tissue_behind_it(scenario):
    contact = simulate(scenario, 3)
    found = diagnose_channels(contact.time_s, contact.displacement_mm, contact.force_n)
    assert abs(found.delay_s - scenario.force_delay_s) < max(4 * found.delay_std_s, 2e-4)
    assert abs(found.zero_n - scenario.force_zero_n) < 4 * found.zero_std_n
    assert abs(found.contact_mm - scenario.contact_position_mm) < 4 * found.contact_std_mm
    np.testing.assert_allclose(found.parameters, scenario.tissue.as_array(), rtol=0.08)
    expected = [
        name
        for name, value in (
            ("delay", scenario.force_delay_s),
            ("zero", scenario.force_zero_n),
            ("contact", scenario.contact_position_mm),
        )
        if value != 0.0
    ]
    assert list(found.clear_faults) == expected
    assert found.residual_rms_n <= found.residual_rms_without_n * 1.001


@needs_recordings
@pytest.mark.parametrize(
    ("name", "delay", "contact"),
    [
        ("sine_soft", -0.030, None),
        ("sine_horse_raw", -0.030, None),
        ("sine_horse_aligned", 0.0, None),
        ("press_triangle_unzeroed", None, 6.15),
    ],
)
def test_finds_what_is_known_of_the_recordings(name, delay, contact):
    """30 ms between the channels; contact at 6.0 to 6.3 mm (data/README.md)."""
    recording = next(r for r in RECORDINGS if r.name == name)
    found = diagnose_channels(*load(data_folder(), recording))
    if delay is not None:
        assert found.delay_s == pytest.approx(delay, abs=0.004)
    if contact is not None:
        assert found.contact_mm == pytest.approx(contact, abs=0.2)


@pytest.mark.parametrize(
    "x", [(-1.5, -4.8, 1.8, 1.05, 0.004, 0.02, 0.3), (0, -2, 3, 0.7, -0.03, -1, 1)]
)
def test_the_slopes_of_the_fit_are_its_derivatives(x):
    time_s = np.arange(0.0, 3.0, 0.002)
    depth = 2.0 + 1.2 * np.sin(9.0 * time_s) + 0.6 * np.sin(23.0 * time_s)
    fit = _Fit(time_s, depth, depth**1.8, 0.06)
    x = np.array(x, dtype=float)
    slopes = fit._slopes(x)
    apart = fit._misfit(x) + fit._measured - x[5] <= 0.0  # at its edge the law has a corner
    for i in range(7):
        step = np.zeros(7)
        step[i] = 1e-6
        numerical = (fit._misfit(x + step) - fit._misfit(x - step)) / 2e-6
        error = np.where(apart, 0.0, slopes[:, i] - numerical)
        assert np.quantile(np.abs(error), 0.995) < 1e-4 * (1.0 + np.max(np.abs(numerical)))


def test_too_little_is_refused_with_a_reason():
    with pytest.raises(ValueError, match="10 samples"):
        diagnose_channels(np.arange(10.0), np.zeros(10), np.zeros(10))
    with pytest.raises(ValueError, match="force span of 0 N"):
        diagnose_channels(np.arange(100.0), np.arange(100.0), np.ones(100))


@pytest.mark.parametrize(("seed", "delay"), [(100_001, 0.0025), (100_004, 0.015), (100_004, 0.002)])
def test_a_delay_between_two_samples_is_found_in_spite_of_noise_in_the_displacement(seed, delay):
    """A spline through noisy samples has its noisiest slope at the samples: 1 to 8 ms off."""
    scenario = replace(catalogue.random_scenario(seed), force_delay_s=delay)
    contact = simulate(scenario, seed)
    found = diagnose_channels(contact.time_s, contact.displacement_mm, contact.force_n)
    assert found.delay_s == pytest.approx(delay, abs=1.5e-3)


def test_gaps_are_not_filled_up_until_the_memory_is_full():
    """Regression: a night between two recordings in one file took gigabytes in `hc doctor`."""
    time_s = np.arange(2000) * 1e-3
    values = np.sin(time_s)
    some = evenly_spaced(np.where(time_s < 1.0, time_s, time_s + 5.0), values, values)
    assert len(some[0]) == pytest.approx(7000, abs=1)
    night = np.where(time_s < 1.0, time_s, time_s + 40_000.0)
    with pytest.raises(ValueError, match="mostly gaps"):
        evenly_spaced(night, values, values)
    with pytest.raises(ValueError, match="no times of measurement"):
        evenly_spaced(time_s * 1e-310, values, values)


@pytest.mark.parametrize("seed", [100_014, pytest.param(100_034, marks=pytest.mark.slow)])
def test_the_default_filter_takes_no_small_delay_from_a_few_windows(seed):
    """Regression: where the tissue lets go, four windows passed for five deviations from none."""
    scenario = next(s for s in SEPARATIONS if s.name == "viscous_500hz")
    contact = simulate(scenario, seed)
    readings = contact.time_s, contact.displacement_mm, contact.force_n
    series = create_estimator("self_tuning_ukf").run(*readings)
    assert np.all(series.channel_delay == 0.0)


@pytest.mark.parametrize("scenario", ["indentation", "relaxation", "lump", "teleoperation"])
def test_slow_presses_and_tissue_that_relaxes_or_varies_are_no_fault_of_the_channels(scenario):
    """Regression: "26.5 ± 1.4 ms late", "100.0 ± 19.9 ms late", a contact position off."""
    series = Rig(load_scenario(scenario)).run(20.0)
    every_fourth = (series.time_s[::4], series.displacement_mm[::4], series.force_n[::4])
    assert diagnose_channels(*every_fourth).clear_faults == ()


@pytest.mark.parametrize("delay_s", [0.0, 0.02])
def test_a_slow_pose_with_noise_beside_a_fast_wrench_gives_the_delay(delay_s):
    """Regression: 1.8 ms off with a deviation of 0.2 ms, as `hc setup` told of a robot."""
    generator = np.random.default_rng(0)

    def motion(at):
        slow, fast = 2.2 * at, 11.0 * at
        depth = 0.5 - 3.5 * np.cos(slow) + 0.2 * np.sin(fast)
        return depth, 7.7 * np.sin(slow) + 2.2 * np.cos(fast)

    time_s = np.arange(0.0, 14.0, 0.002)
    force = hunt_crossley_force(*motion(time_s - delay_s), np.array([0.5, 0.05, 1.5, 1.0]))
    force = force + 0.02 * generator.standard_normal(time_s.size)
    poses = np.arange(0.0, 14.0, 0.008)
    depth = motion(poses)[0] + 0.005 * generator.standard_normal(poses.size)
    found = diagnose_channels(time_s, np.interp(time_s, poses, depth), force)
    assert abs(found.delay_s - delay_s) < min(4.0 * found.delay_std_s, 1e-3)
    np.testing.assert_allclose(found.parameters, [0.5, 0.05, 1.5, 1.0], rtol=0.01)
