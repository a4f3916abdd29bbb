"""Tables of the teleoperation benchmark, for a terminal and for the document."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

Row = Mapping[str, Any]


def _number(digits: int, name: str) -> Callable[[Row], str]:
    return lambda row: f"{row[name]:.{digits}f}"


def _contrast(name: str) -> Callable[[Row], str]:
    """A limit cycle has no contrast that anybody could feel."""
    return lambda row: f"{row[name]:.2f}" if row["stable"] else "-"


COLUMNS: tuple[tuple[str, Callable[[Row], str]], ...] = (
    ("method", lambda row: row["method"]),
    ("filter", lambda row: row["filter"] or ""),
    ("round trip ms", lambda row: f"{row['round_trip_ms']:g}"),
    ("stable", lambda row: "yes" if row["stable"] else "NO"),
    ("force error N", _number(2, "force_error_n")),
    ("transparency", _number(2, "transparency")),
    ("peak force N", _number(1, "peak_force_n")),
    ("lump contrast", _contrast("lump_contrast")),
    ("first press", _contrast("first_press_contrast")),
    ("swing mm", _number(2, "oscillation_mm")),
    ("ringing mm", _number(2, "ringing_mm")),
    ("energy made mJ", _number(0, "energy_made_mj")),
)


def _cells(result: Mapping[str, Any]) -> list[list[str]]:
    rows = [
        {**detail, **row} for row, detail in zip(result["rows"], result["details"], strict=True)
    ]
    return [[name for name, _ in COLUMNS]] + [[text(row) for _, text in COLUMNS] for row in rows]


def text_table(result: Mapping[str, Any]) -> str:
    """What `run_teleoperation` found, for a terminal."""
    table = _cells(result)
    widths = [max(len(line[i]) for line in table) for i in range(len(COLUMNS))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in table
    ]
    lines.insert(1, "  ".join("-" * width for width in widths))
    unstable = [row for row in result["rows"] if not row["stable"]]
    by_method: dict[str, list[str]] = {}
    for row in unstable:
        name = row["method"] if row["filter"] is None else f"{row['method']} ({row['filter']})"
        by_method.setdefault(name, []).append(f"{row['round_trip_ms']:g}")
    lines.append("")
    lines += [
        f"{name} is unstable with a round trip of {', '.join(delays)} ms"
        for name, delays in by_method.items()
    ]
    seeds = result["seeds"]
    lines.append(f"{seeds} seed{'s' if seeds > 1 else ''}, {result['seconds']:.0f} s")
    return "\n".join(lines)


def markdown_table(result: Mapping[str, Any]) -> str:
    """The same as a Markdown table."""
    table = _cells(result)
    lines = ["| " + " | ".join(line) + " |" for line in table]
    lines.insert(1, "|" + " --- |" * len(COLUMNS))
    return "\n".join(lines)
