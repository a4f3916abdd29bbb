"""Runs with known content: simulated presses, and the paths of a tip."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_bringup.run_data import RunData, records_of_series
from hc_bringup.tip_path import TipPath
from hc_estimator import create_estimator


def pressed(
    *,
    stiffness: Any = 0.3,
    damping: float = 0.02,
    seconds: float = 6.0,
    rate_hz: float = 500.0,
    period_s: float = 1.0,
    lifted_mm: float = 0.5,
    noise_n: float = 0.002,
    seed: int = 1,
    filter_name: str = "ukf",
    tip: TipPath | None = None,
    **fields: Any,
) -> RunData:
    """Presses of 2 mm with a pause in the air after each, through an estimator."""
    time_s = np.arange(0.0, seconds, 1.0 / rate_hz)
    random = np.random.default_rng(seed)
    phase = 2.0 * np.pi * time_s / period_s
    depth = (1.0 + 0.5 * lifted_mm) * (1.0 - np.cos(phase)) - lifted_mm
    speed = (1.0 + 0.5 * lifted_mm) * 2.0 * np.pi / period_s * np.sin(phase)
    deep = np.maximum(depth, 0.0)
    k = stiffness(time_s) if callable(stiffness) else np.full_like(time_s, stiffness)
    force = np.maximum(0.0, deep**1.5 * (k + damping * speed))
    measured = force + noise_n * random.standard_normal(len(force))
    reading = depth + 1e-3 * random.standard_normal(len(depth))
    estimator = create_estimator(filter_name)
    series = estimator.run(time_s, reading, measured)
    truth = np.column_stack(
        [k, np.full_like(k, damping), np.full_like(k, 1.5), np.full_like(k, 1.0)]
    )
    values: dict[str, Any] = {
        "name": "presses",
        "estimator": f"{filter_name} on kinematic",
        "time_s": time_s,
        "displacement_mm": reading,
        "force_n": measured,
        "estimates": records_of_series(series, measured, np.arange(len(time_s), dtype=np.uint64)),
        "truth": truth,
        "tip": tip,
        "settings": {"initial_stiffness": 1.0},
        "versions": {"this software": "test"},
    }
    return RunData(**(values | fields))


@pytest.fixture
def make_run() -> Callable[..., RunData]:
    """Function (**options) -> a run of presses."""
    return pressed


@pytest.fixture
def write_csv(tmp_path: Path) -> Callable[..., Path]:
    """Writes a run's samples as a recording; returns its path."""

    def write(data: RunData, name: str = "presses.csv") -> Path:
        path = tmp_path / name
        rows = np.column_stack([data.time_s, data.displacement_mm, data.force_n])
        header = "time_s,displacement_mm,force_N"
        np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.9g")
        return path

    return write
