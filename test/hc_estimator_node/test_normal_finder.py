"""The normal that the forces of an approach show, and whether it is as well known as is said."""

import math

import numpy as np
import pytest

from hc_estimator.stream.contact_frame import unit_vector
from hc_estimator.stream.normal_finder import FAIR_DEG, POOR_DEG, NormalFinder

NORMAL = np.array(unit_vector((0.2, -0.3, 1.0)))


def found(push, extra, noise, seed, free=-0.5):
    """The normal of forces along NORMAL, with others that are added."""
    generator = np.random.default_rng(seed)
    finder = NormalFinder()
    for newtons, more in zip(push, extra, strict=True):
        force = newtons * NORMAL + more + noise * generator.standard_normal(3)
        finder.add(tuple(force), float(force[2]))
    return finder.normal(free, noise)


def off_deg(normal):
    return math.degrees(math.acos(min(float(np.array(normal.direction) @ NORMAL), 1.0)))


def approach(free=200, press=200, most=4.0):
    return np.concatenate((np.zeros(free), np.linspace(0.0, most, press) ** 1.5))


def test_the_normal_is_where_the_tissue_pushes_from():
    """Begun in mid-press, with a weight that is not known."""
    push = np.concatenate((np.linspace(3.0, 0.0, 100), approach()))
    normal = found(push, np.full((500, 3), (0.3, 0.2, -0.5)), 0.02, 1)
    assert off_deg(normal) < 1.0
    assert normal.deviation_deg < 1.0
    assert not normal.is_poor


def test_without_a_press_there_is_none():
    assert found(approach(), np.zeros((400, 3)), 0.02, 1, free=40.0) is None
    assert NormalFinder().normal(0.0, 0.02) is None


@pytest.mark.parametrize("noise", [0.02, 0.3])
def test_its_deviation_is_true_where_there_is_noise_alone(noise):
    weight = np.full((400, 3), (0.3, 0.2, -0.5))
    results = [found(approach(), weight, noise, seed) for seed in range(200)]
    scores = [(off_deg(normal) / normal.deviation_deg) ** 2 for normal in results]
    assert 0.6 < np.mean(scores) < 1.6


def test_a_weight_that_wanders_while_the_tool_turns_is_in_it():
    """Half a newton of a tool that was not weighed and turns to and fro."""
    ratios = []
    for seed in range(200):
        generator = np.random.default_rng(1000 + seed)
        phase = generator.uniform(0.0, 2.0 * math.pi) + np.linspace(0.0, 9.0, 400)
        wander = 0.5 * np.outer(np.sin(phase), (1.0, 0.0, 0.0))
        wander[:, 2] = 0.5 * np.cos(phase) * 0.1 - 0.5
        normal = found(approach(), wander, 0.02, seed)
        ratios.append(off_deg(normal) / normal.deviation_deg)
    assert np.mean(np.array(ratios) < 3.0) > 0.9
    assert np.median(ratios) < 1.5


def test_a_press_that_says_little_is_poor():
    weight = np.full((400, 3), (0.3, 0.2, -0.5))
    weak = found(approach(most=0.9), weight, 0.4, 3)
    assert FAIR_DEG < weak.deviation_deg < POOR_DEG
    generator = np.random.default_rng(5)
    slides = np.zeros((400, 3))
    sticks = np.repeat(generator.normal(0.0, 12.0, 40), 5)
    slides[200:] = np.outer(sticks, unit_vector((0.3, 0.2, 0.0)))
    wild = found(approach(), slides, 0.02, 3, free=0.0)
    assert wild.deviation_deg > POOR_DEG
    assert wild.is_poor


def test_the_tip_was_at_the_surface_when_it_last_came_through_it_on_its_own_way():
    finder = NormalFinder()
    assert finder.tip_at(0.0) is None
    for depth in (-2.0, 1.0, 3.0, math.nan, -1.0, 2.0, 4.0, 3.5):  # in, out, and in again
        finder.add_tip(depth, (0.4, 1e-3 * depth, 0.2 - 2e-3 * depth))
    assert finder.tip_at(0.5) == pytest.approx((0.4, 0.5e-3, 0.2 - 1e-3))
    assert finder.tip_at(-1.5) == pytest.approx((0.4, -1.5e-3, 0.203))  # of the first time
    assert finder.tip_at(-3.0) is None


def test_a_reading_that_is_no_number_is_passed_over_and_a_single_strong_one_is_not_trusted():
    finder = NormalFinder()
    finder.add((math.nan, 0.0, 0.0), 0.0)
    for _ in range(50):
        finder.add((0.0, 0.0, 0.01), 0.01)
        finder.add((0.0, 0.0, -0.01), -0.01)
    finder.add((0.0, 0.0, 5.0), 5.0)
    normal = finder.normal(0.0, 0.01)
    assert normal.direction == pytest.approx((0.0, 0.0, 1.0))
    assert normal.is_poor
