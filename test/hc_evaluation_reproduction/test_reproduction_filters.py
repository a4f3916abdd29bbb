"""The literal columns against plain implementations of the papers' equations."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from hc_evaluation.reproduction import load_experiment, position_filters
from hc_evaluation.reproduction.experiment import Column
from hc_evaluation.reproduction.signals import Signal, make_signal
from hc_evaluation.reproduction.trace import run_column

Array = NDArray[np.float64]


def _process(state: Array, step: float) -> Array:
    d, v, _, stiffness, damping, n, p = state
    force = 0.0
    if d > 0.0:
        force = d**n * (stiffness + damping * np.sign(v) * abs(v) ** p)
    return np.array([d + step * v, v, force, stiffness, damping, n, p])


def _plain_ukf(
    column: Column, signal: Signal, steps: int, error: dict[str, float] | None = None
) -> Array:
    """Paper A, Eq. 7 to 15, alpha 1, beta 2, kappa 0; K, B, n, p after each step.

    `error` is added to the predicted state, as section 5.3 has it.
    """
    size = 7
    state = np.array(column.start_state)
    covariance = np.diag(column.start_variance)
    noise, sensor = np.diag(column.process_noise), np.diag(column.measurement_noise)
    picks = np.zeros((2, size))
    picks[0, 0] = picks[1, 2] = 1.0
    weights_mean = np.r_[0.0, np.full(14, 1.0 / 14.0)]
    weights_covariance = np.r_[2.0, np.full(14, 1.0 / 14.0)]  # lambda / N + 1 - alpha^2 + beta
    found = []
    for k in range(steps):
        root = np.linalg.cholesky(size * covariance)
        points = [state, *(state + root.T), *(state - root.T)]
        images = np.array([_process(point, signal.time_step) for point in points])
        predicted = weights_mean @ images
        spread = images - predicted
        covariance = (spread.T * weights_covariance) @ spread + noise
        if error is not None and error["first_step"] <= k <= error["last_step"]:
            predicted[3] += error["K"]
            predicted[4] += error["B"]
        expected = picks @ covariance @ picks.T + sensor
        gain = covariance @ picks.T @ np.linalg.inv(expected)
        reading = np.array([signal.displacement_mm[k], signal.force_n[k]])
        state = predicted + gain @ (reading - picks @ predicted)
        covariance = covariance - gain @ expected @ gain.T
        covariance = 0.5 * (covariance + covariance.T)
        found.append(state[3:].copy())
    return np.array(found)


def test_the_literal_filter_is_the_papers() -> None:
    found = load_experiment("a_table_1")
    column = found.column("UKF, paper")
    signal = make_signal(found.signal, 1)
    plain = _plain_ukf(column, signal, 60)
    trace = run_column(column, signal, found.signal)
    assert np.allclose(trace.parameters[:60], plain, rtol=1e-6, atol=1e-9)
    assert abs(plain[-1, 2] - 1.0) > 0.05  # n does move


def test_the_added_error_is_an_error_of_the_prediction() -> None:
    """Added between two samples it comes to the same: neither K nor B is measured."""
    found = load_experiment("a_table_3")
    column = found.column("UKF, paper")
    signal = make_signal(found.signal, 1)
    error = {"first_step": 20, "last_step": 30, "K": 0.8, "B": 0.8}  # steps count from 1
    plain = _plain_ukf(column, signal, 45, error | {"first_step": 19, "last_step": 29})
    trace = run_column(column, signal, {"added_error": error})
    assert np.allclose(trace.parameters[:19], plain[:19], rtol=1e-6, atol=1e-9)
    assert np.allclose(trace.parameters[30:45], plain[30:45], rtol=1e-6, atol=1e-9)
    undisturbed = run_column(column, signal, {})
    assert abs(trace.parameters[30, 0] - undisturbed.parameters[30, 0]) > 1.0


@pytest.mark.parametrize("name", ["RWSTUKF kinematic", "RLS"])
def test_the_added_error_reaches_every_estimator(name: str) -> None:
    """K and B of the next estimate are larger by the error, but for one small update."""
    found = load_experiment("a_table_3")
    signal = make_signal(found.signal, 1)
    column = found.column(name)
    error = {"first_step": 300, "last_step": 300, "K": 0.8, "B": 0.8}
    plain = run_column(column, signal, {}).parameters
    disturbed = run_column(column, signal, {"added_error": error}).parameters
    assert np.array_equal(disturbed[:300], plain[:300])
    moved = disturbed[300, :2] - plain[300, :2]
    assert moved == pytest.approx([0.8, 0.8], abs=0.4)
    assert np.sum(moved) == pytest.approx(1.6, abs=0.25)


def test_with_r_known_as_one_the_literal_q_never_moves() -> None:
    found = load_experiment("b_table_1")
    signal = make_signal(found.signal, 1)
    first = found.column("AUKF, paper")
    tripled = dataclasses.replace(
        first, parameters=dict(first.parameters) | {"matching_window": 12}
    )
    a = run_column(first, signal, found.signal)
    # R = 1 leaves no positive Phi: the first guess stays for ever, whatever the window.
    b = run_column(tripled, signal, found.signal)
    assert np.allclose(a.noise_std, 0.004)
    assert np.array_equal(a.force, b.force)


# The slave of paper C in free motion, far from the tissue: a linear system.
MODEL = [0.07, 0.05, 0.08, 2.0, 3.0, 1.7, 1000.0]
STEP = 1e-3


def _free_motion(seed: int, count: int = 1500) -> tuple[Array, Array, Array]:
    generator = np.random.default_rng(seed)
    drive = 0.5 * np.sin(2.0 * np.pi * STEP * np.arange(count))
    rate = -0.05 / 0.07
    decay = np.exp(rate * STEP)
    x, v = 0.0, 0.0
    truth = np.empty(count)
    for k in range(count):
        if k > 0:
            pushed = -0.08 / 0.07 * x + drive[k - 1] / 0.07
            x, v = x + STEP * v, decay * v + (decay - 1.0) / rate * pushed
            v += 0.02 * generator.standard_normal()
        truth[k] = x
    readings = truth + np.sqrt(0.005) * generator.standard_normal(count)
    return truth, readings, drive


def _as_penetration(position_cm: Array) -> Array:
    return 10.0 * (position_cm - MODEL[6])


def test_the_extended_filter_is_the_kalman_filter_in_free_motion() -> None:
    _, readings, drive = _free_motion(3)
    settings = {
        "model": MODEL,
        "process_noise": [0.001, 0.02, 0.0],
        "measurement_variance": 0.005,
    }
    result = position_filters.run("position_ekf", _as_penetration(readings), drive, STEP, settings)
    rate = -0.05 / 0.07
    decay = np.exp(rate * STEP)
    share = (decay - 1.0) / rate
    exact = np.array([[1.0, STEP], [-share * 0.08 / 0.07, decay]])
    jacobian = np.array([[1.0, STEP], [-STEP * 0.08 / 0.07, decay]])
    state, covariance = np.array([readings[0], 0.0]), np.diag([0.005, 1.0])
    for k in range(readings.size):
        if k > 0:
            state = exact @ state + np.array([0.0, share * drive[k - 1] / 0.07])
            covariance = jacobian @ covariance @ jacobian.T + np.diag([1e-6, 4e-4])
        gain = covariance[:, 0] / (covariance[0, 0] + 0.005)
        state = state + gain * (readings[k] - state[0])
        covariance = covariance - np.outer(gain, covariance[0])
        assert result[k, 0] == pytest.approx(_as_penetration(state)[0], rel=1e-9)
        assert result[k, 1] == pytest.approx(10.0 * state[1], rel=1e-6, abs=1e-9)
    assert np.all(result[:, 2] == 0.0)


def test_many_particles_come_to_the_kalman_filter() -> None:
    truth, readings, drive = _free_motion(4)
    common = {"model": MODEL, "measurement_variance": 0.005}
    kalman = position_filters.run(
        "position_ekf",
        _as_penetration(readings),
        drive,
        STEP,
        common | {"process_noise": [0.001, 0.02, 0.0]},
    )
    particles = position_filters.run(
        "position_pf",
        _as_penetration(readings),
        drive,
        STEP,
        common | {"process_noise": [0.001, 0.02, 0.0], "particles": 2000, "seed": 1},
    )
    target = _as_penetration(truth)
    errors = [np.sqrt(np.mean((r[300:, 0] - target[300:]) ** 2)) for r in (kalman, particles)]
    assert errors[1] < 1.5 * errors[0]
    assert errors[0] < 0.4 * 10.0 * np.sqrt(0.005)


def test_gamma_noise_of_the_proposal_has_the_mean_of_paper_c() -> None:
    count = 4000
    settings = {
        "model": [0.07, 1e-9, 0.0, 2.0, 3.0, 1.7, 1000.0],
        "process_noise": [0.0, 0.0, 0.0],
        "measurement_variance": 1e12,  # says nothing: the particles move by the proposal alone
        "particles": 200,
        "seed": 2,
        "gamma": [0.05, 0.2],
    }
    result = position_filters.run(
        "position_pf", np.full(count, -9000.0), np.zeros(count), STEP, settings
    )
    assert result[-1, 1] == pytest.approx(10.0 * 0.01 * count, rel=0.15)


def test_the_force_state_of_eq_26_moves_the_particle_with_its_noise() -> None:
    """One particle, weights that say nothing: the recursion of Eq. 26, written down."""
    count, step = 300, 0.001
    mass, damping, spring, stiffness, loss, exponent, surface = MODEL
    settings = {
        "model": MODEL,
        "process_noise": [0.0, 0.0, 0.5],
        "measurement_variance": 1.0,
        "particles": 1,
        "seed": 7,
        "force_state": True,
    }
    drive = np.full(count, 12.0)
    start = surface + 0.5
    result = position_filters.run("position_pf", np.full(count, 10.0 * 0.5), drive, step, settings)
    draws = np.random.Generator(np.random.PCG64(7)).standard_normal((count, 1, 3))[:, 0, 2] * 0.5
    x, v, force = start, 0.0, 0.0
    a1 = -damping / mass
    share = (np.exp(a1 * step) - 1.0) / a1
    for k in range(1, count):
        depth = max(x - surface, 0.0)
        law = max(depth**exponent * (stiffness + loss * v), 0.0)
        rate = -spring / mass * x + (drive[k - 1] - force) / mass
        x, v, force = x + step * v, np.exp(a1 * step) * v + share * rate, law + draws[k]
        assert result[k, 0] == pytest.approx(10.0 * (x - surface), rel=1e-9, abs=1e-9)
        assert result[k, 1] == pytest.approx(10.0 * v, rel=1e-9, abs=1e-9)
        assert result[k, 2] == pytest.approx(force, rel=1e-9, abs=1e-9)
    plain = position_filters.run(
        "position_pf",
        np.full(count, 10.0 * 0.5),
        drive,
        step,
        settings | {"force_state": False},
    )
    assert np.abs(plain[:, 0] - result[:, 0]).max() > 1e-3  # sigma_3 did not move it there
