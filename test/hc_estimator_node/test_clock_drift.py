"""Two live topics whose stamps are of clocks that go unlike: K was wrong, and nothing was said."""

import re

import numpy as np
import pytest

from hc_estimator.stream.clock_drift import ClockDrift
from hc_estimator.stream.readings import Check

NS = 10**9
RATES = (1000, 250)
"""Readings a second of force and position."""


def watched(fast=(0.0, 0.0), seconds=60, seed=1, *, trouble=lambda now, sensor: 0.0, jitter=0.002):
    """What is said each second of two topics, of which stamps go (1 + fast) times as fast."""
    generator, drift, said = np.random.default_rng(seed), ClockDrift(), []
    for second in range(seconds):
        for sensor, rate in enumerate(RATES):
            at = second + np.arange(rate) / rate
            way = 0.0005 * (1 + sensor) + generator.exponential(jitter, rate)
            for measured_s, way_s in zip(at, way, strict=True):
                stamp_s = measured_s * (1.0 + fast[sensor]) + trouble(measured_s, sensor)
                drift.add(sensor, round(stamp_s * NS), round((measured_s + way_s) * NS))
        said.append(drift.look(float(second)))
    return said


@pytest.mark.parametrize("fast", [0.002, 0.0002, -0.002])
def test_a_clock_that_goes_faster_is_found(fast):
    for seed in (1, 2):
        rates = watched((0.0, fast), seed=seed)
        assert rates[-1] == pytest.approx(fast, rel=0.05)
        assert watched((fast, 0.0), seed=seed)[-1] == pytest.approx(-fast, rel=0.05)
    if abs(fast) > 0.001:
        assert next(i for i, rate in enumerate(rates) if rate) <= 24  # seconds


def stepping(now_s, sensor):
    return 0.03 if sensor and now_s > 33.0 else 0.0


def of_an_ntp_server(now_s, _sensor):
    return 0.02 * np.sin(now_s / 20.0)


def stalling(now_s, sensor):
    return -0.2 if sensor and 20.0 < now_s % 60.0 < 21.0 else 0.0


def buffered(now_s, sensor):
    return -0.01 * (now_s % 7.0) / 7.0 if sensor else 0.0


@pytest.mark.parametrize("trouble", [stepping, of_an_ntp_server, stalling, buffered])
def test_nothing_else_passes_for_two_clocks(trouble):
    for seed in (1, 2):
        for jitter in (0.0002, 0.01):
            assert not any(watched(trouble=trouble, seed=seed, jitter=jitter))


def test_clocks_that_go_alike_are_not_doubted():
    assert not any(watched())
    assert not any(watched((1e-6, -1e-6), seconds=90))
    assert not any(watched((0.002, 0.002)))  # played at another rate, or this clock is slewed


def test_a_topic_that_was_silent_is_watched_anew():
    drift = ClockDrift()
    for second in range(40):
        if second != 25:
            drift.add(1, round(1.002 * second * NS), second * NS)
        drift.add(0, second * NS, second * NS)
        drift.look(float(second))
    assert drift.span_s > 0.0
    for second in range(40, 45):
        drift.add(0, second * NS, second * NS)
        drift.look(float(second))
    assert drift.span_s == 0.0


@pytest.mark.parametrize(("fast", "ahead"), [(0.002, "/arm"), (-0.002, "/wrist")])
def test_it_is_said_in_one_line(fast, ahead):
    drift = ClockDrift()
    for second in range(24):
        drift.add(0, second * NS, second * NS)
        drift.add(1, round((1.0 + fast) * second * NS), second * NS)
        doubts = drift.doubts(float(second), ("/wrist", "/arm"))
    [doubt] = doubts
    other = {"/arm": "/wrist", "/wrist": "/arm"}[ahead]
    assert (doubt.check, doubt.channel) == (Check.CLOCK, "both")
    rate, growth_ms, rest = re.fullmatch(
        f"the stamps of {ahead} go ([0-9]+) us a second faster than those of {other}, by ([0-9.]+) "
        "ms in the last 20 s: (.*)",
        doubt.sentence,
    ).groups()
    assert (float(rate), float(growth_ms)) == pytest.approx((2000.0, 40.0), rel=0.03)
    assert rest == (
        "they are of two clocks, and no time offset serves; stamp both by one clock (PTP, chrony), "
        "or where they arrive"
    )
