"""Are the stamps of a recording those of arrival, of readings that were taken at an even rate?

A moving value lies where its stamp says between those beside it, if that is the time at which it
was read. Where it lies closer to the line over even times (`arrival_clock`), those were.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.arrival_clock import FEWEST, measured_stamps
from hc_estimator.stream.readings import FloatArray

UNEVEN, FEW = 0.1, 0.002
"""Of the usual step, by which one is uneven; and the share of such from which one looks."""
SMOOTHER, NOT_ROUGHER = 1.5, 1.0
"""Times by which the motion has to be smoother over even times: stamps that say when a reading was
measured make it smoother than any other times. Of readings that come in bursts it need not be
rougher: no sensor measures so."""
INSTANT, TOGETHER = 0.1, 0.2
"""Of a usual pause, for which readings of a burst are apart at most; share of such steps from which
on they come in bursts."""
MOST_USUAL = 0.99
"""Share of the readings that count: others are outliers, or of a sensor that was away."""
STRAIGHT_NS = 20e6
"""For so long the way of a tool is straight enough."""
LATE = 0.9
"""Share of the stamps that are off which are off by no more than is said."""


class EvenTimes(NamedTuple):
    """When readings were taken that are stamped on arrival.

    Attributes:
        stamps_ns: when they were measured [ns], shape (n,).
        rate_hz: how many in a second.
        late_s: by how much those are off whose stamps are, up to `LATE` of them [s].
    """

    stamps_ns: NDArray[np.int64]
    rate_hz: float
    late_s: float


def find_even_times(stamps_ns: NDArray[np.int64], *channels: FloatArray) -> EvenTimes | None:
    """Return when readings were taken if that is not what their stamps say.

    Args:
        stamps_ns: stamps [ns], shape (n,), in the order in which the readings came.
        channels: what was read at these stamps, shape (n,) each, all finite.

    Returns:
        None where the stamps are even, or as likely to be true as even times.
    """
    if len(stamps_ns) < 2 * FEWEST:
        return None
    steps = np.diff(stamps_ns)
    even = float(np.mean(steps)) if np.median(steps) <= 0 else float(np.median(steps))
    if not even > 0.0 or np.mean(np.abs(steps - even) > UNEVEN * even) < FEW:
        return None
    measured_ns = measured_stamps(stamps_ns)
    late = (stamps_ns - measured_ns).astype(np.float64)
    late -= np.median(late)
    period = float(np.median(np.diff(measured_ns)))
    off = np.abs(late) > UNEVEN * period
    if not period > 0.0 or np.mean(off) < FEW:
        return None
    usual_late = float(np.quantile(np.abs(late[off]), LATE))
    apart = max(1, round(min(usual_late, STRAIGHT_NS) / period))
    there = off[: -2 * apart] | off[apart:-apart] | off[2 * apart :]
    if np.count_nonzero(there) < FEWEST:
        return None
    gains = [
        _roughness(stamps_ns, values, apart, there)
        / max(_roughness(measured_ns, values, apart, there), _NOTHING)
        for values in channels
    ]
    least = NOT_ROUGHER if share_in_bursts(steps) > TOGETHER else SMOOTHER
    if not (max(gains) > least and min(gains) > 1.0 / SMOOTHER):
        return None
    return EvenTimes(measured_ns, 1e9 / period, usual_late * 1e-9)


_NOTHING = 1e-300


def share_in_bursts(steps: FloatArray | NDArray[np.int64]) -> float:
    """Return the share of readings at the time of the one before, beside the usual pause.

    Args:
        steps: from each stamp to the next, shape (n,).
    """
    return float(np.mean(steps < INSTANT * float(np.quantile(steps, 0.95))))


def _roughness(
    stamps_ns: NDArray[np.int64], values: FloatArray, apart: int, there: NDArray[np.bool_]
) -> float:
    """Return how far values lie from the lines between those so many readings apart (RMS)."""
    before, here, after = values[: -2 * apart], values[apart:-apart], values[2 * apart :]
    whole = (stamps_ns[2 * apart :] - stamps_ns[: -2 * apart]).astype(np.float64)
    part = (stamps_ns[apart:-apart] - stamps_ns[: -2 * apart]).astype(np.float64)
    share = np.clip(part / np.maximum(whole, 1.0), 0.0, 1.0)
    off = (here - before - share * (after - before))[there] ** 2
    return float(np.sqrt(np.mean(off[off <= np.quantile(off, MOST_USUAL)])))
