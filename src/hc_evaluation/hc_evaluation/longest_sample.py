"""How long one sample of the default filter takes where tissue varies, and the longest of them.

A mean says nothing of a live node: what it asks of hundreds of points now and then has to be over
before the next reading is there. Each sample is timed in several passes over the same contact, and
counts with the least of them: what else runs on the machine is not what is asked. As shares of the
time between two readings.
"""

from __future__ import annotations

import gc
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator import DEFAULT_FILTER, create_estimator
from hc_evaluation.accuracy.scan import KINDS as SCANS
from hc_evaluation.accuracy.scan import random_scan
from hc_evaluation.accuracy.scenarios import simulate

PASSES = 3
SEED = 3
FORCE_ZERO_N = 0.3
"""So that zeros are asked as well as lumps and delays."""


def sample_times(passes: int = PASSES, samples: int | None = None) -> NDArray[np.float64]:
    """Least time of each sample of a scan over lumps.

    Args:
        passes: over the contact.
        samples: of it that are timed; None for all.

    Returns:
        Shares of the time between two readings, shape (samples,).
    """
    scenario = random_scan(SCANS[0], SEED)
    contact = simulate(scenario, SEED)
    readings = (contact.time_s, contact.displacement_mm, contact.force_n + FORCE_ZERO_N)
    rows = np.stack(readings, axis=1)[:samples].tolist()
    least = np.full(len(rows), np.inf)
    estimator = create_estimator(DEFAULT_FILTER)
    estimator.warm_up()
    collects = gc.isenabled()
    gc.disable()
    try:
        for _ in range(passes):
            estimator.reset()
            for number, row in enumerate(rows):
                start = time.perf_counter()
                estimator.step(*row)
                least[number] = min(least[number], time.perf_counter() - start)
    finally:
        if collects:
            gc.enable()
    return least * scenario.rate_hz


def longest_samples() -> dict[str, Any]:
    """Percentiles of `sample_times` as the command line shows them.

    Returns:
        varying_p50, _p99, _p99_9 and _longest in percent of the time between two readings.
    """
    share = 100.0 * sample_times()
    return {
        "varying_p50_percent": float(np.percentile(share, 50.0)),
        "varying_p99_percent": float(np.percentile(share, 99.0)),
        "varying_p99_9_percent": float(np.percentile(share, 99.9)),
        "varying_longest_percent": float(share.max()),
    }
