"""Contacts as a table in a file: CSV, or parquet for other programs; units in the names."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from hc_bringup.errors import UserError
from hc_bringup.report.contacts import Contact
from hc_estimator import PARAMETER_NAMES

PARAMETER_UNITS: Final = ("N/mm^n", "N(s/mm)^p/mm^n", "1", "1")
SUFFIXES: Final = (".csv", ".parquet")


def columns(contacts: Sequence[Contact]) -> dict[str, list[Any]]:
    """Return the table by columns; a name ends in its unit in brackets.

    The covariance stands in ten columns cov_NAME_NAME, in the products of the parameters' units.
    """
    table: dict[str, list[Any]] = {
        "contact [1]": [c.number for c in contacts],
        "start [s]": [c.start_s for c in contacts],
        "end [s]": [c.end_s for c in contacts],
        "samples [1]": [c.samples for c in contacts],
        "rejected [1]": [c.rejected for c in contacts],
        "x [mm]": [float(c.position_mm[0]) for c in contacts],
        "y [mm]": [float(c.position_mm[1]) for c in contacts],
        "travel [mm]": [c.travel_mm for c in contacts],
        "peak_depth [mm]": [c.peak_depth_mm for c in contacts],
        "peak_force [N]": [c.peak_force_n for c in contacts],
        "peak_speed [mm/s]": [c.peak_speed_mm_s for c in contacts],
        "energy_in [mJ]": [c.energy_in_mj for c in contacts],
        "energy_loss [mJ]": [c.energy_loss_mj for c in contacts],
        "force_rmse [N]": [c.force_rmse_n for c in contacts],
        "changes [1]": [c.changes for c in contacts],
        "mismatch_share [1]": [c.mismatch_share for c in contacts],
    }
    table["surface [mm]"] = [c.surface_mm for c in contacts]
    table["surface_std [mm]"] = [c.surface_std_mm for c in contacts]
    for i, (name, unit) in enumerate(zip(PARAMETER_NAMES, PARAMETER_UNITS, strict=True)):
        table[f"{name} [{unit}]"] = [float(c.parameters[i]) for c in contacts]
        table[f"{name}_std [{unit}]"] = [float(c.parameters_std[i]) for c in contacts]
        table[f"{name}_identifiability [1]"] = [float(c.identifiability[i]) for c in contacts]
    for i, one in enumerate(PARAMETER_NAMES):
        for j, other in enumerate(PARAMETER_NAMES[i:], i):
            table[f"cov_{one}_{other}"] = [float(c.covariance[i, j]) for c in contacts]
    return table


def encode(
    contacts: Sequence[Contact], suffix: str, beside: Mapping[str, list[Any]] | None = None
) -> bytes:
    """Return the file's content.

    Args:
        contacts: its rows.
        suffix: .csv or .parquet.
        beside: further columns.

    Raises:
        UserError: if parquet is asked for and its library is not installed.
    """
    table = columns(contacts) | dict(beside or {})
    if suffix == ".parquet":
        return _parquet(table)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    for row in zip(*table.values(), strict=True):
        writer.writerow(["" if isinstance(v, float) and math.isnan(v) else v for v in row])
    return text.getvalue().encode()


def _parquet(table: dict[str, list[Any]]) -> bytes:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise UserError("writing .parquet needs pyarrow: pip install hc-suite[parquet]") from error
    buffer = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.table(table), buffer)
    return buffer.getvalue()


def has_known_suffix(path: Path) -> bool:
    """Whether a file's name says a format that can be written."""
    return path.suffix.lower() in SUFFIXES
