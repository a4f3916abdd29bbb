"""The filters' kernels over many channels, for `EstimatorArray`: one call, all channels.

One kernel for each filter's: numba's cache on the disk knows no kernel that gets another one as an
argument. Each takes a settings record for all channels, shape (1,), memory records (channels,),
particles (channels, rows, columns) and samples (channels, samples, 3), and fills rows (channels,
samples, COLUMNS).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hc_estimator.compilation import compiled_without_lock
from hc_estimator.filters import adaptive_ukf, ekf, rbpf, rls, rwstukf, self_tuning_ukf, sir_pf, ukf


@compiled_without_lock
def _self_tuning_ukf(settings: Any, memories: Any, particles: Any, samples: Any, rows: Any) -> None:
    for i in range(memories.shape[0]):
        self_tuning_ukf.run(settings, memories[i : i + 1], particles[i], samples[i], rows[i])


@compiled_without_lock
def _ukf(settings: Any, memories: Any, particles: Any, samples: Any, rows: Any) -> None:
    for i in range(memories.shape[0]):
        ukf.run(settings, memories[i : i + 1], particles[i], samples[i], rows[i])


@compiled_without_lock
def _ekf(settings: Any, memories: Any, particles: Any, samples: Any, rows: Any) -> None:
    for i in range(memories.shape[0]):
        ekf.run(settings, memories[i : i + 1], particles[i], samples[i], rows[i])


@compiled_without_lock
def _rwstukf(settings: Any, memories: Any, particles: Any, samples: Any, rows: Any) -> None:
    for i in range(memories.shape[0]):
        rwstukf.run(settings, memories[i : i + 1], particles[i], samples[i], rows[i])


@compiled_without_lock
def _adaptive_ukf(settings: Any, memories: Any, particles: Any, samples: Any, rows: Any) -> None:
    for i in range(memories.shape[0]):
        adaptive_ukf.run(settings, memories[i : i + 1], particles[i], samples[i], rows[i])


@compiled_without_lock
def _rls(settings: Any, memories: Any, particles: Any, samples: Any, rows: Any) -> None:
    for i in range(memories.shape[0]):
        rls.run(settings, memories[i : i + 1], particles[i], samples[i], rows[i])


@compiled_without_lock
def _sir_pf(settings: Any, memories: Any, particles: Any, samples: Any, rows: Any) -> None:
    for i in range(memories.shape[0]):
        sir_pf.run(settings, memories[i : i + 1], particles[i], samples[i], rows[i])


@compiled_without_lock
def _rbpf(settings: Any, memories: Any, particles: Any, samples: Any, rows: Any) -> None:
    for i in range(memories.shape[0]):
        rbpf.run(settings, memories[i : i + 1], particles[i], samples[i], rows[i])


KERNELS: dict[str, Callable[..., None]] = {
    "self_tuning_ukf": _self_tuning_ukf,
    "ukf": _ukf,
    "ekf": _ekf,
    "rwstukf": _rwstukf,
    "aukf": _adaptive_ukf,
    "raukf": _adaptive_ukf,
    "rls": _rls,
    "sir_pf": _sir_pf,
    "rbpf": _rbpf,
}
