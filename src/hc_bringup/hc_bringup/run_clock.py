"""One clock for a run whose own was set: what came after it is laid behind what came before.

A driver that is started again with another clock, or a clock that is put right, gives stamps that
lie before those that were there already, or years ahead. Drawn to scale the two parts would lie
hours apart, in the wrong order, and a run would last less than nothing, or for years.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_evaluation.channels import GAP_STEPS

Array = NDArray[np.float64]

PAUSE_S: Final = 1.0
"""Between two parts: how long it really took no stamp says."""
_SAME_S: Final = 1e-6
"""Times of years, in a float64, are known to less than that."""
_CONFIRMED: Final = 5
"""Readings that go on from there: fewer are stamps out of place."""


class RunClock(NamedTuple):
    """Parts of a run, each with a clock that does not go back.

    Attributes:
        first: row with which each part begins, shape (parts,); 0 the first.
        start_s: time of each as recorded [s], shape (parts,).
        end_s: the largest time of each [s], shape (parts,).
        shift_s: what is added to it [s], shape (parts,); 0 the first.
    """

    first: NDArray[np.intp]
    start_s: Array
    end_s: Array
    shift_s: Array

    @classmethod
    def of(cls, time_s: Array, forward_s: Array | Sequence[float] = ()) -> RunClock:
        """Find the parts.

        Args:
            time_s: in the order of the recording [s], shape (n,), n > 0; need not be finite.
            forward_s: times of samples before which the clock was set forward [s].
        """
        first = np.unique(np.concatenate(([0], _set_back(time_s), _set_at(time_s, forward_s))))
        ends = np.append(first[1:], len(time_s))
        parts = [time_s[a:b][np.isfinite(time_s[a:b])] for a, b in zip(first, ends, strict=True)]
        start_s = np.array([part[0] if len(part) else 0.0 for part in parts])
        end_s = np.array([part.max() if len(part) else 0.0 for part in parts])
        shift_s = np.zeros(len(parts))
        for i in range(1, len(parts)):
            shift_s[i] = end_s[i - 1] + shift_s[i - 1] + PAUSE_S - start_s[i]
        return cls(first, start_s, end_s, shift_s)

    @property
    def is_one(self) -> bool:
        """Whether the clock was never set."""
        return len(self.first) == 1

    def of_rows(self, time_s: Array) -> Array:
        """Return the times of all rows in one clock [s], shape (n,)."""
        lengths = np.diff(np.append(self.first, len(time_s)))
        return time_s + np.repeat(self.shift_s, lengths)

    def of_others(self, time_s: Array) -> Array:
        """Return times of something else, each in the part that it is in or nearest to [s]."""
        outside = np.maximum(
            np.maximum(self.start_s - time_s[:, None], time_s[:, None] - self.end_s), 0.0
        )
        found: Array = time_s + self.shift_s[np.argmin(outside, axis=1)]
        return found

    def lines(self) -> list[str]:
        """Say where it was set, a line each."""
        return [
            f"the clock was set {'back' if start < end else 'forward'} by {abs(end - start):.4g} s "
            f"at {end + shift:.4g} s: what came after is told and shown {PAUSE_S:g} s behind that"
            for end, shift, start in zip(
                self.end_s[:-1], self.shift_s[:-1], self.start_s[1:], strict=True
            )
        ]


def _set_at(time_s: Array, forward_s: Array | Sequence[float]) -> NDArray[np.intp]:
    """Return the rows in which the time goes to one of these, or past it."""
    rows = []
    with np.errstate(invalid="ignore"):
        for at in forward_s:
            reached = (time_s[:-1] < at - _SAME_S) & (time_s[1:] >= at - _SAME_S)
            rows.extend((np.flatnonzero(reached) + 1).tolist())
    return np.array(rows, np.intp)


def _set_back(time_s: Array) -> NDArray[np.intp]:
    """Return the rows at which a clock goes on that lies clearly before what came before."""
    with np.errstate(invalid="ignore", over="ignore"):
        steps = np.diff(time_s)
        usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
        back = np.flatnonzero(steps < -GAP_STEPS * usual)
    return np.array(
        [
            row + 1
            for row in back
            if len(after := time_s[row + 1 : row + 1 + _CONFIRMED]) == _CONFIRMED
            and (np.diff(after) >= 0.0).all()
            and after[-1] < time_s[row]
        ],
        np.intp,
    )
