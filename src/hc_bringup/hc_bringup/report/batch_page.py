"""The page of a batch: what was found in how many recordings, charts over all, and what failed."""

from __future__ import annotations

import collections
import html
import itertools
import math
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from hc_bringup.batch.tables import TOUCHES, Done, site_rows
from hc_bringup.batch.variants import Variant
from hc_bringup.batch.work import recording_units
from hc_bringup.report.page import encode_numbers, items, render, table
from hc_bringup.sites import SITE
from hc_bringup.terminal.numbers import counted
from hc_estimator import PARAMETER_NAMES

MOST_ROWS: Final = 1000
MOST_POINTS: Final = 20_000
MOST_REASONS: Final = 30
MOST_CHARTED: Final = 6
"""Variants with a colour of their own in the charts."""
_CHARTED: Final = (*PARAMETER_NAMES, "force_predicted_rmse", "nis_mean")
_TITLES: Final = (
    ("stiffness", "K [N/mmⁿ]"),
    ("damping", "B [N(s/mm)ᵖ/mmⁿ]"),
    ("displacement_exponent", "n"),
    ("velocity_exponent", "p"),
    ("force_predicted_rmse", "force error one step ahead [mN, RMS]"),
    ("nis_mean", "mean NIS (ideal 2)"),
)


