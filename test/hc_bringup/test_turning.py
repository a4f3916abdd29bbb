"""A tool that turns while it is set up: no axis of a sensor is one direction then."""

from __future__ import annotations

import numpy as np
import pytest

from hc_bringup.turning import turned_deg, turning_line


def about_y(degrees: np.ndarray) -> np.ndarray:
    half = np.radians(degrees) / 2.0
    none = np.zeros_like(half)
    return np.column_stack([none, np.sin(half), none, np.cos(half)])


def test_the_turn_is_that_from_the_usual_attitude() -> None:
    assert turned_deg(about_y(np.r_[np.zeros(300), np.full(100, 20.0)])) == pytest.approx(20.0)
    # One attitude and its negative are the same; a length that is not 1 does not matter.
    signs = np.where(np.arange(400) % 2, -3.0, 2.0)[:, None]
    assert turned_deg(signs * about_y(np.zeros(400))) == pytest.approx(0.0, abs=1e-6)


def test_noise_one_wrong_attitude_and_none_at_all_are_no_turn() -> None:
    random = np.random.default_rng(1)
    noisy = about_y(0.3 * random.standard_normal(500))
    noisy[7] = (1.0, 0.0, 0.0, 0.0)
    noisy[9] = np.nan
    noisy[11] = 0.0
    assert turned_deg(noisy) < 1.0
    assert turned_deg([]) == turned_deg(np.zeros((50, 4))) == 0.0
    assert turning_line(turned_deg(noisy)) == ""


def test_what_is_said_names_the_way_out() -> None:
    line = turning_line(24.3)
    assert "by up to 24 degrees" in line
    assert "input.contact.frame: surface" in line
    assert "hc payload" in line
