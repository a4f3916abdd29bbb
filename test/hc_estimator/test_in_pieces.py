"""Recordings that go through an estimator piece by piece give the numbers of one call."""

import numpy as np
import pytest

from hc_estimator import create_estimator
from hc_estimator.stream.in_pieces import PIECE, run_in_pieces
from hc_msgs_py import free_memory
from hc_msgs_py.free_memory import NotEnoughMemoryError, free_bytes


def presses(count):
    time_s = np.arange(count) * 1e-3
    depth = 1.5 + 2.2 * np.sin(2.1 * time_s) + 0.5 * np.sin(13.0 * time_s)
    force = 0.5 * np.maximum(depth, 0.0) ** 1.5
    generator = np.random.default_rng(1)
    force[::7] = np.nan  # a force that is missing now and then
    return time_s, depth + generator.normal(0.0, 0.002, count), force


@pytest.mark.parametrize("filter", ["self_tuning_ukf", "raukf"])
@pytest.mark.parametrize("count", [0, 1, PIECE, 2 * PIECE + 17])
def test_pieces_are_the_whole_to_the_last_bit(filter, count):
    readings = presses(count)
    whole = create_estimator(filter, missing_readings=True).run(*readings)
    pieces = run_in_pieces(create_estimator(filter, missing_readings=True), *readings)
    np.testing.assert_array_equal(pieces.values, whole.values)


def test_lengths_that_differ_are_refused_as_in_one_call():
    estimator = create_estimator("raukf")
    for columns in ((5, 5, 4), (PIECE, PIECE, PIECE + 1)):
        with pytest.raises(ValueError, match="give three one-dimensional arrays of one length"):
            run_in_pieces(estimator, *map(np.zeros, columns))


def test_a_recording_that_does_not_fit_is_refused_before_it_fills_the_memory(monkeypatch, tmp_path):
    """Regression: of two days at 1 kHz a shell says "Killed", after minutes."""
    meminfo = tmp_path / "meminfo"
    meminfo.write_text("MemTotal:  24105 kB\nMemAvailable:       1 kB\nSwapFree:  1 kB\n")
    monkeypatch.setattr(free_memory, "MEMINFO", meminfo)
    monkeypatch.setattr(free_memory, "CGROUP", tmp_path)
    run_in_pieces(create_estimator("raukf"), *presses(4))
    with pytest.raises(NotEnoughMemoryError, match=r"estimates of 5 samples .*hc bag split"):
        run_in_pieces(create_estimator("raukf"), *presses(5))
    (tmp_path / "memory.max").write_text("max\n")
    assert free_bytes() == 2048.0
    (tmp_path / "memory.max").write_text("5000\n")
    (tmp_path / "memory.current").write_text("4800\n")
    (tmp_path / "memory.stat").write_text("anon 4000\ninactive_file 500\nactive_file 300\n")
    assert free_bytes() == 1000.0  # what was read of files gives way
    (tmp_path / "meminfo").unlink()
    assert free_bytes() == np.inf
