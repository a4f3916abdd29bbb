"""A reading that is wrong once is refused, and nothing that looks at raw readings takes it.

Regression of 2026-11-29: one reading that was 3 mm off bent the points of the grid about it. The
finder of the delay found 10 to 40 ms where there were none, and K was up to 14 deviations off.
Where the force is late, displacements are held back, and the gate comes to them only after the
grid: K was up to 4.6 % off. A single force that is wrong left a delay known to 4.4 ms, not 0.7.
"""

import numpy as np
import pytest

import hc_estimator as hc

TISSUE = np.array([0.4, 0.01, 1.5, 1.0])
RATE_HZ, SECONDS = 500.0, 12.0
FIRST = 200  # readings before which none is wrong


def spoilt(plant, wrong, size, seed=8, late=0.0, force_size=0.0):
    """Series of a contact with readings that are off by `size` [mm], `force_size` [N] at times.

    The force is late by `late` [s].
    """
    rng = np.random.default_rng(seed)
    time = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    depth, _ = plant.motion(time)
    force = plant.force(*plant.motion(time - late), *TISSUE)
    displacement = depth + 0.002 * rng.standard_normal(time.size)
    displacement[wrong] += size
    force = force + 0.005 * rng.standard_normal(time.size)
    force[wrong] += force_size
    return hc.create_estimator("self_tuning_ukf").run(time, displacement, force)


@pytest.mark.parametrize("size", [3.0, -3.0, 30.0])
@pytest.mark.parametrize("seed", range(3))
def test_no_delay_is_invented_for_wrong_displacements(plant, seed, size):
    wrong = np.random.default_rng(seed).integers(FIRST, round(SECONDS * RATE_HZ), 20)
    series = spoilt(plant, wrong, size)
    assert np.all(series.rejected[wrong] != 0)
    assert not np.any(series.channel_delay)
    assert not np.any(series.model_mismatch[2000:])
    error = (series.parameters[-1] - TISSUE) / series.parameters_std[-1]
    assert np.max(np.abs(error)) < 4.0


def test_two_wrong_displacements_in_a_row_are_outliers_as_well(plant):
    wrong = np.arange(700, 5500, 400)
    series = spoilt(plant, np.r_[wrong, wrong + 1], 3.0)
    assert not np.any(series.channel_delay)
    assert series.parameters[-1, 0] == pytest.approx(TISSUE[0], rel=0.003)


@pytest.mark.parametrize("late", [0.02, -0.02])
@pytest.mark.parametrize(("size", "force_size"), [(3.0, 0.0), (0.0, 3.0)])
def test_a_delay_is_as_well_known_with_wrong_readings_as_without(plant, late, size, force_size):
    wrong = np.random.default_rng(5).integers(FIRST, round(SECONDS * RATE_HZ), 20)
    sound = spoilt(plant, wrong, 0.0, late=late)
    series = spoilt(plant, wrong, size, late=late, force_size=force_size)
    second_half = slice(round(0.5 * SECONDS * RATE_HZ), None)
    assert np.max(np.abs(series.channel_delay[second_half] - late)) < 0.002
    assert series.channel_delay_std[-1] < 1.5 * sound.channel_delay_std[-1]
    assert not np.any(series.model_mismatch[second_half])
    error = np.abs(series.parameters[second_half, 0] / TISSUE[0] - 1.0)
    assert np.max(error) < 0.005 + np.max(np.abs(sound.parameters[second_half, 0] / TISSUE[0] - 1))


def test_no_delay_is_doubted_no_more_for_wrong_forces(plant):
    wrong = np.random.default_rng(5).integers(FIRST, round(SECONDS * RATE_HZ), 20)
    sound = spoilt(plant, wrong, 0.0)
    series = spoilt(plant, wrong, 0.0, force_size=-3.0)
    assert series.channel_delay_std[-1] < 1.5 * sound.channel_delay_std[-1]
