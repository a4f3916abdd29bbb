"""Tissue that relaxes is seen in the readings, and nothing that stands still otherwise is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hc_bringup.cli import main
from hc_bringup.held_tool import relaxing_line

Array = NDArray[np.float64]


def press(rate_hz: float, lost: float, seed: int = 0, drift_mm: float = 0.0) -> list[Array]:
    """A ramp to 4 mm within 2 s and a hold of 8 s, in which a share of the force is lost."""
    generator = np.random.default_rng(seed)
    time_s = np.arange(0.0, 10.0, 1.0 / rate_hz)
    depth = np.interp(time_s, [0.0, 2.0, 10.0], [-1.0, 4.0, 4.0 - drift_mm])
    held_s = np.maximum(time_s - 2.0, 0.0)
    force = 0.3 * np.maximum(depth, 0.0) ** 1.5 * (1.0 - lost * (1.0 - np.exp(-held_s / 2.0)))
    depth += 0.002 * generator.standard_normal(time_s.size)
    return [time_s, depth, force + 0.01 * generator.standard_normal(time_s.size)]


@pytest.mark.parametrize("rate_hz", [10.0, 100.0, 1000.0])
def test_a_force_that_falls_at_one_depth_is_told(rate_hz: float) -> None:
    said = relaxing_line(*press(rate_hz, 0.5))
    assert said.startswith("the force falls from 2.")
    assert " while the depth stays at 4 mm for 7." in said
    assert "tissue that relaxes" in said


@pytest.mark.parametrize("rate_hz", [10.0, 100.0, 1000.0])
@pytest.mark.parametrize("seed", range(5))
def test_a_force_that_stays_or_goes_with_the_depth_is_not(rate_hz: float, seed: int) -> None:
    assert relaxing_line(*press(rate_hz, 0.0, seed)) == ""
    assert relaxing_line(*press(rate_hz, 0.0, seed, drift_mm=0.02)) == ""
    assert relaxing_line(*press(rate_hz, 0.0, seed, drift_mm=0.4)) == ""


def test_readings_at_stamps_of_their_own_are_compared_in_time() -> None:
    time_s, depth, force = press(1000.0, 0.4)
    depth[::2], force[1::2] = np.nan, np.nan
    assert "tissue that relaxes" in relaxing_line(time_s, depth, force)


@pytest.mark.parametrize("count", [0, 5, 40])
def test_too_little_says_nothing(count: int) -> None:
    nothing = np.full(count, np.nan)
    assert relaxing_line(np.arange(float(count)), nothing, nothing) == ""
    assert relaxing_line(np.zeros(count), np.ones(count), np.ones(count)) == ""


def test_the_doctor_names_it(tmp_path, capsys) -> None:
    """Regression: "nothing is wrong" of two real recordings whose force falls to 0.6 of itself."""
    path = tmp_path / "hold.csv"
    rows = np.column_stack(press(10.0, 0.5))
    header = "time_s,displacement_mm,force_N"
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.6g")
    assert main(["doctor", str(path)]) == 1
    assert "while the depth stays at 4 mm" in capsys.readouterr().out


def test_the_doctor_says_that_deviations_are_too_small(tmp_path, capsys) -> None:
    """Regression: `hc estimate` warned of a recording, and the doctor said "nothing is wrong"."""
    time_s = np.arange(0.0, 12.0, 0.002)
    depth = 1.5 + 2.0 * np.sin(5.0 * time_s)
    speed = 10.0 * np.cos(5.0 * time_s)
    force = np.maximum(depth, 0.0) ** 1.5 * (0.5 + 0.01 * speed)
    force += np.random.default_rng(1).normal(0.0, 0.002, time_s.size)
    odd = (time_s % 0.7 < 0.06) & (time_s > 4.0)  # in which it is of another world
    force[odd] *= 40.0 * np.sin(time_s[odd] * 30.0)
    path = tmp_path / "spikes.csv"
    rows = np.column_stack([time_s, depth, force])
    header = "time_s,displacement_mm,force_N"
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.6g")
    main(["estimate", str(path)])
    warned = "errors are far larger than the filter admits" in capsys.readouterr().err
    main(["doctor", str(path)])
    assert ("errors are far larger than the filter admits" in capsys.readouterr().out) == warned
    assert warned
