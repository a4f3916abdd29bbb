"""Friction between force sensor and tissue: taken off by the way alone, and found in the air.

The forces that are to be found were made by other friction than is taken off (a smooth function of
the velocity), as well as by the same.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hc_estimator import create_estimator
from hc_estimator.stream.dry_friction import DRY_FRICTION, PRESLIDING, DryFriction
from hc_estimator.stream.friction_checks import find_friction, find_presliding
from hc_estimator.stream.readings import Check, robust_range, whole
from hc_estimator.stream.sanity import check_samples

K, B, N, P = 0.4, 0.01, 1.5, 1.0
WAYS = st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=60)


def stamped(count, rate_hz=500.0):
    return np.round(np.arange(count) * 1e9 / rate_hz).astype(np.int64)


def plain(ways, newtons, presliding):
    """Friction of places without noise, in the increments of its strain; NaN while it turns."""
    strain, last, found, slid = 0.0, ways[0], [], False
    for place in ways:
        strain = min(max(strain + (place - last) / presliding, -1.0), 1.0)
        last = place
        slid = slid or abs(strain) == 1.0
        found.append(newtons * strain if abs(strain) == 1.0 or not slid else math.nan)
    return found


def contact(friction, seed=1, seconds=12.0, rate_hz=500.0, zero_n=0.0, top_mm=-3.0, **noise):
    """Presses from the air into tissue: stamps [s], displacements [mm] and forces [N]."""
    random = np.random.default_rng(seed)
    time_s = np.arange(int(seconds * rate_hz)) / rate_hz
    ramp = np.minimum(time_s, 1.0)
    place = top_mm + ramp * (4.0 - 3.5 * np.cos(np.pi * time_s) + 0.8 * np.sin(10.7 * time_s))
    velocity = np.gradient(place, time_s)
    depth = np.maximum(place, 0.0)
    force = np.maximum(0.0, depth**N * (K + B * np.sign(velocity) * np.abs(velocity) ** P))
    force = force + friction(place, velocity) + zero_n
    place = place + noise.get("noise_mm", 0.003) * random.standard_normal(len(time_s))
    force = force + noise.get("noise_n", 0.01) * random.standard_normal(len(time_s))
    return time_s, place, force


def smooth(newtons, velocity_mm_s=0.3):
    return lambda _place, velocity: newtons * np.tanh(velocity / velocity_mm_s)


def sliding(newtons, presliding):
    """Prandtl's element, with whatever it is while it turns."""

    def friction(place, _velocity):
        middle, found = place[0], []
        for now in place.tolist():
            middle = min(max(middle, now - presliding), now + presliding)
            found.append(newtons * (now - middle) / presliding)
        return np.array(found)

    return friction


def none(place, _velocity):
    return np.zeros(len(place))


@given(st.lists(st.sampled_from([-1, 1]), min_size=1, max_size=20), st.floats(1e-2, 100.0))
@settings(max_examples=100, deadline=None)
def test_it_is_that_of_an_element_that_yields(turns, newtons):
    """Along straight ways: third differences are no noise there but at the turns."""
    presliding = 0.4
    steps = np.repeat(turns, 40) * 0.05
    ways = np.cumsum(steps)
    friction = DryFriction(newtons, presliding)
    stamps = stamped(len(ways))
    found = friction.of_many(stamps, ways)
    known = ~np.isnan(found)
    assert np.all(np.abs(found[known]) <= newtons)
    again = DryFriction(newtons, presliding)
    one_by_one = [again.at(*row) for row in zip(stamps.tolist(), ways.tolist(), strict=True)]
    np.testing.assert_array_equal(one_by_one, found)
    expected = np.array(plain(ways.tolist(), newtons, presliding))
    turned = np.abs(np.diff(steps, prepend=steps[0])) > 0.0
    late = np.convolve(turned, np.ones(30), "full")[: len(ways)] > 0.0  # noise of the turn, and way
    np.testing.assert_allclose(found[~late], expected[~late], atol=1e-9 * newtons)
    assert np.isnan(found).sum() <= np.isnan(expected).sum() + 10 * turned.sum()


