"""One run of one estimator on one contact, reduced to the numbers that the tables are made of.

Every function takes plain, picklable arguments and returns plain numbers, so that the runs can be
spread over processes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator import DEFAULT_FILTER, create_estimator
from hc_estimator.contact.arrays import hunt_crossley_force
from hc_evaluation import metrics
from hc_evaluation.accuracy.candidate import load_candidate
from hc_evaluation.accuracy.scenarios import Scenario, SimulatedContact, simulate
from hc_evaluation.bounds import posterior_cramer_rao_bound

FloatArray = NDArray[np.float64]
Numbers = dict[str, float]

SETTLED_S = 1.5  # "all four within 5 % after 1.5 s"
TOLERANCE = 0.05
# Prior of the bounds in d, v, a, ln K, ln B, n, p, and the walk per second of the last four: what
# an estimator may assume that is to fit every tissue (the default's own first guess).
PRIOR_STD = (1.0, 50.0, 500.0, 2.0, 1.5, 0.5, 0.1)
WALK = np.full(4, 3e-10)
# Of an estimator that is told of a change: the old tissue is the prior of the new one.
RESTART_STD = (1.0, 1.0, 0.3, 0.1)
SMALLEST_JERK_DENSITY = 1e3  # mm^2/s^5, of a tool at rest
WELL_SEEN = 3.0  # a parameter counts as excited once so many bounds fit into the tolerance


@dataclass(frozen=True)
class Setup:
    """The estimator under test: filter, and the parameters that differ from its defaults.

    Attributes:
        filter: a filter of hc_estimator.
        parameters: what differs from its defaults.
        candidate: "FILE.py:NAME" of a function that makes the estimator instead (see `candidate`).
    """

    filter: str = DEFAULT_FILTER
    parameters: Mapping[str, Any] = field(default_factory=dict)
    candidate: str = ""

    @property
    def name(self) -> str:
        """What is under test."""
        return self.candidate or self.filter

    def create(self) -> Any:
        """Make the estimator: anything with run(time_s, displacement_mm, force_n).

        Raises:
            ValueError: an unknown filter, candidate or parameter.
        """
        if self.candidate:
            return load_candidate(self.candidate, self.parameters)
        return create_estimator(self.filter, **self.parameters)

    def with_parameters(self, more: Mapping[str, Any]) -> Setup:
        """The same with further parameters."""
        return replace(self, parameters={**self.parameters, **more})


@dataclass(frozen=True)
class Task:
    """One run: estimator, contact and seed of its noise."""

    setup: Setup
    scenario: Scenario
    seed: int


def run_task(task: Task) -> tuple[SimulatedContact, Any]:
    """The simulated contact of a task, and the estimator's series on it."""
    contact = simulate(task.scenario, task.seed)
    series = task.setup.create().run(contact.time_s, contact.displacement_mm, contact.force_n)
    return contact, series


def sampled(rate_hz: float, time: FloatArray, start_s: float) -> NDArray[np.intp]:
    """Indices of about twenty samples a second from start_s on."""
    stride = max(1, round(rate_hz / 20.0))
    return np.arange(int(np.searchsorted(time, start_s)), time.size, stride)


def known_mean(values: FloatArray) -> float:
    """Mean of the values that are known; NaN where an estimator gives none."""
    known = values[np.isfinite(values)]
    return float(np.mean(known)) if known.size else float("nan")


def bound_of(contact: SimulatedContact) -> FloatArray:
    """Posterior Cramer-Rao bound of a contact, shape (N, 4, 4).

    It knows the noise levels and the separation, starts from the prior `PRIOR_STD` and lets the
    parameters walk as `WALK` says; the density of the jerk is that of the true motion
    (`true_jerk_density`; a tenth or ten times of it change the bound by 1 to 5 %).
    """
    return posterior_cramer_rao_bound(
        contact.time_s,
        contact.displacement,
        contact.velocity,
        contact.parameters,
        displacement_noise_std=contact.displacement_noise_std,
        force_noise_std=contact.force_noise_std,
        jerk_density=true_jerk_density(contact),
        parameter_density=WALK,
        initial_covariance=np.diag(np.square(PRIOR_STD)),
    )


def true_jerk_density(contact: SimulatedContact) -> float:
    """Spectral density of the white jerk that is as strong as the true motion's [mm^2/s^5].

    A jerk of standard deviation s that stays alike over the time s_a / s (s_a: that of the
    acceleration) has the density 2 s^2 s_a / s at low frequencies.
    """
    jerk = np.gradient(contact.acceleration, contact.time_s)
    found = 2.0 * float(np.std(jerk)) * float(np.std(contact.acceleration))
    return max(found, SMALLEST_JERK_DENSITY)


