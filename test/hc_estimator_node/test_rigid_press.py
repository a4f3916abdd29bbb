"""What gives way in presses on steel: the truth within its deviation, or why it is not shown."""

import math

import numpy as np
import pytest

from hc_estimator.stream.rigid_press import estimate_frame

MM_PER_N = 0.002


def presses(
    seed=0,
    mm_per_n=MM_PER_N,
    peak_n=20.0,
    noise_n=0.05,
    noise_mm=0.002,
    friction_mm=0.0,
    soft=lambda f: 0.0,
    count=3,
    rate_hz=500.0,
):
    """Displacement [mm] and force [N] of presses of 2 s from the air, 2 s apart."""
    random = np.random.default_rng(seed)
    time_s = np.arange(0.0, 4.0 * count, 1.0 / rate_hz)
    way = -np.cos(0.5 * np.pi * time_s)
    force = peak_n * np.maximum(way, 0.0)
    depth = 7.0 + 3.0 * np.minimum(way, 0.0) + mm_per_n * force + soft(force)
    depth -= friction_mm * np.sign(np.gradient(force))
    noise = random.standard_normal((2, time_s.size))
    return depth + noise_mm * noise[0], force + 0.3 + noise_n * noise[1]


@pytest.mark.parametrize("case", [{}, {"noise_n": 0.2}, {"count": 1}, {"rate_hz": 25.0}])
def test_the_deviation_is_honest(case):
    found = [estimate_frame(*presses(seed, **case)) for seed in range(40)]
    pulls = [(f.mm_per_n - MM_PER_N) / f.mm_per_n_std for f in found]
    assert 0.6 < math.sqrt(np.mean(np.square(pulls))) < 1.5
    assert max(f.mm_per_n_std for f in found) < 0.04 * MM_PER_N


def test_it_is_the_slope_of_a_plain_fit_where_nothing_is_wrong():
    depth, force = presses(noise_n=0.0, noise_mm=0.0)
    found = estimate_frame(depth, force)
    assert found.mm_per_n == pytest.approx(MM_PER_N, rel=1e-9)
    assert (found.ways_in, found.ways_out) == (3, 3)
    assert found.from_n == pytest.approx(0.3 + 0.2 * 20.0, rel=0.01)


def test_a_little_friction_moves_the_ways_apart_and_not_the_slope():
    found = estimate_frame(*presses(friction_mm=0.002))
    assert found.loop_mm == pytest.approx(0.004, abs=5e-4)
    assert abs(found.mm_per_n - MM_PER_N) < 4.0 * found.mm_per_n_std


def test_one_way_shows_no_loop():
    depth, force = presses(count=1)
    found = estimate_frame(depth[:1000], force[:1000])  # up to the largest force
    assert (found.ways_in, found.ways_out) == (1, 0)
    assert math.isnan(found.loop_mm)


def test_spikes_and_missing_readings_change_little():
    depth, force = presses()
    force[[1000, 1003, 3000]] = 500.0
    force[::7] = depth[3::11] = np.nan
    found = estimate_frame(depth, force)
    assert abs(found.mm_per_n - MM_PER_N) < 4.0 * found.mm_per_n_std < 0.03 * MM_PER_N


@pytest.mark.parametrize(
    ("case", "says"),
    [
        ({"peak_n": 0.3}, "press harder"),
        ({"noise_n": 2.0}, "press harder"),
        ({"mm_per_n": 0.0}, "nothing for certain"),
        ({"noise_mm": 0.06}, "known to 1[0-9] % only"),
        ({"mm_per_n": -MM_PER_N}, "turn the sign"),
        ({"friction_mm": 0.008}, "friction, play, slip"),
        ({"soft": lambda f: 0.3 * (f / 20.0) ** (1 / 1.5)}, "still soft"),
        ({"soft": lambda f: 4.0 * (f / 20.0) ** 0.5}, "still soft"),
        ({"soft": lambda f: 0.03 * (f / 20.0) ** 3}, "slips or bends"),
        ({"rate_hz": 6.0, "count": 20}, "press slower"),
    ],
)
def test_what_the_recording_cannot_show_is_said(case, says):
    with pytest.raises(ValueError, match=says):
        estimate_frame(*presses(**case))


def test_too_few_readings_are_said():
    depth, force = presses()
    with pytest.raises(ValueError, match="too few"):
        estimate_frame(depth[:50], force[:50])
