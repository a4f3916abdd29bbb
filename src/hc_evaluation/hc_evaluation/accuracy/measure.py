"""One run of one estimator on one contact, reduced to the numbers that the tables are made of.

Every function takes plain, picklable arguments and returns plain numbers, so that the runs can be
spread over processes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator import DEFAULT_FILTER, EstimateSeries, Estimator, create_estimator
from hc_evaluation import metrics
from hc_evaluation.accuracy.scenarios import Scenario, SimulatedContact, simulate
from hc_evaluation.bounds import posterior_cramer_rao_bound
from hc_evaluation.contact_law import hunt_crossley_force

FloatArray = NDArray[np.float64]
Numbers = dict[str, float]

SETTLED_S = 1.5  # "all four within 5 % after 1.5 s"
TOLERANCE = 0.05
WELL_SEEN = 3.0  # a parameter counts as excited once so many bounds fit into the tolerance


@dataclass(frozen=True)
class Setup:
    """The estimator under test: filter, and the parameters that differ from its defaults."""

    filter: str = DEFAULT_FILTER
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def create(self) -> Estimator:
        """Make the estimator."""
        return create_estimator(self.filter, **self.parameters)


@dataclass(frozen=True)
class Task:
    """One run: estimator, contact and seed of its noise."""

    setup: Setup
    scenario: Scenario
    seed: int


def _run(task: Task) -> tuple[SimulatedContact, Estimator, EstimateSeries]:
    contact = simulate(task.scenario, task.seed)
    estimator = task.setup.create()
    series = estimator.run(contact.time_s, contact.displacement_mm, contact.force_n)
    return contact, estimator, series


def _sampled(scenario: Scenario, time: FloatArray, start_s: float) -> NDArray[np.intp]:
    """Indices of about twenty samples a second from start_s on."""
    stride = max(1, round(scenario.rate_hz / 20.0))
    return np.arange(int(np.searchsorted(time, start_s)), time.size, stride)


def bound_of(contact: SimulatedContact, estimator: Estimator, jerk_density: float) -> FloatArray:
    """Posterior Cramer-Rao bound with the estimator's own prior and walks, shape (N, 4, 4)."""
    values = {name: float(v) for name, v in estimator.configuration.items() if _is_number(v)}
    prior = np.diag(
        [
            values["initial_displacement_std"] ** 2,
            values["initial_velocity_std"] ** 2,
            values["initial_acceleration_std"] ** 2,
            values["initial_stiffness_log_std"] ** 2,
            values["initial_damping_log_std"] ** 2,
            values["initial_displacement_exponent_std"] ** 2,
            values["initial_velocity_exponent_std"] ** 2,
        ]
    )
    walk = np.array(
        [
            values["stiffness_log_walk"],
            values["damping_log_walk"],
            values["displacement_exponent_walk"],
            values["velocity_exponent_walk"],
        ]
    )
    return posterior_cramer_rao_bound(
        contact.time_s,
        contact.displacement,
        contact.velocity,
        contact.parameters,
        displacement_noise_std=contact.displacement_noise_std,
        force_noise_std=contact.force_noise_std,
        jerk_density=jerk_density,
        parameter_density=walk,
        initial_covariance=prior,
    )


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def quiet_run(task: Task) -> Numbers:
    """A tissue that does not change: errors, consistency, false alarms (issue item 1)."""
    contact, estimator, series = _run(task)
    time = contact.time_s
    error = metrics.log_parameter_error(series.parameters[-1], contact.parameters[-1])
    chosen = _sampled(task.scenario, time, 2.0)
    consistency = metrics.nees(
        series.parameters[chosen], series.covariance[chosen], contact.parameters[chosen]
    )
    relative = metrics.relative_parameter_error(series.parameters, contact.parameters)
    density = float(np.median(series.process_noise_scale[chosen]))
    density *= float(estimator.configuration["jerk_density"])
    bound = bound_of(contact, estimator, density)
    deviations = np.sqrt(np.diagonal(bound, axis1=1, axis2=2))
    scale = np.ones_like(deviations)
    scale[:, 2:] = contact.parameters[:, 2:]
    excited = WELL_SEEN * deviations / scale <= TOLERANCE
    after = time >= SETTLED_S
    counted = np.count_nonzero(excited[after])
    within = np.count_nonzero((relative <= TOLERANCE)[after] & excited[after])
    force = hunt_crossley_force(contact.displacement, contact.velocity, series.parameters)
    late = time >= 2.0
    result = {f"error_{i}": float(error[i]) for i in range(4)}
    result |= {f"bound_{i}": float(deviations[-1, i]) for i in range(4)}
    return result | {
        "nees": float(np.mean(consistency)),
        "nis": float(np.nanmean(series.nis[time > 1.0])),
        "within": within / counted if counted else float("nan"),
        "changes": float(np.count_nonzero(series.change_detected)),
        "mismatch": float(np.mean(series.model_mismatch[late])),
        "seconds": float(time[-1]),
        "jerk_density": density,
        "force_rms": float(np.sqrt(np.mean((force - contact.force)[late] ** 2))),
    }