@dataclass
class _Sums:
    """What the page needs of all results, whatever their number."""

    recordings: set[str] = field(default_factory=set)
    read: set[str] = field(default_factory=set)  # with a result of one variant at least
    without: set[str] = field(default_factory=set)  # of one variant at least
    contacts: int = 0
    samples: int = 0
    seconds: float = 0.0
    reasons: collections.Counter[str] = field(default_factory=collections.Counter)
    example: dict[str, str] = field(default_factory=dict)
    values: dict[str, list[list[float]]] = field(default_factory=dict)
    failures: collections.Counter[str] = field(default_factory=collections.Counter)
    rows: list[list[str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    count: int = 0
    by_place: bool = False


def batch_page(
    results: Iterable[Done], variants: Sequence[Variant], command: Sequence[str], *, complete: bool
) -> str:
    """Return the page.

    Args:
        results: in the order of the recordings.
        variants: ways to estimate.
        command: the command line that makes it.
        complete: whether all was done.
    """
    sums = _Sums(values={variant.label: [] for variant in variants})
    for number, (_, group) in enumerate(itertools.groupby(results, lambda done: done.name), 1):
        for done in group:
            _add(sums, number, done, with_variant=len(variants) > 1)
    parts = [_header(sums, complete=complete), _variants(sums, variants), _reasons(sums)]
    parts += [
        f'<section class="panel" data-curve="{name}"><h2>{html.escape(title)}</h2></section>'
        for name, title in _TITLES
    ]
    parts.append(_recordings(sums, with_variant=len(variants) > 1))
    parts.append(
        '<section class="panel full"><h2>How to make it again</h2><pre>'
        f"{html.escape(shlex.join(command))}</pre></section></main>"
    )
    charted = [_curves(v.label, sums.values[v.label]) for v in variants[:MOST_CHARTED]]
    title = f"Batch of {len(sums.recordings)} recordings"
    return render(title, "".join(parts), {"variants": charted}, (), "batch.js")


def _add(sums: _Sums, number: int, done: Done, *, with_variant: bool) -> None:
    row, reason, label = done.result["recording"], done.result["reason"], done.variant.label
    found = _found(done)
    sums.recordings.add(done.name)
    sums.by_place |= bool(done.result["places"])
    if row and not reason and done.name not in sums.read:
        # What has no result has no length either: it may be its time that is wrong.
        sums.read.add(done.name)
        sums.samples += row["samples"]
        sums.seconds += row["duration"] if math.isfinite(row["duration"]) else 0.0
    if reason:
        sums.without.add(done.name)
        sums.failures[label] += 1
        sums.reasons[reason] += 1
        sums.example.setdefault(reason, done.name)
    else:
        sums.contacts += row["contacts"]
        for _, one in found:
            if math.isnan(one[PARAMETER_NAMES[0]]):
                continue  # no touch that counts
            deviations = [one[f"{name}_std"] for name in PARAMETER_NAMES]
            share = one["mismatch_share"]
            values = [one[name] for name in _CHARTED]
            sums.values[label].append([float(number), *values, *deviations, share])
    sums.count += len(found)
    if sums.count <= MOST_ROWS:
        sums.rows += [
            _row(f"{number}  {done.name}{which}", one, done, with_variant=with_variant)
            for which, one in found
        ]
        said = [done.result["reason"], *done.result["notes"]]
        # Of a recording with places they are told once.
        sums.notes += [""] * (len(found) - 1) + ["; ".join(filter(None, said))]


def _found(done: Done) -> list[tuple[str, dict[str, Any]]]:
    """Return what a result says of its recording, or of each of its places: which, and values."""
    row = done.result["recording"]
    places = site_rows(done, ()) if done.result["places"] else []
    units = recording_units()
    names = [f"{name}{what}" for name in PARAMETER_NAMES for what in ("", "_std")]
    return [
        (
            f", site {place[SITE]}",
            row
            | {name: place[f"{name} [{units[name]}]"] for name in names}
            | {"contacts": place[TOUCHES]},
        )
        for place in places
    ] or [("", row)]


def _row(name: str, row: dict[str, Any], done: Done, *, with_variant: bool) -> list[str]:
    begin = [name, *([done.variant.label] if with_variant else [])]
    if done.result["reason"]:
        return [*begin, *([""] * 8)]
    return [
        *begin,
        f"{row['duration']:.1f}",
        str(row["contacts"]),
        *(_value(row[name], row[f"{name}_std"]) for name in PARAMETER_NAMES),
        f"{1e3 * row['force_predicted_rmse']:.3g}",
        f"{row['nis_mean']:.2f}",
    ]


def _value(value: float, deviation: float) -> str:
    """Return a parameter of a row; nothing where no place was touched as it was asked for."""
    return "" if math.isnan(value) else f"{value:.3g} ± {2.0 * deviation:.1g}"


def _header(sums: _Sums, *, complete: bool) -> str:
    recordings, read = len(sums.recordings), len(sums.read)
    what = "place of a recording" if sums.by_place else "recording"
    of_which = "" if read == recordings else f", {read:,} with a result"
    lines = [
        f"{counted(recordings, 'recording', ',')}{of_which}: {sums.samples:,} samples, "
        f"{_time(sums.seconds)}; {counted(sums.contacts, 'contact', ',')} found."
    ]
    if read < recordings:
        lines.append(f"{recordings - read:,} without a result, see below.")
    if some := len(sums.without & sums.read):
        lines.append(f"{some:,} without a result of some variant, see below.")
    if not complete:
        lines.append("Not complete: this batch was ended early; hc batch --resume goes on.")
    return (
        f'<header><h1>Batch</h1><p id="headline">{counted(recordings, "recording", ",")}</p>'
        '<div class="tools"><button id="theme" type="button" aria-label="light or dark">◐</button>'
        f'</div></header><main class="report"><section class="panel full">{items(lines)}</section>'
        f'<p class="hint">Each point is a {what}, in the order of the table below. Values are '
        "those at its end.</p>"
    )


def _time(seconds: float) -> str:
    return f"{seconds / 3600.0:.1f} hours" if seconds >= 3600.0 else f"{seconds / 60.0:.1f} minutes"


def _variants(sums: _Sums, variants: Sequence[Variant]) -> str:
    """Return medians over all recordings, a row for each variant."""
    head = ["", "results", "none", "K", "B", "n", "p", "force error [mN]", "NIS", "law misfits"]
    rows = []
    for variant in variants:
        found = np.array(sums.values[variant.label]).reshape(-1, len(_CHARTED) + 6)
        name = variant.label or f"{variant.configuration['filter']}"
        row = [name, str(len(found)), str(sums.failures[variant.label])]
        if len(found):
            low, middle, high = np.nanpercentile(found[:, 1:5], (5.0, 50.0, 95.0), axis=0)
            row += [
                f"{m:.3g} ({a:.3g} to {b:.3g})" for a, m, b in zip(low, middle, high, strict=True)
            ]
            row += [f"{1e3 * np.nanmedian(found[:, 5]):.3g}", f"{np.nanmedian(found[:, 6]):.2f}"]
            row.append(f"{100.0 * np.nanmean(found[:, -1]):.1f} %")
        else:
            row += ["–"] * 7
        rows.append(row)
    return (
        '<section class="panel full"><h2>Over all recordings: median (5 to 95 %)</h2>'
        f'{table(head, rows, "numbers")}<p id="key"></p></section>'
    )


def _reasons(sums: _Sums) -> str:
    if not sums.reasons:
        return ""
    rows = [
        [reason, str(count), sums.example[reason]]
        for reason, count in sorted(sums.reasons.items(), key=lambda pair: (-pair[1], pair[0]))
    ]
    more = len(rows) - MOST_REASONS
    note = f"<p>and {more} more reasons: see recordings.csv</p>" if more > 0 else ""
    found = table(["reason", "results", "for example"], rows[:MOST_REASONS], "reasons")
    return f'<section class="panel full"><h2>Without a result</h2>{found}{note}</section>'


def _recordings(sums: _Sums, *, with_variant: bool) -> str:
    head = ["recording", *(["variant"] if with_variant else []), "s", "contacts"]
    head += ["K", "B", "n", "p", "force error [mN]", "NIS"]
    more = sums.count - len(sums.rows)
    table_of_all = "sites.csv" if sums.by_place else "recordings.csv"
    note = f"<p>and {more:,} more: {table_of_all} has all of them</p>" if more > 0 else ""
    return (
        '<section class="panel full"><h2>Recordings (± 2 standard deviations)</h2>'
        f"{table(head, sums.rows, 'numbers batch', sums.notes)}{note}</section>"
    )


def _curves(label: str, values: Sequence[Sequence[float]]) -> dict[str, Any]:
    """Return the points of a variant, no more than can be told apart."""
    found = np.array(values).reshape(-1, len(_CHARTED) + 6)
    found = found[:: -(-max(1, len(found)) // MOST_POINTS)]
    points: dict[str, Any] = {"label": label, "number": encode_numbers(found[:, 0], exact=True)}
    for i, name in enumerate(_CHARTED):
        scale = 1e3 if name == "force_predicted_rmse" else 1.0
        points[name] = encode_numbers(scale * found[:, 1 + i])
    for i, name in enumerate(PARAMETER_NAMES):
        points[f"{name}_std"] = encode_numbers(found[:, 1 + len(_CHARTED) + i])
    return points
