"""A hand that trembles beneath the noise of the position: what is told of the damping is true."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

import hc_estimator as hc

RATE = 500.0
TRUTH = np.array([0.4, 0.01, 1.5, 1.0])
FORCE_NOISE = 0.01


def presses(generator, duration):
    """Time and position of presses and lifts of one to four millimetres with smooth ends."""
    times, places, now = [0.0], [-generator.uniform(0.5, 6.0)], 0.0
    while now < duration:
        for place in (generator.uniform(1.0, 4.0), -generator.uniform(0.5, 6.0)):
            now += generator.uniform(0.0, 1.0)
            times.append(now)
            places.append(places[-1])
            now += generator.uniform(0.15, 1.5)
            times.append(now)
            places.append(place)
    time = np.arange(int(duration * RATE)) / RATE
    before = np.clip(np.searchsorted(times, time, "right") - 1, 0, len(times) - 2)
    begin, end = np.array(times)[before], np.array(times)[before + 1]
    share = np.clip((time - begin) / np.maximum(end - begin, 1e-9), 0.0, 1.0)
    share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    place = np.array(places)
    return time, place[before] + (place[before + 1] - place[before]) * share


def contact(plant, seed, tremor, position_noise):
    """Time, position and force that sensors read."""
    generator = np.random.default_rng(seed)
    time, position = presses(generator, 30.0)
    motion = lfilter(
        *butter(2, (5.0, 11.0), "bandpass", fs=RATE), generator.standard_normal(time.size)
    )
    position += tremor * motion / motion.std()
    force = plant.force(position, np.gradient(position, time), *TRUTH)
    noise = generator.standard_normal((2, time.size))
    return time, position + position_noise * noise[0], force + FORCE_NOISE * noise[1]


def told(plant, seed, tremor, position_noise):
    """Errors of K, B, n and p in contact after ten seconds, as a share, and in deviations."""
    time, position, force = contact(plant, seed, tremor, position_noise)
    series = hc.create_estimator("self_tuning_ukf").run(time, position, force)
    late = series.contact & (series.rejected == 0) & (time > 10.0)
    off = series.parameters[late] - TRUTH
    return off / TRUTH, off / series.parameters_std[late]


@pytest.mark.parametrize(
    ("tremor", "noise", "error", "within"),
    [
        (0.0, 0.03, 0.03, 0.95),
        (0.02, 0.01, 0.02, 0.8),
        (0.05, 0.01, 0.02, 0.8),
        (0.02, 0.03, 0.06, 0.85),
        (0.05, 0.03, 0.05, 0.8),
    ],
)
def test_the_damping_of_a_hand_that_trembles_beneath_the_noise_is_true(
    tremor, noise, error, within, plant
):
    """B was 10 and 13 % off beneath 0.03 mm, B and p within three deviations in 85 and 65 %.

    And 1.7 and 1.9 % beneath 0.01 mm, within three in 61 % of the time.
    """
    results = [told(plant, seed, tremor, noise) for seed in range(300, 308)]
    off, scores = (np.concatenate(x) for x in zip(*results, strict=True))
    assert np.median(np.abs(off[:, 1])) < error
    assert np.mean(np.abs(scores[:, [1, 3]]) < 3.0) > within
    assert np.median(np.abs(off[:, 0])) < 0.003
    assert np.mean(np.abs(scores[:, 0]) < 3.0) > 0.97
