"""Filters that see motion and effort only: against each other, a closed form and paper C's."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from hc_estimator.ros.effort_settings import EFFORT_SETTINGS
from hc_estimator.ros.node_settings import MISSING_READINGS, NODE_SETTINGS, READING
from hc_estimator.ros.settings_meaning import check_together, effort_settings
from hc_estimator.stream.effort_filters import (
    METHODS,
    ContactForceFilter,
    EffortSettings,
    error_in_motion,
    make_force_filter,
)
from hc_evaluation.reproduction import position_filters

STEP = 0.001
SLAVE = EffortSettings(damping=0.005, force_jerk=1e3)
TISSUE = (0.25, 0.006, 1.6)


def press(count: int = 2500, friction_n: float = 0.0, seed: int = 1) -> tuple[np.ndarray, ...]:
    """Time, position, effort, noise of sensors included; and the true position and force."""
    mass = 1e-3 * SLAVE.mass_kg
    random = np.random.default_rng(seed)
    time = np.arange(count) * STEP
    position, velocity = -2.0, 0.0
    rows = np.empty((count, 3))
    parts = 4
    for k in range(count):
        wanted = 1.0 - 3.0 * math.cos(2.0 * math.pi * 0.7 * time[k])
        effort = min(max(4.0 * (wanted - position) - 0.09 * velocity, -30.0), 30.0)
        rows[k] = position, effort, force_of(position, velocity)
        for _ in range(parts):
            felt = force_of(position, velocity) + friction_n * math.tanh(velocity / 0.5)
            velocity += STEP / parts / mass * (effort - SLAVE.damping * velocity - felt)
            position += STEP / parts * velocity
    noise = random.normal(size=(2, count)) * np.array([[0.002], [0.01]])
    return time, rows[:, 0] + noise[0], rows[:, 1] + noise[1], rows[:, 0], rows[:, 2]


def force_of(position: float, velocity: float) -> float:
    if position <= 0.0:
        return 0.0
    stiffness, damping, exponent = TISSUE
    return max(0.0, position**exponent * (stiffness + damping * velocity))


@pytest.mark.parametrize(
    ("method", "largest_n"),
    [("observer", 0.15), ("extended", 0.06), ("unscented", 0.06), ("sir_pf", 0.03)],
)
def test_the_force_is_found(method: str, largest_n: float) -> None:
    time, position, effort, where, force = press()
    settings = dataclasses.replace(SLAVE, method=method, tissue=TISSUE)
    depth, found = make_force_filter(settings).run(time, position, effort)
    late = slice(500, None)
    assert force[late].max() > 1.0
    assert np.sqrt(np.mean((found - force)[late] ** 2)) < largest_n
    if method != "observer":  # which brings the displacement late with its force
        assert np.sqrt(np.mean((depth - where)[late] ** 2)) < 0.005


def test_without_dry_friction_extended_and_unscented_are_one_kalman_filter() -> None:
    time, position, effort, _, _ = press(600)
    found = [
        np.array(
            make_force_filter(dataclasses.replace(SLAVE, method=m)).run(time, position, effort)
        )
        for m in ("extended", "unscented")
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=0.0, atol=1e-6)


def test_it_says_how_well_it_knows_the_force() -> None:
    time, position, effort, _, force = press()
    follower = ContactForceFilter(dataclasses.replace(SLAVE, method="extended"))
    _, found = follower.run(time, position, effort)
    inside = np.abs(found - force)[500:] < 3.0 * follower.force_std_n
    assert follower.force_std_n < 0.1
    assert inside.mean() > 0.95


def test_dry_friction_that_is_told_is_not_force() -> None:
    time, position, effort, _, force = press(friction_n=0.2)
    for method in ("extended", "unscented"):
        error = {}
        for known in (0.0, 0.2):
            told = dataclasses.replace(SLAVE, method=method, dry_friction_n=known)
            _, found = make_force_filter(told).run(time, position, effort)
            error[known] = np.sqrt(np.mean((found - force)[500:] ** 2))
        assert error[0.2] < 0.07
        assert error[0.0] > 0.15


@pytest.mark.slow  # for the oracle's compilation
def test_particles_without_noise_go_as_equation_26_of_the_offline_filter() -> None:
    """The reproduction's compiled filter, in cm, is the oracle: same equation, own program."""
    time, position, effort, _, _ = press(1500)
    settings = dataclasses.replace(
        SLAVE, method="sir_pf", sigma=(0.0, 0.0, 0.0), particles=2, tissue=TISSUE, spring=0.01
    )
    depth, force = make_force_filter(settings).run(time, position, effort)
    model = [1e-3 * 0.5 * 10.0, 0.05, 0.1, 0.25 * 10**1.6, 0.006 * 10**2.6, 1.6, 0.0]
    oracle = position_filters.run(
        "position_pf",
        position,
        effort,
        STEP,
        {
            "model": model,
            "process_noise": [0.0, 0.0, 0.0],
            "measurement_variance": 4e-8,
            "particles": 2,
            "seed": 1,
            "force_state": True,
        },
    )
    np.testing.assert_allclose(depth, oracle[:, 0], atol=1e-8)
    np.testing.assert_allclose(force, oracle[:, 2], atol=1e-8)


