"""How many channels at 1 kHz one core allows: `EstimatorArray.step`, filter by filter.

Processor time of the calling thread is counted, not time on the clock, so that what else runs on
the machine enters only by what it leaves of caches and memory.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator import EstimatorArray
from hc_evaluation.speed import contact_samples

CHANNELS = 256
SAMPLES = 1000
ROUNDS = 3
RATE_HZ = 1000.0
FILTERS = ("ekf", "ukf", "rls", "rwstukf", "aukf", "raukf", "self_tuning_ukf")


def channel_samples(channels: int, samples: int) -> tuple[NDArray[np.float64], ...]:
    """Return times (samples,), displacements and forces (channels, samples), out of step."""
    data = contact_samples(samples + channels)
    index = np.arange(channels)[:, None] + np.arange(samples)
    return data[0, :samples], data[1][index], data[2][index]


def run_array_speed(
    channels: int = CHANNELS,
    samples: int = SAMPLES,
    progress: Callable[[float], None] = lambda _share: None,
) -> dict[str, Any]:
    """Measure a step of all channels, the filters taken in turns.

    Args:
        channels: of the array.
        samples: of each round.
        progress: told the done share.

    Returns:
        channels, samples, and by filter: step_ms (processor time of a step of all channels, median
        of the rounds), channel_us (that of one channel) and channels_at_1_khz (that one core has
        time for).
    """
    times, depths, forces = channel_samples(channels, samples)
    columns = [(t, depths[:, k].copy(), forces[:, k].copy()) for k, t in enumerate(times.tolist())]
    spent: dict[str, list[float]] = {name: [] for name in FILTERS}
    arrays = {name: EstimatorArray(name, channels) for name in FILTERS}
    for array in arrays.values():
        array.warm_up()
    for number in range(ROUNDS):
        for place, (name, array) in enumerate(arrays.items()):
            array.reset()
            start = time.thread_time()
            for t, d, f in columns:
                array.step(t, d, f)
            spent[name].append((time.thread_time() - start) / samples)
            progress((number + (place + 1) / len(arrays)) / ROUNDS)
    filters = {}
    for name, seconds in spent.items():
        step = statistics.median(seconds)
        filters[name] = {
            "step_ms": 1e3 * step,
            "channel_us": 1e6 * step / channels,
            "channels_at_1_khz": int(channels / (step * RATE_HZ)),
        }
    return {"channels": channels, "samples": samples, "filters": filters}