def change_run(task: Task) -> Numbers:
    """A tissue that changes abruptly: how soon it is found again (issue item 2)."""
    contact, estimator, series = _run(task)
    time = contact.time_s
    instant = task.scenario.changes[0][0]
    relative = metrics.relative_parameter_error(series.parameters, contact.parameters)
    two_later = int(np.searchsorted(time, instant + 2.0))
    called = time[series.change_detected]
    after = called[called >= instant]
    return {
        "settling_s": metrics.settling_time(time, relative, TOLERANCE, instant),
        "bound_s": _soonest(contact, estimator, instant),
        "error_after_2s": float(np.max(relative[two_later])),
        "early_calls": float(np.count_nonzero(called < instant)),
        "calls": float(after.size),
        "delay_s": float(after[0] - instant) if after.size else float("nan"),
    }


def _soonest(contact: SimulatedContact, estimator: Estimator, instant: float) -> float:
    """Time after which the bound allows all four within 5 % in half of the runs.

    The bound is that of an estimator which is told the instant and knows the old tissue as the
    prior of the new one; the largest of four Gaussian errors is below 1.5 standard deviations in
    somewhat more than half of the runs.
    """
    after = contact.time_s >= instant
    values = estimator.configuration
    if "restart_stiffness_log_std" not in values:
        return float("nan")
    parameters = contact.parameters[after]
    prior = np.diag(
        [
            contact.displacement_noise_std[0] ** 2,
            1.0,
            1e3,
            *(
                float(values[f"restart_{name}_std"]) ** 2
                for name in (
                    "stiffness_log",
                    "damping_log",
                    "displacement_exponent",
                    "velocity_exponent",
                )
            ),
        ]
    )
    bound = posterior_cramer_rao_bound(
        contact.time_s[after],
        contact.displacement[after],
        contact.velocity[after],
        parameters,
        displacement_noise_std=contact.displacement_noise_std[after],
        force_noise_std=contact.force_noise_std[after],
        jerk_density=float(values["jerk_density"]),
        parameter_density=np.zeros(4),
        initial_covariance=prior,
    )
    deviations = np.sqrt(np.diagonal(bound, axis1=1, axis2=2)).copy()
    deviations[:, 2:] /= parameters[:, 2:]
    return metrics.settling_time(contact.time_s[after], 1.5 * deviations, TOLERANCE, instant)


def noise_run(task: Task) -> Numbers:
    """A sensor that turns noisier: no change, same parameters, consistent (issue item 3)."""
    contact, _, series = _run(task)
    time = contact.time_s
    instant = task.scenario.noise_jumps[0][0]
    relative = metrics.relative_parameter_error(series.parameters, contact.parameters)
    return {
        "nis_before": float(np.nanmean(series.nis[(time > 1.0) & (time < instant)])),
        "nis_after": float(np.nanmean(series.nis[time > instant + 1.0])),
        "worst_error": float(np.max(relative[time > instant])),
        "changes": float(np.count_nonzero(series.change_detected)),
        "mismatch": float(np.mean(series.model_mismatch[time > instant + 1.0])),
    }


def weak_run(task: Task) -> Numbers:
    """A motion that cannot show everything: is that told? (issue item 5)."""
    contact, _, series = _run(task)
    error = metrics.log_parameter_error(series.parameters[-1], contact.parameters[-1])
    deviations = np.sqrt(
        np.diagonal(metrics.log_parameter_covariance(series.parameters, series.covariance)[-1])
    )
    drift = 0.0
    in_contact = np.flatnonzero(contact.displacement > 0.0)
    # From a tenth of a second after the last contact on, nothing may move any more.
    last_contact = int(in_contact[-1]) if in_contact.size else -1
    free_from = last_contact + 1 + round(0.1 * task.scenario.rate_hz)
    if free_from < contact.time_s.size:
        drift = float(np.max(np.ptp(series.parameters[free_from:], axis=0)))
    force = hunt_crossley_force(contact.displacement, contact.velocity, series.parameters)
    half = contact.time_s > 0.5 * contact.time_s[-1]
    result = {f"error_{i}": float(error[i]) for i in range(4)}
    result |= {f"deviation_{i}": float(deviations[i]) for i in range(4)}
    result |= {f"identifiability_{i}": float(series.identifiability[-1, i]) for i in range(4)}
    return result | {
        "nees": float(
            metrics.nees(series.parameters[-1], series.covariance[-1], contact.parameters[-1])
        ),
        "changes": float(np.count_nonzero(series.change_detected)),
        "free_drift": drift,
        "force_rms": float(np.sqrt(np.mean((force - contact.force)[half] ** 2))),
    }


def plain_run(task: Task) -> Numbers:
    """What can be measured of every filter, whatever its parameters are called."""
    contact, _, series = _run(task)
    time = contact.time_s
    relative = metrics.relative_parameter_error(series.parameters[-1], contact.parameters[-1])
    chosen = _sampled(task.scenario, time, 2.0)
    force = hunt_crossley_force(contact.displacement, contact.velocity, series.parameters)
    result = {f"relative_{i}": float(relative[i]) for i in range(4)}
    covariance = series.covariance[chosen]
    parameters = series.parameters[chosen]
    consistency = float("nan")
    if np.all(np.linalg.eigvalsh(covariance)[:, 0] > 0.0) and np.all(parameters[:, :2] > 0.0):
        consistency = float(
            np.mean(metrics.nees(parameters, covariance, contact.parameters[chosen]))
        )
    finite = np.isfinite(series.nis)
    return result | {
        "nees": consistency,
        "nis": float(np.mean(series.nis[finite])) if np.any(finite) else float("nan"),
        "force_rms": float(np.sqrt(np.mean((force - contact.force)[time > 2.0] ** 2))),
    }
