"""Readings of a tactile array that cannot be right: K of 4051 to 1e-11 N/mm was told as it came."""

import numpy as np
import pytest

from hc_estimator.stream.array_status import why_no_places
from hc_estimator.stream.array_watch import ArrayWatch

START = 1_700_000_000_000_000_000
RATE = 200.0
COLUMNS = 4


def pad(time_s, rng, taxels=16):
    """A pad pressed at 0.8 Hz from the air; taxel 8 stands over a hard spot."""
    depth = 1.0 + 2.0 * np.sin(2.0 * np.pi * 0.8 * time_s)
    stiffness = np.where(np.arange(taxels) == taxels // 2, 1.0, 0.3)
    force = stiffness * max(depth, 0.0) ** 1.5 + rng.normal(0.0, 0.005, taxels)
    return np.full(taxels, depth) + rng.normal(0.0, 0.002, taxels), force


def watched(
    spoil=lambda depth, force: (depth, force), seconds=12.0, watch=None, latency_ns=10**6, live=True
):
    """What a watch says in the end, looking once a second as the node does; and what was new."""
    watch, rng, new = watch or ArrayWatch(), np.random.default_rng(1), []
    for i in range(int(seconds * RATE)):
        time_s = i / RATE
        depth, force = spoil(*pad(time_s, rng))
        watch.add(START + round(time_s * 1e9), depth, force)
        watch.add_latency(latency_ns, live=live)
        while watch.looking:
            watch.go_on()
        if i % int(RATE) == 0:
            new += watch.look(time_s, COLUMNS)
    assert watch.failure == ""
    return watch.problems, new


def at(taxel, channel, value):
    def spoil(depth, force):
        (depth, force)[channel][taxel] = value
        return depth, force

    return spoil


def test_sound_readings_are_not_doubted():
    assert watched() == ([], [])


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (at(1, 1, 0.7), "1 of 16 taxels reads the same force all the time while the others "),
        (at(5, 1, 0.0), "1 of 16 taxels reads the same force all the time while the others "),
        (at(1, 0, 1.5), "1 of 16 taxels reads the same displacement all the time while "),
        (lambda d, f: (1000.0 * d, f), "taxel 8: 5.21 N over 4e+03 mm"),
        (lambda d, f: (d, 1000.0 * f), "taxel 8: 5.21e+03 N over 4 mm"),
        (lambda d, f: (d, -f), "it reads a push as a pull; turn its sign; the array's driver "),
        (lambda d, f: (-d, f), "turn the sign of the displacement; the array's driver has to"),
        (lambda d, f: (d, f + 2.0), "the force reads 2 N free of contact; the array's driver "),
        (lambda d, f: (d + 50.0, f), "contact begins near 50 mm, not at 0; the array's driver"),
    ],
    ids=["stuck", "dead", "stuck place", "mm", "mN", "pull", "turned", "zero", "far"],
)
def test_what_cannot_be_right_is_said_once(spoil, said):
    problems, new = watched(spoil)
    assert len(problems) == len(new) == 1
    assert said in problems[0]
    assert ".sign" not in problems[0]
    assert ".zero" not in problems[0]


def test_a_taxel_beside_the_tissue_that_reads_zero_is_no_fault():
    def edge(depth, force):
        force[[0, 4, 8, 12]] = 0.0  # a column off the tissue, of a sensor that is silent unloaded
        return depth, force

    assert watched(edge) == ([], [])


def test_a_pad_at_rest_of_a_coarse_sensor_is_no_fault():
    assert watched(lambda d, f: (np.full(16, 1.0), np.full(16, 0.3))) == ([], [])


def test_missing_readings_are_no_taxel_that_stands_still():
    assert watched(at(1, 1, np.nan)) == ([], [])


def test_stamps_in_the_future_are_told():
    problems, _new = watched(latency_ns=-3600 * 10**9)
    assert problems == [
        "samples are stamped 3600 s in the future: the clocks of sensor and computer differ (use "
        "PTP or chrony)"
    ]


@pytest.mark.parametrize(
    ("latency_s", "said"),
    [
        (1000, "samples are 1000 s old when they are used: the clocks of sensor and computer "),
        (1_700_000_000, "samples are stamped as of 1970: their times count from the start of a "),
    ],
)
def test_stamps_far_in_the_past_are_told_unless_a_player_speaks(latency_s, said):
    """Status "estimating" and nothing else, with a latency of 1e+09 us."""
    problems, new = watched(latency_ns=latency_s * 10**9)
    assert len(problems) == len(new) == 1
    assert problems[0].startswith(said)
    assert watched(latency_ns=latency_s * 10**9, live=False) == ([], [])


def test_another_array_is_judged_by_its_own_readings():
    watch = ArrayWatch()
    assert watched(lambda d, f: (d, -f), watch=watch)[0]
    watch.forget(9)
    assert watch.problems == []
    assert watched(lambda d, f: (d[:9], f[:9]), watch=watch) == ([], [])


@pytest.mark.parametrize(
    ("taxels", "columns", "pitch_m", "said"),
    [
        (16, 4, 0.002, ""),
        (16, 0, 0.002, "columns = 0, of which 16 taxels are no whole rows"),
        (16, 3, 0.002, "columns = 3, of which 16 taxels are no whole rows"),
        (16, 4, 2.0, "pitch = 2 m from one taxel to the next"),
        (16, 4, float("nan"), "pitch = nan m"),
    ],
)
def test_taxels_without_places_are_told(taxels, columns, pitch_m, said):
    """The page had no map, and nobody said why."""
    found = why_no_places(taxels, columns, pitch_m)
    assert found.startswith(said)
    assert bool(found) == bool(said)
