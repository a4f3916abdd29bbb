"""How fast the estimators are, as ratios to others within one run.

Absolute times mean nothing on somebody else's machine; the ratio of two times taken in turns in
one process does. The others are filterpy, Stone Soup and pykalman, which most people would reach
for, and the same plain filter written in numba and in C++ with Eigen, which is what one would write
for speed (rivals/plain_ukf.py, rivals/packages.py); particle filters stand beside one in numpy
(rivals/plain_particles.py). Processor time is counted, not time on the
clock: what else runs on the machine enters only by what it leaves of caches and memory.
"""

from __future__ import annotations

import functools
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator import DEFAULT_FILTER, available_filters, available_state_spaces, create_estimator
from hc_estimator.contact.arrays import hunt_crossley_force
from hc_evaluation.longest_sample import longest_samples
from hc_evaluation.rivals.packages import pykalman_runner, stone_soup_runner
from hc_evaluation.rivals.plain_particles import numpy_particles
from hc_evaluation.rivals.plain_ukf import (
    DISPLACEMENT_NOISE_MM,
    RATE_HZ,
    NotAvailableError,
    Runner,
    cpp_runner,
    filterpy_filter,
    numba_runner,
)

SAMPLES = 2000
BATCH_REPEATS = 20
ROUNDS = 5
PARTICLES = (50, 1000)
"""The default's number, and one with which numpy has its overhead behind it."""
KALMAN_FILTERS = ("ukf", "ekf", "rwstukf", "aukf", "raukf")
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


