"""Two channels of which one clock goes faster than the other: a delay that grows with time.

No one delay serves such a recording, and no law fits it. What law holds need not be known to see
it: the force is some function of the depth, and some other times the velocity,

    F(t) = g(d(t')) + v(t') h(d(t')),    t' = t - delay - rate (t - middle),

with g and h linear between knots, so that for a delay and a rate they follow from linear least
squares (variable projection, Golub and Pereyra 1973), and two numbers are looked for. That begins
in a short piece of the recording, in which a rate moves little, and goes on in ever longer ones:
in a periodic motion a shift by a period would fit as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from hc_evaluation.hold_forward import smooth_motion

FloatArray = NDArray[np.float64]

LARGEST_RATE: Final = 0.01
"""Of clocks that are meant to go alike; beyond it the rate of one was taken for another."""
LARGEST_DELAY_S: Final = 0.2
LEAST_GROWTH_S: Final = 0.004
"""Of the delay, from the beginning to the end: less changes B by less than anybody tells."""
SHORTEST_S: Final = 6.0
"""The piece that the search begins in."""
EXPLAINED: Final = 0.1
"""Of the squared residual with the best one delay: what a rate has to take away."""
EVENLY: Final = 0.25
"""Of the rate: so far that of either half may lie off."""
STEP_S: Final = 0.005
"""Between the instants that are compared."""
MOST_INSTANTS: Final = 4000
_KNOTS: Final = (0.0, 0.15, 0.35, 0.6, 0.8)
"""Of the depth, as shares of its range."""
_TOUCHED: Final = 0.2
"""Of the whole range of the force: so much of it the first piece has to show."""


@dataclass(frozen=True)
class ClockRates:
    """By how much the stamps of the force fall behind those of the displacement.

    Attributes:
        rate: seconds in a second; negative where those of the displacement fall behind.
        first_s: by how much the force is late at the beginning [s].
        last_s: by how much at the end [s].
    """

    rate: float
    first_s: float
    last_s: float

    def by_the_other(self, displacement_s: FloatArray) -> FloatArray:
        """Return stamps of displacements as the clock of the forces goes, from the same start on.

        Args:
            displacement_s: stamps [s], shape (n,).
        """
        first_s = float(np.min(displacement_s[np.isfinite(displacement_s)]))
        return displacement_s + self.rate / (1.0 - self.rate) * (displacement_s - first_s)


def find_clock_rates(
    time_s: FloatArray, displacement_mm: FloatArray, force_n: FloatArray
) -> ClockRates | None:
    """Look for a delay that grows evenly.

    Args:
        time_s: evenly spaced stamps [s], shape (n,).
        displacement_mm: penetration [mm], shape (n,).
        force_n: contact force [N], shape (n,).

    Returns:
        The rate; None where no rate takes away what one delay leaves.
    """
    span_s = float(time_s[-1] - time_s[0])
    if span_s < 2.0 * SHORTEST_S or not (np.ptp(force_n) > 0.0 and np.ptp(displacement_mm) > 0.0):
        return None
    channels = _Channels(time_s, displacement_mm, force_n)
    begin_s, end_s = channels.first_piece()
    delay_s, rate = channels.search(begin_s, end_s)
    while True:
        delay_s, rate = channels.refined(delay_s, rate, begin_s, end_s)
        if begin_s <= time_s[0] and end_s >= time_s[-1]:
            break
        longer_s = end_s - begin_s
        wider = max(begin_s - 0.5 * longer_s, time_s[0]), min(end_s + 0.5 * longer_s, time_s[-1])
        delay_s += rate * (0.5 * (wider[0] + wider[1]) - 0.5 * (begin_s + end_s))
        begin_s, end_s = wider
    growth_s = abs(rate) * span_s
    if growth_s < LEAST_GROWTH_S or abs(rate) > LARGEST_RATE:
        return None
    whole = channels.between(begin_s, end_s)
    left = whole.misfit(delay_s, rate)
    if not left < (1.0 - EXPLAINED) * whole.left_by_one_delay():
        return None
    if not left < whole.left_by_one_delay(damping_grows=True):
        return None  # tissue whose damping changes looks so, too
    if not channels.grows_evenly(delay_s, rate):
        return None
    return ClockRates(rate, delay_s - 0.5 * rate * span_s, delay_s + 0.5 * rate * span_s)


class _Channels:
    """Both channels, to be compared in pieces."""

    def __init__(
        self, time_s: FloatArray, displacement_mm: FloatArray, force_n: FloatArray
    ) -> None:
        step_s = float(np.median(np.diff(time_s)))
        self._time_s = time_s
        self._depth, self._rate = smooth_motion(displacement_mm, 1.0 / step_s)
        low, high = np.quantile(displacement_mm, (0.001, 0.999))
        self._knots = low + (high - low) * np.array(_KNOTS)
        together = max(1, round(STEP_S / step_s))  # readings whose mean is one instant's
        whole = len(time_s) // together * together
        self._at = time_s[:whole].reshape(-1, together).mean(axis=1)
        self._force = force_n[:whole].reshape(-1, together).mean(axis=1)

    def between(self, begin_s: float, end_s: float) -> _Piece:
        """Return what lies between two instants."""
        rows = np.flatnonzero((self._at >= begin_s) & (self._at <= end_s))
        rows = rows[:: max(1, len(rows) // MOST_INSTANTS)]
        return _Piece(
            (self._time_s, self._depth, self._rate),
            (self._at[rows], self._force[rows]),
            self._knots,
        )

    def first_piece(self) -> tuple[float, float]:
        """Return where the tool presses enough for a search to begin in [s]."""
        first_s, last_s = float(self._time_s[0]), float(self._time_s[-1])
        needed = _TOUCHED * float(np.ptp(self._force))
        begin_s = first_s
        while begin_s + 2.0 * SHORTEST_S < last_s:
            inside = (self._at >= begin_s) & (self._at <= begin_s + SHORTEST_S)
            if inside.any() and np.ptp(self._force[inside]) >= needed:
                break
            begin_s += 0.5 * SHORTEST_S
        return begin_s, min(begin_s + SHORTEST_S, last_s)

    def search(self, begin_s: float, end_s: float) -> tuple[float, float]:
        """Return the best delay [s] and rate on a grid."""
        piece = self.between(begin_s, end_s)
        delays = np.arange(-LARGEST_DELAY_S, LARGEST_DELAY_S + 1e-9, 0.01)
        rates = np.linspace(-LARGEST_RATE, LARGEST_RATE, 5)
        _left, delay_s, rate = min((piece.misfit(a, b), a, b) for b in rates for a in delays)
        return float(delay_s), float(rate)

    def refined(
        self, delay_s: float, rate: float, begin_s: float, end_s: float
    ) -> tuple[float, float]:
        """Return the best delay [s] and rate near some."""
        piece, half_s = self.between(begin_s, end_s), 0.5 * (end_s - begin_s)

        def left(x: FloatArray) -> float:
            return piece.misfit(float(x[0]), float(x[1]) / half_s)

        start = np.array([delay_s, rate * half_s])
        simplex = start + np.array([[0.0, 0.0], [0.008, 0.0], [0.0, 0.016]])
        options: Any = {"initial_simplex": simplex, "xatol": 1e-4, "fatol": 0.0, "maxfev": 120}
        found = minimize(left, start, method="Nelder-Mead", options=options)
        return float(found.x[0]), float(found.x[1]) / half_s

    def grows_evenly(self, delay_s: float, rate: float) -> bool:
        """Whether either half, with a law of its own, has the rate of the whole."""
        first_s, last_s = float(self._time_s[0]), float(self._time_s[-1])
        quarter_s = 0.25 * (last_s - first_s)
        for begin_s, middle_s in ((first_s, -quarter_s), (first_s + 2.0 * quarter_s, quarter_s)):
            end_s = begin_s + 2.0 * quarter_s
            _delay_s, own = self.refined(delay_s + rate * middle_s, rate, begin_s, end_s)
            if abs(own - rate) > EVENLY * abs(rate):
                return False
        return True


class _Piece:
    """Forces of some instants, and the motion by its own clock."""

    def __init__(
        self,
        motion: tuple[FloatArray, FloatArray, FloatArray],
        forces: tuple[FloatArray, FloatArray],
        knots: FloatArray,
    ) -> None:
        self._motion, self._knots = motion, knots
        self._at, self._force = forces
        self._middle_s = 0.5 * float(self._at[0] + self._at[-1])

    def misfit(self, delay_s: float, rate: float, *, damping_grows: bool = False) -> float:
        """Return the sum of the squares that no law takes away [N^2].

        Args:
            delay_s: by which the force is late in the middle [s].
            rate: by which that grows.
            damping_grows: whether the law's damping may change evenly with time.
        """
        time_s, depth, velocity = self._motion
        then = self._at - delay_s - rate * (self._at - self._middle_s)
        d, v = np.interp(then, time_s, depth), np.interp(then, time_s, velocity)
        beyond = np.maximum(d[:, None] - self._knots, 0.0)
        damping = v[:, None] * beyond
        columns = np.column_stack([np.ones_like(d), beyond, damping])
        if damping_grows:
            columns = np.column_stack([columns, (self._at - self._middle_s)[:, None] * damping])
        gram = columns.T @ columns
        gram[np.diag_indices_from(gram)] *= 1.0 + 1e-9
        seen = columns.T @ self._force
        taken = float(seen @ np.linalg.lstsq(gram, seen, rcond=None)[0])
        return max(float(self._force @ self._force) - taken, 0.0)

    def left_by_one_delay(self, *, damping_grows: bool = False) -> float:
        """Return the sum of the squares with the one delay that fits best [N^2]."""

        def least(delays: FloatArray) -> tuple[float, float]:
            return min((self.misfit(a, 0.0, damping_grows=damping_grows), a) for a in delays)

        reach = 2.0 * LARGEST_DELAY_S
        _left, delay_s = least(np.arange(-reach, reach + 1e-9, 0.01))
        return least(delay_s + np.arange(-0.01, 0.0101, 0.001))[0]
