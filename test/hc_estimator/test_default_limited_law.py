"""K and B that are given out are limited to what was felt, unless the law fits and is known."""

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


@pytest.mark.parametrize("zero", [-3.0, 2.0, 6.0])
def test_parameters_never_foretell_far_more_than_was_felt(zero, plant):
    """Where the tool was deepest and fastest: three times the largest force, unless it is known."""
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
        assert law[0] <= 3.0001 * largest, f"at {time[k]} s"
    assert asked > 50
