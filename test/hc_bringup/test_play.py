"""Play between where the position is read and the tip: named, and no delay made of it."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from hc_bringup.diagnosis import diagnose
from hc_evaluation.play import behind_play

RATE = 500.0
PLAY = 0.6


def presses(seconds=24.0, seed=1):
    """Stamps and depths of presses from the air at changing speed."""
    time_s = np.arange(0.0, seconds, 1.0 / RATE)
    return time_s, -2.0 + 3.0 * (1.0 - np.cos(np.pi * time_s + 0.6 * np.sin(0.7 * time_s)))


def felt(time_s, depth_mm):
    """Force of K = 0.4, B = 0.012, n = 1.5, p = 1 at these depths."""
    speed = np.gradient(depth_mm, time_s)
    law = (0.4 + 0.012 * np.sign(speed) * np.abs(speed)) * np.maximum(depth_mm, 0.0) ** 1.5
    return np.maximum(law, 0.0)


def said(time_s, position_mm, force_n, seed=1):
    noise = np.random.default_rng(seed).standard_normal((2, time_s.size))
    found = diagnose(time_s, position_mm + 0.003 * noise[0], force_n + 0.01 * noise[1])
    return found, " | ".join(finding.what for finding in found.findings)


def test_the_tip_follows_when_the_play_is_through():
    places = np.array([0.0, 1.0, 0.8, 0.5, np.nan, 0.2, 0.9, 1.4])
    expected = [0.0, 0.75, 0.75, 0.75, np.nan, 0.45, 0.65, 1.15]
    np.testing.assert_allclose(behind_play(places, 0.5), expected)
    assert np.isnan(behind_play(np.full(3, np.nan), 0.5)).all()


def test_a_play_is_named_with_what_it_costs():
    """Regression: "79 ms late" and "contact begins at -0.5 mm" were told, and K of 0.257 of 0.4."""
    time_s, motor = presses()
    found, words = said(time_s, motor, felt(time_s, behind_play(motor, PLAY)))
    assert "the position has a play of 0.6" in words
    assert "late" not in words
    assert "contact seems" not in words
    assert "refused" not in words
    assert found.estimated.parameters[0] == pytest.approx(0.4, rel=0.02)
    assert found.estimated.parameters[1] == pytest.approx(0.012, rel=0.1)


def late(time_s, depth, force):
    return np.interp(time_s - 0.03, time_s, force)


def filtered(time_s, depth, force):
    return lfilter(*butter(2, 10.0 / (0.5 * RATE)), force)


def relaxing(time_s, depth, force):
    elastic, memory = 0.2 * np.maximum(depth, 0.0) ** 1.5, np.zeros(depth.size)
    for k in range(1, depth.size):
        memory[k] = memory[k - 1] * np.exp(-0.5 / RATE) + elastic[k] - elastic[k - 1]
    return np.maximum(force + memory, 0.0) * (depth > 0.0)


def adhesive(time_s, depth, force):
    leaves = (np.gradient(depth) < 0.0) & (depth < 0.5) & (depth > -1.0)
    return force - 0.3 * leaves * np.sin(np.pi * (depth + 1.0) / 1.5)


@pytest.mark.parametrize("change", [late, filtered, relaxing, adhesive, lambda _t, _d, f: f])
def test_what_is_no_play_is_not_called_one(change):
    time_s, depth = presses()
    assert "play" not in said(time_s, depth, change(time_s, depth, felt(time_s, depth)))[1]