@given(WAYS)
@settings(deadline=None)
def test_nothing_is_taken_off_where_nothing_is_set(ways):
    friction = DryFriction()
    friction.configure({})
    assert (friction.newtons, friction.presliding_mm) == (DRY_FRICTION.default, PRESLIDING.default)
    assert friction.of_many(stamped(len(ways)), np.array(ways)).tolist() == [0.0] * len(ways)


@given(WAYS, st.integers(0, 59))
@settings(deadline=None)
def test_a_place_that_was_not_read_changes_nothing(ways, gap):
    """NaN, or an infinite one: what comes after is the same to the last bit."""
    ways.insert(min(gap, len(ways)), math.nan)
    ways.insert(min(gap, len(ways)), math.inf)
    stamps = stamped(len(ways))
    found = DryFriction(2.0, 0.1).of_many(stamps, np.array(ways))
    read = np.isfinite(ways)
    less = DryFriction(2.0, 0.1).of_many(stamps[read], np.array(ways)[read])
    np.testing.assert_array_equal(found[read], less)
    assert not np.any(np.abs(found[~np.isnan(found)]) > 2.0)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -1e300, 1e11, 50.0])
def test_a_reading_that_cannot_be_spoils_nothing_for_long(wrong):
    time_s, place, _ = contact(none)
    stamps = stamped(len(time_s))
    right = DryFriction(0.3, 0.05).of_many(stamps, place)
    place[2000] = wrong
    found = DryFriction(0.3, 0.05).of_many(stamps, place)
    np.testing.assert_array_equal(found[:2000], right[:2000])
    later = slice(2000 + 400, None)  # 0.8 s: the next turn is over
    same = (found[later] == right[later]) | (np.isnan(found[later]) & np.isnan(right[later]))
    assert np.mean(same) > 0.9


@pytest.mark.parametrize("presliding", [1e-4, 0.002, 0.02])
@pytest.mark.parametrize("moved_mm", [0.0, 5.0])
def test_noise_of_a_tool_at_rest_is_no_turn(presliding, moved_mm):
    """Its force chattered by the friction, so that no tare was taken."""
    random = np.random.default_rng(1)
    place = np.concatenate([np.linspace(0.0, moved_mm, 1000), np.full(3000, moved_mm)])
    place += 0.003 * random.standard_normal(len(place))
    found = DryFriction(0.3, presliding).of_many(stamped(len(place)), place)
    resting = found[2000:]
    assert np.nanstd(resting) < 0.06
    assert np.mean(np.isnan(resting)) < 0.4
    if moved_mm:
        assert np.mean(found[500:1000] == 0.3) > 0.9


def test_a_turn_that_takes_long_is_a_rest():
    place = np.concatenate([np.linspace(0.0, 1.0, 500), np.full(1500, 0.99)])
    found = DryFriction(0.3, 0.02).of_many(stamped(len(place)), place)
    assert np.isnan(found[520:700]).all()
    np.testing.assert_allclose(found[760:], 0.15, atol=0.02)


@pytest.mark.parametrize("rate_hz", [100.0, 200.0, 500.0])
@pytest.mark.parametrize("step_mm", [0.0, 0.01, 0.05])
@pytest.mark.parametrize("way_mm", [3.0, -3.0])
def test_a_tool_that_has_stopped_gets_its_force_back(rate_hz, step_mm, way_mm):
    """Coarse positions rest at the very end of a slide: all forces from there on were left out."""
    time_s = np.arange(int(6.0 * rate_hz)) / rate_hz
    place = way_mm * (0.5 - 0.5 * np.cos(np.pi * np.clip(time_s - 1.0, 0.0, 1.0)))
    if step_mm:
        place = np.round(place / step_mm) * step_mm
    for presliding in (0.01, 0.05):
        found = DryFriction(0.3, presliding).of_many(stamped(len(place), rate_hz), place)
        np.testing.assert_allclose(found[time_s > 4.0], math.copysign(0.3, way_mm), atol=0.1)


