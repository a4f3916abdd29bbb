"""Damping that is the same at every depth (Kelvin, Voigt) is named, not a fault that looks like it.

Regression of 2026-11-29: of F = 0.5 d + 0.03 v the doctor said that the force was 52 ms late, or
its zero off by 3.8 N, with the numbers to type.
"""

import numpy as np
import pytest

from hc_bringup.diagnosis import diagnose

TIME_S = np.arange(0.0, 16.0, 0.002)


def motion(time):
    rates = 2.0 * np.pi * np.array([0.5, 0.9, 1.7])
    sines = np.array([0.8, 0.4, 0.27])
    phase = rates * time[:, None] + np.array([0.0, 1.0, 2.0])
    return 2.0 + np.sin(phase) @ sines, np.cos(phase) @ (sines * rates)


def found(force, seed):
    rng = np.random.default_rng(seed)
    displacement = motion(TIME_S)[0] + 0.003 * rng.standard_normal(TIME_S.size)
    return diagnose(TIME_S, displacement, force + 0.01 * rng.standard_normal(TIME_S.size)).findings


@pytest.mark.parametrize("seed", range(3))
def test_kelvin_and_voigt_are_named_and_nothing_is_to_be_typed(seed):
    depth, speed = motion(TIME_S)
    findings = found(np.maximum(0.5 * depth + 0.03 * speed, 0.0), seed)
    assert "F = 0.5 d + 0.03 v (Kelvin and Voigt)" in findings[0].what
    assert "--contact-model kelvin_voigt" in findings[0].what
    assert not any(finding.settings for finding in findings)


def test_beside_a_delay_that_explains_as_much_it_is_the_other_reading():
    depth, speed = motion(TIME_S)
    findings = found(0.5 * depth + 0.01 * speed, 1)
    assert "Kelvin and Voigt" in findings[0].what
    assert "late against" in findings[1].what


@pytest.mark.parametrize("late_s", [0.03, -0.03])
@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_a_delay_of_a_tissue_is_a_delay(late_s, exponent):
    depth, speed = motion(TIME_S - late_s)
    findings = found(depth**exponent * (0.4 + 0.008 * speed), 2)
    assert "late against" in findings[0].what
    assert not any("Voigt" in finding.what for finding in findings)
