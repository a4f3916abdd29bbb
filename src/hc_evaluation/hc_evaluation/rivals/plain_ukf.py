"""A plain unscented filter three times: by filterpy, in numba over numpy, in C++ with Eigen.

All three have the state [d, v, a, ln K, ln B, n, p], the same process and measurement functions,
points (alpha = 1, beta = 2, kappa = 0, redrawn after the prediction) and noise, nothing adaptive,
and give the same numbers to rounding.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_msgs_py.compilation import KernelCompiler

Array = NDArray[np.float64]
compiled = KernelCompiler(lambda: (Path(__file__),))
Runner = Callable[[Array], Array]
"""Takes displacements and forces, shape (samples, 2); returns the states, (samples, 7)."""

RATE_HZ: Final = 1000.0
JERK_DENSITY: Final = 1e5  # mm^2/s^5
DISPLACEMENT_NOISE_MM: Final = 0.002
FORCE_STD_N: Final = 1.0
STATES: Final = 7
SOURCE: Final = Path(__file__).with_name("plain_ukf.cpp")
EIGEN_FOLDERS: Final = ("/usr/include/eigen3", "/usr/local/include/eigen3")


class NotAvailableError(Exception):
    """A rival cannot run here; the text says what is missing."""


def start() -> tuple[Array, Array, Array, Array]:
    """Return first state (7,), its covariance, process noise (7, 7) and sensor noise (2, 2)."""
    dt = 1.0 / RATE_HZ
    gain = np.array([dt**3 / 6.0, dt**2 / 2.0, dt])
    process = np.diag([0.0, 0.0, 0.0, 1e-8, 1e-8, 1e-8, 1e-8])
    process[:3, :3] = JERK_DENSITY * np.outer(gain, gain) / dt + np.diag([1e-12, 1e-9, 1e-6])
    return (
        np.array([3.4, 0.0, 0.0, 0.0, np.log(0.01), 1.5, 1.0]),
        np.diag([1e-4, 100.0, 1e4, 1.0, 1.0, 0.09, 0.01]),
        process,
        np.diag([DISPLACEMENT_NOISE_MM**2, FORCE_STD_N**2]),
    )


def filterpy_filter() -> Any:
    """Return filterpy's unscented filter.

    Raises:
        ImportError: if filterpy is not installed.
    """
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    def process(x: Array, dt: float) -> Array:
        moved = x.copy()
        moved[0] = x[0] + dt * x[1] + 0.5 * dt * dt * x[2]
        moved[1] = x[1] + dt * x[2]
        return moved

    def measure(x: Array) -> Array:
        displacement, velocity = max(x[0], 0.0), x[1]
        damping = np.exp(x[4]) * np.sign(velocity) * abs(velocity) ** x[6]
        return np.array([x[0], max(displacement ** x[5] * (np.exp(x[3]) + damping), 0.0)])

    points = MerweScaledSigmaPoints(STATES, alpha=1.0, beta=2.0, kappa=0.0)
    ukf = UnscentedKalmanFilter(STATES, 2, 1.0 / RATE_HZ, measure, process, points)
    ukf.x, ukf.P, ukf.Q, ukf.R = start()
    return ukf


def numba_runner() -> Runner:
    """Return the filter as one writes it in numba: the formulas in numpy, compiled."""
    first, covariance, process, noise = start()

    def run(samples: Array) -> Array:
        states = np.empty((len(samples), STATES))
        _run(first, covariance, process, noise, 1.0 / RATE_HZ, samples, states)
        return states

    return run


@compiled
def _draw(x: Any, P: Any, sigma: Any) -> None:
    n = len(x)
    L = np.linalg.cholesky(n * P)
    sigma[0] = x
    for i in range(n):
        sigma[1 + i] = x + L[:, i]
        sigma[1 + n + i] = x - L[:, i]


@compiled
def _run(x: Any, P: Any, Q: Any, R: Any, dt: Any, samples: Any, states: Any) -> None:
    n = len(x)
    x, P = x.copy(), P.copy()
    sigma, h = np.empty((2 * n + 1, n)), np.empty((2 * n + 1, 2))
    mean_weights = np.full(2 * n + 1, 0.5 / n)
    weights = mean_weights.copy()
    mean_weights[0], weights[0] = 0.0, 2.0
    for k in range(len(samples)):
        _draw(x, P, sigma)
        for i in range(2 * n + 1):
            sigma[i, 0] += dt * sigma[i, 1] + 0.5 * dt * dt * sigma[i, 2]
            sigma[i, 1] += dt * sigma[i, 2]
        x = mean_weights @ sigma
        dx = sigma - x
        P = dx.T @ (weights.reshape(-1, 1) * dx) + Q
        _draw(x, P, sigma)
        dx = sigma - x
        for i in range(2 * n + 1):
            d, v = max(sigma[i, 0], 0.0), sigma[i, 1]
            damping = np.exp(sigma[i, 4]) * np.sign(v) * abs(v) ** sigma[i, 6]
            h[i, 0] = sigma[i, 0]
            h[i, 1] = max(d ** sigma[i, 5] * (np.exp(sigma[i, 3]) + damping), 0.0)
        mean = mean_weights @ h
        dz = h - mean
        S = dz.T @ (weights.reshape(-1, 1) * dz) + R
        K = dx.T @ (weights.reshape(-1, 1) * dz) @ np.linalg.inv(S)
        x = x + K @ (samples[k] - mean)
        P = P - K @ S @ K.T
        states[k] = x


def cpp_runner(folder: Path) -> Runner:
    """Compile the C++ filter and return it.

    Args:
        folder: takes the library.

    Raises:
        NotAvailableError: if there is no compiler or no Eigen, or it does not compile.
    """
    compiler = shutil.which(os.environ.get("CXX") or "c++")
    if compiler is None:
        raise NotAvailableError("no C++ compiler (Debian: apt-get install g++)")
    eigen = [name for name in EIGEN_FOLDERS if Path(name, "Eigen", "Dense").is_file()]
    if not eigen:
        raise NotAvailableError("no Eigen (Debian: apt-get install libeigen3-dev)")
    library = folder / "plain_ukf.so"
    words = [compiler, "-O3", "-march=native", "-DNDEBUG", "-shared", "-fPIC", f"-I{eigen[0]}"]
    done = subprocess.run(
        [*words, str(SOURCE), "-o", str(library)], capture_output=True, text=True, timeout=300
    )
    if done.returncode:
        lines = done.stderr.splitlines()
        raise NotAvailableError(f"it does not compile: {lines[0] if lines else 'no reason given'}")
    function = ctypes.CDLL(str(library)).plain_ukf_run
    pointer = ctypes.POINTER(ctypes.c_double)
    function.argtypes = [pointer, pointer, ctypes.c_long, pointer]
    function.restype = None
    begin = np.concatenate([*(part.ravel() for part in start()), [1.0 / RATE_HZ]])

    def run(samples: Array) -> Array:
        samples = np.ascontiguousarray(samples, np.float64)
        states = np.empty((len(samples), STATES))
        function(
            *(a.ctypes.data_as(pointer) for a in (begin, samples)),
            len(samples),
            states.ctypes.data_as(pointer),
        )
        return states

    return run
