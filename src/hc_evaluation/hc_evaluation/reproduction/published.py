"""The figures that the papers print, as data with their source (published.yaml)."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

PUBLISHED_FILE = Path(__file__).resolve().parent / "published.yaml"


@functools.cache
def published_papers() -> Mapping[str, Any]:
    """All published figures by paper and table, as in published.yaml."""
    data: Mapping[str, Any] = yaml.safe_load(PUBLISHED_FILE.read_text(encoding="utf-8"))
    return data


def published_table(key: str) -> Mapping[str, Any]:
    """One published table.

    Args:
        key: paper and table, "rwstukf_sensors_2018.table_1" say; empty for none.

    Raises:
        KeyError: there is no such table.
    """
    if not key:
        return {}
    paper, table = key.split(".")
    result: Mapping[str, Any] = published_papers()[paper][table]
    return result


def published_value(key: str, column: str, row: str) -> float | None:
    """One printed number, None where the paper prints none."""
    entry = published_table(key).get(column, {})
    value = entry.get(row) if isinstance(entry, Mapping) else None
    return None if value is None else float(value)


def unit_of(key: str) -> tuple[str, float]:
    """Unit in which a table prints its forces, and how many of it make one N."""
    unit = str(published_table(key).get("unit", "N"))
    return unit, 1000.0 if unit == "mN" else 1.0
