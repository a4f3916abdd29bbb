"""Sanity checks of a stream: the newest readings are looked at every few seconds, between samples.

Looking takes some milliseconds, which no sample must wait for. So it is done in parts of some
tenths of one, each after a sample was dealt with (`go_on`). A thread is no way: numpy gives the
interpreter's lock back in each of its calls, wakes who waits for it, and has taken it again before
that one runs; samples then waited for 2 to 5 ms, in every look.
"""

from __future__ import annotations

import math
from array import array

import numpy as np

from hc_estimator.stream.readings import Check, Parts, Readings, Suspicion, usable
from hc_estimator.stream.sanity import check_in_parts, less_gaps
from hc_estimator.stream.stamp_watch import StampWatch

KEPT = 4096
"""Readings of each channel: four seconds at 1 kHz."""
PERIOD_S = 2.0
PATIENCE_S = 0.5
"""Then what is left of a look is done at once: samples come so seldom that none waits for it."""
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
        force_limit_n: the estimator's, see `check_samples`.
        counted_once: channels whose repeated readings are left out, see there.
        failure: why the last look came to nothing, empty if it did not: estimates do not depend on
            looking, so it ends nothing.
    """

    def __init__(self) -> None:
        self.suspicions: list[Suspicion] = []
        self.force_limit_n = math.inf
        self.counted_once: tuple[str, ...] = ()
        self.failure = ""
        self._parts: Parts[list[Suspicion]] | None = None
        self._found: list[Suspicion] | None = None
        self._began_s = 0.0
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
        self._parts = self._found = None
        self.suspicions = []

    def forget_readings(self) -> None:
        """Another sensor speaks from now on, by the same clock: of that is known what was."""
        stamps = self._stamps
        seen = {key: n for key, n in self._seen.items() if key[0] == Check.CLOCK.value}
        kept = [s for s in self.suspicions if s.check is Check.CLOCK and s.channel == "samples"]
        self.forget()
        self._stamps, self._seen, self.suspicions = stamps, seen, kept

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
        """Begin a look, if it is time to; returns what has become suspicious since the last time.

        Args:
            now_s: a clock that never goes back.
        """
        while self.looking and now_s - self._began_s > PATIENCE_S:
            self.go_on()
        new: list[Suspicion] = []
        if self._found is not None:
            found, self._found = self._found, None
            found = less_gaps(found, self.counted_once)
            of_stamps = self._stamps.take(now_s)
            if self._stamps.moved:  # what is wrong with this clock was not said yet
                self._seen = {k: n for k, n in self._seen.items() if k[0] != Check.CLOCK.value}
                self.suspicions = [s for s in self.suspicions if s.check is not Check.CLOCK]
            new = self._weigh([*found, *of_stamps])
        count = self._displacement.count + self._force.count
        if not self.looking and now_s >= self._next_s and count > self._looked_at:
            self._looked_at = count
            self._next_s, self._began_s = now_s + PERIOD_S, now_s
            channels = self._displacement.readings(), self._force.readings()
            self._parts = check_in_parts(*channels, self.force_limit_n)
        return new

    @property
    def looking(self) -> bool:
        """Whether a look is under way, so that `go_on` has something to do."""
        return self._parts is not None

    def go_on(self) -> None:
        """Do the next part of the look that is under way."""
        if self._parts is None:
            return
        try:
            with np.errstate(all="ignore"):
                next(self._parts)
        except StopIteration as end:
            self._parts, self._found, self.failure = None, end.value, ""
        except Exception as error:  # noqa: BLE001 - it only advises: told, and the next look is tried
            self._parts, self.failure = None, f"{type(error).__name__}: {error}"

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
