"""Whether the stamps of samples are of the clock by which they are used."""

from __future__ import annotations

import math
from typing import Final

from hc_estimator.stream.readings import Check, Suspicion

AHEAD_NS: Final = 10_000_000
"""Clocks that a time server holds differ by less, and nothing here minds so much."""
OLD_NS: Final = 1_000_000_000
"""What is so old when it is used is not of now: clocks that differ, or a recording."""
DAY_S: Final = 86_400.0
YEAR_S: Final = 365.25 * DAY_S
SINCE_START_NS: Final = 40 * 365 * 86_400 * 1_000_000_000
"""A clock without a battery begins at a date of this century: what is older counts from a start."""
STEADY_NS: Final = 300_000_000
"""Clocks that differ do so by the same from one look to the next."""
OTHER_CLOCK_NS: Final = 60_000_000_000
"""By so much no age changes from one look to the next but by another clock."""
PACE: Final = 0.05
"""Clocks of computers go equally fast but for parts in ten thousand."""
SAME_PACE: Final = 0.02
"""From one look to the next: where a machine falls behind, ages do not change evenly."""
_DIFFER: Final = "the clocks of sensor and computer differ (use PTP or chrony)"


class StampWatch:
    """Doubts stamps that all lie in the future, or all far in the past, or go at another pace.

    Attributes:
        moved: whether the stamps are of another clock since the last look that had samples.
    """

    def __init__(self) -> None:
        self.moved = False
        self._before_ns: int | None = None
        self._known_ns: int | None = None  # the same, of the last look that had samples
        self._looked_s = 0.0
        self._pace = math.nan  # of the stamps against this computer's clock, at the last look
        self._clear()

    def _clear(self) -> None:
        self._least_ns: int | None = None
        self._most_ns = 0
        self._live = True

    def add(self, latency_ns: int, *, live: bool) -> None:
        """Take in how old a sample was when it was used [ns].

        Args:
            latency_ns: from its stamp to now; negative for a stamp in the future.
            live: whether it is of now by what it came from; a recording may be as old as it is.
        """
        if self._least_ns is None:
            self._least_ns = self._most_ns = latency_ns
        elif latency_ns < self._least_ns:
            self._least_ns = latency_ns
        elif latency_ns > self._most_ns:
            self._most_ns = latency_ns
        self._live = live

    def take(self, now_s: float) -> list[Suspicion]:
        """Return what is doubted of the samples since the last call; nothing without samples.

        Args:
            now_s: a clock that never goes back.
        """
        least_ns, most_ns, live = self._least_ns, self._most_ns, self._live
        before_ns, self._before_ns = self._before_ns, self._least_ns
        pace_before, self._pace = self._pace, math.nan
        elapsed_s, self._looked_s = now_s - self._looked_s, now_s
        self._clear()
        self.moved = False
        if least_ns is None:
            return []
        known_ns, self._known_ns = self._known_ns, least_ns
        self.moved = known_ns is not None and abs(least_ns - known_ns) > OTHER_CLOCK_NS
        if before_ns is not None and elapsed_s > 0.0:
            self._pace = 1.0 - 1e-9 * (least_ns - before_ns) / elapsed_s
        doubted = live or most_ns < -AHEAD_NS
        if doubted and abs(self._pace - 1.0) > PACE and abs(self._pace - pace_before) < SAME_PACE:
            said = (
                f"stamps go {self._pace:.2g} times as fast as this computer's clock: stamps that "
                "are counted at a rate that is not the sensor's (then B is wrong by about that "
                "factor), or what is played or simulated at another rate"
            )
        elif most_ns < -SINCE_START_NS:
            said = (
                "samples are stamped by a computer's clock, and the time here is that of a "
                "simulation that has not begun or counts from its start: use_sim_time: false for "
                "the estimator, or let /clock be published"
            )
        elif most_ns < -AHEAD_NS:
            said = f"samples are stamped {_seconds(-most_ns)} in the future: {_DIFFER}"
        elif least_ns > SINCE_START_NS and live:
            said = (
                "samples are stamped as of 1970: their times count from the start of a simulation "
                "(use_sim_time: true for the estimator, where /clock is published) or of a device "
                "(its driver has to stamp by the computer's clock)"
            )
        elif least_ns > OLD_NS and live:
            steady = before_ns is None or abs(least_ns - before_ns) < STEADY_NS
            said = f"samples are {_seconds(least_ns)} old when they are used: " + (
                f"{_DIFFER}, or a recording is played"
                if steady
                else "a driver or a machine that does not keep up (hc topic hz, top), or a "
                "recording that is played at another rate"
            )
        else:
            return []
        return [Suspicion(Check.CLOCK, "samples", said)]


def _seconds(duration_ns: int) -> str:
    seconds = duration_ns * 1e-9
    if seconds >= 2.0 * YEAR_S:
        return f"{seconds / YEAR_S:.0f} years"
    if seconds >= 2.0 * DAY_S:
        return f"{seconds / DAY_S:.0f} days"
    return f"{seconds:.0f} s" if seconds >= 100.0 else f"{seconds:.3g} s"
