"""What a recording shows in both channels at once: no motion, a freeze, a rate that is too low.

Regression of 2026-11-28: two channels that stood still were "100 % known", and "nothing is wrong".
"""

import numpy as np
import pytest

from hc_estimator.stream.both_channels import check_both
from hc_estimator.stream.readings import Check
from hc_estimator.stream.sanity import check_samples

TIME_S = np.arange(0.0, 10.0, 0.001)
NOISE = np.random.default_rng(1).standard_normal((2, TIME_S.size))


def presses(times=TIME_S, noise=NOISE):
    depth = 1.0 + 1.6 * np.sin(3.1 * times - 1.5) + 0.6 * np.sin(8.2 * times)
    force = 0.3 * np.maximum(depth, 0.0) ** 1.5
    return depth + 0.002 * noise[0, : times.size], force + 0.01 * noise[1, : times.size]


def checks(found):
    return [(s.check, s.channel) for s in found]


@pytest.mark.parametrize(
    ("depth", "force"),
    [
        (np.full(TIME_S.size, 1.0), np.full(TIME_S.size, 0.5)),
        (2.0 + 0.002 * NOISE[0], 1.0 + 0.01 * NOISE[1]),
        (np.full(TIME_S.size, 2.0), 0.01 * NOISE[1]),
    ],
    ids=["constant", "noise", "one_of_each"],
)
def test_two_channels_that_stand_still_are_all_that_is_told(depth, force):
    (found,) = check_samples(TIME_S, depth, force)
    assert (found.check, found.channel) == (Check.STUCK, "both")
    assert found.sentence.startswith("nothing moves")


@pytest.mark.parametrize("apart", [False, True], ids=["pairs", "readings_of_their_own"])
def test_a_freeze_of_both_is_told_with_when_and_how_long(apart):
    depth, force = presses()
    depth[3000:6000], force[3000:6000] = depth[3000], force[3000]
    if apart:
        depth[::2], force[1::2] = np.nan, np.nan
    found = [s for s in check_samples(TIME_S, depth, force) if s.channel == "both"]
    assert checks(found) == [(Check.PAUSE, "both")]
    assert "still for 3 s, 3 s after the beginning" in found[0].sentence


def test_a_rate_that_is_too_low_for_the_motion_is_told():
    slow = np.arange(0.0, 10.0, 0.2)
    (found,) = check_both(slow, *presses(slow))
    assert (found.check, found.channel) == (Check.RATE, "displacement")
    assert "5 Hz is too low a rate" in found.sentence


def rests(times=TIME_S):
    """A simulated tool that rests in the tissue, without any noise."""
    depth = np.minimum(1.0 + 1.6 * np.sin(3.1 * times), 2.0)
    return depth, 0.3 * np.maximum(depth, 0.0) ** 1.5


@pytest.mark.parametrize(
    ("depth", "force"),
    [
        presses(),
        rests(),
        (np.round(presses()[0], 2), np.round(presses()[1], 1)),
        (np.full(TIME_S.size, 2.0) + 0.002 * NOISE[0], np.exp(-TIME_S) + 0.01 * NOISE[1]),
        (presses()[0], 0.01 * NOISE[1]),
    ],
    ids=["presses", "a_simulated_rest", "coarse_sensors", "tissue_that_relaxes", "in_the_air"],
)
def test_what_may_be_right_is_not_doubted(depth, force):
    assert check_both(TIME_S, depth, force) == []


def test_readings_of_any_size_and_kind_are_looked_at():
    depth, force = presses()
    for values in (depth * 1e300, np.full(TIME_S.size, np.nan), np.full(TIME_S.size, np.inf)):
        check_both(TIME_S, values, force)
        check_both(TIME_S[::-1], depth, values)
    assert check_both(TIME_S[:5], depth[:5], force[:5]) == []
