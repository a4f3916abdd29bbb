"""Scores of one run: the papers' own, and the honest ones.

The papers score the force rebuilt from the updated state: the contact law at the estimated motion
and parameters. Our default reports another force, the mean of law and sensor; both are scored. A
filter with enough gain drives either to zero while its parameters mean nothing, so three others
stand beside them: the parameters' error against the truth with the NEES, the force predicted half a
second ahead with frozen parameters (hold-forward), and the force one step ahead. All forces are
compared with the true, noise-free force.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.contact.arrays import force_gradient, force_of
from hc_estimator.contact.registry import (
    LARGEST_DISPLACEMENT_EXPONENT,
    LARGEST_VELOCITY_EXPONENT,
    SMALLEST_DISPLACEMENT_EXPONENT,
    SMALLEST_VELOCITY_EXPONENT,
)
from hc_evaluation.bounds import posterior_cramer_rao_bound
from hc_evaluation.hold_forward import hold_forward_errors
from hc_evaluation.reproduction.experiment import load_experiment
from hc_evaluation.reproduction.floor import regression_floor
from hc_evaluation.reproduction.signals import Signal, make_signal
from hc_evaluation.reproduction.trace import Trace

FloatArray = NDArray[np.float64]
Scores = dict[str, float]

LATE = 0.5  # the honest scores look at this last share of a run, where the estimate has settled
TOLERANCE = 0.05  # "within 5 %"
WELL_SEEN = 3.0  # a parameter is identifiable if so many bounds fit into the tolerance
NEES_INSTANTS = 20
CONSTANT = 1e-9  # mm/s: a velocity that varies less is constant
DIVERGED = 3.0  # force error, in RMS of the true force, beyond which a run has failed
HORIZON_S, HORIZON_SHARE = 0.5, 0.2  # of the hold-forward error; the share counts in short runs
STRIDE_S, STRIDE_SHARE = 0.05, 0.005
# Prior of the bound: as wide as any first guess in the experiments, in ln K, ln B, n, p.
PRIOR_STD = (1.0, 50.0, 500.0, 2.0, 2.0, 0.5, 0.3)
SMALLEST_JERK_DENSITY = 1e4  # mm^2/s^5; below it the bound of the parameters hardly changes


def _rms(values: FloatArray) -> float:
    with np.errstate(all="ignore"):
        result = float(np.sqrt(np.mean(values * values)))
    return result if np.isfinite(result) else float("inf")


def _rms_of_known(values: FloatArray) -> float:
    """RMS of what was foretold, infinite where nothing was: that is not right either."""
    known = values[~np.isnan(values)]
    return _rms(known) if known.size else float("inf")


def _free_nees(trace: Trace, truth: FloatArray, first: int) -> float:
    """Median NEES per free parameter over instants from `first` on; ideal near 1.

    In K, B, n, p themselves, because literal filters may have negative K or B; a parameter held
    fixed has no variance and is left out.
    """
    chosen = np.linspace(first, trace.force.size - 1, NEES_INSTANTS).astype(int)
    values = []
    for k in chosen:
        variance = np.diagonal(trace.covariance[k])
        free = variance > 0.0
        if not np.any(free) or not np.all(np.isfinite(trace.covariance[k])):
            return float("nan")
        error = (trace.parameters[k] - truth)[free]
        scale = np.sqrt(variance[free])
        correlation = trace.covariance[k][np.ix_(free, free)] / np.outer(scale, scale)
        weighted = np.linalg.lstsq(correlation, error / scale, rcond=None)[0]
        values.append(float(weighted @ (error / scale)) / int(np.count_nonzero(free)))
    return float(np.median(values))


def _noise_scores(signal: Signal, trace: Trace, settings: Mapping[str, Any]) -> Scores:
    """How well the adapted noise is known: RMSE, and mean error later.

    Of its standard deviation [N], or of its variance [N^2] where the paper's figures are read so.
    """
    if settings.get("noise_as") == "variance":  # as the paper's figures are read here
        error = trace.noise_std**2 - signal.force_noise_std**2
    else:
        error = trace.noise_std - signal.force_noise_std
    late = signal.time_s > float(settings["noise_from_s"])
    return {
        "noise_rmse": _rms(error),
        "noise_rmse_after": _rms(error[late]),
        "noise_mean_error_after": float(np.mean(np.abs(error[late]))),
    }


def _limited_share(parameters: FloatArray) -> float:
    """Share of the samples whose n or p the contact law inside the filters has to limit."""
    n, p = parameters[:, 2], parameters[:, 3]
    inside = (n >= SMALLEST_DISPLACEMENT_EXPONENT) & (n <= LARGEST_DISPLACEMENT_EXPONENT)
    inside &= (p >= SMALLEST_VELOCITY_EXPONENT) & (p <= LARGEST_VELOCITY_EXPONENT)
    if np.all(np.isnan(n)):
        return float("nan")
    return float(np.mean(~inside))


def _apparent_stiffness(parameters: FloatArray, velocity: float) -> float:
    """K + B v^p: all that a constant velocity shows of K, B and p."""
    stiffness, damping, _, p = parameters
    with np.errstate(all="ignore"):
        return float(stiffness + damping * np.sign(velocity) * np.abs(velocity) ** p)


def _parameter_scores(
    signal: Signal, trace: Trace, settings: Mapping[str, Any], first: int
) -> Scores:
    truth = signal.parameters
    span = float(signal.time_s[-1] - signal.time_s[0])
    with np.errstate(all="ignore"):
        force = force_of(
            signal.true_displacement,
            signal.true_velocity,
            trace.parameters,
            adhesive=trace.adhesive,
        )
        late = slice(first, None)
        _, held = hold_forward_errors(
            signal.time_s,
            signal.true_displacement,
            signal.true_velocity,
            signal.true_force,
            trace.parameters,
            adhesive=trace.adhesive,
            horizon_s=min(HORIZON_S, HORIZON_SHARE * span),
            start_s=LATE * span,
            stride_s=max(STRIDE_S, STRIDE_SHARE * span),
        )
        result = {
            "force_from_parameters_rmse": _rms((force - signal.true_force)[late]),
            "hold_forward_rmse": _rms(held),
        }
    if np.all(np.isfinite(truth)):
        error = np.abs(trace.parameters[-1] / truth - 1.0)
        result |= {f"error_{n}": float(e) for n, e in zip("KBnp", error, strict=True)}
        seen = [n in settings["identifiable"] for n in "KBnp"]
        largest = [float(np.max(error[seen]))] if any(seen) else []
        if np.ptp(signal.true_velocity) < CONSTANT:
            stiffness = _apparent_stiffness(trace.parameters[-1], signal.true_velocity[-1])
            true = _apparent_stiffness(truth, signal.true_velocity[-1])
            result["error_apparent"] = abs(stiffness / true - 1.0)
            largest.append(result["error_apparent"])
        result["error_identifiable"] = max(largest) if largest else float("nan")
        result["nees"] = _free_nees(trace, truth, first)
    return result


def _teleoperation_scores(signal: Signal, trace: Trace) -> Scores:
    """Table III of paper C: means, and roots of the sum of squares, in cm, cm/s and N."""
    position = 0.1 * (trace.displacement - signal.true_displacement)
    velocity = 0.1 * (trace.velocity - signal.true_velocity)
    force = trace.force - signal.true_force
    tracking = 0.1 * (signal.rig["slave_position"] - signal.rig["command"])
    impedance = signal.rig["feedback_force"] - signal.true_force
    columns = {
        "position": position,
        "velocity": velocity,
        "tele_force": force,
        "tele_law": trace.law_force - signal.true_force,
        "position_tracking": tracking,
        "impedance_tracking": impedance,
    }
    result = {f"{name}_mean": float(np.mean(values)) for name, values in columns.items()}
    for name, values in columns.items():
        result[f"{name}_root_sum"] = _rms(values) * float(np.sqrt(values.size))
    return result


def score(signal: Signal, trace: Trace, settings: Mapping[str, Any]) -> Scores:
    """All scores of a run that the experiment asks for.

    Args:
        signal: readings and truth.
        trace: what the estimator made of them.
        settings: the experiment's `scoring` section, completed by `complete`: `noise_from_s`
            asks for the noise's scores, `teleoperation` for table III of paper C.

    Returns:
        Numbers by name; forces in N, relative errors as shares. `failed` is 1 if an update had no
        meaning, a number is not finite, or the force error is three times the force itself.
    """
    error = trace.force - signal.true_force
    first = int(LATE * signal.time_s.size)
    with np.errstate(all="ignore"):
        finite = bool(np.all(np.isfinite(error)))
        result: Scores = {
            "force_mean": float(np.mean(np.abs(error))) if finite else float("inf"),
            "force_max": float(np.max(np.abs(error))) if finite else float("inf"),
            "force_rmse": _rms(error) if finite else float("inf"),
            "law_rmse": _rms(trace.law_force - signal.true_force),
            "force_late_rmse": _rms(error[first:]),
            "one_step_rmse": _rms_of_known((trace.force_predicted - signal.true_force)[first:]),
            "mismatch_share": float(np.mean(trace.mismatch[first:])),
            "updates_undone": float(trace.numerical_failures),
            "exponents_limited": _limited_share(trace.parameters),
        }
    lost = trace.numerical_failures > 0 or not finite
    result["failed"] = float(lost or result["force_rmse"] > DIVERGED * _rms(signal.true_force))
    if np.any(np.isfinite(trace.parameters)):
        result |= _parameter_scores(signal, trace, settings, first)
        finite_nis = trace.nis[first:][np.isfinite(trace.nis[first:])]
        result["nis"] = float(np.mean(finite_nis)) if finite_nis.size else float("nan")
    if "noise_from_s" in settings and np.any(np.isfinite(trace.noise_std)):
        result |= _noise_scores(signal, trace, settings)
    if np.isfinite(signal.jump_s):
        called = signal.time_s[trace.changes]
        after = called[called > signal.jump_s]
        result["change_delay_s"] = float(after[0] - signal.jump_s) if after.size else float("inf")
        settled = called[(called > 10.0) & (called <= signal.jump_s)]
        result["false_changes"] = float(settled.size)
    if settings.get("teleoperation"):
        result |= _teleoperation_scores(signal, trace)
    return result


def jerk_density(signal: Signal) -> float:
    """Density of the white jerk whose motion varies as much as the true one [mm^2/s^5].

    The second difference of a velocity driven by white jerk of density q has the variance
    2/3 q dt^3. Steps of the velocity make it large: then the bound does not know them beforehand.
    """
    second = np.diff(signal.true_velocity, 2)
    found = 1.5 * float(np.mean(second * second)) / signal.time_step**3
    return max(found, SMALLEST_JERK_DENSITY)


def bounds(signal: Signal) -> tuple[FloatArray, Scores]:
    """What any estimator can reach: the posterior Cramer-Rao bound on parameters and force.

    Args:
        signal: a signal of a Hunt-Crossley tissue; only its truth and noise levels are used.

    Returns:
        Relative standard deviations of K, B, n, p at the end, shape (4,), and the floors of the
        force error from the parameters' part of the bound (motion taken as known): over the whole
        run and over its last part [N].
    """
    truth = np.broadcast_to(signal.parameters, (signal.time_s.size, 4))
    bound = posterior_cramer_rao_bound(
        signal.time_s,
        signal.true_displacement,
        signal.true_velocity,
        truth,
        displacement_noise_std=signal.displacement_noise_std,
        force_noise_std=signal.force_noise_std,
        jerk_density=jerk_density(signal),
        parameter_density=np.zeros(4),
        initial_covariance=np.diag(np.square(PRIOR_STD)),
    )
    slopes = force_gradient(signal.true_displacement, signal.true_velocity, truth)[:, 2:]
    variance = np.einsum("ki,kij,kj->k", slopes, bound, slopes)
    first = int(LATE * signal.time_s.size)
    deviations = np.sqrt(np.diagonal(bound[-1]))
    deviations[2:] /= signal.parameters[2:]
    floors = {
        "force_rmse": float(np.sqrt(np.mean(variance))),
        "force_late_rmse": float(np.sqrt(np.mean(variance[first:]))),
    }
    return deviations, floors


@functools.cache
def _completed(name: str) -> tuple[tuple[str, ...], tuple[tuple[str, float], ...]]:
    signal = make_signal(load_experiment(name).signal, 0)
    if not np.all(np.isfinite(signal.parameters)) or not np.any(signal.true_displacement > 0.0):
        return (), ()
    deviations, floors = bounds(signal)
    seen = tuple(n for n, d in zip("KBnp", deviations, strict=True) if WELL_SEEN * d <= TOLERANCE)
    return seen, tuple(floors.items())


def identifiable(name: str) -> tuple[str, ...]:
    """The parameters of an experiment whose bound at the end fits three times into 5 %."""
    return _completed(name)[0]


@functools.cache
def floors(name: str) -> Scores:
    """The floors of the force error of an experiment [N]; empty without a Hunt-Crossley truth.

    `force_rmse` and `force_late_rmse` are those of `bounds`; `regression_rmse` is what the start
    costs (see `floor`), `regression_root_sum` the same as a root of the sum of squares.
    """
    found = dict(_completed(name)[1])
    if found:
        signal = make_signal(load_experiment(name).signal, 0)
        found["regression_rmse"] = regression_floor(signal)
        found["regression_root_sum"] = found["regression_rmse"] * signal.time_s.size**0.5
    return found
