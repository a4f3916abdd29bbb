"""The latency of an estimate is that of its sample, whatever becomes of the clock."""

import pytest

from hc_estimator.stream.latency import LatencyClock
from hc_estimator.stream.readings import Check
from hc_estimator.stream.stamp_watch import StampWatch
from hc_estimator.stream.suspicion_watch import SuspicionWatch

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


@pytest.mark.parametrize(
    ("latencies", "live", "told"),
    [
        ((-7200_000, -7200_003), True, "stamped 7200 s in the future"),
        ((-30, -12), False, "stamped 0.012 s in the future"),
        ((-30, -12, 3), True, ""),  # one that waited: a source that stamps ahead now and then
        ((-9, -4), True, ""),
        ((7200_000, 7200_400), True, "samples are 7200 s old when they are used"),
        ((7200_000, 7200_400), False, ""),  # a bag
        # Regression: of a simulation they were "1795770749 s old", of clocks that differ.
        ((1_795_770_749_000, 1_795_770_749_400), True, "use_sim_time: true"),
        # Regression: of a computer whose clock stands at 2007, "stamped as of 1970".
        ((600_000_000_000, 600_000_000_400), True, "samples are 19 years old when they are used"),
        ((-600_000_000_400, -600_000_000_000), True, "stamped 19 years in the future: the clocks"),
        ((259_200_000, 259_200_400), True, "samples are 3 days old when they are used"),
        # Regression: with use_sim_time and no /clock, "1795955745 s in the future: (use PTP ...)".
        ((-1_795_770_749_000, -1_795_770_749_400), True, "use_sim_time: false"),
        ((1300, 40, 2), True, ""),  # a node that stood still
        ((), True, ""),
    ],
)
def test_stamps_of_another_clock_are_doubted_and_late_samples_are_not(latencies, live, told):
    watch = StampWatch()
    for _ in range(2):  # nothing is left of what was looked at
        for late in latencies:
            watch.add(late * MS, live=live)
        found = watch.take(0.0)
        assert [(s.check, s.channel) for s in found] == [(Check.CLOCK, "samples")] * bool(told)
        assert not told or told in found[0].sentence
        assert watch.take(0.0) == []


def test_an_age_that_changes_is_no_difference_of_clocks():
    """Regression: a driver that a busy machine starved was told to have another clock."""
    watch = StampWatch()
    looks = ((9000, "clocks"), (9800, "does not keep up"), (9805, "clocks"))
    for look, (age, told) in enumerate(looks):
        watch.add(age * MS, live=True)
        (found,) = watch.take(2.0 * look)
        assert told in found.sentence


@pytest.mark.parametrize("pace", [0.5, 0.9, 2.0, 10.0])
@pytest.mark.parametrize("live", [True, False])
def test_stamps_that_go_at_another_pace_are_said_to_do_so(pace, live):
    """Regression: stamps counted at half the rate were "a driver that does not keep up"."""
    watch = StampWatch()
    told = []
    for look in range(6):
        now_s = 100.0 + 2.1 * look
        for age_s in ((1.0 - pace) * 2.1 * look + wait for wait in (0.002, 0.05)):
            watch.add(round(age_s * 1e9), live=live)
        told += [s.sentence for s in watch.take(now_s)]
    expected = live or pace > 1.0  # a bag that is played slowly is as old as it is
    assert any(f"stamps go {pace:.2g} times as fast" in said for said in told) is expected


def test_a_machine_that_falls_behind_is_no_clock_of_another_pace():
    watch = StampWatch()
    ages = (0, 400, 1500, 3300, 3900, 2500, 900, 300, 20, 15)
    for look, age in enumerate(ages):
        watch.add(age * MS, live=True)
        assert not any("as fast as" in s.sentence for s in watch.take(2.0 * look))


def test_a_second_clock_is_told_as_well():
    """Regression: of a driver that came back with stamps of 1970 nothing was told.

    Its clock had been an hour ahead before, and the doubt of the clock stood already.
    """
    watch = SuspicionWatch()
    told = []
    for look in range(12):
        latency_ns = -3600 * 10**9 if look < 6 else 1796 * 10**15
        for reading in range(20):
            watch.add((100 * look + reading) * MS, 1.0, 1.0)
            watch.add_latency(latency_ns + look, live=True)
        for step in range(21):
            told += [s.sentence for s in watch.look(2.1 * look + 0.1 * step)]
    said = [sentence for sentence in told if "stamped" in sentence]
    assert ["3600 s in the future" in said[0], "as of 1970" in said[1], len(said)] == [
        True,
        True,
        2,
    ]
    assert [s.sentence for s in watch.suspicions if s.check is Check.CLOCK] == [said[1]]
