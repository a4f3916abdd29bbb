"""Force from motion and motor effort: the observer against what it must find."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hc_estimator.input.effort import DisturbanceObserver
from hc_estimator.input.surface import SurfaceFinder

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


def test_after_a_gap_it_begins_anew() -> None:
    observer = DisturbanceObserver(mass_kg=0.5)
    observer.step(0.0, 0.0, 0.0)
    assert observer.step(10.0, 500.0, 0.7) == (500.0, 0.7)
    place, force = observer.step(10.001, 500.0, 0.7)
    assert place == 500.0
    assert force == pytest.approx(0.7)


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
