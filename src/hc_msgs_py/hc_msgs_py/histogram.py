"""The suite's one histogram: durations counted in fixed memory, for quantiles and shares.

The bins are those of an HDR histogram: exact below 128 ns, above that 64 bins for every doubling,
so that a quantile is known to 0.8 % of its value whatever its size. Only bins that hold something
are kept: a second at 1 kHz fills some hundred of 3,648, and its quantiles are asked for between two
samples.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Sequence
from itertools import accumulate
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_msgs_py.units import NANOSECONDS

_SUB_BITS: Final = 6
_LARGEST_BITS: Final = 62  # 2^62 ns is 146 years
_LARGEST: Final = (1 << _LARGEST_BITS) - 1
_BINS: Final = (_LARGEST_BITS - _SUB_BITS + 1) << _SUB_BITS


class DurationHistogram:
    """Counts durations and answers quantiles.

    Attributes:
        count: number of durations.
        maximum_ns: largest duration [ns], exact.
    """

    __slots__ = ("_bins", "count", "maximum_ns")

    def __init__(self) -> None:
        self._bins: defaultdict[int, int] = defaultdict(int)
        self.count = 0
        self.maximum_ns = 0

    def add(self, duration_ns: int) -> None:
        """Count a duration [ns]; a negative one counts as zero, one above 146 years as those."""
        if duration_ns > self.maximum_ns:
            self.maximum_ns = duration_ns
        self.count += 1
        shift = duration_ns.bit_length() - _SUB_BITS - 1
        if duration_ns <= 0:
            self._bins[0] += 1
        elif shift <= 0:
            self._bins[duration_ns] += 1
        elif duration_ns <= _LARGEST:
            self._bins[(shift << _SUB_BITS) + (duration_ns >> shift)] += 1
        else:
            self._bins[_BINS - 1] += 1

    def add_s(self, duration_s: float) -> None:
        """Count a duration [s]; NaN counts as zero."""
        self.add(int(min(duration_s, 1e9) * NANOSECONDS) if duration_s > 0.0 else 0)

    def add_many(self, durations_ns: NDArray[np.int64]) -> None:
        """Count durations [ns], (n,); the same as `add` one by one."""
        if not len(durations_ns):
            return
        self.maximum_ns = max(self.maximum_ns, int(durations_ns.max()))
        self.count += len(durations_ns)
        kept = np.clip(durations_ns, 0, _LARGEST)
        # frexp gives the number of bits; where it rounds up, the next octave begins at that bin.
        shift = np.maximum(np.frexp(kept.astype(np.float64))[1] - _SUB_BITS - 1, 0)
        places, numbers = np.unique((shift << _SUB_BITS) + (kept >> shift), return_counts=True)
        for place, number in zip(places.tolist(), numbers.tolist(), strict=True):
            self._bins[place] += number

    @property
    def maximum_s(self) -> float:
        """Largest duration [s]."""
        return self.maximum_ns / NANOSECONDS

    def quantile_ns(self, fraction: float) -> float:
        """Return the duration [ns] that a fraction of all durations does not exceed.

        Args:
            fraction: from 0 to 1.

        Returns:
            Centre of the bin that holds the quantile, at most the exact maximum; NaN when nothing
            was counted.

        Raises:
            ValueError: if the fraction is not within 0 to 1.
        """
        return self.quantiles_ns((fraction,))[0]

    def quantiles_ns(self, fractions: Sequence[float]) -> list[float]:
        """Return `quantile_ns` of several fractions; the bins are gone through once.

        Raises:
            ValueError: as there.
        """
        for fraction in fractions:
            if not 0.0 <= fraction <= 1.0:
                raise ValueError(f"fraction = {fraction!r} is not a number from 0 to 1")
        if self.count == 0:
            return [float("nan")] * len(fractions)
        bins = sorted(self._bins)
        seen = list(accumulate(self._bins[place] for place in bins))
        largest = float(max(self.maximum_ns, 0))
        # The first bin up to which so many were seen; of none it is the first that holds one.
        places = (bisect_left(seen, max(f * self.count, 0.5)) for f in fractions)
        return [
            min(float(_CENTRES[bins[place]]), largest)
            if place < len(bins)
            else float(self.maximum_ns)
            for place in places
        ]

    def quantile_s(self, fraction: float) -> float:
        """The same in s."""
        return self.quantile_ns(fraction) / NANOSECONDS

    def between(self, edges_ns: NDArray[Any]) -> NDArray[np.int64]:
        """Return how many lie below the first edge, between the edges and above the last one.

        Args:
            edges_ns: (m,) growing; a bin of the histogram counts where its centre lies.

        Returns:
            (m + 1,) counts.
        """
        places = np.searchsorted(edges_ns, _CENTRES[list(self._bins)])
        numbers = list(self._bins.values())
        return np.bincount(places, numbers, minlength=len(edges_ns) + 1).astype(np.int64)

    def merge(self, other: DurationHistogram) -> None:
        """Add what another histogram counted."""
        self.count += other.count
        self.maximum_ns = max(self.maximum_ns, other.maximum_ns)
        for place, number in other._bins.items():
            self._bins[place] += number

    def clear(self) -> None:
        """Forget everything."""
        self._bins.clear()
        self.count = 0
        self.maximum_ns = 0


def _centres() -> NDArray[np.float64]:
    """The centres [ns] of all bins, in their order."""
    index = np.arange(_BINS)
    shift = np.maximum((index >> _SUB_BITS) - 1, 0)
    lower = (index - (shift << _SUB_BITS)) << shift
    centres: NDArray[np.float64] = lower + ((1 << shift) - 1) / 2
    return centres


_CENTRES: Final = _centres()
