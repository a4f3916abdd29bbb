"""Tissue that holds the tool on its way out is named; nothing else is called so."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from hc_bringup.diagnosis import diagnose
from hc_bringup.sticking import sticking_line

RATE = 500.0


def presses():
    time_s = np.arange(0.0, 30.0, 1.0 / RATE)
    depth = -3.0 + 3.5 * (1.0 - np.cos(0.6 * np.pi * time_s))
    speed = np.gradient(depth, time_s)
    law = (0.4 + 0.012 * np.sign(speed) * np.abs(speed)) * np.maximum(depth, 0.0) ** 1.5
    return time_s, depth, speed, np.maximum(law, 0.0)


def noisy(depth, force):
    noise = np.random.default_rng(16).standard_normal((2, depth.size))
    return depth + 0.003 * noise[0], force + 0.01 * noise[1]


def sticks(depth, speed, force):
    near = (speed < 0.0) & (depth < 0.5) & (depth > -1.0)
    return force - 0.3 * near * np.sin(np.pi * (depth + 1.0) / 1.5)


def grips(depth, speed, force):
    return np.where((speed < 0.0) & (depth > 0.0), -0.2, force)


@pytest.mark.parametrize(("change", "pull_n"), [(sticks, "0.3"), (grips, "0.2")])
@pytest.mark.parametrize("zero_n", [0.0, -1.5])
def test_what_holds_the_tool_is_named_with_its_force(change, pull_n, zero_n):
    time_s, depth, speed, force = presses()
    said = sticking_line(time_s, *noisy(depth, change(depth, speed, force) + zero_n))
    assert said.startswith(f"the tool is pulled by up to {pull_n}")


def test_doctor_says_it_beside_the_misfit():
    time_s, depth, speed, force = presses()
    found = diagnose(time_s, *noisy(depth, sticks(depth, speed, force)))
    words = [finding.what for finding in found.findings]
    assert words[-2].startswith("the tool is pulled by up to 0.3")
    assert words[-1].startswith("the contact law does not fit in ")


@pytest.mark.parametrize(
    "change",
    [
        lambda speed, force: force,
        lambda speed, force: force + 0.3 * np.tanh(speed),  # friction, in the air as well
        lambda speed, force: lfilter(*butter(2, 10.0 / (0.5 * RATE)), force),
        lambda speed, force: force - 1.0 * (np.arange(force.size) % 1000 == 0),
    ],
    ids=["sound", "friction", "filter", "spikes"],
)
def test_nothing_else_is_called_so(change):
    time_s, depth, speed, force = presses()
    assert sticking_line(time_s, *noisy(depth, change(speed, force))) == ""


def test_of_a_tool_that_stays_in_the_tissue_nothing_is_said():
    """What it reads where it is highest is no zero: of one late by 30 ms "pulled by 0.6 N"."""
    time_s, depth, _speed, _force = presses()
    inside = 3.0 + 0.35 * depth
    late = np.interp(time_s + 0.03, time_s, 0.85 * inside**1.7)
    assert sticking_line(time_s, *noisy(inside, late)) == ""
