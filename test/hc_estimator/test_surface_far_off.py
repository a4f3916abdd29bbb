"""A surface millimetres from the zero, which moves besides: readings as a surgical arm has them."""

import numpy as np
import pytest

import hc_estimator as hc

RATE_HZ = 66.0
TISSUE = (0.35, 0.008, 1.4, 1.0)


def readings(plant, position, amplitude=1.0, swing=1.0):
    """Slow palpation of an organ that breathes, displacement noisy by 0.1 mm."""
    time = np.arange(round(20.0 * RATE_HZ)) / RATE_HZ
    sines = ((0.9 * swing, 0.25, 1.0), (0.7 * swing, 0.6, 2.0), (0.4 * swing, 1.3, 0.5))
    depth = 1.8 + sum(a * np.sin(2.0 * np.pi * f * time + phase) for a, f, phase in sines)
    force = plant.force(depth, np.gradient(depth, time), *TISSUE)
    surface = position + amplitude * np.sin(2.0 * np.pi * 0.22 * time)
    rng = np.random.default_rng(4)
    return (
        time,
        depth + surface + 0.1 * rng.standard_normal(time.size),
        force + 0.02 * rng.standard_normal(time.size),
        surface,
    )


@pytest.mark.parametrize("position", [6.0, 3.0, -3.0])
def test_a_surface_millimetres_off_is_found(position, plant):
    time, d, f, surface = readings(plant, position)
    series = hc.create_estimator("self_tuning_ukf").run(time, d, f)
    late = time > 10.0
    off = np.median(np.abs(series.contact_position[late] - surface[late]))
    assert off < 0.5
    error = np.abs(series.force_predicted[late] - f[late])
    assert np.sqrt(np.mean(error**2)) < 2.0 * np.sqrt(np.mean(np.diff(f[late]) ** 2))
