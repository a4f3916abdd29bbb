"""Force from motion and motor effort: the observer against what it must find."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hc_estimator.stream.effort import DisturbanceObserver
from hc_estimator.stream.effort_filters import (
    METHODS,
    EffortSettings,
    error_in_motion,
    make_force_filter,
)
from hc_estimator.stream.surface import SurfaceFinder

STEP = 0.001
MASS = 0.5e-3  # N s^2/mm


def motion(frequency: float = 1.5, count: int = 6000) -> tuple[np.ndarray, ...]:
    """Time, position, velocity, acceleration of a sine of 3 mm."""
    time = np.arange(count) * STEP
    turn = 2.0 * np.pi * frequency
    return (
        time,
        3.0 * np.sin(turn * time),
        3.0 * turn * np.cos(turn * time),
        -3.0 * turn**2 * np.sin(turn * time),
    )


def held(effort: np.ndarray) -> np.ndarray:
    """The effort of the interval after each stamp, as a controller holds it."""
    return np.r_[0.5 * (effort[1:] + effort[:-1]), effort[-1]]


def test_force_and_displacement_come_late_by_the_same() -> None:
    """A spring of 0.4 N/mm stays a spring of 0.4 N/mm, without damping and without mass."""
    time, position, velocity, acceleration = motion(5.0)
    effort = held(MASS * acceleration + 0.005 * velocity + 0.4 * position)
    observer = DisturbanceObserver(mass_kg=0.5, damping=0.005)
    place, force = observer.run(time, position, effort)
    late = slice(1000, None)
    speed = np.gradient(place, STEP)
    both = np.column_stack([place[late], speed[late]])
    stiffness, damping = np.linalg.lstsq(both, force[late], rcond=None)[0]
    assert stiffness == pytest.approx(0.4, rel=1e-3)
    assert abs(damping) < 2e-5
    np.testing.assert_allclose(force[late], 0.4 * place[late], atol=2e-3)
    # and the low-pass is the one that is written down: two poles at 15 Hz
    gain = 1.0 / (1.0 + (5.0 / 15.0) ** 2)
    assert place[late].max() == pytest.approx(3.0 * gain, rel=0.01)


def test_dry_friction_that_is_known_is_taken_off_and_what_is_not_is_seen() -> None:
    time, position, velocity, acceleration = motion(1.0)
    effort = held(MASS * acceleration + 0.2 * np.tanh(velocity / 0.5))
    error = {}
    for known in (0.2, 0.0):
        observer = DisturbanceObserver(mass_kg=0.5, dry_friction_n=known)
        _, force = observer.run(time, position, effort)
        error[known] = float(np.sqrt(np.mean(force[1000:] ** 2)))
    assert error[0.2] < 0.05
    assert error[0.0] == pytest.approx(0.2, rel=0.15)


def test_step_is_run_and_reset_forgets() -> None:
    time, position, _, acceleration = motion()
    effort = held(MASS * acceleration + 1.0)
    whole = DisturbanceObserver(mass_kg=0.5)
    first = np.array(whole.run(time, position, effort))
    single = DisturbanceObserver(mass_kg=0.5)
    rows = zip(time.tolist(), position.tolist(), effort.tolist(), strict=True)
    assert np.array_equal(first.T, [single.step(*row) for row in rows])
    whole.reset()
    assert np.array_equal(whole.run(time, position, effort), first)


@pytest.mark.parametrize(
    "reading",
    [(math.nan, 0.0, 0.0), (0.01, math.nan, 0.0), (0.01, 0.0, math.inf), (0.0, 0.0, 0.0)],
)
def test_a_reading_that_is_none_leaves_no_trace(reading: tuple[float, float, float]) -> None:
    one, other = DisturbanceObserver(mass_kg=0.5), DisturbanceObserver(mass_kg=0.5)
    for observer in (one, other):
        observer.step(0.0, 1.0, 0.3)
    assert all(math.isnan(value) for value in one.step(*reading))
    assert one.step(0.02, 1.01, 0.3) == other.step(0.02, 1.01, 0.3)


def test_after_a_gap_there_is_no_force_until_it_is_known_again() -> None:
    observer = DisturbanceObserver(mass_kg=0.5)
    for k in range(10):
        observer.step(k * STEP, 0.0, 0.0)
    for k in range(200):
        place, force = observer.step(10.0 + k * STEP, 500.0 + 0.03 * k, 0.7)
        assert math.isnan(force) == ((k - 1) * STEP < 5.0 / (2.0 * math.pi * 15.0))
        if not math.isnan(force):
            assert force == pytest.approx(0.7, abs=1e-3)
    assert place == pytest.approx(506.0, abs=1.0)


@pytest.mark.parametrize("method", METHODS)
def test_readings_that_are_lost_make_neither_force_nor_surface(method: str) -> None:
    """The effort that moved the tool was not read: it became a force of newtons.

    A search for the surface took it for contact, up to 5 mm above the tissue, or for the zero.
    """
    random = np.random.default_rng(4)
    time = np.arange(4000) * STEP
    turn = 2.0 * np.pi * 4.0
    position = -9.0 + 3.0 * time - 0.4 * np.cos(turn * time)
    velocity = 3.0 + 0.4 * turn * np.sin(turn * time)
    contact = np.maximum(position, 0.0) ** 1.6 * (0.25 + 0.006 * velocity)
    effort = held(MASS * 0.4 * turn**2 * np.cos(turn * time) + contact)
    lost = np.zeros(len(time), bool)
    for first in range(150, 2800, 250):
        lost[first + random.integers(100) :][: random.integers(10, 90)] = True
    readings = (position + 0.002 * random.standard_normal(len(time)), effort)
    settings = EffortSettings(method=method)
    follower = make_force_filter(settings)
    finder = SurfaceFinder(error_in_motion(settings))
    found = None
    for k in np.flatnonzero(~lost):
        place, force = follower.step(float(time[k]), *(float(r[k]) for r in readings))
        if math.isnan(force):
            continue
        if time[k] > 0.1 and position[k] < 0.0:
            assert abs(force) < 0.12
        found = found or finder.add(place, force)
    assert found is not None
    assert abs(found.force_n) < 0.03
    assert abs(found.displacement_mm) < 0.8


@pytest.mark.parametrize("heard_from_mm", [1.0, 1.5, 2.0])
def test_a_press_first_heard_at_depth_does_not_put_the_surface_there(heard_from_mm: float) -> None:
    """Readings lost over the contact: five of one depth gave a surface 0.8 to 1.9 mm too deep."""
    random = np.random.default_rng(3)
    time = np.arange(9000) * STEP
    position = 0.4 - 2.4 * np.cos(2.0 * np.pi * time / 3.0)  # three presses, 2.8 mm deep
    force = 0.25 * np.maximum(position, 0.0) ** 1.6 + 0.003 * random.standard_normal(len(time))
    first_press = (time < 1.5) & (position > -0.3) & (position < heard_from_mm)
    finder = SurfaceFinder(0.02)
    readings = zip(position[~first_press], force[~first_press], strict=True)
    found = next(filter(None, (finder.add(*row) for row in readings)))
    assert abs(found.displacement_mm) < 0.3
    assert abs(found.force_n) < 0.01


def test_a_stream_that_becomes_slow_is_a_stream_again_soon() -> None:
    observer = DisturbanceObserver(mass_kg=0.5)
    for k in range(100):
        observer.step(k * STEP, 0.0, 0.1)
    forces = [observer.step(0.1 + k * 0.02, 0.0, 0.1)[1] for k in range(1, 40)]
    assert np.isfinite(forces[15:]).all()


@pytest.mark.parametrize(
    ("name", "value"),
    [("mass_kg", -1.0), ("damping", math.nan), ("bandwidth_hz", 0.0), ("dry_friction_n", -0.1)],
)
def test_what_cannot_be_is_named(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        DisturbanceObserver(**{"mass_kg": 0.5, name: value})


def test_an_error_in_motion_is_no_contact_when_the_finder_is_told_of_it() -> None:
    """At rest the calculated force is quiet; friction then looks like contact, unless told."""
    random = np.random.default_rng(1)
    position = np.r_[np.full(500, -8.0), np.linspace(-8.0, 4.0, 2400)]
    force = random.normal(size=len(position)) * 0.001
    force[500:] += 0.05  # friction of the motion
    force += 0.4 * np.maximum(position, 0.0) ** 1.5
    found = {}
    for told in (0.0, 0.03):
        finder = SurfaceFinder(told)
        results = (finder.add(*row) for row in zip(position, force, strict=True))
        found[told] = next((result for result in results if result is not None), None)
    assert found[0.03] is not None
    assert abs(found[0.03].displacement_mm) < 0.3
    assert found[0.0] is None or abs(found[0.0].displacement_mm) > 1.0
