"""What was felt where: the estimate over the tip's sideways position, in cells of a grid.

A cell keeps the weighted mean of (ln K, n) over the estimates made above it, from which the page
draws the tissue's stiffness at whatever depth is asked for. Estimates that follow one another are
not independent, so a cell's uncertainty does not shrink with their number: it is their mean
covariance plus their scatter.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.dashboard.columns import INDEX

CELL_MM: Final = 0.5
MOST_CELLS: Final = 4000
"""With more, four cells become one: memory and frames stay bounded however far the tip goes."""
TIPS_KEPT: Final = 500
"""Positions of the tip that are kept for estimates that come late: five seconds at 100 Hz."""
ROWS_KEPT: Final = 500
LARGEST_LOG_STD: Final = 1.0
"""Estimates of a stiffness that is not known to a factor of e say nothing about a place."""
LONGEST_WAIT_S: Final = 2.0
"""A row waits so long for the tip's position after it, then it is dropped."""
_LEAST_VARIANCE: Final = 1e-6
"""Of ln K: no estimate outweighs the others beyond that."""

MAP_COLUMNS: Final = ("x", "y", "count", "ln_K", "n", "var_ln_K", "var_n", "cov", "deepest")

_COUNT, _WEIGHT, _L, _N, _LL, _NN, _LN, _VL, _VN, _VLN, _DEEPEST = range(11)
_SUMS = slice(_COUNT, _DEEPEST)


class PalpationMap:
    """Cells of a grid, made where the tip has been.

    Attributes:
        cell_mm: edge of a cell; doubles when there are too many.
        version: changes whenever a cell does.
    """

    def __init__(self, cell_mm: float = CELL_MM, most_cells: int = MOST_CELLS) -> None:
        self._first_cell_mm = self.cell_mm = cell_mm
        self._most = most_cells
        self.version = 0
        self._cells: dict[tuple[int, int], NDArray[np.float64]] = {}
        self._waiting: deque[NDArray[np.float64]] = deque(maxlen=ROWS_KEPT)
        self._tips: deque[tuple[float, float, float]] = deque(maxlen=TIPS_KEPT)

    def clear(self) -> None:
        """Forget everything felt so far."""
        self.cell_mm = self._first_cell_mm
        self._cells.clear()
        self._waiting.clear()
        self._tips.clear()
        self.version += 1

    def add_rows(self, rows: NDArray[np.float64]) -> None:
        """Take in rows (m, columns); they wait until the tip's position at their time is known."""
        for row in rows:
            touched = row[INDEX["contact"]] == 1.0
            if not (touched and row[INDEX["samples"]] > row[INDEX["rejected"]]):
                continue
            stiffness, exponent = row[INDEX["K"]], row[INDEX["n"]]
            if not (stiffness > 0.0 and math.isfinite(exponent)):
                continue
            variance = (row[INDEX["K_std"]] / stiffness) ** 2
            if not variance <= LARGEST_LOG_STD**2:
                continue
            row_here = (
                row[INDEX["time"]],
                math.log(stiffness),
                exponent,
                variance,
                row[INDEX["n_std"]] ** 2,
                row[INDEX["K_n_covariance"]] / stiffness,
                row[INDEX["displacement_max"]],
            )
            self._waiting.append(np.array(row_here))
        self._settle()
        if self._tips:
            latest = max(self._tips[-1][0], rows[-1, INDEX["time"]])
            while self._waiting and latest - self._waiting[0][0] > LONGEST_WAIT_S:
                self._waiting.popleft()

    def add_tip(self, time_s: float, x_mm: float, y_mm: float) -> None:
        """Take in a position of the tip, and place the rows that waited for it."""
        if self._tips and time_s <= self._tips[-1][0]:
            return
        self._tips.append((time_s, x_mm, y_mm))
        self._settle()

    def _settle(self) -> None:
        """Place the rows between two known positions; drop those from before the first one."""
        if len(self._tips) < 2 or not self._waiting:
            return
        ready = []
        while self._waiting and self._waiting[0][0] <= self._tips[-1][0]:
            ready.append(self._waiting.popleft())
        if not ready:
            return
        times, x_mm, y_mm = np.array(self._tips).T
        rows = np.array(ready)
        known = rows[:, 0] >= times[0]
        x, y = (np.interp(rows[:, 0], times, axis) for axis in (x_mm, y_mm))
        for one, at_x, at_y, usable in zip(rows, x, y, known, strict=True):
            if usable and math.isfinite(at_x) and math.isfinite(at_y):
                self._place(float(at_x), float(at_y), one[1:])

    def place_contact(
        self, x_mm: float, y_mm: float, parameters: NDArray[np.float64], depth_mm: float
    ) -> None:
        """Take in a whole contact whose place is known.

        Args:
            x_mm: sideways position.
            y_mm: sideways position across it.
            parameters: (5,) ln K, n, variance of ln K, variance of n, their covariance.
            depth_mm: deepest penetration.
        """
        self._place(x_mm, y_mm, np.append(parameters, depth_mm))

    def table(self) -> NDArray[np.float64]:
        """Return the cells, (cells, 9) in the order of MAP_COLUMNS; x and y are their centres."""
        out = np.empty((len(self._cells), len(MAP_COLUMNS)))
        for place, ((i, j), cell) in enumerate(self._cells.items()):
            mean = cell[_L : _LN + 1] / cell[_WEIGHT]
            within = cell[_VL : _VLN + 1] / cell[_WEIGHT]
            ln_k, exponent = mean[0], mean[1]
            out[place] = (
                i * self.cell_mm,
                j * self.cell_mm,
                cell[_COUNT],
                ln_k,
                exponent,
                within[0] + max(0.0, mean[2] - ln_k**2),
                within[1] + max(0.0, mean[3] - exponent**2),
                within[2] + mean[4] - ln_k * exponent,
                cell[_DEEPEST],
            )
        return out

    def _place(self, x_mm: float, y_mm: float, row: NDArray[np.float64]) -> None:
        ln_k, exponent, variance, variance_n, common, deepest = row
        weight = 1.0 / max(variance, _LEAST_VARIANCE)
        key = (math.floor(x_mm / self.cell_mm + 0.5), math.floor(y_mm / self.cell_mm + 0.5))
        cell = self._cells.get(key)
        if cell is None:
            cell = self._cells[key] = np.zeros(11)
        cell[_COUNT] += 1.0
        cell[_WEIGHT] += weight
        cell[_L : _VLN + 1] += weight * np.array(
            (
                ln_k,
                exponent,
                ln_k**2,
                exponent**2,
                ln_k * exponent,
                variance,
                variance_n,
                common,
            )
        )
        cell[_DEEPEST] = max(cell[_DEEPEST], deepest)
        self.version += 1
        if len(self._cells) > self._most:
            self._coarsen()

    def _coarsen(self) -> None:
        cells, self._cells = self._cells, {}
        self.cell_mm *= 2.0
        for (i, j), cell in cells.items():
            key = (math.floor(0.5 * i + 0.5), math.floor(0.5 * j + 0.5))
            merged = self._cells.setdefault(key, np.zeros(11))
            merged[_SUMS] += cell[_SUMS]
            merged[_DEEPEST] = max(merged[_DEEPEST], cell[_DEEPEST])
