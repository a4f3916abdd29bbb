"""What is wrong with the stream of a tactile array, from what was counted since the last status.

Free of ROS: the node gives the counts and what its subscription says of the publishers.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.estimate import Rejection

SILENT_S = 2.0
"""Without a sample for so long, an array that gave some is silent."""
SHARE_LATE = 0.05
MOST_NAMED = 5
_NO_READING = (Rejection.NOT_FINITE, Rejection.OUT_OF_RANGE)
LEAST_PITCH_M = 1e-5
MOST_PITCH_M = 1.0
"""Taxels further apart, or closer, are none: the number is wrong."""


def why_no_places(taxels: int, columns: int, pitch_m: float) -> str:
    """Return why no map can show where taxels are; empty if one can.

    Args:
        taxels: how many there are.
        columns: taxels of a row.
        pitch_m: from one to the next [m].
    """
    if columns < 1 or taxels % columns:
        return (
            f"columns = {columns}, of which {taxels} taxels are no whole rows: no map can show "
            "them; columns is the number of taxels in a row"
        )
    if not LEAST_PITCH_M <= pitch_m <= MOST_PITCH_M:  # true for NaN
        return (
            f"pitch = {pitch_m:g} m from one taxel to the next: no map can show them; give it in "
            f"m, {LEAST_PITCH_M:g} to {MOST_PITCH_M:g}"
        )
    return ""


class Effort(NamedTuple):
    """What a sample of all taxels takes.

    Attributes:
        taxels: how many there are.
        filter: of each of them.
        computation_s: of a sample, the median [s].
        plainer: a filter that takes less time; empty where there is none.
    """

    taxels: int
    filter: str
    computation_s: float
    plainer: str

    @property
    def said(self) -> str:
        """What it takes, and what takes less, for a sentence of samples that are left out."""
        other = f"a plainer filter ({self.plainer}), " if self.plainer else ""
        return (
            f"{self.taxels} taxels take {1e3 * self.computation_s:.2g} ms a sample with "
            f"{self.filter}: take {other}more threads, or send fewer samples"
        )


class ArrayHealth:
    """Judges the stream once in a status."""

    def __init__(self) -> None:
        self._before: Mapping[str, int] = {}
        self._without = np.zeros(0, bool)  # taxels without a reading in every sample so far
        self._samples = 0

    def add(self, rejected: NDArray[np.integer]) -> None:
        """Hear why the readings of the taxels were refused, one sample's, shape (taxels,)."""
        without = np.isin(rejected, _NO_READING)
        if self._samples and len(without) == len(self._without):
            self._without &= without
        else:
            self._without, self._samples = without, 0
        self._samples += 1

    def problems(
        self,
        counts: Mapping[str, int],
        *,
        silent_s: float | None,
        afresh: str,
        effort: Effort | None = None,
    ) -> list[str]:
        """Return what is wrong since the last call, a phrase for each.

        Args:
            counts: totals: received, late, strays, restarts, undecodable, skipped.
            silent_s: time since the newest message [s]; None before the first.
            afresh: why the estimators were started afresh the last time.
            effort: what a sample takes since the last status; None where there was none.
        """
        since = {name: count - self._before.get(name, 0) for name, count in counts.items()}
        self._before = dict(counts)
        found = []
        if silent_s is not None and silent_s > SILENT_S:
            found.append(f"no sample for {silent_s:.0f} s: is the array still publishing?")
        if since["undecodable"]:
            found.append(
                f"{since['undecodable']} samples that cannot be read: displacement and force must "
                "have one element for each taxel, and there must be one at least"
            )
        if since["strays"] > 1:
            found.append(
                f"{since['strays']} samples left out, whose stamps are zero, go back or jump: let "
                "the source stamp them when they are measured"
            )
        if since["late"] > SHARE_LATE * since["received"]:
            found.append(
                f"{since['late']} samples left out, whose stamps repeat that of the one before or "
                "lie before it"
            )
        if since["restarts"] > 1:
            found.append(
                f"started afresh {since['restarts']} times since the last status ({afresh}): give "
                "each array a topic and a node of its own"
            )
        if since["skipped"]:
            of_what = f", for {effort.said}" if effort else ""
            found.append(f"cannot keep up: {since['skipped']} samples left out{of_what}")
        found += self._taxels_without()
        return found

    @property
    def without_reading(self) -> int:
        """How many taxels had no reading in any sample since the last status."""
        return int(self._without.sum()) if self._samples else 0

    def begin_anew(self) -> None:
        """The status was made: what comes belongs to the next one."""
        self._samples = 0

    def _taxels_without(self) -> list[str]:
        number, total = self.without_reading, len(self._without)
        if not number:
            return []
        named = ", ".join(map(str, np.flatnonzero(self._without)[:MOST_NAMED]))
        more = " ..." if number > MOST_NAMED else ""
        return [
            f"{number} of {total} taxels give no reading (NaN, infinite or beyond the limits): "
            f"{named}{more}, counted row by row from 0"
        ]
