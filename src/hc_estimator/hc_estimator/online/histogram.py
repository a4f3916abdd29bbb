"""Histogram of durations for quantiles over a run: fixed memory, no allocation when it counts.

The bins are those of an HDR histogram: exact below 64 ns, above that 32 bins for every doubling,
so that a quantile is known to 1/32 of its value whatever its size.
"""

from __future__ import annotations

_SUB_BITS = 5
_SUB_BINS = 1 << _SUB_BITS
_LARGEST_BITS = 44  # 2^44 ns is 4.9 hours
_LARGEST = (1 << _LARGEST_BITS) - 1
_BINS = (_LARGEST_BITS - _SUB_BITS + 1) << _SUB_BITS


class DurationHistogram:
    """Counts durations and answers quantiles.

    Attributes:
        count: number of durations.
        maximum_ns: largest duration [ns], exact.
    """

    __slots__ = ("_bins", "count", "maximum_ns")

    def __init__(self) -> None:
        self._bins = [0] * _BINS
        self.count = 0
        self.maximum_ns = 0

    def add(self, duration_ns: int) -> None:
        """Count a duration [ns]; a negative one counts as zero, one above 4.9 h as 4.9 h."""
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
            self._bins[-1] += 1

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
        if not 0.0 <= fraction <= 1.0:
            raise ValueError(f"fraction = {fraction!r} is not a number from 0 to 1")
        if self.count == 0:
            return float("nan")
        wanted = fraction * self.count
        seen = 0
        for index, number in enumerate(self._bins):
            seen += number
            if number and seen >= wanted:
                return min(_centre(index), float(max(self.maximum_ns, 0)))
        return float(self.maximum_ns)

    def merge(self, other: DurationHistogram) -> None:
        """Add what another histogram counted."""
        self.count += other.count
        self.maximum_ns = max(self.maximum_ns, other.maximum_ns)
        for index, number in enumerate(other._bins):
            if number:
                self._bins[index] += number

    def clear(self) -> None:
        """Forget everything."""
        for index in range(_BINS):
            self._bins[index] = 0
        self.count = 0
        self.maximum_ns = 0


def _centre(index: int) -> float:
    """Return the centre [ns] of a bin."""
    shift = (index >> _SUB_BITS) - 1
    if shift <= 0:
        return float(index)
    lower = (index - (shift << _SUB_BITS)) << shift
    return lower + ((1 << shift) - 1) / 2
