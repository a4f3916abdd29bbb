"""Tables of the accuracy experiments, as text for a terminal and as Markdown for the documents."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hc_evaluation.accuracy.columns import COLUMNS, TARGET_COLUMNS, Column, Row
from hc_evaluation.accuracy.run import EXPERIMENTS
from hc_evaluation.places import names_of, places_of, write_place

SUMMARY = "accuracy summary"
"""Place of the table of all experiments."""
OLDER = "Of the pages, each of which says what gave it; the newest: "
"""Before the origin of that table where only some of the experiments were measured."""


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


def markdown_tables(name: str, experiment: Mapping[str, Any]) -> dict[str, str]:
    """One experiment as Markdown: its table, and that of its targets.

    Args:
        name: the experiment.
        experiment: its part of what `run.run_accuracy` returned.

    Returns:
        Markdown by what is added to the name of its CSV; a sentence where it was skipped.
    """
    if "skipped" in experiment:
        return {"": f"Skipped: {experiment['skipped']}."}
    tables = {"": _markdown(_cells(COLUMNS[name], experiment["rows"]))}
    if experiment["targets"]:
        tables["targets"] = _markdown(_cells(TARGET_COLUMNS, experiment["targets"]))
    return tables


def _markdown(table: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(line) + " |" for line in table]
    return "\n".join([lines[0], "|" + " --- |" * len(table[0]), *lines[1:]])


def write_tables(result: Mapping[str, Any], document: Path, origin: str = "") -> tuple[str, ...]:
    """Replace the tables of a document and of its evidence by newly measured ones (`places`).

    Args:
        result: what `run.run_accuracy` returned.
        document: it, or pages of its evidence, have the places `accuracy NAME`.
        origin: command and commit that the tables come from, a sentence.

    Returns:
        Names of the experiments whose tables were replaced.

    Raises:
        OSError: a file cannot be read or written.
        ValueError: a place has no end.
    """
    wanted = names_of(document)
    replaced = []
    for name, experiment in result["experiments"].items():
        if f"accuracy {name}" not in wanted:
            continue
        said = _said(result, experiment, origin)
        write_place(document, f"accuracy {name}", said, markdown_tables(name, experiment))
        replaced.append(name)
    if SUMMARY in wanted and any(result["experiments"][name]["targets"] for name in replaced):
        here = {name for name, e in EXPERIMENTS.items() if not e.by_name_only}
        older = [name for name in here - set(replaced) if f"accuracy {name}" in wanted]
        said = f"{OLDER}{origin}" if older else origin
        write_place(document, SUMMARY, said, {"": summary(document)})
    return tuple(replaced)


def _said(result: Mapping[str, Any], experiment: Mapping[str, Any], origin: str) -> str:
    seeds = experiment.get("seeds", result["seeds"])
    return f"{seeds} seed{'s' if seeds > 1 else ''} from {result['first_seed']}. {origin}".rstrip()


def summary(document: Path) -> str:
    """What each experiment asks and how many of its targets are met, as its page says."""
    table = [["experiment", "what it asks", "targets met", "not met"]]
    places = {place.name: place for place in places_of(document)}
    for name, asked in EXPERIMENTS.items():
        place = places.get(f"accuracy {name}")
        if place is None or not place.tables or place.tables[-1][0][0] != TARGET_COLUMNS[0][0]:
            continue
        rows = place.tables[-1][1:]
        missed = [row[0] for row in rows if row[-1] != "yes"]
        link = f"[{name}]({place.page.relative_to(document.parent).as_posix()})"
        met = f"{len(rows) - len(missed)} of {len(rows)}"
        more = f"; {len(missed) - 1} more" if len(missed) > 1 else ""
        table.append([link, asked.summary, met, f"{''.join(missed[:1])}{more}"])
    return _markdown(table)
