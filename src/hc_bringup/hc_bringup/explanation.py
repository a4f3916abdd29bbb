"""Why the contact law does not fit: the likeliest of the things that look like other parameters.

Quick enough for a live display (some tenths of a second), so coarser than
hc_evaluation.channels, which fits everything at once and takes seconds. Each candidate is put
right in turn, over a grid, and the law F = d^n (K + B v) fitted by linear least squares; whoever
leaves much less of the force unexplained has the word.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SPAN_S: Final = 6.0
EXPLAIN_PERIOD_S: Final = 5.0
LEAST_SAMPLES: Final = 150
MOST_SAMPLES: Final = 700
DELAYS_S: Final = np.arange(-0.06, 0.0601, 0.004)
EXPONENTS: Final = np.arange(0.7, 2.71, 0.05)
CONTACTS: Final = np.linspace(-0.3, 0.6, 37)
"""Of the contact position, as shares of the deepest penetration."""
CLEARLY_LESS: Final = 0.75
"""What is left with a candidate put right, over what is left without: below this it is told."""
LEAST_MISFIT: Final = 1.3
"""What the law leaves over the noise: below this there is nothing to explain."""
VARIES: Final = 0.4
"""What is left with parameters of their own for every second: below this the tissue varies."""
LARGEST_ZERO: Final = 0.2
"""Of the largest force: a zero beyond it is another fault in disguise."""
WINDOW_S: Final = 1.0
SEPARATED: Final = 0.02
"""Share of the largest force: less of it deep in the tissue, and the tool has lost contact."""
RELAXED_SHARE: Final = 0.04
"""Of the force that is gone after a hold: above this the tissue relaxes."""
HOLD_S: Final = 0.4


class RecentMotion:
    """The last seconds of a stream, thinned, for `explain`.

    Attributes:
        revision: of the configuration with which they were read.
    """

    def __init__(self, span_s: float = SPAN_S) -> None:
        self._span_s, self._step_s = span_s, span_s / MOST_SAMPLES
        self._rows: deque[tuple[float, float, float]] = deque()
        self.revision = 0

    def copy(self) -> RecentMotion:
        """Return what is remembered now, for another thread to explain."""
        same = RecentMotion(self._span_s)
        same._rows, same.revision = deque(self._rows), self.revision
        return same

    def add(self, time_s: float, depth_mm: float, force_n: float, revision: int = 0) -> None:
        """Take in one sample, in the order of time; too early ones are left out.

        What was read with other zeros, or by another filter, says nothing of those of now.
        """
        if revision != self.revision:
            self.revision = revision
            self._rows.clear()
        if self._rows and time_s < self._rows[-1][0] - self._span_s:
            self._rows.clear()  # the source has started again
        if self._rows and not time_s >= self._rows[-1][0] + self._step_s:
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


class BackgroundExplainer:
    """Looks into why the law does not fit, in a thread: what shows it must not wait."""

    def __init__(self) -> None:
        self._said = ""
        self._revision = 0
        self._next = 0.0
        self._thread: threading.Thread | None = None

    def explain(self, motion: RecentMotion, mismatch: bool) -> str:
        """Return what was found last; empty while the law fits."""
        if motion.revision != self._revision:
            self._revision, self._said = motion.revision, ""
            self._next = time.monotonic()
        if not mismatch:
            self._said = ""
            return ""
        busy = self._thread is not None and self._thread.is_alive()
        if not busy and time.monotonic() >= self._next:
            self._next = time.monotonic() + EXPLAIN_PERIOD_S
            self._thread = threading.Thread(target=self._look, args=(motion.copy(),), daemon=True)
            self._thread.start()
        return self._said

    def _look(self, motion: RecentMotion) -> None:
        said = motion.explain()
        if motion.revision == self._revision:
            self._said = said


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
    noise = float(np.sqrt(np.mean(np.diff(force_n, 5) ** 2) / 252.0))
    if not plain > LEAST_MISFIT * noise:
        return ""  # nothing but noise is left
    deepest = float(depth.max())
    found = [
        min((_left(even, depth, force, delay, 0.0), delay, "delay") for delay in DELAYS_S),
        min(
            (_left(even, depth, force, 0.0, share * deepest), share * deepest, "contact")
            for share in CONTACTS
        ),
    ]
    zero = _zero(even, depth, force)
    if abs(zero) < LARGEST_ZERO * float(np.max(np.abs(force))):
        found.append((_left(even, depth, force, 0.0, 0.0, with_zero=True), zero, "zero"))
    left, value, what = min(found)
    clear = left < CLEARLY_LESS * plain and not (what == "zero" and abs(value) < left)
    if _left_by_windows(even, depth, force) < VARIES * min(plain, left):
        return "the tissue is not the same along the way"
    if not clear:
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
    """Return what is left of the force, and the zero that was fitted; the best exponent of many."""
    from scipy.signal import savgol_filter  # takes two seconds to import, and few runs need it

    depth = np.interp(time_s - delay_s, time_s, depth_mm) - contact_mm
    step = float(time_s[1] - time_s[0])
    window = max(5, min(len(depth) // 4, round(0.03 / step)) | 1)
    velocity = savgol_filter(depth, window, 2, deriv=1, delta=step)
    touching = depth > 0.02 * max(float(depth.max()), 1e-9)
    # Tissue cannot pull: where it has let go of a tool that withdraws, the force says nothing.
    weak = np.abs(force_n) < SEPARATED * float(np.max(np.abs(force_n)))
    touching &= ~(weak & (velocity < 0.0))
    # Samples of the first instants have no displacement of their own once it is shifted.
    touching &= (time_s >= time_s[0] + abs(delay_s)) & (time_s <= time_s[-1] - abs(delay_s))
    count = int(np.count_nonzero(touching))
    if count < min(LEAST_SAMPLES // 2, len(depth) // 3):  # the second: of a window among many
        return np.inf, 0.0
    deep, speed, force = depth[touching], velocity[touching], force_n[touching]
    elastic = np.exp(EXPONENTS[:, None] * np.log(deep))  # (exponents, samples)
    mean = float(force.mean()) if zero else 0.0
    centred = force - mean
    columns = np.stack([elastic, elastic * speed])  # (2, exponents, samples)
    middle = columns.mean(axis=2, keepdims=True) if zero else np.zeros((2, len(EXPONENTS), 1))
    columns = columns - middle
    kk, bb, kb = (
        np.einsum("es,es->e", columns[a], columns[b]) for a, b in ((0, 0), (1, 1), (0, 1))
    )
    kf, bf = columns @ centred
    determinant = np.maximum(kk * bb - kb**2, 1e-300)
    damping = np.maximum(0.0, (kk * bf - kb * kf) / determinant)  # tissue takes energy, never gives
    stiffness = (kf - kb * damping) / kk
    squares = (
        centred @ centred
        - 2.0 * (stiffness * kf + damping * bf)
        + stiffness**2 * kk
        + damping**2 * bb
        + 2.0 * stiffness * damping * kb
    )
    best = int(np.argmin(squares))
    fitted = mean - float(stiffness[best] * middle[0, best, 0] + damping[best] * middle[1, best, 0])
    return float(np.sqrt(max(squares[best], 0.0) / count)), fitted if zero else 0.0


def _left_by_windows(time_s: Array, depth_mm: Array, force_n: Array) -> float:
    """Return the RMS of the force that is left with parameters of their own for every second."""
    count = int((time_s[-1] - time_s[0]) / WINDOW_S)
    if count < 3:
        return np.inf
    squares = [
        _left(time_s[rows], depth_mm[rows], force_n[rows], 0.0, 0.0) ** 2
        for rows in np.array_split(np.arange(len(time_s)), count)
    ]
    finite = [one for one in squares if np.isfinite(one)]
    return float(np.sqrt(np.mean(finite))) if len(finite) > count // 2 else np.inf


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