@pytest.mark.parametrize("share", [0.005, 0.05, 0.2])
@pytest.mark.parametrize(
    "kind", [smooth, lambda newtons: smooth(newtons, 1.0), lambda n: sliding(n, 0.05)]
)
@pytest.mark.parametrize("zero_n", [0.0, 0.7])
def test_the_air_shows_it(kind, share, zero_n):
    newtons = share * 8.0
    _, place, force = contact(kind(newtons), zero_n=zero_n)
    found = whole(find_friction(place, force))
    assert found is not None
    assert found.newtons == pytest.approx(newtons, rel=0.1)
    assert found.zero_n == pytest.approx(zero_n, abs=0.1 * newtons + 0.005)
    (doubt,) = [s for s in check_samples(*contact(kind(newtons))) if s.channel == "force"]
    assert doubt.check is Check.FRICTION
    assert doubt.remedy == pytest.approx(newtons, rel=0.1)


@pytest.mark.parametrize("presliding", [0.02, 0.1, 0.3])
def test_the_air_shows_how_far_it_goes_before_it_slides(presliding):
    time_s, place, force = contact(sliding(0.5, presliding), top_mm=-4.0, seconds=20.0)
    found = whole(find_friction(place, force))
    assert find_presliding(time_s, place, force, found) == pytest.approx(presliding, rel=0.4)


def drift(time_s, place, force):
    return time_s, place, force + 0.05 * time_s


def late(time_s, place, force):
    return time_s[:-20], place[20:], force[:-20]


def breathing(time_s, place, force):
    return time_s, place + 0.5 * np.sin(1.6 * time_s), force


def inertia(time_s, place, force):
    smooth_mm = np.convolve(place, np.ones(25) / 25.0, "same")
    force = force + 3e-4 * np.gradient(np.gradient(smooth_mm, time_s), time_s)
    return time_s[50:-50], place[50:-50], force[50:-50]


def stepping(time_s, place, force):
    return time_s, place, force + 0.3 * (time_s > 6.0)


def sticky(time_s, place, force):
    """It sticks: up to half a millimetre above the surface it pulls."""
    out = np.gradient(np.convolve(place, np.ones(25) / 25.0, "same")) < 0.0
    return time_s, place, force - 0.2 * (out & (place > -0.5) & (place < 0.1))


def once(time_s, place, force):
    """One press, and a sensor that crept by 1 % of the largest force meanwhile."""
    kept = (time_s > 0.1) & (time_s < 2.0)
    crept = 0.08 * (time_s > 1.0)
    return time_s[kept], place[kept], (force + crept)[kept]


@pytest.mark.parametrize("other", [drift, late, breathing, inertia, stepping, sticky, once])
@pytest.mark.parametrize("seed", range(3))
def test_nothing_else_is_taken_for_it(other, seed):
    _, place, force = other(*contact(none, seed))
    assert whole(find_friction(place, force)) is None


@pytest.mark.parametrize("seed", range(4))
def test_a_drift_does_not_hide_it(seed):
    _, place, force = drift(*contact(smooth(0.3), seed))
    assert whole(find_friction(place, force)).newtons == pytest.approx(0.3, rel=0.1)


def pressed(place, force_n, rate_hz, zero_n, seed=1):
    """Readings of a place in the course of time, with friction of so much."""
    random = np.random.default_rng(seed)
    time_s = np.arange(len(place)) / rate_hz
    force = K * np.maximum(place, 0.0) ** N + force_n * np.tanh(np.gradient(place, time_s) / 0.2)
    force = force + zero_n(time_s)
    place = place + 0.003 * random.standard_normal(len(place))
    return time_s, place, force + 0.01 * random.standard_normal(len(place))


def triangle(share):
    return 1.0 - np.abs(2.0 * (share % 1.0) - 1.0)


