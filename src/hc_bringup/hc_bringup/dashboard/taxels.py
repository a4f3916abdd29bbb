"""A tactile array for the page: the estimate of every taxel that has touched, at its place.

The page draws it as it draws the palpation map, so the columns are those of MAP_COLUMNS. Where a
taxel has let go its last estimate stays.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from hc_msgs.msg import TactileEstimate
from numpy.typing import NDArray

from hc_bringup.dashboard.palpation import LARGEST_LOG_STD, MAP_COLUMNS
from hc_bringup.dashboard.taps import Arrival
from hc_estimator.stream.array_status import why_no_places
from hc_msgs_py.units import METRE_IN_MM
from hc_msgs_py.wire_arrays import ArraysDecoder

MOST_SHOWN: Final = 4096
"""Of more taxels only every second, third ... row and column is shown: frames stay bounded."""

ARRAY_TYPE: Final = "hc_msgs/msg/TactileEstimate"

_PLACE: Final = {name: index for index, name in enumerate(MAP_COLUMNS)}


def arrays_of(kinds: Mapping[str, Sequence[str]]) -> list[str]:
    """Return the topics of tactile arrays among all topics with their types."""
    return sorted(name for name, types in kinds.items() if ARRAY_TYPE in types)


def chosen_array(topics: Sequence[str], own: str) -> str:
    """Return the array that the page shows: that of its namespace, or else the only one.

    Args:
        topics: of arrays that somebody publishes.
        own: that of the page's namespace.
    """
    return topics[0] if len(topics) == 1 else own


class TaxelMap:
    """What each taxel of an array last said of the tissue under it.

    Attributes:
        version: changes whenever an estimate does.
    """

    def __init__(self) -> None:
        self.version = 0
        self._decoder = ArraysDecoder(TactileEstimate)
        self._record: Any = None
        self._undecodable = 0
        self._touched = np.zeros(0, bool)
        self._kept = np.zeros((0, 4))  # K, its deviation, n, its deviation

    def take(self, arrivals: list[Arrival]) -> None:
        """Take messages of tactile/estimate in the order in which they came."""
        for arrival in arrivals:
            try:
                _, record = self._decoder.decode(arrival.data)
            except ValueError:
                self._undecodable += 1
                continue
            columns, pitch_m = int(record["columns"]), float(record["pitch"])
            if why_no_places(len(record["stiffness"]), columns, pitch_m):
                self._undecodable += 1
                continue
            self._add(record)

    def _add(self, record: Any) -> None:
        before = self._record
        if (
            before is None
            or len(before["stiffness"]) != len(record["stiffness"])
            or before["columns"] != record["columns"]
            or record["sequence"] < before["sequence"]
        ):
            self._touched = np.zeros(len(record["stiffness"]), bool)
            self._kept = np.zeros((len(self._touched), 4))
        self._record = record
        touching = np.asarray(record["contact"], bool)
        self._touched |= touching
        names = ("stiffness", "stiffness_std", "displacement_exponent", "displacement_exponent_std")
        for column, name in enumerate(names):
            self._kept[touching, column] = record[name][touching]
        self.version += 1

    @property
    def _step(self) -> int:
        """Every so-manieth row and column is shown."""
        return max(1, math.ceil(math.sqrt(len(self._touched) / MOST_SHOWN)))

    @property
    def cell_mm(self) -> float:
        """Edge of a cell of the table."""
        if self._record is None:
            return 1.0
        return float(self._record["pitch"]) * METRE_IN_MM * self._step

    def table(self) -> NDArray[np.float64]:
        """Return the taxels that have touched, (taxels, len(MAP_COLUMNS)).

        The first row of the array stands at the top, its middle at (0, 0). What K and n have in
        common is not in the message, nor how deep it went: cov is NaN, deepest infinite.
        """
        if self._record is None:
            return np.empty((0, len(MAP_COLUMNS)))
        columns = int(self._record["columns"])
        stiffness, deviation, exponent, exponent_std = self._kept.T
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = deviation / stiffness
            known = self._touched & (stiffness > 0.0) & (relative < LARGEST_LOG_STD)
        row, column = np.divmod(np.arange(len(known)), columns)
        step = self._step
        shown = np.flatnonzero(known & (row % step == 0) & (column % step == 0))
        pitch_mm = float(self._record["pitch"]) * METRE_IN_MM
        result = np.empty((len(shown), len(MAP_COLUMNS)))
        cells: dict[str, NDArray[np.float64] | float] = {
            "x": (column[shown] - 0.5 * (columns - 1)) * pitch_mm,
            "y": (0.5 * (len(known) // columns - 1) - row[shown]) * pitch_mm,
            "count": 1.0,
            "ln_K": np.log(stiffness[shown]),
            "n": exponent[shown],
            "var_ln_K": relative[shown] ** 2,
            "var_n": exponent_std[shown] ** 2,
            "cov": np.nan,
            "deepest": np.inf,
        }
        for name, values in cells.items():
            result[:, _PLACE[name]] = values
        return result

    @property
    def status(self) -> dict[str, Any] | None:
        """Size of the array and how much of it is known; None before the first estimate."""
        if self._record is None:
            return None
        columns = int(self._record["columns"])
        return {
            "rows": len(self._touched) // columns,
            "columns": columns,
            "touched": int(self._touched.sum()),
            "touching": int(np.count_nonzero(self._record["contact"])),
            "force": float(np.nansum(self._record["force_measured"])),
            "every": self._step,
            "undecodable": self._undecodable,
        }
