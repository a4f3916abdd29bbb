"""The latency of an estimate is that of its sample, whatever becomes of the clock."""

import pytest

from hc_estimator.stream.latency import LatencyClock

HOUR = 3_600_000_000_000
MS = 1_000_000


@pytest.mark.parametrize("step", [HOUR, -HOUR, 600_000 * MS, -1000 * MS])
@pytest.mark.parametrize("goes_with_it", [False, True])
def test_a_clock_that_is_set_is_no_latency(step, goes_with_it):
    """Once a run that had slept for ten minutes was told to be 615 s late, for ever."""
    clock = LatencyClock()
    offset, steady = 5 * HOUR, 0
    for number in range(2000):
        steady += MS
        stamp = steady + offset - 3 * MS
        if number >= 1000 and goes_with_it:
            stamp += step
        now = steady + offset + (step if number >= 1000 else 0)
        assert clock.latency_ns(stamp, now, steady) == 3 * MS


def test_a_true_latency_is_told():
    clock = LatencyClock()
    for late in (2, 700, 5000, 3):  # a node that stood still has its samples to work off
        assert clock.latency_ns(HOUR - late * MS, HOUR, 7) == late * MS


def test_stamps_of_another_machine_s_clock_are_taken_as_they_are():
    clock = LatencyClock()
    for steady in range(0, 100 * MS, MS):
        assert clock.latency_ns(steady - HOUR, steady, steady) == HOUR