def run_speed(progress: Callable[[float], None] = lambda _share: None) -> dict[str, Any]:
    """Measure microseconds a sample: the others, `ukf` and `ekf` by run and step, all by run.

    Args:
        progress: told the done share.

    Returns:
        filterpy_us, stone_soup_us, pykalman_us, numba_us, cpp_us (None where it is not there;
        rivals says why), ukf_run_us, ekf_run_us, FILTER_step_us of every Kalman filter (medians
        over rounds), run_ratio and step_ratio (of `ukf` to filterpy), ukf_to_numba, ukf_to_cpp,
        ekf_to_cpp (by run; medians of the rounds' ratios), default_run_us, default_step_us,
        default_to_ukf and default_to_ukf_by_step (the same), sir_pf_step_us (50 particles), for 50
        and 1000 particles sir_pf_N_ns and numpy_particles_N_ns (nanoseconds a sample and particle,
        by run) and sir_pf_N_to_numpy (their ratio), filters_us (microseconds a sample of run()
        by filter and state space), and how long single samples take where tissue varies
        (`longest_sample`).

    Raises:
        ImportError: if filterpy is not installed.
    """
    data = contact_samples()
    reference = filterpy_filter()
    kalman = {name: create_estimator(name) for name in KALMAN_FILTERS}
    ukf, ekf, default = kalman["ukf"], kalman["ekf"], create_estimator(DEFAULT_FILTER)
    particles = {n: create_estimator("sir_pf", particle_count=n) for n in PARTICLES}
    for estimator in (*kalman.values(), default, *particles.values()):
        estimator.warm_up()
    with tempfile.TemporaryDirectory() as folder:
        compiled, interpreted, rivals = _runners(Path(folder))
        measures: dict[str, Callable[[], float]] = {
            "filterpy_us": lambda: _filterpy_us(reference, data[:, : SAMPLES // 4]),
            **{
                name: functools.partial(_plain_us, run, data[:, : SAMPLES // 4], repeats=1)
                for name, run in interpreted.items()
            },
            **{name: functools.partial(_plain_us, run, data) for name, run in compiled.items()},
            "ukf_run_us": lambda: _run_us(ukf, data),
            "ekf_run_us": lambda: _run_us(ekf, data),
            **{
                f"{name}_step_us": functools.partial(_step_us, estimator, data)
                for name, estimator in kalman.items()
            },
            "default_run_us": lambda: _run_us(default, data, repeats=BATCH_REPEATS // 5),
            "default_step_us": lambda: _step_us(default, data),
            "sir_pf_step_us": lambda: _step_us(particles[PARTICLES[0]], data),
            **_by_particle(particles, data),
        }
        rounds: dict[str, list[float]] = {name: [] for name in measures}
        for number in range(ROUNDS):
            for name, measure in measures.items():
                rounds[name].append(measure())
            progress(0.6 * (number + 1) / ROUNDS)

    def ratio(one: str, other: str) -> float | None:
        if other not in rounds:
            return None
        return statistics.median(a / b for a, b in zip(rounds[one], rounds[other], strict=True))

    filters = {}
    kinds = [(f, s) for f in available_filters() for s in available_state_spaces(f)]
    for number, (name, space) in enumerate(kinds):
        estimator = create_estimator(name, state_space=space)
        estimator.warm_up()
        filters[f"{name}/{space}"] = _run_us(estimator, data, repeats=1)
        progress(0.6 + 0.3 * (number + 1) / len(kinds))
    return {
        "samples": SAMPLES,
        **{f"{name}_us": None for name in rivals},
        "rivals": rivals,
        **{name: statistics.median(values) for name, values in rounds.items()},
        "run_ratio": ratio("ukf_run_us", "filterpy_us"),
        "step_ratio": ratio("ukf_step_us", "filterpy_us"),
        "ukf_to_numba": ratio("ukf_run_us", "numba_us"),
        "ukf_to_cpp": ratio("ukf_run_us", "cpp_us"),
        "ekf_to_cpp": ratio("ekf_run_us", "cpp_us"),
        "default_to_ukf": ratio("default_run_us", "ukf_run_us"),
        "default_to_ukf_by_step": ratio("default_step_us", "ukf_step_us"),
        **{
            f"sir_pf_{n}_to_numpy": ratio(f"sir_pf_{n}_ns", f"numpy_particles_{n}_ns")
            for n in PARTICLES
        },
        "filters_us": filters,
        **longest_samples(),
    }


def _runners(folder: Path) -> tuple[dict[str, Runner], dict[str, Runner], dict[str, str]]:
    """Return those that run over arrays compiled, those that do not, and what each rival says."""
    compiled: dict[str, Runner] = {"numba_us": numba_runner()}
    interpreted: dict[str, Runner] = {}
    rivals: dict[str, str] = {}
    makers: tuple[tuple[str, Callable[[], Runner], dict[str, Runner]], ...] = (
        ("cpp", functools.partial(cpp_runner, folder), compiled),
        ("stone_soup", stone_soup_runner, interpreted),
        ("pykalman", pykalman_runner, interpreted),
    )
    for name, make, runners in makers:
        try:
            runners[f"{name}_us"] = make()
            rivals[name] = "measured"
        except NotAvailableError as error:
            rivals[name] = str(error)
    return compiled, interpreted, rivals


def _by_particle(
    estimators: dict[int, Any], data: NDArray[np.float64]
) -> dict[str, Callable[[], float]]:
    """Return what measures nanoseconds a sample and particle, ours and in numpy, by number."""
    few = data[:, : SAMPLES // 10]

    def ours(count: int) -> float:
        return 1e3 * _run_us(estimators[count], few, repeats=1) / count

    def numpys(count: int) -> float:
        return 1e3 * _plain_us(numpy_particles(count), few, repeats=1) / count

    return {
        f"{name}_{count}_ns": functools.partial(measure, count)
        for count in estimators
        for name, measure in (("sir_pf", ours), ("numpy_particles", numpys))
    }


def _plain_us(run: Runner, data: NDArray[np.float64], repeats: int = BATCH_REPEATS) -> float:
    samples = np.ascontiguousarray(data[1:].T)
    run(samples[:1])  # compiled by now
    start = time.thread_time()
    for _ in range(repeats):
        run(samples)
    return 1e6 * (time.thread_time() - start) / (repeats * len(samples))


def _filterpy_us(reference: Any, data: NDArray[np.float64]) -> float:
    start = time.thread_time()
    for _, displacement, force in data.T:
        reference.predict()
        reference.update(np.array([displacement, force]))
    return 1e6 * (time.thread_time() - start) / int(data.shape[1])


def _run_us(estimator: Any, data: NDArray[np.float64], repeats: int = BATCH_REPEATS) -> float:
    spent = 0.0
    for _ in range(repeats):
        estimator.reset()
        start = time.thread_time()
        estimator.run(*data)
        spent += time.thread_time() - start
    return 1e6 * spent / (repeats * int(data.shape[1]))


def _step_us(estimator: Any, data: NDArray[np.float64]) -> float:
    estimator.reset()
    rows = data.T.tolist()
    start = time.thread_time()
    for time_s, displacement, force in rows:
        estimator.step(time_s, displacement, force)
    return 1e6 * (time.thread_time() - start) / int(data.shape[1])