def quiet_run(task: Task) -> Numbers:
    """A tissue that does not change: errors, consistency, false alarms."""
    contact, series = run_task(task)
    time = contact.time_s
    error = metrics.log_parameter_error(series.parameters[-1], contact.parameters[-1])
    chosen = sampled(task.scenario.rate_hz, time, 2.0)
    consistency = metrics.nees(
        series.parameters[chosen], series.covariance[chosen], contact.parameters[chosen]
    )
    relative = metrics.relative_parameter_error(series.parameters, contact.parameters)
    bound = bound_of(contact)
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
        "nis": known_mean(series.nis[time > 1.0]),
        "within": within / counted if counted else float("nan"),
        "changes": float(np.count_nonzero(series.change_detected)),
        "mismatch": float(np.mean(series.model_mismatch[late])),
        "seconds": float(time[-1]),
        "force_rms": float(np.sqrt(np.mean((force - contact.force)[late] ** 2))),
    }


def change_run(task: Task) -> Numbers:
    """A tissue that changes abruptly: how soon it is found again."""
    contact, series = run_task(task)
    time = contact.time_s
    instant = task.scenario.changes[0][0]
    relative = metrics.relative_parameter_error(series.parameters, contact.parameters)
    two_later = int(np.searchsorted(time, instant + 2.0))
    called = time[series.change_detected]
    after = called[called >= instant]
    return {
        "settling_s": metrics.settling_time(time, relative, TOLERANCE, instant),
        "bound_s": _soonest(contact, instant),
        "error_after_2s": float(np.max(relative[two_later])),
        "early_calls": float(np.count_nonzero(called < instant)),
        "calls": float(after.size),
        "delay_s": float(after[0] - instant) if after.size else float("nan"),
    }


def _soonest(contact: SimulatedContact, instant: float) -> float:
    """Time after which the bound allows all four within 5 % in half of the runs.

    The bound is that of an estimator which is told the instant and knows the old tissue as the
    prior of the new one; the largest of four Gaussian errors is below 1.5 standard deviations in
    somewhat more than half of the runs.
    """
    after = contact.time_s >= instant
    parameters = contact.parameters[after]
    motion_std = (contact.displacement_noise_std[0], 1.0, np.sqrt(1e3))
    bound = posterior_cramer_rao_bound(
        contact.time_s[after],
        contact.displacement[after],
        contact.velocity[after],
        parameters,
        displacement_noise_std=contact.displacement_noise_std[after],
        force_noise_std=contact.force_noise_std[after],
        jerk_density=true_jerk_density(contact),
        parameter_density=np.zeros(4),
        initial_covariance=np.diag(np.square([*motion_std, *RESTART_STD])),
    )
    deviations = np.sqrt(np.diagonal(bound, axis1=1, axis2=2)).copy()
    deviations[:, 2:] /= parameters[:, 2:]
    return metrics.settling_time(contact.time_s[after], 1.5 * deviations, TOLERANCE, instant)


def noise_run(task: Task) -> Numbers:
    """A sensor that turns noisier: no change, same parameters, consistent."""
    contact, series = run_task(task)
    time = contact.time_s
    instant = task.scenario.noise_jumps[0][0]
    relative = metrics.relative_parameter_error(series.parameters, contact.parameters)
    return {
        "nis_before": known_mean(series.nis[(time > 1.0) & (time < instant)]),
        "nis_after": known_mean(series.nis[time > instant + 1.0]),
        "worst_error": float(np.max(relative[time > instant])),
        "changes": float(np.count_nonzero(series.change_detected)),
        "mismatch": float(np.mean(series.model_mismatch[time > instant + 1.0])),
    }


def weak_run(task: Task) -> Numbers:
    """A motion that cannot show everything: is that told?."""
    contact, series = run_task(task)
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
    contact, series = run_task(task)
    time = contact.time_s
    relative = metrics.relative_parameter_error(series.parameters[-1], contact.parameters[-1])
    chosen = sampled(task.scenario.rate_hz, time, 2.0)
    force = hunt_crossley_force(contact.displacement, contact.velocity, series.parameters)
    result = {f"relative_{i}": float(relative[i]) for i in range(4)}
    covariance = series.covariance[chosen]
    parameters = series.parameters[chosen]
    consistency = float("nan")
    if np.all(np.linalg.eigvalsh(covariance)[:, 0] > 0.0) and np.all(parameters[:, :2] > 0.0):
        consistency = float(
            np.mean(metrics.nees(parameters, covariance, contact.parameters[chosen]))
        )
    return result | {
        "nees": consistency,
        "nis": known_mean(series.nis),
        "force_rms": float(np.sqrt(np.mean((force - contact.force)[time > 2.0] ** 2))),
    }
