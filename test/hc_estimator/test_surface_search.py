"""A surface millimetres from the zero, which moves besides: readings as a surgical arm has them."""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import surface_search
from hc_estimator.multiple_model.hypotheses import OWN, SURFACE_ROW

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


def test_the_best_position_and_stiffness_of_a_steady_surface_are_found(parts):
    _, bank = parts
    search = bank.search
    surface_search.reset(search)
    now = np.linspace(-0.79, 0.0, 80)
    depth = 1.5 + np.sin(2.0 * np.pi * 1.3 * now)
    velocity = 2.6 * np.pi * np.cos(2.0 * np.pi * 1.3 * now)
    search.points[:, 0] = depth + 4.0 + 0.75 * now
    search.points[:, 1] = velocity + 0.75
    search.points[:, 2] = 0.4 * depth**1.5 * (1.0 + 0.02 * velocity)
    search.points[:, 3] = now
    search.count, search.touching_force = 80, 0.01
    squares = surface_search._try_all(search)
    position, speed, stiffness, damping = search.best
    assert (position, speed) == (pytest.approx(4.0, abs=0.25), 0.75)
    assert stiffness == pytest.approx(0.4, rel=0.3)
    assert 0.0 <= damping < 0.02
    assert squares < 1e-3 * np.sum(search.points[:, 2] ** 2)


@pytest.mark.parametrize("why", ["explained", "tested", "short", "off"])
def test_nothing_is_searched_for_without_need(why, parts):
    options, bank = parts
    for row in bank.rows:
        row.model_error = 0.0 if why == "explained" else 1.0
    options.search_surface = 0 if why == "off" else 1
    bank.change.testing = 1 if why == "tested" else 0
    before = bank.rows[SURFACE_ROW].state[OWN]
    for _ in range(5 if why == "short" else 200):
        surface_search.look(options, bank)
    assert bank.search.count == 0
    assert bank.rows[SURFACE_ROW].state[OWN] == before
