"""A tool in a hand that trembles: what is noise, and what a rest leaves of what is known."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

import hc_estimator as hc

RATE = 1000.0
FORCE_NOISE, POSITION_NOISE = 0.01, 0.005
STIFFNESS, DAMPING, EXPONENT, VELOCITY_EXPONENT = 0.25, 0.0055, 1.6, 0.92


def trembling(generator, count, low, high):
    """A tremor between two frequencies, RMS 1."""
    bands = butter(2, (low, high), "bandpass", fs=RATE, output="sos")
    motion = sosfilt(bands, generator.standard_normal(count))
    return motion / motion.std()


def felt(generator, time, position, surface):
    """What sensors read over tissue that begins at a position."""
    depth = np.clip(position - surface, 0.0, None)
    velocity = np.gradient(position, time)
    force = STIFFNESS + DAMPING * np.sign(velocity) * np.abs(velocity) ** VELOCITY_EXPONENT
    force = np.maximum(force * depth**EXPONENT, 0.0)
    noise = generator.standard_normal((2, time.size))
    return position + POSITION_NOISE * noise[0], force + FORCE_NOISE * noise[1]


@pytest.mark.parametrize("band", [(4.0, 7.0), (6.0, 10.0), (8.0, 12.0)])
@pytest.mark.parametrize("seed", [0, 1])
def test_what_a_tremor_makes_of_the_force_is_no_noise_of_the_sensor(band, seed):
    """The sensor of 10 mN seemed to have 40 to 110."""
    generator = np.random.default_rng(seed)
    time = np.arange(0.0, 30.0, 1.0 / RATE)
    position = 1.5 + np.sin(2.0 * np.pi * 0.2 * time - 1.5)
    position += 0.02 * trembling(generator, time.size, *band)
    series = hc.create_estimator("self_tuning_ukf").run(time, *felt(generator, time, position, 0.0))
    late = time > 8.0
    assert np.median(series.force_noise_std[late]) == pytest.approx(FORCE_NOISE, rel=0.3)
    error = np.abs(series.parameters[late, 0] / STIFFNESS - 1.0)
    deviation = series.parameters_std[late, 0] / STIFFNESS
    assert np.mean(error < 3.0 * deviation) > 0.95
    assert np.median(deviation) < 1e-3
    assert np.mean(series.model_mismatch[late]) < 0.01


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_rest_leaves_what_the_way_there_has_shown(seed):
    """Contact position found by taps; at one depth nothing more of it is seen, nor less known."""
    generator = np.random.default_rng(seed)
    time = np.arange(0.0, 55.0, 1.0 / RATE)
    position = 1.4 - 1.6 * np.cos(2.0 * np.pi * 0.67 * time)
    position[time > 20.15] = 3.0
    window = np.hanning(301)
    position = np.convolve(np.pad(position, 150, "edge"), window / window.sum(), "valid")
    position += 0.03 * trembling(generator, time.size, 8.0, 12.0)
    series = hc.create_estimator("self_tuning_ukf").run(
        time, *felt(generator, time, position, 0.126)
    )
    deviation = series.parameters_std[:, 0] / series.parameters[:, 0]
    assert np.median(deviation[(time > 17.0) & (time < 20.0)]) < 0.03
    late = time > 32.0
    assert np.quantile(deviation[late], 0.95) < 0.06
    error = np.abs(series.parameters[late, 0] / STIFFNESS - 1.0)
    assert np.mean(error < 3.0 * deviation[late]) > 0.95