@pytest.mark.parametrize("method", METHODS)
def test_step_is_run_reset_forgets_and_what_is_none_leaves_no_trace(method: str) -> None:
    time, position, effort, _, _ = press(300)
    settings = dataclasses.replace(SLAVE, method=method)
    whole = make_force_filter(settings)
    first = np.array(whole.run(time, position, effort))
    single = make_force_filter(settings)
    rows = zip(time.tolist(), position.tolist(), effort.tolist(), strict=True)
    steps = []
    for row in rows:
        steps.append(single.step(*row))
        for none in ((row[0], 0.0, 0.0), (row[0] + 1.0, math.nan, 0.0), (math.nan, 0.0, 0.0)):
            assert all(math.isnan(value) for value in single.step(*none))
    assert np.array_equal(first.T, steps)
    whole.reset()
    assert np.array_equal(whole.run(time, position, effort), first)
    assert np.isfinite(first).all()


@pytest.mark.parametrize("method", METHODS)
def test_wild_readings_and_gaps_do_not_end_it(method: str) -> None:
    random = np.random.default_rng(3)
    follower = make_force_filter(dataclasses.replace(SLAVE, method=method, dry_friction_n=0.1))
    time = 0.0
    for _ in range(400):
        time += float(random.choice([1e-6, 1e-3, 0.05, 5.0]))
        scale = float(random.choice([0.0, 1.0, 1e4]))
        found = follower.step(time, scale * random.normal(), scale * random.normal())
        assert not any(math.isinf(value) for value in found)
    quiet = [follower.step(time + k * 1e-3, 0.0, 0.0) for k in range(1, 400)]
    assert np.isfinite(quiet[100:]).all()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("method", "guess"),
        ("mass_kg", 0.0),
        ("damping", math.nan),
        ("force_jerk", 0.0),
        ("tissue", (1.0, 2.0)),
        ("sigma", (0.1, -1.0, 0.0)),
        ("particles", 1),
        ("surface_mm", math.inf),
    ],
)
def test_what_cannot_be_is_named(name: str, value: object) -> None:
    with pytest.raises(ValueError, match=name):
        EffortSettings(**{name: value})


def test_the_error_in_motion_grows_with_friction() -> None:
    assert error_in_motion(SLAVE) == pytest.approx(0.02)
    assert error_in_motion(dataclasses.replace(SLAVE, dry_friction_n=1.0)) == pytest.approx(0.12)


def test_the_nodes_settings_are_checked_and_become_the_filters() -> None:
    values = {name: setting.default for name, setting in NODE_SETTINGS.items()}
    values |= {MISSING_READINGS: True, "input.source": "effort"}
    assert effort_settings(values) == EffortSettings()
    check_together(values)
    wrong = {
        "input.effort.mass": 0.0,
        "input.effort.tissue": [1.0, 2.0],
        "input.effort.force_jerk": 0.0,
        "input.position.type": "pose",
    }
    for name, value in wrong.items():
        with pytest.raises(ValueError, match=f"parameter {name}"):
            check_together(values | {name: value})
    assert {setting.name for setting in EFFORT_SETTINGS} <= READING
