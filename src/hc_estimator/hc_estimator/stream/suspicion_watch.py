"""Sanity checks of a stream: the newest readings are looked at every few seconds, in a thread.

Looking takes some ten milliseconds, which no sample must wait for.
"""

from __future__ import annotations

from array import array
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from hc_estimator.stream.readings import Readings, Suspicion, usable
from hc_estimator.stream.sanity import check_channels
from hc_estimator.stream.stamp_watch import StampWatch

KEPT = 4096
"""Readings of each channel: four seconds at 1 kHz."""
PERIOD_S = 2.0
CONFIRMATIONS = 2
"""Looks in a row that must doubt a thing before it is told, and must not before it is forgotten."""


class _Channel:
    """The newest readings of one channel, in memory that was there from the start."""

    def __init__(self, name: str, unit: str) -> None:
        self._name, self._unit = name, unit
        self._times = array("d", bytes(8 * KEPT))
        self._values = array("d", bytes(8 * KEPT))
        self.count = 0

    def add(self, time_s: float, value: float) -> None:
        place = self.count % KEPT
        self._times[place] = time_s
        self._values[place] = value
        self.count += 1

    def readings(self) -> Readings:
        """Return a copy, oldest first, finite readings only."""
        kept = min(self.count, KEPT)
        shift = -(self.count % KEPT) if self.count > KEPT else 0
        times = np.roll(np.array(self._times[:kept]), shift)
        values = np.roll(np.array(self._values[:kept]), shift)
        return usable(self._name, self._unit, times, values)


class SuspicionWatch:
    """Collects readings and says what is suspicious about them.

    Attributes:
        suspicions: what is suspicious now.
        failure: why the last look came to nothing, empty if it did not: estimates do not depend on
            looking, so it ends nothing.
    """

    def __init__(self) -> None:
        self.suspicions: list[Suspicion] = []
        self.failure = ""
        self._worker = ThreadPoolExecutor(1, "sanity")
        self._looking: Future[list[Suspicion]] | None = None
        self._next_s = 0.0
        self.forget()

    def forget(self) -> None:
        """The sensors are read otherwise from now on."""
        self._displacement = _Channel("displacement", "mm")
        self._force = _Channel("force", "N")
        self._stamps = StampWatch()
        self._origin_ns: int | None = None
        self._seen: dict[tuple[str, str], int] = {}
        self._looked_at = 0
        self._looking = None
        self.suspicions = []

    def add(self, stamp_ns: int, displacement_mm: float, force_n: float) -> None:
        """Take in a sample; NaN where there is no reading of a channel."""
        if self._origin_ns is None:
            self._origin_ns = stamp_ns
        time_s = (stamp_ns - self._origin_ns) * 1e-9
        if displacement_mm == displacement_mm:  # no NaN
            self._displacement.add(time_s, displacement_mm)
        if force_n == force_n:
            self._force.add(time_s, force_n)

    def add_latency(self, latency_ns: int, *, live: bool) -> None:
        """Take in how old a sample was when it was used [ns], and whether it should be of now."""
        self._stamps.add(latency_ns, live=live)

    def look(self, now_s: float) -> list[Suspicion]:
        """Look, if it is time to; returns what has become suspicious since the last time.

        Args:
            now_s: a clock that never goes back.
        """
        new: list[Suspicion] = []
        if self._looking is not None and self._looking.done():
            looked, self._looking = self._looking, None
            error = looked.exception()
            self.failure = "" if error is None else f"{type(error).__name__}: {error}"
            if error is None:
                new = self._weigh([*looked.result(), *self._stamps.take(now_s)])
        count = self._displacement.count + self._force.count
        if self._looking is None and now_s >= self._next_s and count > self._looked_at:
            self._looked_at = count
            self._next_s = now_s + PERIOD_S
            self._looking = self._worker.submit(
                check_channels, self._displacement.readings(), self._force.readings()
            )
        return new

    def _weigh(self, found: list[Suspicion]) -> list[Suspicion]:
        """Tell a doubt once it was there twice, and until it was absent twice."""
        by_key = {(s.check.value, s.channel): s for s in found}
        current = {(s.check.value, s.channel): s for s in self.suspicions}
        new = []
        for key in by_key.keys() | current.keys() | self._seen.keys():
            score = self._seen.get(key, 0) + (1 if key in by_key else -1)
            self._seen[key] = score = max(0, min(score, CONFIRMATIONS))
            if key in current and score == 0:
                del current[key]
            elif key in by_key and (key in current or score == CONFIRMATIONS):
                if key not in current:
                    new.append(by_key[key])
                current[key] = by_key[key]
        self.suspicions = list(current.values())
        return new
