"""Axes, signs and zeros of a robot's sensors, found from a tool that presses some times."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hc_estimator.contact.hunt_crossley import hunt_crossley_force
from hc_estimator.stream.sensor_setup import SetupError, propose
from hc_estimator.stream.vector_readings import VectorReadings

SURFACE = 412.0
BIAS = np.array([0.3, -1.1, 4.2])
AXES = ("x", "y", "z")


def presses(push, move, *, rest_s=2.0, rate=(500.0, 125.0), lift=3.0, seed=0, slide=0.0):
    """Wrench and pose of a tool that rests and then presses into tissue, along two directions."""
    generator = np.random.default_rng(seed)

    def depth(time_s):
        after = np.maximum(time_s - rest_s, 0.0)
        swing = 0.5 * (4.0 + lift)
        return -lift + swing * (1.0 - np.cos(2.2 * after)) + 0.2 * np.sin(11.0 * after)

    times = [np.arange(0.0, 12.0, 1.0 / r) for r in rate]
    d = depth(times[0])
    v = np.gradient(d, times[0])
    pairs = zip(d, v, strict=True)
    force = np.array(
        [hunt_crossley_force(*dv, 0.5, 0.05, 1.5, 1.0) if dv[0] > 0 else 0.0 for dv in pairs]
    )
    wrench = BIAS + force[:, None] * push + 0.02 * generator.standard_normal((len(d), 3))
    place = (SURFACE + depth(times[1]))[:, None] * move
    place = place + 0.005 * generator.standard_normal((len(times[1]), 3))
    place[:, 0] += slide * times[1]
    return (
        VectorReadings(times[0], wrench, AXES),
        VectorReadings(times[1], place, AXES),
        d,
        force,
    )


@pytest.mark.parametrize("rest_s", [None, 2.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("sign_f", "sign_p"), [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_axes_signs_and_zeros_are_found(axis, sign_f, sign_p, rest_s):
    push, move = np.zeros(3), np.zeros(3)
    push[axis], move[(axis + 1) % 3] = sign_f, sign_p
    force, position, depth, newtons = presses(push, move)
    found = propose(force, position, rest_s=rest_s)
    assert (found.force.axis, found.force.sign) == (AXES[axis], sign_f)
    assert (found.position.axis, found.position.sign) == (AXES[(axis + 1) % 3], sign_p)
    assert found.force.zero == pytest.approx(sign_f * BIAS[axis], abs=0.01)
    assert found.position.zero == pytest.approx(SURFACE, abs=0.15)
    assert found.position.zero_std < 0.2
    assert (found.force.rate_hz, found.position.rate_hz) == (pytest.approx(500), pytest.approx(125))
    assert found.force.noise == pytest.approx(0.02, rel=0.2)
    assert found.notes == ()
    inside = force.time_s <= position.time_s[-1]
    np.testing.assert_allclose(found.force_n[~np.isnan(found.force_n)], newtons[inside], atol=0.12)
    # As the node reads them: each reading at its own stamp, and nothing in between made up.
    places = ~np.isnan(found.displacement_mm)
    assert places.sum() == len(position.time_s)
    expected = np.interp(found.time_s[places], force.time_s, depth)
    np.testing.assert_allclose(found.displacement_mm[places], expected, atol=0.25)


def test_a_force_that_is_not_read_after_the_rest_says_it_by_its_curve():
    """Readings of the press were taken for there: a quantile of none raised."""
    push, move = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])
    force, position, _depth, _newtons = presses(push, move)
    found = propose(force, position, rest_s=100.0)
    assert (found.force.axis, found.force.sign) == ("z", 1)
    assert (found.position.axis, found.position.sign) == ("y", -1)


def test_a_sensor_that_sits_askew_gets_a_direction():
    for seed in range(10):
        turn = Rotation.random(random_state=seed).as_matrix()
        push, move = turn[:, 0], turn[:, 1]
        force, position, depth, _newtons = presses(push, move, seed=seed)
        found = propose(force, position)
        for proposal, truth in ((found.force, push), (found.position, move)):
            direction = proposal.sign * np.array(proposal.direction)
            assert float(direction @ truth) > math.cos(math.radians(11.0))
        places = ~np.isnan(found.displacement_mm)
        expected = np.interp(found.time_s[places], force.time_s, depth)
        np.testing.assert_allclose(found.displacement_mm[places], expected, atol=0.4)


def test_far_from_the_origin_the_surface_is_still_found():
    """A direction that was off by a tenth of a degree put the surface half a millimetre off."""
    push, move = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, -1.0])
    force, position, *_rest = presses(push, move)
    far = position._replace(values=position.values + np.array([4000.0, 1000.0, 0.0]))
    found = propose(force, far)
    assert found.position.zero == pytest.approx(SURFACE, abs=0.15)


def test_a_tool_that_slides_meanwhile_is_read_along_its_press():
    push, move = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])
    force, position, *_rest = presses(push, move, slide=1.5)
    found = propose(force, position)
    assert (found.position.axis, found.position.sign) == ("z", 1)


def test_the_joint_that_moves_with_the_force_is_found():
    push, move = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])
    force, position, *_rest = presses(push, move)
    generator = np.random.default_rng(3)
    still = 0.2 + 1e-4 * generator.standard_normal(len(position.time_s))
    other = np.sin(0.9 * position.time_s)
    joints = np.column_stack((still, position.values[:, 2], other))
    found = propose(force, VectorReadings(position.time_s, joints, ("a", "plunger", "b"), True))
    assert (found.position.joint, found.position.sign, found.position.axis) == ("plunger", -1, "")
    assert found.position.zero == pytest.approx(SURFACE, abs=0.15)


def test_joints_may_be_called_as_axes_are():
    """Regression: of a gantry's joints x, y and z the third was taken for the axis of a vector."""
    force, position, *_rest = presses(np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0]))
    found = propose(force, position._replace(of_joints=True))
    assert (found.position.joint, found.position.sign, found.position.axis) == ("z", -1, "")


