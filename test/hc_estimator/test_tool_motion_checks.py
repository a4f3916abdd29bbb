"""Drag and mass in drawn contacts: none is named where something else is wrong, most is found."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from presses_from_air import TROUBLES, nothing, presses, readings, relaxing, steps

from hc_estimator.stream.readings import Check, usable, whole
from hc_estimator.stream.sanity import check_samples
from hc_estimator.stream.tool_motion_checks import find_tool_motion

SEEDS = range(25)
SHARE = 0.03
"""Of the largest force: what drag or mass takes of it."""


def found(time_s, place, force):
    channels = usable("displacement", "mm", time_s, place), usable("force", "N", time_s, force)
    return whole(find_tool_motion(*channels))


def moved(contact):
    """Velocity and acceleration with their 95 % quantiles."""
    velocity = np.gradient(contact["place"], contact["time"])
    acceleration = np.gradient(velocity, contact["time"])
    return [(v, float(np.quantile(np.abs(v), 0.95))) for v in (velocity, acceleration)]


@pytest.mark.parametrize("trouble", TROUBLES)
def test_none_is_named_where_there_is_none(trouble):
    """Nor where dry friction holds the tool back, but for one way at one speed, which is both."""
    named = 0
    for seed in SEEDS:
        place, with_friction, contact = readings(trouble, seed)
        assert found(contact["time"], place, with_friction(0.0)) is None, seed
        named += found(contact["time"], place, with_friction(SHARE)) is not None
    assert named <= 1


@pytest.mark.parametrize(("which", "least"), [(0, 0.5), (1, 0.3)])
@pytest.mark.parametrize("trouble", [nothing, relaxing, steps])
def test_most_is_found_where_there_is_one(trouble, which, least):
    """Drag, and a mass: of slow motions, of few passages or of a noisy sensor it is not seen."""
    right = wrong = 0
    for seed in SEEDS:
        place, with_friction, contact = readings(trouble, seed)
        motion, most = moved(contact)[which]
        one = found(
            contact["time"], place, with_friction(0.0) + SHARE * contact["most"] * motion / most
        )
        sizes = (0.0, 0.0) if one is None else (one.drag_n, one.inertia_n)
        assert sizes[1 - which] == 0.0, seed
        if sizes[which]:
            quotient = (one.damping, 1e-3 * one.mass_kg)[which] * most / (SHARE * contact["most"])
            right += abs(quotient - 1.0) < 0.25
            wrong += abs(quotient - 1.0) >= 0.25
    assert right >= least * len(SEEDS)
    assert wrong <= 0.08 * len(SEEDS)


@pytest.mark.parametrize("friction_n", [0.0, 0.2])
def test_both_are_told_apart_from_each_other_from_friction_and_from_the_zero(friction_n):
    one = found(*presses(friction_n=friction_n, zero_n=0.4))
    assert one.damping == pytest.approx(0.01, rel=0.03)
    assert one.mass_kg == pytest.approx(0.3, rel=0.05)
    assert one.zero_n == pytest.approx(0.4, abs=0.005)
    assert abs(one.zero_n - 0.4) < 6.0 * one.zero_std_n
    told = {s.check: s for s in check_samples(*presses(friction_n=friction_n))}
    assert {Check.INERTIA, Check.DAMPING} <= told.keys()
    assert (Check.FRICTION in told) is (friction_n > 0.0)
    if friction_n:
        assert told[Check.FRICTION].remedy == pytest.approx(friction_n, rel=0.05)
    assert Check.ZERO_STEP not in told


def test_in_the_tissue_nobody_knows():
    """Where the tool never leaves it, damping is the tissue's."""
    time_s, place, force = presses()
    inside = place > 0.3
    held = np.interp(time_s, time_s[inside], place[inside])
    assert found(time_s, held, np.interp(time_s, time_s[inside], force[inside])) is None
    assert found(*presses(0.0, 0.0)) is None


def test_in_the_air_alone_it_is_found_as_well():
    one = found(*presses(stiffness=0.0))
    assert one.damping == pytest.approx(0.01, rel=0.03)
    assert one.mass_kg == pytest.approx(0.3, rel=0.05)


def test_what_is_seldom_uneven_or_short_is_none():
    time_s, place, force = presses()
    assert found(time_s[:80], place[:80], force[:80]) is None
    some = np.sort(np.random.default_rng(1).choice(len(time_s), 300, replace=False))
    sparse = found(time_s[some], place[some], force[some])
    assert sparse is None or abs(sparse.mass_kg - 0.3) < 0.1
    twice = np.repeat(np.arange(2000), 2)
    assert found(time_s[twice], place[twice], force[twice]) is None  # stamps that do not go on
    back = found(time_s[::-1], place[::-1], force[::-1])
    assert back is None
    at_once = usable("force", "N", np.full(len(time_s), 3.21), force)  # regression: an IndexError
    assert whole(find_tool_motion(usable("displacement", "mm", time_s, place), at_once)) is None


@pytest.mark.parametrize(("channel", "count"), [(0, 8), (1, 60)])
def test_spikes_hide_nothing(channel, count):
    """Regression: eight of 3 mm, or forty of 3 N, in 12,000 readings, and neither was found."""
    time_s, *readings = presses()
    readings[channel][np.random.default_rng(2).choice(len(time_s), count, replace=False)] += 3.0
    place, force = readings
    one = found(time_s, place, force)
    assert one.damping == pytest.approx(0.01, rel=0.03)
    assert one.mass_kg == pytest.approx(0.3, rel=0.05)


SIZES = st.sampled_from([0.0, 1e-300, 1e-6, 1.0, 1e6, 9e11])


@given(st.integers(0, 10**6), SIZES, SIZES, SIZES, st.integers(1, 400), st.integers(100, 900))
@settings(max_examples=60, deadline=None)
def test_nonsense_is_looked_at_without_an_error(seed, step, size_mm, size_n, few, count):
    """Stamps that repeat, channels that stand or jump, numbers of any size."""
    random = np.random.default_rng(seed)
    time_s = np.cumsum(random.choice([0.0, 1.0, 1.0, 1.0, 50.0], count)) * step
    even_s = np.arange(count) * max(step, 1e-9)
    place = size_mm * np.cumsum(random.standard_normal(count))
    force = size_n * random.choice([0.0, 1.0, -1.0, 3.0], count)
    force[: count // 2] = force[0]
    with np.errstate(all="ignore"):
        for stamps in (time_s, even_s):
            displacement = usable("displacement", "mm", stamps, place)
            for of_force in (stamps, np.full(count, stamps[few % count])):
                one = whole(find_tool_motion(displacement, usable("force", "N", of_force, force)))
                assert one is None or np.isfinite(one).all()
