"""Scores, bounds, intervals and verdicts against closed forms."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.optimize import minimize

from hc_estimator import DEFAULT_FILTER, create_estimator
from hc_estimator.contact.arrays import hunt_crossley_force
from hc_evaluation.reproduction import load_experiment
from hc_evaluation.reproduction.floor import first_guess, regression_error, regression_floor
from hc_evaluation.reproduction.scores import (
    SMALLEST_JERK_DENSITY,
    bounds,
    jerk_density,
    score,
)
from hc_evaluation.reproduction.signals import Signal, make_signal
from hc_evaluation.reproduction.trace import Trace

ALL = {"identifiable": ("K", "B", "n", "p")}


@pytest.fixture(scope="module")
def signal() -> Signal:
    return make_signal(load_experiment("b_table_1").signal, 1)


def _perfect(signal: Signal, spread: float = 0.01, seed: int = 0) -> Trace:
    """A trace with the true force whose parameters err by as much as their covariance says."""
    count = signal.time_s.size
    deviations = spread * signal.parameters
    generator = np.random.default_rng(seed)
    errors = generator.standard_normal((count, 4)) * deviations
    return Trace(
        force=signal.true_force.copy(),
        law_force=signal.true_force.copy(),
        force_predicted=signal.true_force.copy(),
        displacement=signal.true_displacement.copy(),
        velocity=signal.true_velocity.copy(),
        parameters=signal.parameters + errors,
        covariance=np.tile(np.diag(deviations**2), (count, 1, 1)),
        noise_std=signal.force_noise_std.copy(),
        nis=np.full(count, 2.0),
        changes=np.zeros(count, np.bool_),
        mismatch=np.zeros(count, np.bool_),
        numerical_failures=0,
    )


def test_a_perfect_trace_has_no_error(signal: Signal) -> None:
    trace = _perfect(signal, spread=0.0)
    found = score(signal, trace, ALL | {"noise_from_s": 20.0})
    for name in (
        "force_mean",
        "force_max",
        "force_rmse",
        "law_rmse",
        "one_step_rmse",
        "hold_forward_rmse",
        "force_from_parameters_rmse",
        "error_identifiable",
        "noise_rmse",
        "noise_mean_error_after",
        "failed",
    ):
        assert found[name] == pytest.approx(0.0, abs=1e-12), name


def test_the_forces_errors_are_what_their_names_say(signal: Signal) -> None:
    trace = _perfect(signal, spread=0.0)
    error = 0.01 * np.sin(np.arange(signal.time_s.size))
    found = score(signal, dataclasses.replace(trace, force=signal.true_force + error), ALL)
    assert found["force_mean"] == pytest.approx(np.mean(np.abs(error)), rel=1e-12)
    assert found["force_max"] == pytest.approx(np.max(np.abs(error)), rel=1e-12)
    assert found["force_rmse"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)


def test_the_law_is_scored_beside_the_force_that_is_reported(signal: Signal) -> None:
    trace = _perfect(signal, spread=0.0)
    found = score(signal, dataclasses.replace(trace, law_force=signal.true_force + 0.3), ALL)
    assert found["force_rmse"] == 0.0
    assert found["law_rmse"] == pytest.approx(0.3)
    assert found["failed"] == 0.0


def test_a_force_that_was_not_foretold_is_not_free_of_error(signal: Signal) -> None:
    """Regression of 2026-11-27: a missing prediction counted as an error of zero."""
    trace = _perfect(signal, spread=0.0)
    foretold = signal.true_force + 0.3
    foretold[::2] = np.nan
    found = score(signal, dataclasses.replace(trace, force_predicted=foretold), ALL)
    assert found["one_step_rmse"] == pytest.approx(0.3)
    nothing = np.full_like(foretold, np.nan)
    found = score(signal, dataclasses.replace(trace, force_predicted=nothing), ALL)
    assert found["one_step_rmse"] == np.inf


def test_what_the_guards_did_is_counted(signal: Signal) -> None:
    trace = _perfect(signal, spread=0.0)
    assert score(signal, trace, ALL)["exponents_limited"] == 0.0
    trace.parameters[: signal.time_s.size // 4, 2] = 9.0
    trace.parameters[signal.time_s.size // 2 :, 3] = 0.1
    found = score(signal, dataclasses.replace(trace, numerical_failures=7), ALL)
    assert found["exponents_limited"] == pytest.approx(0.75, abs=1e-3)
    assert found["updates_undone"] == 7.0


def test_noise_read_as_a_variance_is_scored_as_one(signal: Signal) -> None:
    trace = _perfect(signal)
    off = dataclasses.replace(trace, noise_std=np.full_like(signal.time_s, 0.1))
    plain = score(signal, off, ALL | {"noise_from_s": 20.0})
    squared = score(signal, off, ALL | {"noise_from_s": 20.0, "noise_as": "variance"})
    assert plain["noise_rmse"] == pytest.approx(0.1 - 0.036)
    assert squared["noise_rmse"] == pytest.approx(0.1**2 - 0.036**2)


def test_an_honest_covariance_has_a_nees_near_one(signal: Signal) -> None:
    values = [score(signal, _perfect(signal, seed=k), ALL)["nees"] for k in range(20)]
    # Median of chi-square with 4 degrees of freedom over 4: 0.84.
    assert np.mean(values) == pytest.approx(0.84, abs=0.12)
    bold = _perfect(signal)
    found = score(signal, dataclasses.replace(bold, covariance=bold.covariance / 100.0), ALL)
    assert found["nees"] > 30.0


@pytest.mark.parametrize(
    "change",
    [
        {"numerical_failures": 1},
        {"force": np.nan},
        {"force": 1e9},
    ],
)
def test_a_run_without_meaning_has_failed(signal: Signal, change: dict[str, float]) -> None:
    trace = _perfect(signal)
    if "force" in change:
        force = trace.force.copy()
        force[100:] = change["force"]
        trace = dataclasses.replace(trace, force=force)
    else:
        trace = dataclasses.replace(trace, numerical_failures=1)
    assert score(signal, trace, ALL)["failed"] == 1.0


def test_the_change_is_timed_and_false_ones_are_counted() -> None:
    found = load_experiment("b_table_4")
    data = make_signal(found.signal, 1)
    trace = _perfect(data)
    for instant in (5.0, 15.0, 20.0, 32.05, 40.0):  # the first ten seconds do not count
        trace.changes[int(np.argmin(np.abs(data.time_s - instant)))] = True
    result = score(data, trace, ALL)
    assert result["change_delay_s"] == pytest.approx(0.05, abs=1e-6)
    assert result["false_changes"] == 2.0


def test_the_bound_is_that_of_weighted_least_squares(signal: Signal) -> None:
    """With the motion known the bound of constant parameters is the inverse information."""
    exact = dataclasses.replace(signal, displacement_noise_std=np.full_like(signal.time_s, 1e-7))
    deviations, floors = bounds(exact)
    step = 1e-6
    slopes = []
    for k in range(4):
        moved = []
        for sign in (1.0, -1.0):
            parameters = signal.parameters.copy()
            if k < 2:
                parameters[k] *= np.exp(sign * step)
            else:
                parameters[k] += sign * step
            moved.append(
                hunt_crossley_force(exact.true_displacement, exact.true_velocity, parameters)
            )
        slopes.append((moved[0] - moved[1]) / (2.0 * step))
    jacobian = np.array(slopes).T
    information = jacobian.T @ jacobian / 0.036**2 + np.diag(1.0 / np.array([4.0, 4.0, 0.25, 0.09]))
    expected = np.sqrt(np.diagonal(np.linalg.inv(information)))
    expected[2:] /= signal.parameters[2:]
    # The velocity is not known exactly, so that the bound may lie a little above.
    assert np.all(deviations > 0.99 * expected)
    assert np.all(deviations < 1.3 * expected)
    assert 0.0 < floors["force_late_rmse"] < floors["force_rmse"] < 0.036


def test_the_jerk_density_is_that_of_the_white_jerk_behind_it(signal: Signal) -> None:
    assert jerk_density(signal) == SMALLEST_JERK_DENSITY  # two slow sines
    density, step, count = 3e7, 1e-3, 40_000
    generator = np.random.default_rng(5)
    # Exact steps of an integrated Wiener process: velocity and acceleration under white jerk.
    covariance = density * np.array([[step**3 / 3.0, step**2 / 2.0], [step**2 / 2.0, step]])
    kicks = generator.multivariate_normal(np.zeros(2), covariance, count)
    acceleration = np.cumsum(kicks[:, 1])
    velocity = np.cumsum(step * (acceleration - kicks[:, 1]) + kicks[:, 0])
    jerky = dataclasses.replace(signal, time_s=step * np.arange(count), true_velocity=velocity)
    assert jerk_density(jerky) == pytest.approx(density, rel=0.05)


def test_the_first_guess_is_the_defaults() -> None:
    estimate = create_estimator(DEFAULT_FILTER).step(0.0, -1.0, 0.0)  # no contact
    mean, deviations = first_guess()
    assert estimate.parameters == pytest.approx([*np.exp(mean[:2]), *mean[2:]], rel=1e-12)
    scale = np.array([*np.exp(mean[:2]), 1.0, 1.0])
    assert estimate.parameters_std == pytest.approx(deviations * scale, rel=1e-6)


def test_the_regression_ends_at_the_batch_fit(signal: Signal) -> None:
    error = regression_error(signal)
    assert regression_floor(signal) == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)
    mean, deviations = first_guess()
    depth, velocity = signal.true_displacement, signal.true_velocity

    def cost(guess: np.ndarray) -> float:
        parameters = np.array([np.exp(guess[0]), np.exp(guess[1]), guess[2], guess[3]])
        force = hunt_crossley_force(depth, velocity, parameters)
        misfit = (signal.force_n - force) / signal.force_noise_std
        return float(np.sum(misfit**2) + np.sum(((guess - mean) / deviations) ** 2))

    stiffness, damping, n, p = signal.parameters
    fit = minimize(cost, [np.log(stiffness), np.log(damping), n, p], method="Nelder-Mead",
                   options={"xatol": 1e-9, "fatol": 1e-9, "maxiter": 4000})  # fmt: skip
    parameters = np.array([*np.exp(fit.x[:2]), *fit.x[2:]])
    force = hunt_crossley_force(depth[-1:], velocity[-1:], parameters)
    assert error[-1] == pytest.approx(force[0] - signal.true_force[-1], abs=1e-7)
    _, floors = bounds(signal)
    late = error[signal.time_s.size // 2 :]
    assert np.sqrt(np.mean(late**2)) < 2.5 * floors["force_late_rmse"]


def test_less_noise_makes_a_lower_floor(signal: Signal) -> None:
    noise = signal.force_n - signal.true_force
    calm = dataclasses.replace(
        signal,
        force_n=signal.true_force + 0.01 * noise,
        force_noise_std=0.01 * signal.force_noise_std,
    )
    assert regression_floor(calm) < 0.1 * regression_floor(signal)


def test_at_constant_velocity_k_and_b_count_together() -> None:
    found = load_experiment("a_table_1")
    data = make_signal(found.signal, 1)
    trace = _perfect(data, spread=0.0)
    stiffness = 10.0 + 0.1**1.05
    # All in B: the same force, and another K, B and p.
    trace.parameters[:] = [0.0, stiffness / 0.1**1.5, 2.0, 1.5]
    result = score(data, trace, {"identifiable": ("n",)})
    assert result["error_apparent"] == pytest.approx(0.0, abs=1e-12)
    assert result["error_identifiable"] == pytest.approx(0.0, abs=1e-12)
    assert result["error_K"] == 1.0


def test_the_misfit_that_is_told_is_counted_in_the_second_half(signal: Signal) -> None:
    trace = _perfect(signal)
    count = signal.time_s.size
    trace.mismatch[: count // 2] = True
    trace.mismatch[count // 2 : count // 2 + count // 8] = True
    assert score(signal, trace, ALL)["mismatch_share"] == pytest.approx(0.25, abs=1e-3)
