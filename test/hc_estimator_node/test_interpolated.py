"""A channel that was interpolated between slower readings is found, by its readings, and no other.

Regression of 2026-11-28: positions of 1 kHz, interpolated to the 4 kHz of the force, made K 0.108 ±
0.004 of 0.3, and nothing was said.
"""

import numpy as np
import pytest

from hc_estimator import create_estimator
from hc_estimator.contact.hunt_crossley import hunt_crossley_force
from hc_estimator.stream.interpolated import find_interpolation

TRUE = (0.3, 0.01, 1.5, 1.0)


def motion(times):
    depth = 1.0 + 1.6 * np.sin(3.1 * times - 1.5) + 0.6 * np.sin(8.2 * times)
    return depth, 4.96 * np.cos(3.1 * times - 1.5) + 4.92 * np.cos(8.2 * times)


def interpolated(rate_hz, ratio, *, digits=7, shift=0.0, noise_mm=0.002, seed=0, seconds=4.0):
    """Times of the samples and readings brought there, and which samples are next to a reading."""
    generator = np.random.default_rng(seed)
    read_s = np.arange(0.0, seconds, 1.0 / rate_hz)
    readings = motion(read_s)[0] + noise_mm * generator.standard_normal(read_s.size)
    time_s = np.arange(shift / (rate_hz * ratio), read_s[-1], 1.0 / (rate_hz * ratio))
    next_to = np.rint((read_s - time_s[0]) * rate_hz * ratio).astype(int)
    next_to = next_to[(next_to >= 0) & (next_to < time_s.size)]
    return time_s, np.round(np.interp(time_s, read_s, readings), digits), next_to


@pytest.mark.parametrize("digits", [12, 4], ids=["in_full", "of_a_tenth_of_a_micrometre"])
@pytest.mark.parametrize(
    ("rate_hz", "ratio", "shift"),
    [(1000, 2, 0.0), (1000, 2, 0.4), (1000, 4, 0.0), (200, 5, 0.3), (500, 2.4, 0.0), (50, 20, 0.3)],
)
def test_the_readings_of_an_interpolated_channel_are_found(rate_hz, ratio, shift, digits):
    time_s, values, next_to = interpolated(rate_hz, ratio, shift=shift, digits=digits)
    found = find_interpolation(time_s, values)
    assert found is not None
    assert found.rate_hz == pytest.approx(rate_hz, rel=1e-3)
    wrong = np.setxor1d(np.flatnonzero(found.keep), next_to)
    assert len(wrong) < 0.02 * len(next_to)  # half-way between two samples either will do


def test_stamps_with_few_digits_do_no_harm():
    time_s, values, _next_to = interpolated(500, 2.4)
    found = find_interpolation(np.round(time_s, 4), values)
    assert found is not None
    assert found.rate_hz == pytest.approx(500.0, rel=1e-3)


def test_a_rest_in_the_middle_does_no_harm():
    time_s, values, next_to = interpolated(250, 4)
    values[1000:2500] = values[1000]
    found = find_interpolation(time_s, values)
    assert found is not None
    before = next_to[next_to < 990]
    assert found.keep[before].all()
    assert found.keep[:990].sum() == pytest.approx(len(before), abs=2)


STEADY_S = np.arange(0.0, 6.0, 0.001)
TRIANGLE = np.abs((2.0 * STEADY_S) % 2.0 - 1.0)
NOISE = np.random.default_rng(1).standard_normal(STEADY_S.size)
DEPTH_MM = motion(STEADY_S)[0]
OTHERS = {
    "readings": DEPTH_MM + 0.002 * NOISE,
    "readings of three digits": np.round(DEPTH_MM + 0.002 * NOISE, 3),
    "readings of two digits": np.round(DEPTH_MM + 0.002 * NOISE, 2),
    "without noise": DEPTH_MM,
    "without noise, four digits": np.round(DEPTH_MM, 4),
    "a force without noise": 0.3 * np.maximum(DEPTH_MM, 0.0) ** 1.5,
    "smoothed": np.convolve(DEPTH_MM + 0.002 * NOISE, np.ones(10) / 10.0, "same"),
    "held": np.repeat((DEPTH_MM + 0.002 * NOISE)[::4], 4),
    "hum": 0.3 * np.sin(2.0 * np.pi * 100.0 * STEADY_S) + 0.01 * NOISE,
    "hum alone": DEPTH_MM + 0.3 * np.sin(2.0 * np.pi * 50.0 * STEADY_S),
    "constant": np.full(STEADY_S.size, 2.0),
    "still": 2.0 + 0.002 * NOISE,
    "a ramp": 0.5 * STEADY_S,
    "a ramp, four digits": np.round(0.5 * STEADY_S, 4),
    "to and fro at constant velocity": TRIANGLE,
    "to and fro with rests": np.clip(2.0 * TRIANGLE, 0.0, 1.7),
    "steps": np.floor(3.0 * STEADY_S),
    "a walk": np.cumsum(NOISE),
    "few": (DEPTH_MM + 0.002 * NOISE)[:150],
}


@pytest.mark.parametrize("values", OTHERS.values(), ids=OTHERS)
def test_nothing_is_found_in_another_channel(values):
    assert find_interpolation(STEADY_S[: len(values)], values) is None


def test_stamps_that_go_back_or_stand_are_none_to_judge_by():
    time_s, values, _next_to = interpolated(250, 4)
    assert find_interpolation(time_s[::-1], values) is None
    assert find_interpolation(np.zeros(len(values)), values) is None


@pytest.mark.parametrize(("rate_hz", "ratio"), [(1000, 4), (500, 2.4)])
def test_the_readings_alone_give_the_tissue(rate_hz, ratio):
    time_s, values, _next_to = interpolated(rate_hz, ratio, seed=3)
    pairs = zip(*motion(time_s), strict=True)
    force = np.array([hunt_crossley_force(d, v, *TRUE) if d > 0 else 0.0 for d, v in pairs])
    force += 0.01 * np.random.default_rng(4).standard_normal(force.size)
    values[~find_interpolation(time_s, values).keep] = np.nan
    estimator = create_estimator("self_tuning_ukf", missing_readings=True)
    last = estimator.run(time_s, values, force)[-1]
    assert (np.abs(last.parameters - TRUE) < 3.5 * last.parameters_std).all()
    assert last.parameters[0] == pytest.approx(TRUE[0], rel=0.02)
