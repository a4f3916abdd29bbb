"""Readings of a tactile array that cannot be right: of all taxels, and of the one that feels most.

A sign, a unit or a zero that is wrong is wrong for all taxels alike, and shows best where the
forces are largest: there the checks look that a single indenter's readings go through. That a taxel
stands still while the others move shows only beside these.
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.readings import LEAST_SAMPLES, Check, Suspicion
from hc_estimator.stream.suspicion_watch import SuspicionWatch

WINDOW_S: Final = 4.0
"""Within that a press comes and goes."""
MOST_NAMED: Final = 5
MUCH_MORE: Final = 1.5
"""By so much another taxel's forces have to be larger: its readings are collected anew."""
NEIGHBOURS: Final = 3
"""A corner of the array has so many; what reads zero beside fewer may lie beside the tissue."""
HALF: Final = 0.5

FloatArray = NDArray[np.float64]
CHECKS: Final = (Check.SIGN, Check.UNITS, Check.FORCE_ZERO, Check.POSITION_ZERO, Check.CLOCK)
"""What every taxel has in common: all else may be that one's alone."""
_SETTINGS = re.compile(r": tare .*| \((?:force|position)\.[^)]*\)")
"""Settings and services of a single sensor in a sentence: an array has none."""
_DRIVER: Final = "; the array's driver has to put it right"


class ArrayWatch:
    """Collects samples and says what is suspicious about them.

    Attributes:
        problems: what is suspicious now, a sentence each.
        failure: why the last look came to nothing, empty if it did not.
    """

    def __init__(self) -> None:
        self.problems: list[str] = []
        self._watch = SuspicionWatch()
        self._taxel = 0
        self._stuck: list[str] = []
        self._begin_window(0, 0.0)

    def _begin_window(self, taxels: int, now_s: float) -> None:
        self._began_s, self._samples = now_s, 0
        self._low = np.full((2, taxels), np.inf)
        self._high = np.full((2, taxels), -np.inf)
        self._number = np.zeros((2, taxels), np.int64)

    @property
    def failure(self) -> str:
        """Why the last look at the taxel that feels most came to nothing."""
        return self._watch.failure

    @property
    def looking(self) -> bool:
        """Whether a look is under way, so that `go_on` has something to do."""
        return self._watch.looking

    def go_on(self) -> None:
        """Do the next part of the look that is under way, some tenths of a millisecond."""
        self._watch.go_on()

    def add(self, stamp_ns: int, displacements_mm: FloatArray, forces_n: FloatArray) -> None:
        """Take in a sample.

        Args:
            stamp_ns: stamp [ns].
            displacements_mm: penetration of each taxel [mm]; NaN where there is no reading.
            forces_n: force of each taxel [N], as many.
        """
        taxels = len(forces_n)
        if taxels != self._low.shape[1]:
            self.forget(taxels)
        both = np.stack((displacements_mm, forces_n))
        np.fmin(self._low, both, out=self._low)
        np.fmax(self._high, both, out=self._high)
        self._number += np.isfinite(both)
        self._samples += 1
        self._watch.add(stamp_ns, float(both[0, self._taxel]), float(both[1, self._taxel]))

    def add_latency(self, latency_ns: int, *, live: bool) -> None:
        """Take in how old a sample was when it was used [ns].

        Args:
            latency_ns: from its stamp to now; negative for a stamp in the future.
            live: whether it is of now; a recording that is played may be as old as it is.
        """
        self._watch.add_latency(latency_ns, live=live)

    def forget(self, taxels: int) -> None:
        """Another array speaks from now on."""
        self._watch.forget()
        self._taxel, self._stuck, self.problems = 0, [], []
        self._begin_window(taxels, self._began_s)

    def look(self, now_s: float, columns: int) -> list[str]:
        """Judge, if it is time to; returns what has become suspicious since the last time.

        Args:
            now_s: a clock that never goes back.
            columns: taxels of a row; what has no rows (0, or no divisor) has no neighbours.
        """
        new = self._said(self._watch.look(now_s))
        if self._samples >= LEAST_SAMPLES and now_s - self._began_s >= WINDOW_S:
            before, self._stuck = self._stuck, self._standing(columns)
            new += [said for said in self._stuck if said not in before]
            self._follow()
            self._begin_window(self._low.shape[1], now_s)
        self.problems = [*self._stuck, *self._said(self._watch.suspicions)]
        return new

    def _said(self, suspicions: list[Suspicion]) -> list[str]:
        """Put into words for an array what is doubted of the taxel that feels most."""
        return [
            s.sentence
            if s.channel == "samples"
            else f"taxel {self._taxel}: {_SETTINGS.sub('', s.sentence)}{_DRIVER}"
            for s in suspicions
            if s.check in CHECKS
        ]

    def _follow(self) -> None:
        """Watch the taxel with the largest range of forces from now on."""
        span = self._spans()[1]
        most = int(np.argmax(span))
        if span[most] > MUCH_MORE * span[self._taxel]:
            self._taxel = most
            self._watch.forget_readings()

    def _spans(self) -> FloatArray:
        """Return the range of displacement and force of each taxel, shape (2, taxels)."""
        with np.errstate(invalid="ignore"):  # infinite readings, and none at all
            spans: FloatArray = self._high - self._low
        spans[~np.isfinite(spans) | (self._number < LEAST_SAMPLES)] = 0.0
        return spans

    def _standing(self, columns: int) -> list[str]:
        """Name the taxels of which a channel stands still while it moves at the others."""
        depth, force = self._spans() > 0.0
        enough = self._number >= LEAST_SAMPLES
        found = []
        if np.mean(force) >= HALF:
            pressed = depth & (self._high[0] > 0.0)
            still = enough[1] & ~force & pressed
            empty = self._high[1] == 0.0
            still &= ~empty | _surrounded(force, columns)
            found += _named(still, self._high[1], "N", "force")
        if np.mean(depth) >= HALF:
            found += _named(enough[0] & ~depth & force, self._high[0], "mm", "displacement")
        return found


def _surrounded(loaded: NDArray[np.bool_], columns: int) -> NDArray[np.bool_]:
    """Whether all neighbours of a taxel, of which it has three at least, are loaded."""
    taxels = len(loaded)
    if columns < 1 or taxels % columns:
        return np.zeros(taxels, bool)
    place = np.pad(loaded.reshape(-1, columns).astype(int), 1)
    there = np.pad(np.ones_like(place[1:-1, 1:-1]), 1)
    rows, width = taxels // columns, columns
    near, possible = np.zeros((rows, width), int), np.zeros((rows, width), int)
    for down in range(3):
        for right in range(3):
            if (down, right) != (1, 1):
                near += place[down : down + rows, right : right + width]
                possible += there[down : down + rows, right : right + width]
    inside: NDArray[np.bool_] = (near == possible) & (possible >= NEIGHBOURS)
    return inside.ravel()


def _named(still: NDArray[np.bool_], values: FloatArray, unit: str, channel: str) -> list[str]:
    which = np.flatnonzero(still)
    if not len(which):
        return []
    more = " ..." if len(which) > MOST_NAMED else ""
    listed = ", ".join(f"{i} ({values[i]:.3g} {unit})" for i in which[:MOST_NAMED])
    reads = "reads" if len(which) == 1 else "read"
    return [
        f"{len(which)} of {len(still)} taxels {reads} the same {channel} all the time while the "
        f"others change: {listed}{more}, counted row by row from 0: what is "
        "estimated there is not the tissue"
    ]
