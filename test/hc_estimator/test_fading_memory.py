"""The velocity of a noisy place: exact for a parabola, and the least squares that it is to be."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hc_estimator.stream.fading_memory import MEMORY_S, FadingMemory


def fed(stamps_ns, places):
    memory = FadingMemory()
    for stamp, place in zip(stamps_ns.tolist(), places.tolist(), strict=True):
        memory.take(stamp, place)
    return memory


@given(st.floats(-50, 50), st.floats(-100, 100), st.floats(-1000, 1000))
def test_it_has_no_lag_on_a_parabola(place, velocity, acceleration):
    stamps = 1_000_000_000 + 2_000_000 * np.arange(400)
    time_s = (stamps - stamps[0]) * 1e-9
    memory = fed(stamps, place + velocity * time_s + 0.5 * acceleration * time_s**2)
    for ahead_ns in (0, 30_000_000):
        at_s = time_s[-1] + ahead_ns * 1e-9
        expected = velocity + acceleration * at_s
        assert memory.velocity_at(int(stamps[-1]) + ahead_ns) == pytest.approx(expected, abs=1e-4)


def test_it_is_least_squares_with_a_memory_that_fades():
    random = np.random.default_rng(1)
    stamps = 1_000_000 * np.arange(600)
    time_s = stamps * 1e-9
    places = np.sin(9.0 * time_s) + 0.003 * random.standard_normal(len(time_s))
    memory = fed(stamps, places)
    back = time_s - time_s[-1]
    weights = np.exp(0.5 * back / MEMORY_S)  # of the residual: squares fade by e in MEMORY_S
    columns = np.column_stack([np.ones(len(back)), back, 0.5 * back**2])
    fit = np.linalg.lstsq(columns * weights[:, None], places * weights, rcond=None)[0]
    assert memory.velocity_at(int(stamps[-1])) == pytest.approx(fit[1], rel=1e-6)
    assert memory.velocity_at(int(stamps[-1]) + 10**7) == pytest.approx(fit[1] + 0.01 * fit[2])


@pytest.mark.parametrize("later_ns", [-5_000_000, 0, 700_000_000])
def test_stamps_that_go_back_or_pause_begin_anew(later_ns):
    stamps = 1_000_000_000 + 1_000_000 * np.arange(400)
    memory = fed(stamps, 0.01 * np.arange(400.0))
    assert memory.velocity_at(int(stamps[-1])) == pytest.approx(10.0)
    memory.take(int(stamps[-1]) + later_ns, -30.0)
    assert memory.velocity_at(int(stamps[-1]) + 2 * abs(later_ns)) == 0.0
