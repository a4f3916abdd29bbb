"""Tables of the accuracy experiments, as text for a terminal and as Markdown for the documents."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hc_evaluation.accuracy.columns import COLUMNS, TARGET_COLUMNS, Column, Row


def _cells(columns: Sequence[Column], rows: Sequence[Row]) -> list[list[str]]:
    table = [[name for name, _ in columns]]
    table += [[text(row) for _, text in columns] for row in rows]
    return table


def _aligned(table: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(line[i]) for line in table) for i in range(len(table[0]))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in table
    ]
    return [lines[0], "  ".join("-" * width for width in widths), *lines[1:]]


def text_table(result: Mapping[str, Any]) -> str:
    """Everything that `run_accuracy` found, for a terminal.

    Args:
        result: what `run.run_accuracy` returned.

    Returns:
        Text of several lines.
    """
    lines = []
    met = asked = 0
    for name, experiment in result["experiments"].items():
        lines.append(f"{name}: {experiment['summary']}")
        if "skipped" in experiment:
            lines += [f"  skipped: {experiment['skipped']}", ""]
            continue
        lines += ["  " + line for line in _aligned(_cells(COLUMNS[name], experiment["rows"]))]
        targets = experiment["targets"]
        if targets:
            lines.append("")
            lines += ["  " + line for line in _aligned(_cells(TARGET_COLUMNS, targets))]
        lines.append("")
        met += sum(t["met"] for t in targets)
        asked += len(targets)
    lines.append(
        f"{result['filter']}, {result['seeds']} seeds from {result['first_seed']}: "
        f"{met} of {asked} targets met, {result['seconds']:.0f} s"
    )
    return "\n".join(lines)


def markdown_table(name: str, experiment: Mapping[str, Any]) -> str:
    """One experiment as a Markdown table, its targets below.

    Args:
        name: the experiment.
        experiment: its part of what `run.run_accuracy` returned.

    Returns:
        Markdown; a sentence where it was skipped.
    """
    if "skipped" in experiment:
        return f"Skipped: {experiment['skipped']}."
    parts = [_markdown(_cells(COLUMNS[name], experiment["rows"]))]
    if experiment["targets"]:
        parts.append(_markdown(_cells(TARGET_COLUMNS, experiment["targets"])))
    return "\n\n".join(parts)


def _markdown(table: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(line) + " |" for line in table]
    return "\n".join([lines[0], "|" + " --- |" * len(table[0]), *lines[1:]])


def write_tables(result: Mapping[str, Any], path: Path, origin: str = "") -> tuple[str, ...]:
    """Replace the tables in a Markdown document by newly measured ones.

    A table stands between the lines `<!-- accuracy NAME -->` and `<!-- end -->`.

    Args:
        result: what `run.run_accuracy` returned.
        path: the document; written in place.
        origin: command and commit that the tables come from, a sentence.

    Returns:
        Names of the experiments whose tables were replaced.

    Raises:
        ValueError: a table's end is missing.
    """
    lines = path.read_text(encoding="utf-8").split("\n")
    replaced = []
    for name, experiment in result["experiments"].items():
        start = f"<!-- accuracy {name} -->"
        if start not in lines:
            continue
        first = lines.index(start)
        if "<!-- end -->" not in lines[first:]:
            raise ValueError(f"{path}: no line <!-- end --> after {start}")
        last = lines.index("<!-- end -->", first)
        seeds = experiment.get("seeds", result["seeds"])
        said = f"{seeds} seeds from {result['first_seed']}. {origin}".rstrip()
        table = markdown_table(name, experiment)
        lines[first : last + 1] = [start, f"{said}\n", *table.split("\n"), "<!-- end -->"]
        replaced.append(name)
    path.write_text("\n".join(lines), encoding="utf-8")
    return tuple(replaced)
