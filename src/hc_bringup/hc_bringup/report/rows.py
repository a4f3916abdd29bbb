"""A run in the form of the live page: rows, cells of the map, contacts and events.

A report is the live page at rest, so it gets the same columns; its rows are as long as it takes to
have no more than some thousands of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.cut_time import cut_gaps
from hc_bringup.dashboard.columns import COLUMNS, INDEX, PARAMETERS
from hc_bringup.dashboard.digest import Digest
from hc_bringup.dashboard.palpation import PalpationMap
from hc_bringup.report.contacts import Contact
from hc_bringup.run_data import RunData

Array = NDArray[np.float64]

MOST_ROWS: Final = 4000
LEAST_ROW_NS: Final = 1_000_000
CHANGE, CONTACT_MADE, CONTACT_LOST, MISMATCH = 1, 2, 3, 17
"""Kinds of hc_msgs/EstimatorEvent that can be told from the estimates themselves."""
MOST_EVENTS: Final = 500
SAME_MISFIT_S: Final = 0.5


def page_rows(data: RunData) -> Array:
    """Return the run as rows of the live page, (rows, columns)."""
    stamps = np.rint(data.time_s * 1e9).astype(np.int64)
    keep = _in_order(stamps)
    drawn_s = cut_gaps(data.time_s[keep]).drawn_s  # in a long gap there is nothing to tell
    span = round((drawn_s[-1] - drawn_s[0]) * 1e9)
    digest = Digest(max(LEAST_ROW_NS, -(-span // MOST_ROWS)))
    table = data.estimates[keep]
    rows = np.concatenate([digest.add(table, stamps[keep], estimates=True), digest.flush()])
    rows[:, INDEX["time"]] += data.time_s[keep][0]
    last = np.searchsorted(data.time_s[keep], rows[:, INDEX["time"]] - 1e-9)
    last = np.minimum(last, len(table) - 1)
    if data.truth is not None:
        for name, values in zip(PARAMETERS, data.truth[keep][last].T, strict=True):
            rows[:, INDEX[f"{name}_true"]] = values
    if data.tip is not None:
        for name, values in zip(("tip_x", "tip_y"), data.tip.position_mm.T, strict=True):
            rows[:, INDEX[name]] = np.interp(rows[:, INDEX["time"]], data.tip.time_s, values)
    return rows


def map_cells(data: RunData, rows: Array) -> tuple[float, Array]:
    """Return the cells of the palpation map as the live page would have them, and their size."""
    cells = PalpationMap()
    if data.tip is not None:
        # A run at rest knows the tip at every row.
        for row in rows:
            cells.add_rows(row[None])
            cells.add_tip(*(float(row[INDEX[name]]) for name in ("time", "tip_x", "tip_y")))
    return cells.cell_mm, cells.table()


def page_contacts(contacts: Sequence[Contact]) -> list[dict[str, Any]]:
    """Return contacts as the live page has them."""
    return [
        {
            "number": contact.number,
            "start": contact.start_s,
            "end": contact.end_s,
            "parameters": contact.parameters.tolist(),
            "std": contact.parameters_std.tolist(),
            "stiffness_exponent_covariance": float(contact.covariance[0, 2]),
            "peak_force": contact.peak_force_n,
            "peak_depth": contact.peak_depth_mm,
            "force_rmse": contact.force_rmse_n,
            "position": contact.position_mm.tolist(),
            "mismatch": contact.mismatch_share > 0.0,
            "mismatch_share": contact.mismatch_share,
            "changes": contact.changes,
        }
        for contact in contacts
    ]


def page_events(data: RunData, contacts: Sequence[Contact]) -> list[dict[str, Any]]:
    """Return what was recorded on hc/events, else what can be told from the estimates."""
    if data.events is not None:
        events = [(e.time_s, e.kind, e.reason) for e in data.events if e.time_s >= 0.0]
    else:
        began = data.model_mismatch & ~np.append(False, data.model_mismatch[:-1])
        events = [
            *((t, CHANGE, "") for t in data.time_s[data.change_detected].tolist()),
            *((t, MISMATCH, "") for t in data.time_s[began].tolist()),
            *((c.start_s, CONTACT_MADE, f"contact {c.number}") for c in contacts),
            *(
                (c.end_s, CONTACT_LOST, f"contact {c.number} after {c.duration_s:.2f} s")
                for c in contacts
            ),
        ]
    events = _each_once(sorted(events))
    return [{"time": t, "kind": k, "reason": r} for t, k, r in events[-MOST_EVENTS:]]


def _each_once(events: Sequence[tuple[float, int, str]]) -> list[tuple[float, int, str]]:
    """Leave out a misfit that comes back within half a second: that is the same one."""
    kept: list[tuple[float, int, str]] = []
    latest = -np.inf
    for event in events:
        again = event[1] == MISMATCH and event[0] - latest < SAME_MISFIT_S
        latest = event[0] if event[1] == MISMATCH else latest
        if not again:
            kept.append(event)
    return kept


def column_blocks(rows: Array) -> dict[str, Array]:
    """Return the columns that say anything, by name."""
    return {
        name: rows[:, place]
        for place, name in enumerate(COLUMNS)
        if np.isfinite(rows[:, place]).any()
    }


def _in_order(stamps: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mark the samples that are later than all before them."""
    highest = np.maximum.accumulate(stamps)
    return np.append(True, stamps[1:] > highest[:-1])
