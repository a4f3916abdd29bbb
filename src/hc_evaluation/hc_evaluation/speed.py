"""How fast the estimators are, as ratios to filterpy within one run.

Absolute times mean nothing on somebody else's machine; the ratio of two times taken in turns in
one process does. filterpy is the library that most people would reach for; its unscented filter
gets the same seven states, process and measurement functions.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator import DEFAULT_FILTER, available_filters, available_state_spaces, create_estimator
from hc_evaluation.contact_law import hunt_crossley_force

SAMPLES = 2000
BATCH_REPEATS = 20
ROUNDS = 5
RATE_HZ = 1000.0
PARTICLES = 50
JERK_DENSITY = 1e5  # mm^2/s^5
DISPLACEMENT_NOISE_MM = 0.002
FORCE_NOISE_N = 0.01


def contact_samples(samples: int = SAMPLES) -> NDArray[np.float64]:
    """Return time [s], displacement [mm], force [N] of a noisy contact, shape (3, samples)."""
    time_s = np.arange(samples) / RATE_HZ
    phase = 2.0 * np.pi * time_s
    displacement = 3.0 + 1.6 * np.sin(0.7 * phase) + 0.8 * np.sin(2.3 * phase + 0.5)
    velocity = 2.0 * np.pi * (1.12 * np.cos(0.7 * phase) + 1.84 * np.cos(2.3 * phase + 0.5))
    force = hunt_crossley_force(displacement, velocity, np.array([0.2, 0.008, 1.8, 1.05]))
    noise = np.random.default_rng(1).normal(size=(2, samples))
    return np.stack(
        [
            time_s,
            displacement + DISPLACEMENT_NOISE_MM * noise[0],
            force + FORCE_NOISE_N * noise[1],
        ]
    )


def filterpy_filter() -> Any:
    """Return filterpy's unscented filter for [d, v, a, ln K, ln B, n, p].

    Raises:
        ImportError: if filterpy is not installed.
    """
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    def process(x: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
        moved = x.copy()
        moved[0] = x[0] + dt * x[1] + 0.5 * dt * dt * x[2]
        moved[1] = x[1] + dt * x[2]
        return moved

    def measure(x: NDArray[np.float64]) -> NDArray[np.float64]:
        displacement, velocity = max(x[0], 0.0), x[1]
        damping = np.exp(x[4]) * np.sign(velocity) * abs(velocity) ** x[6]
        return np.array([x[0], max(displacement ** x[5] * (np.exp(x[3]) + damping), 0.0)])

    points = MerweScaledSigmaPoints(7, alpha=1.0, beta=2.0, kappa=0.0)
    ukf = UnscentedKalmanFilter(7, 2, 1.0 / RATE_HZ, measure, process, points)
    ukf.x = np.array([3.4, 0.0, 0.0, 0.0, np.log(0.01), 1.5, 1.0])
    ukf.P = np.diag([1e-4, 100.0, 1e4, 1.0, 1.0, 0.09, 0.01])
    dt = 1.0 / RATE_HZ
    gain = np.array([dt**3 / 6.0, dt**2 / 2.0, dt])
    ukf.Q = np.diag([0.0, 0.0, 0.0, 1e-8, 1e-8, 1e-8, 1e-8])
    ukf.Q[:3, :3] = JERK_DENSITY * np.outer(gain, gain) / dt + np.diag([1e-12, 1e-9, 1e-6])
    ukf.R = np.diag([DISPLACEMENT_NOISE_MM**2, 1.0])
    return ukf


def run_speed(progress: Callable[[float], None] = lambda _share: None) -> dict[str, Any]:
    """Measure microseconds a sample: filterpy, `ukf` by run and step, every filter by run.

    Args:
        progress: told the done share.

    Returns:
        filterpy_us, ukf_run_us, ukf_step_us (medians over rounds), run_ratio and step_ratio (ours
        to filterpy's, median of the rounds' ratios), default_step_us, sir_pf_step_us, and
        filters_us (microseconds a sample of run() by filter and state space).

    Raises:
        ImportError: if filterpy is not installed.
    """
    data = contact_samples()
    reference = filterpy_filter()
    ukf, default = create_estimator("ukf"), create_estimator(DEFAULT_FILTER)
    particles = create_estimator("sir_pf", particle_count=PARTICLES)
    for estimator in (ukf, default, particles):
        estimator.warm_up()
    rounds = []
    for number in range(ROUNDS):
        rounds.append(
            (
                _filterpy_us(reference, data[:, : SAMPLES // 4]),
                _run_us(ukf, data),
                _step_us(ukf, data),
                _step_us(default, data),
                _step_us(particles, data),
            )
        )
        progress(0.6 * (number + 1) / ROUNDS)
    theirs, run, step, default_step, particle_step = (list(c) for c in zip(*rounds, strict=True))
    filters = {}
    kinds = [(f, s) for f in available_filters() for s in available_state_spaces(f)]
    for number, (name, space) in enumerate(kinds):
        estimator = create_estimator(name, state_space=space)
        estimator.warm_up()
        filters[f"{name}/{space}"] = _run_us(estimator, data, repeats=1)
        progress(0.6 + 0.4 * (number + 1) / len(kinds))
    return {
        "samples": SAMPLES,
        "filterpy_us": statistics.median(theirs),
        "ukf_run_us": statistics.median(run),
        "ukf_step_us": statistics.median(step),
        "run_ratio": statistics.median(a / b for a, b in zip(run, theirs, strict=True)),
        "step_ratio": statistics.median(a / b for a, b in zip(step, theirs, strict=True)),
        "default_step_us": statistics.median(default_step),
        "sir_pf_step_us": statistics.median(particle_step),
        "filters_us": filters,
    }


def _filterpy_us(reference: Any, data: NDArray[np.float64]) -> float:
    start = time.perf_counter()
    for _, displacement, force in data.T:
        reference.predict()
        reference.update(np.array([displacement, force]))
    return 1e6 * (time.perf_counter() - start) / int(data.shape[1])


def _run_us(estimator: Any, data: NDArray[np.float64], repeats: int = BATCH_REPEATS) -> float:
    spent = 0.0
    for _ in range(repeats):
        estimator.reset()
        start = time.perf_counter()
        estimator.run(*data)
        spent += time.perf_counter() - start
    return 1e6 * spent / (repeats * int(data.shape[1]))


def _step_us(estimator: Any, data: NDArray[np.float64]) -> float:
    estimator.reset()
    rows = data.T.tolist()
    start = time.perf_counter()
    for time_s, displacement, force in rows:
        estimator.step(time_s, displacement, force)
    return 1e6 * (time.perf_counter() - start) / int(data.shape[1])