def test_readings_that_stand_for_more_take_zero_and_noise_along():
    force, position, *_rest = presses(np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0]))
    found = propose(force, position)
    scaled = found.rescaled(0.001, 10.0)
    assert (scaled.force.scale, scaled.position.scale) == (0.001, 10.0)
    assert scaled.force.zero == pytest.approx(0.001 * found.force.zero)
    assert scaled.position.zero_std == pytest.approx(10.0 * found.position.zero_std)
    np.testing.assert_allclose(scaled.displacement_mm, 10.0 * found.displacement_mm)
    np.testing.assert_allclose(scaled.force_n, 0.001 * found.force_n)


def test_pieces_of_presses_without_a_whole_approach_give_the_zeros_too():
    push, move = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, -1.0])
    force, position, depth, _newtons = presses(push, move)
    # Of every approach the part in which the tool touches is missing.
    near = (depth > -0.3) & (depth < 2.5) & (np.gradient(depth) > 0.0)
    holes = force._replace(time_s=force.time_s[~near], values=force.values[~near])
    found = propose(holes, position)
    assert found.force.zero == pytest.approx(-BIAS[2], abs=0.05)
    assert found.position.zero == pytest.approx(SURFACE, abs=0.6)


def test_a_tool_that_never_leaves_the_tissue_has_no_zeros_but_a_sign():
    push, move = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, -1.0])
    force, position, *_rest = presses(push, move, rest_s=0.0, lift=-0.8)
    found = propose(force, position)
    assert (found.force.sign, found.position.sign) == (-1, -1)
    assert math.isnan(found.position.zero)
    assert math.isnan(found.force.zero)
    assert any("hc find-surface" in note for note in found.notes)
    assert any("hc tare" in note for note in found.notes)


def test_what_the_readings_do_not_show_is_said():
    push, move = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0])
    force, position, *_rest = presses(push, move)
    generator = np.random.default_rng(1)
    free = force._replace(values=BIAS + 0.02 * generator.standard_normal(force.values.shape))
    with pytest.raises(SetupError, match=r"the force changes by .* press into the tissue"):
        propose(free, position)
    other = position._replace(values=generator.standard_normal(position.values.shape))
    with pytest.raises(SetupError, match="hardly go together"):
        propose(force, other)
    # Regression: "force and position have no time in common: compare their clocks".
    for shift_s, said in ((1e6, "1000000 s behind"), (-86400.0, "86400 s ahead of")):
        other = position._replace(time_s=position.time_s + shift_s)
        with pytest.raises(SetupError, match=f"force are {said} those of the position"):
            propose(force, other)
    with pytest.raises(SetupError, match="5 readings of the position are too few"):
        propose(force, VectorReadings(position.time_s[:5], position.values[:5], AXES))
    still = position._replace(values=np.full(position.values.shape, 3.0))
    with pytest.raises(SetupError, match="the position does not change"):
        propose(force, still)


def repeated(readings, times, rate_hz):
    """The readings as a topic tells them that repeats each at a higher rate."""
    time_s = np.arange(readings.time_s[0], readings.time_s[-1], 1.0 / (times * rate_hz))
    last = np.searchsorted(readings.time_s, time_s + 1e-9) - 1
    return VectorReadings(time_s, readings.values[last], AXES)


@pytest.mark.parametrize("seed", range(3))
def test_setup_finds_the_true_rate_and_the_surface_of_a_repeated_pose(seed):
    """Regression: the surface was told from positions up to 6 ms old."""
    force, position, _depth, _newtons = presses(
        np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0]), seed=seed
    )
    held = propose(force, repeated(position, 4, 125.0), rest_s=2.0)
    once = propose(force, position, rest_s=2.0)
    repeats = [s.held for found in (held, once) for s in (found.force, found.position)]
    assert repeats == [False, True, False, False]
    assert held.position.rate_hz == pytest.approx(125.0)
    assert held.position.zero == pytest.approx(once.position.zero, abs=0.02)
    assert held.position.zero == pytest.approx(SURFACE, abs=0.15)
    assert held.position.noise == pytest.approx(0.005, rel=0.3)  # 1e-5 as it was told before
