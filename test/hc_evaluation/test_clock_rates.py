"""Two clocks, one per channel: K was 0.03 to 2.6 of 0.3 to 1.2 N/mm, and no line said why."""

import numpy as np
import pytest

from hc_estimator.contact.arrays import hunt_crossley_force
from hc_evaluation.clock_rates import find_clock_rates

RATE_HZ = 250.0
LAW = np.array([0.6, 0.012, 1.4, 1.0])


def sines(t, generator):
    slow, quick = generator.uniform(0.4, 0.9), generator.uniform(1.5, 3.0)
    return 2.0 + 1.2 * np.sin(2 * np.pi * slow * t) + 0.5 * np.sin(2 * np.pi * quick * t + 1.0)


def taps(t, generator):
    wander = np.interp(t, np.arange(0, 70, 1.0), generator.normal(0.0, 1.0, 70))
    phase = 2 * np.pi * (generator.uniform(1.5, 3.0) * t + 0.1 * wander)
    return 1.6 * np.maximum(np.sin(phase), -0.6) - 0.1


def presses(t, generator):
    out, at = np.full_like(t, -1.0), 0.5
    while at < t[-1]:
        up, hold, down, depth = generator.uniform([0.5, 0.1, 0.4, 1.5], [1.5, 1.5, 1.2, 4.0])
        share = np.clip((t - at) / up, 0, 1) - np.clip((t - at - up - hold) / down, 0, 1)
        out += (depth + 1.0) * share**2 * (3.0 - 2.0 * share)
        at += up + hold + down + generator.uniform(0.2, 1.5)
    return out


MOTIONS = (sines, taps, presses)


def nothing(_time, _depth, _speed, force):
    return force


def relaxing(time_s, _depth, _speed, force):
    remembered, share = np.zeros_like(force), (time_s[1] - time_s[0]) / 1.0
    for i in range(1, len(force)):
        remembered[i] = remembered[i - 1] + share * (force[i] - remembered[i - 1])
    return force - 0.3 * remembered


def drifting(time_s, _depth, _speed, force):
    return force + 0.3 * force.max() * time_s / time_s[-1]


def damped_more_and_more(time_s, depth, speed, force):
    return force + 4.0 * time_s / time_s[-1] * LAW[1] * np.maximum(depth, 0.0) ** LAW[2] * speed


def rubbing(_time, _depth, speed, force):
    return force + 0.1 * force.max() * np.tanh(speed / 0.2)


def late(time_s, _depth, _speed, force):
    return np.interp(time_s - 0.03, time_s, force)


def late_from_the_middle_on(time_s, _depth, _speed, force):
    return np.interp(time_s - np.where(time_s > 0.6 * time_s[-1], 0.03, 0.0), time_s, force)


def sinking(time_s, depth, speed, _force):
    return hunt_crossley_force(depth - 0.8 * time_s / time_s[-1], speed, LAW)


def changing(time_s, _depth, _speed, force):
    return np.where(time_s > 0.5 * time_s[-1], 1.5, 1.0) * force


TROUBLES = (
    nothing,
    relaxing,
    drifting,
    damped_more_and_more,
    rubbing,
    late,
    late_from_the_middle_on,
    sinking,
    changing,
)


def recorded(motion, seed, fast=0.0, trouble=nothing, seconds=30.0):
    """Stamps, displacement and force; the position's clock goes (1 + fast) times as fast."""
    generator = np.random.default_rng([seed, MOTIONS.index(motion)])
    fine = np.arange(0.0, seconds + 1.0, 0.001)
    depth = motion(fine, generator)
    speed = np.gradient(depth, fine)
    force = trouble(fine, depth, speed, hunt_crossley_force(depth, speed, LAW))
    time_s = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    noise = generator.normal(0.0, 1.0, (2, len(time_s)))
    displacement = np.interp(time_s / (1.0 + fast), fine, depth) + 0.003 * noise[0]
    return time_s, displacement, np.interp(time_s, fine, force) + 0.005 * noise[1]


@pytest.mark.parametrize("fast", [0.002, -0.001])
@pytest.mark.parametrize("motion", MOTIONS)
def test_the_rate_between_the_clocks_is_found(motion, fast):
    for seed in (1, 2):
        time_s, displacement, force = recorded(motion, seed, fast)
        found = find_clock_rates(time_s, displacement, force)
        assert found is not None
        assert found.rate == pytest.approx(-fast, rel=0.05)
        by_one_clock = found.by_the_other(time_s)
        assert np.max(np.abs(by_one_clock - time_s / (1.0 + fast))) < 0.003


@pytest.mark.parametrize("trouble", TROUBLES)
def test_nothing_else_passes_for_two_clocks(trouble):
    for motion in MOTIONS:
        for seed in (1, 2):
            assert find_clock_rates(*recorded(motion, seed, trouble=trouble)) is None


def test_what_shows_nothing_is_no_pair_of_clocks():
    time_s, displacement, force = recorded(sines, 1, 0.002)
    assert find_clock_rates(time_s[:2000], displacement[:2000], force[:2000]) is None  # 8 s
    assert find_clock_rates(time_s, displacement, np.zeros_like(force)) is None
    assert find_clock_rates(time_s, np.ones_like(force), force) is None
    noise = np.random.default_rng(1).normal(0.0, 0.005, len(force))
    assert find_clock_rates(time_s, displacement, noise) is None
