"""Whether the stamps of two sensors are of clocks that go unlike, by when their readings come.

What comes first of the readings of a second or two has waited least: how old it is when it comes
is the way it took, and what the two clocks differ by. The way stays the same; that changes evenly
where one clock goes faster. Of two sensors the arrival clock, set or slewed, cancels out.
"""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.readings import Check, Suspicion
from hc_msgs_py.units import NANOSECONDS

WINDOW_S: Final = 2.0
"""The age of its youngest reading stands for a window."""
LEAST_WINDOWS: Final = 10
KEPT_WINDOWS: Final = 30
LEAST_GROWTH_S: Final = 0.004
"""Over all windows that are kept: less changes B by less than anybody tells."""
EVENLY: Final = 0.1
"""Of the growth: so far windows may lie off the line, in the root mean square."""
STEADILY: Final = 0.25
"""Of the rate: so far that of either half may be another."""


class ClockDrift:
    """Follows how old the readings of two sensors are when they come."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """The sensors are read otherwise from now on."""
        self._least_ns: list[int | None] = [None, None]
        self._began_s: float | None = None
        self._windows: deque[tuple[float, int, int]] = deque(maxlen=KEPT_WINDOWS)

    def add(self, sensor: int, stamp_ns: int, arrival_ns: int) -> None:
        """Take in a reading.

        Args:
            sensor: 0 or 1.
            stamp_ns: when it was measured, by its own clock [ns].
            arrival_ns: when it came, by this computer's [ns].
        """
        age_ns, least_ns = arrival_ns - stamp_ns, self._least_ns[sensor]
        if least_ns is None or age_ns < least_ns:
            self._least_ns[sensor] = age_ns

    def look(self, now_s: float) -> float:
        """Return by how much the clock of sensor 1 goes faster than that of sensor 0 [s/s].

        Zero where they go alike, or where that is not known. To be called every second or so.

        Args:
            now_s: a clock that never goes back.
        """
        if self._began_s is None:
            self._began_s = now_s
        if now_s - self._began_s >= WINDOW_S:
            (first_ns, second_ns), middle_s = self._least_ns, 0.5 * (self._began_s + now_s)
            if first_ns is None or second_ns is None:
                self._windows.clear()  # one was silent, and may be another when it comes again
            else:
                self._windows.append((middle_s, first_ns, second_ns))
            self._least_ns, self._began_s = [None, None], now_s
        return self._rate()

    @property
    def span_s(self) -> float:
        """How long the time is that was looked at [s]."""
        return self._windows[-1][0] - self._windows[0][0] if self._windows else 0.0

    def doubts(self, now_s: float, topics: tuple[str, str]) -> list[Suspicion]:
        """Return what `look` says of two topics, in a sentence; nothing of clocks that go alike."""
        rate = self.look(now_s)
        if not rate:
            return []
        slower, faster = topics if rate > 0.0 else topics[::-1]
        said = (
            f"the stamps of {faster} go {1e6 * abs(rate):.0f} us a second faster than those of "
            f"{slower}, by {1e3 * abs(rate) * self.span_s:.3g} ms in the last {self.span_s:.0f} s: "
            "they are of two clocks, and no time offset serves; stamp both by one clock (PTP, "
            "chrony), or where they arrive"
        )
        return [Suspicion(Check.CLOCK, "both", said)]

    def _rate(self) -> float:
        if len(self._windows) < LEAST_WINDOWS:
            return 0.0
        time_s = np.array([window[0] for window in self._windows])
        apart_ns = [first_ns - second_ns for _s, first_ns, second_ns in self._windows]
        ahead_s = np.array([ns - apart_ns[0] for ns in apart_ns], np.float64) / NANOSECONDS
        rate, off_s = _line(time_s, ahead_s)
        growth_s = abs(rate) * self.span_s
        if growth_s < LEAST_GROWTH_S or off_s > EVENLY * growth_s:
            return 0.0
        half = len(time_s) // 2
        for part in (slice(half), slice(half, None)):
            if abs(_line(time_s[part], ahead_s[part])[0] - rate) > STEADILY * abs(rate):
                return 0.0
        return rate


def _line(time_s: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[float, float]:
    """Return slope, and root mean square deviation, of the line through some values."""
    from_middle = time_s - np.mean(time_s)
    slope = float(from_middle @ values / (from_middle @ from_middle))
    return slope, float(np.std(values - slope * from_middle))