@pytest.mark.parametrize("rate_hz", [100.0, 500.0])
@pytest.mark.parametrize("newtons", [0.0, 0.3])
@pytest.mark.parametrize("drift_n_s", [0.05, -0.3])
def test_an_even_drift_is_no_part_of_it(rate_hz, newtons, drift_n_s):
    """More of the air than of the tissue, or less: 0.3 N of a drift was named, and 0.6 N of 0.3."""
    place = -2.0 + 6.0 * triangle(0.4 * np.arange(int(20.0 * rate_hz)) / rate_hz)
    _, place, force = pressed(place, newtons, rate_hz, lambda time_s: drift_n_s * time_s)
    found = whole(find_friction(place, force))
    assert (0.0 if found is None else found.newtons) == pytest.approx(newtons, rel=0.05)


@pytest.mark.parametrize("presses", [2, 3, 5])
@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_a_zero_that_steps_between_few_presses_is_none(presses, share):
    place = -2.0 + 5.0 * (0.5 - 0.5 * np.cos(2.0 * np.pi * presses * np.linspace(0.0, 1.0, 8000)))
    _, place, force = pressed(place, 0.0, 400.0, lambda time_s: 0.3 * (time_s > share * 20.0))
    assert whole(find_friction(place, force)) is None


def test_one_press_does_not_tell_it_from_a_drift():
    place = -2.0 + 5.0 * np.clip(4.0 * triangle(np.linspace(0.0, 1.0, 10_000)) - 0.4, 0.0, 1.0)
    _, place, force = pressed(place, 0.0, 500.0, lambda time_s: -0.1 * time_s)
    assert whole(find_friction(place, force)) is None


@pytest.mark.parametrize("rate_hz", [100.0, 500.0])
def test_a_tool_that_rests_between_presses_shows_it(rate_hz):
    """Forces of the rest counted as those of the way out: nothing was found."""
    share = triangle(0.25 * np.arange(int(20.0 * rate_hz)) / rate_hz)
    place = np.clip(-4.0 + 12.0 * share, -2.0, 4.0)
    _, place, force = pressed(place, 0.3, rate_hz, np.zeros_like)
    assert whole(find_friction(place, force)).newtons == pytest.approx(0.3, rel=0.05)


@pytest.mark.parametrize("seconds", [20, 300, 600])
@pytest.mark.parametrize("presses_hz", [0.5, 1.0])
def test_a_long_recording_shows_it(seconds, presses_hz):
    """The way was that of a share of a recording, of any length: of 300 s a zero was named."""
    place = 0.5 - 2.5 * np.cos(2.0 * np.pi * presses_hz * np.arange(100 * seconds) / 100.0)
    readings = pressed(place, 0.3, 100.0, np.zeros_like)
    assert whole(find_friction(*readings[1:])).newtons == pytest.approx(0.3, rel=0.05)
    assert [s.check for s in check_samples(*readings)] == [Check.FRICTION]


def estimated(time_s, place, force):
    estimator = create_estimator("self_tuning_ukf", missing_readings=True)
    return estimator.run(time_s, place, force)


@pytest.mark.parametrize("kind", [smooth(0.3), sliding(0.3, 0.1), sliding(0.3, 0.02)])
def test_less_it_the_stiffness_is_that_of_the_tissue(kind):
    """With friction of a twenty-fifth of the largest force K was a fraction of what it is.

    With the readings of the turns, as the element says them, it still was in one of ten.
    """
    time_s, place, force = contact(kind, rate_hz=1000.0)
    found = whole(find_friction(place, force))
    friction = DryFriction(found.newtons, find_presliding(time_s, place, force, found))
    low, high = robust_range(force)
    assert 0.03 < found.newtons / (high - low) < 0.08
    taken_off = friction.of_many(np.round(time_s * 1e9).astype(np.int64), place)
    assert np.mean(np.isnan(taken_off)) < 0.4
    before = estimated(time_s, place, force)[len(time_s) - 1]
    assert abs(before.parameters[0] / K - 1.0) > 0.1
    less = estimated(time_s, place, force - taken_off)[len(time_s) - 1]
    assert less.parameters[0] == pytest.approx(K, rel=0.03)
