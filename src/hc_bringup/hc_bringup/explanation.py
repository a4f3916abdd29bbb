"""Why the contact law does not fit: the likeliest of the things that look like other parameters.

Quick enough for a live display (some 30 ms for a thousand samples), so coarser than
hc_evaluation.channels, which fits everything at once and takes seconds. Each candidate is put
right in turn, over a grid, and the law F = d^n (K + B v) fitted by linear least squares; whoever
leaves much less of the force unexplained has the word.
"""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

Array = NDArray[np.float64]

SPAN_S: Final = 6.0
LEAST_SAMPLES: Final = 150
MOST_SAMPLES: Final = 1200
DELAYS_S: Final = np.arange(-0.06, 0.0601, 0.004)
EXPONENTS: Final = np.arange(0.8, 2.61, 0.2)
CONTACTS: Final = np.linspace(-0.3, 0.3, 13)
"""Of the contact position, as shares of the deepest penetration."""
CLEARLY_LESS: Final = 0.75
"""What is left with a candidate put right, over what is left without: below this it is told."""
RELAXED_SHARE: Final = 0.04
"""Of the force that is gone after a hold: above this the tissue relaxes."""
HOLD_S: Final = 0.4


class RecentMotion:
    """The last seconds of a stream, thinned, for `explain`."""

    def __init__(self, span_s: float = SPAN_S) -> None:
        self._span_s, self._step_s = span_s, span_s / MOST_SAMPLES
        self._rows: deque[tuple[float, float, float]] = deque()

    def clear(self) -> None:
        """Forget everything."""
        self._rows.clear()

    def add(self, time_s: float, depth_mm: float, force_n: float) -> None:
        """Take in one sample, in the order of time; too early ones are left out."""
        if self._rows and not time_s >= self._rows[-1][0] + self._step_s:
            if time_s < self._rows[-1][0] - self._span_s:
                self._rows.clear()
            return
        if np.isfinite(depth_mm) and np.isfinite(force_n):
            self._rows.append((time_s, depth_mm, force_n))
        while self._rows and self._rows[-1][0] - self._rows[0][0] > self._span_s:
            self._rows.popleft()

    def explain(self) -> str:
        """Return why the law does not fit, in words; empty if nothing stands out."""
        if len(self._rows) < LEAST_SAMPLES:
            return ""
        return explain(*np.array(self._rows).T)


def explain(time_s: Array, depth_mm: Array, force_n: Array) -> str:
    """Say in a few words why the contact law does not fit a stretch of recording.

    Args:
        time_s: instants, increasing, shape (N,).
        depth_mm: penetration, shape (N,).
        force_n: force, shape (N,).

    Returns:
        A clause such as "the force comes 30 ms before the displacement"; empty if nothing stands
        out.
    """
    if len(time_s) < LEAST_SAMPLES or not np.ptp(time_s) > 0.0 or np.ptp(depth_mm) <= 0.0:
        return ""
    even = np.linspace(time_s[0], time_s[-1], min(len(time_s), MOST_SAMPLES))
    depth = np.interp(even, time_s, depth_mm)
    force = np.interp(even, time_s, force_n)
    relaxed = _relaxation(even, depth, force)
    if relaxed > RELAXED_SHARE:
        return f"the force fades by {100 * relaxed:.0f} % while the tool holds still: it relaxes"
    plain = _left(even, depth, force, 0.0, 0.0)
    if not plain > 0.0:
        return ""
    deepest = float(depth.max())
    found = [
        min(((_left(even, depth, force, delay, 0.0), delay, "delay") for delay in DELAYS_S)),
        min(
            (_left(even, depth, force, 0.0, share * deepest), share * deepest, "contact")
            for share in CONTACTS
        ),
        (_left(even, depth, force, 0.0, 0.0, with_zero=True), _zero(even, depth, force), "zero"),
    ]
    left, value, what = min(found)
    if left > CLEARLY_LESS * plain or (what == "zero" and abs(value) < left):
        if _sticks_out(depth, force):
            return "the tissue lets go of the tool while it withdraws"
        return ""
    if what == "delay":
        order = "after" if value > 0.0 else "before"
        return f"the force comes {1e3 * abs(value):.0f} ms {order} the displacement"
    if what == "contact":
        return f"contact begins at {value:.2g} mm, not at 0: find the surface"
    return f"the force reads {1e3 * value:.0f} mN without contact: tare"


def _left(
    time_s: Array,
    depth_mm: Array,
    force_n: Array,
    delay_s: float,
    contact_mm: float,
    *,
    with_zero: bool = False,
) -> float:
    """Return the RMS of the force that the law leaves, with something put right."""
    return _fit(time_s, depth_mm, force_n, delay_s, contact_mm, with_zero)[0]


def _zero(time_s: Array, depth_mm: Array, force_n: Array) -> float:
    return _fit(time_s, depth_mm, force_n, 0.0, 0.0, True)[1]


def _fit(
    time_s: Array, depth_mm: Array, force_n: Array, delay_s: float, contact_mm: float, zero: bool
) -> tuple[float, float]:
    """Return what is left of the force, and the zero that was fitted; the best exponent of a grid."""
    depth = np.interp(time_s - delay_s, time_s, depth_mm) - contact_mm
    step = float(time_s[1] - time_s[0])
    window = max(5, min(len(depth) // 4, round(0.03 / step)) | 1)
    velocity = savgol_filter(depth, window, 2, deriv=1, delta=step)
    touching = depth > 0.02 * max(float(depth.max()), 1e-9)
    # Samples of the first instants have no displacement of their own once it is shifted.
    touching &= (time_s >= time_s[0] + abs(delay_s)) & (time_s <= time_s[-1] - abs(delay_s))
    if np.count_nonzero(touching) < LEAST_SAMPLES // 2:
        return np.inf, 0.0
    deep, speed, force = depth[touching], velocity[touching], force_n[touching]
    best = (np.inf, 0.0)
    for exponent in EXPONENTS:
        power = deep**exponent
        columns = [power, power * speed] + ([np.ones_like(power)] if zero else [])
        matrix = np.column_stack(columns)
        solution = np.linalg.lstsq(matrix, force, rcond=None)[0]
        left = float(np.sqrt(np.mean((matrix @ solution - force) ** 2)))
        if left < best[0]:
            best = (left, float(solution[-1]) if zero else 0.0)
    return best


def _relaxation(time_s: Array, depth_mm: Array, force_n: Array) -> float:
    """Return the largest share of the force that fades while the tool holds still in the tissue."""
    moving = np.abs(np.gradient(depth_mm, time_s))
    still = (moving < 0.02 * max(float(moving.max()), 1e-9)) & (depth_mm > 0.3 * depth_mm.max())
    edges = np.flatnonzero(np.diff(still.astype(int), prepend=0, append=0))
    largest = 0.0
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if time_s[end - 1] - time_s[begin] < HOLD_S:
            continue
        part = max(1, (end - begin) // 8)
        first, last = force_n[begin : begin + part].mean(), force_n[end - part : end].mean()
        drift = abs(depth_mm[end - 1] - depth_mm[begin]) / depth_mm[begin]
        if first > 0.0:
            largest = max(largest, float((first - last) / first) - 2.0 * float(drift))
    return largest


def _sticks_out(depth_mm: Array, force_n: Array) -> bool:
    """Whether there is much displacement without force: the tool has left, by its reading inside."""
    deep = depth_mm > 0.3 * depth_mm.max()
    weak = np.abs(force_n) < 0.02 * float(np.max(np.abs(force_n)))
    return bool(np.count_nonzero(deep & weak) > 0.1 * np.count_nonzero(deep))
