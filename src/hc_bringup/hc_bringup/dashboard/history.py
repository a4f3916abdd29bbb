"""The last minutes of rows, for pages that open or come back: fixed memory however long it runs."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.dashboard.columns import COLUMNS

CAPACITY: Final = 30_000
"""Ten minutes of rows of 20 ms: 14 MB."""


class History:
    """A ring of rows; every row has a number, counted from 0 in its epoch.

    Attributes:
        epoch: whose rows these are.
        count: rows added so far; the next row has this number.
    """

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._rows = np.empty((capacity, len(COLUMNS)))
        self.epoch = 0
        self.count = 0

    def clear(self, epoch: int) -> None:
        """Begin another epoch."""
        self.epoch, self.count = epoch, 0

    def add(self, rows: NDArray[np.float64]) -> None:
        """Add rows (m, columns)."""
        capacity = len(self._rows)
        kept = rows[-capacity:]
        first = self.count + len(rows) - len(kept)
        self._rows[np.arange(first, first + len(kept)) % capacity] = kept
        self.count += len(rows)

    def since(self, number: int) -> tuple[int, NDArray[np.float64]]:
        """Return the rows from a number on, and the number of the first that is still kept."""
        first = max(number, self.count - len(self._rows), 0)
        if first >= self.count:
            return self.count, np.empty((0, len(COLUMNS)))
        return first, self._rows[np.arange(first, self.count) % len(self._rows)]
