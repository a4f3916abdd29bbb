"""Whether rows may be counted at a rate that was given: not where the table tells the time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hc_logger.csv_columns import candidates
from hc_logger.csv_header import Header
from hc_logger.csv_number import time_of_day
from hc_logger.csv_table import Table
from hc_logger.csv_time import unit_of_times
from hc_logger.csv_vocabulary import UNITS, split_name, unit_of

_SAME = 0.02
"""Of a rate: what says the same does no harm."""
_LEAST_ROWS = 3


def why_not_counted(
    rate_hz: float,
    table: Table,
    header: Header,
    numbers: Callable[[Table, int], list[float]],
    cells: Callable[[Table, int], list[str]],
) -> str:
    """Return why a rate is refused: a column with another one. Empty if the rows may be counted.

    A column that tells few rows apart, as a clock of whole seconds, is none.

    Args:
        rate_hz: rows in a second, as somebody said.
        table: the rows.
        header: names of the columns.
        numbers: gives the numbers of a column, in rows that were read already.
        cells: gives its texts.
    """
    names = list(header.names)
    for index in candidates("time", names, table.numeric, header.units)[0] or table.clocks:
        if index in table.numeric:
            times = numbers(table, index)
            below = header.units[index] if header.units else ""
            unit = split_name(names[index], "time")[1] or unit_of(below, "time")
            unit = unit or unit_of_times(times)[0]
            factor = UNITS["time"].get(unit or "", 0.0)
        else:
            times = [t for t in map(time_of_day, cells(table, index)) if t is not None]
            factor = 1.0
        found_hz = _rate(np.array(times) * factor)
        if found_hz and abs(found_hz - rate_hz) > _SAME * rate_hz:
            name = names[index] if names else f"column {index + 1}"
            return (
                f"--rate {rate_hz:g} contradicts its times, {name!r}: they have {found_hz:.4g} "
                "rows a second; leave --rate away, or take that column out if it is wrong"
            )
    return ""


def _rate(time_s: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    """Return the rows in a second that times show; 0 if they show none."""
    steps = np.diff(time_s)
    if len(steps) < _LEAST_ROWS or not np.isfinite(steps).all():
        return 0.0
    onward = float(np.mean(steps > 0.0))
    usual = float(np.median(steps))
    return 1.0 / usual if onward > 0.5 and usual > 0.0 else 0.0
