"""Tissues and sensors of other scales: forces from 10 uN on, depths from 0.1 to 50 mm, Unix stamps.

The oracle is invariance: the contact law is linear in K and B, so that forces times c must give K
and B times c, and all else alike. Regressions of 2026-11-27: the noise of a force was believed to
be 10 uN at least, however small the forces; variances below 1e-12 N^2 counted as that; and ln B had
a limit of -16 whatever ln K.
"""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator import estimate as columns

FILTER = "self_tuning_ukf"
IN_NEWTONS = (
    columns.PARAMETERS,
    columns.PARAMETERS + 1,
    columns.FORCE_PREDICTED,
    columns.FORCE_RECONSTRUCTED,
    columns.FORCE_NOISE_STD,
    columns.FORCE_ZERO,
)
ALIKE = (
    columns.PARAMETERS + 2,
    columns.PARAMETERS + 3,
    columns.NIS,
    columns.DISPLACEMENT,
    columns.VELOCITY,
    columns.CONTACT,
    columns.CHANGE_DETECTED,
    columns.MODEL_MISMATCH,
    columns.REJECTED,
    columns.CHANNEL_DELAY,
    columns.CONTACT_POSITION,
    columns.HYPOTHESIS,
)
FIRST_GUESS = {"initial_stiffness": 1.0, "initial_damping": 0.07, "force_noise_std": 0.02}


def readings(plant, seed, seconds=4.0, rate=500.0, scale=1.0, depth=1.0, begin=0.0):
    """Presses from the air, and the truth; the force is some 1.2 N times a scale.

    Args:
        plant: the fixture.
        seed: of the noise.
        seconds: duration.
        rate: of the readings [Hz].
        scale: of the forces.
        depth: largest [mm]; the noise goes with it.
        begin: first stamp [s].
    """
    time = np.arange(round(seconds * rate)) / rate
    sines = ((0.6 * depth, 0.7, -1.2), (0.1 * depth, 1.9, 0.5))
    d, v = plant.motion(time, sines, offset=0.35 * depth)
    truth = np.array([1.2 * scale * depth**-1.6, 0.03 * scale * depth**-2.6, 1.6, 1.0])
    noisy = plant.noisy(d, plant.force(d, v, *truth), seed, 0.001 * depth, 0.004 * scale)
    return (begin + time, *noisy), truth


@pytest.mark.parametrize("power", [-7, -13, -17, 5])
@pytest.mark.parametrize("seed", [1, 2])
def test_forces_of_another_unit_give_the_same(power, seed, plant):
    """Powers of two, so that no reading is rounded; the first guess goes along."""
    scale = 2.0**power
    (time, d, force), _ = readings(plant, seed, depth=4.0)
    usual = hc.create_estimator(FILTER).run(time, d, force).values
    guess = {name: value * scale for name, value in FIRST_GUESS.items()}
    other = hc.create_estimator(FILTER, **guess).run(time, d, scale * force).values
    for column in IN_NEWTONS:
        np.testing.assert_allclose(other[:, column] / scale, usual[:, column], rtol=1e-4, atol=1e-6)
    for column in ALIKE:
        np.testing.assert_allclose(other[:, column], usual[:, column], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("scale", [3e-6, 1e-4, 1e-2, 100.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_small_and_large_forces_are_found_without_a_setting(scale, seed, plant):
    contact, truth = readings(plant, seed, scale=scale, depth=4.0)
    series = hc.create_estimator(FILTER).run(*contact)
    late = contact[0] > 2.0
    assert abs(series.parameters[-1, 0] / truth[0] - 1.0) < 0.005
    z = (series.parameters[late] - truth) / series.parameters_std[late]
    assert (np.abs(z) < 4.0).mean() > 0.95
    assert not series.model_mismatch[late].any()
    assert not series.change_detected.any()


@pytest.mark.parametrize("depth", [0.1, 0.3, 1.0, 15.0, 50.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_small_and_large_depths_are_found_without_a_setting(depth, seed, plant):
    contact, truth = readings(plant, seed, depth=depth)
    series = hc.create_estimator(FILTER).run(*contact)
    late = contact[0] > 2.0
    z = (series.parameters[late] - truth) / series.parameters_std[late]
    assert (np.abs(z[:, [0, 2]]) < 4.0).mean() > 0.95
    level = np.log(series.parameters[late, 0] / truth[0])
    level += (series.parameters[late, 2] - truth[2]) * np.log(0.8 * depth)
    assert np.abs(level).max() < 0.02
    assert not series.model_mismatch[late].any()
    assert not series.change_detected.any()


@pytest.mark.parametrize("rate", [100.0, 4000.0])
def test_unix_stamps_give_the_same_as_stamps_from_zero(rate, plant):
    """1.7e9 s: a stamp then holds a quarter of a microsecond."""
    contact, _ = readings(plant, 1, rate=rate, depth=4.0)
    usual = hc.create_estimator(FILTER).run(*contact)
    contact, _ = readings(plant, 1, rate=rate, depth=4.0, begin=1.7e9)
    other = hc.create_estimator(FILTER).run(*contact)
    late = slice(usual.parameters.shape[0] // 2, None)
    off = np.abs(other.parameters - usual.parameters)[late]
    assert (off < 0.3 * usual.parameters_std[late]).all()
    np.testing.assert_array_equal(other.rejected, usual.rejected)
    np.testing.assert_array_equal(other.model_mismatch[late], usual.model_mismatch[late])
