"""Which force is expected of the next reading: that of the law, or the last one."""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model.hypotheses import FRESH

RATE_HZ = 66.0
TISSUE = (0.3, 0.008, 1.4, 1.0)


def arm_readings(plant, seed, zero):
    """Palpation of an organ that breathes, under a zero that is off by some millimetres."""
    draw = np.random.default_rng(seed)
    time = np.arange(round(20.0 * RATE_HZ)) / RATE_HZ
    depth = np.full_like(time, draw.uniform(1.0, 2.5))
    for frequency, largest in ((0.2, 1.2), (0.6, 1.2), (1.2, 0.6)):
        phase = draw.uniform(0.0, 2.0 * np.pi)
        depth += draw.uniform(0.4, 1.0) * largest * np.sin(2.0 * np.pi * frequency * time + phase)
    force = plant.force(depth, np.gradient(depth, time), *TISSUE)
    surface = np.sin(2.0 * np.pi * 0.22 * time + draw.uniform(0.0, 6.0)) - 0.05 * time
    displacement = depth + surface + zero + 0.1 * draw.standard_normal(time.size)
    return time, displacement, force + 0.02 * draw.standard_normal(time.size)


def worst_second(time, force, predicted):
    """Largest RMS error of a second over that of the last reading held."""
    second = np.floor(time).astype(int)[1:]
    error, held = (force - predicted)[1:], np.diff(force)
    ratios = []
    for k in range(1, second[-1]):
        asked = (second == k) & np.isfinite(error)
        ratios.append(np.sqrt(np.mean(error[asked] ** 2) / np.mean(held[asked] ** 2)))
    return max(ratios)


@pytest.mark.parametrize("zero", [-3.0, 2.0, 6.0])
def test_no_second_is_much_worse_than_the_last_reading(zero, plant):
    worst = {}
    for kind in (True, False):
        worst[kind] = []
        for seed in range(4):
            readings = arm_readings(plant, seed, zero)
            estimator = hc.create_estimator("self_tuning_ukf", expect_last_force=kind)
            series = estimator.run(*readings)
            worst[kind].append(worst_second(readings[0], readings[2], series.force_predicted))
    assert max(worst[True]) < 2.0
    assert max(worst[False]) > max(worst[True])


@pytest.mark.parametrize("zero", [-3.0, 2.0, 6.0])
def test_a_pair_of_outliers_is_not_expected_to_go_on(zero, plant):
    for seed in range(4):
        time, displacement, force = arm_readings(plant, seed, zero)
        largest = force.max()
        for start in (150, 400, 900):
            force[start : start + 2] += 15.0
        series = hc.create_estimator("self_tuning_ukf").run(time, displacement, force)
        assert np.nanmax(np.abs(series.force_predicted[66:])) < 3.0 * largest


def test_a_law_that_is_known_is_expected(plant):
    """Taps on a tissue that is known: the first reading of a touch is foretold as well."""
    time = np.arange(4000) / 200.0
    d, v = plant.motion(time, plant.TAPPING, 0.5)
    force = plant.force(d, v, 0.5, 0.02, 1.5, 1.0)
    d, force = plant.noisy(d, force, 3)
    predicted = {}
    for kind in (True, False):
        estimator = hc.create_estimator("self_tuning_ukf", expect_last_force=kind)
        predicted[kind] = estimator.run(time, d, force).force_predicted
    late = time > 5.0
    assert np.mean(predicted[True][late] == predicted[False][late]) > 0.99


@pytest.mark.parametrize("zero", [-3.0, 2.0, 6.0])
def test_parameters_never_foretell_far_more_than_was_felt(zero, plant):
    """Where the tool was deepest and fastest: four times the largest force, unless it is known."""
    time, displacement, force = arm_readings(plant, 1, zero)
    estimator = hc.create_estimator("self_tuning_ukf")
    asked = 0
    for k in range(time.size):
        estimate = estimator.step(time[k], displacement[k], force[k])
        memory = estimator._memory[0]
        tool, noise = memory["tool"], np.sqrt(memory["sensor_noise"][1])
        row = memory["rows"][FRESH if memory["change"]["leads"] else memory["judge"]["chosen"]]
        known = row["model_error"] == 0.0 and max(np.diag(row["covariance"])[2:4]) < 0.2**2
        if tool["known_time"] <= 0.1 or known:
            continue
        asked += 1
        depth = tool["deepest"] + memory["onset"]["zero"][0] - estimate.contact_position
        largest = max(tool["largest_force"], 10.0 * noise)
        law = plant.force(np.array([depth]), np.array([tool["fastest"]]), *estimate.parameters)
        assert law[0] <= 4.0001 * largest, f"at {time[k]} s"
    assert asked > 50
