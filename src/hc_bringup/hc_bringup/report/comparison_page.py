"""The page of a comparison: curves on top of one another, and a table of errors, honesty, cost."""

from __future__ import annotations

import html
import itertools
import math
import shlex
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.dashboard.columns import INDEX, PARAMETERS
from hc_bringup.report.comparison import Entry, Scores
from hc_bringup.report.page import encode_numbers, items, render
from hc_bringup.report.rows import page_rows
from hc_bringup.terminal.numbers import counted

MOST_POINTS: Final = 1500
HONEST: Final = 3.0
"""So many times its ideal, or the ideal so many times it, a NEES may be."""
CURVES: Final = (*PARAMETERS, *(f"{name}_std" for name in PARAMETERS))

Figure = tuple[
    str, str, Callable[[Scores], float], Callable[[float], str], Callable[[float], float]
]


def _percent(value: float) -> str:
    return f"{100.0 * value:.2g} %" if value < 0.1 else f"{100.0 * value:.0f} %"


def _millinewton(value: float) -> str:
    return f"{1e3 * value:.0f}" if value >= 1.0 else f"{1e3 * value:.3g}"


def _distance(ideal: float) -> Callable[[float], float]:
    """Return how far a figure is from its ideal, by ratio."""
    return lambda value: abs(math.log(max(value, 1e-12) / ideal))


def _three_digits(value: float) -> str:
    return f"{float(f'{value:.3g}'):g}"


def _same(value: float) -> float:
    return value


def _no_contest(_value: float) -> float:
    """Return NaN: less of it is not better, for a filter that never says so."""
    return math.nan


FIGURES: Final[tuple[Figure, ...]] = (
    ("force error", "one step ahead, RMS [mN]", lambda s: s.force_rms_n, _millinewton, _same),
    ("", "0.5 s ahead, RMS [mN]", lambda s: s.ahead_rms_n, _millinewton, _same),
    ("error of", "K, median", lambda s: float(s.parameter_errors[0]), _percent, _same),
    ("", "B", lambda s: float(s.parameter_errors[1]), _percent, _same),
    ("", "n", lambda s: float(s.parameter_errors[2]), _percent, _same),
    ("", "p", lambda s: float(s.parameter_errors[3]), _percent, _same),
    ("honesty", "NEES (4)", lambda s: s.nees, _three_digits, _distance(4.0)),
    ("", "NIS (2)", lambda s: s.nis, _three_digits, _distance(2.0)),
    ("", "K within 3 sd", lambda s: s.inside, _percent, lambda v: -v),
    ("", "says that the law does not fit", lambda s: s.mismatch, _percent, _no_contest),
    ("", "samples refused", lambda s: s.refused, _percent, _no_contest),
    ("cost", "a step [us]", lambda s: s.microseconds, lambda v: f"{float(f'{v:.2g}'):g}", _same),
)


def comparison_page(table: Sequence[Sequence[Entry]], command: Sequence[str]) -> str:
    """Return the page.

    Args:
        table: one list a recording, as `compare` gives it.
        command: the command line that makes it.
    """
    content = {"recordings": [_curves(entries) for entries in table if entries]}
    parts = [_header(table)]
    for number, entries in enumerate(entries for entries in table if entries):
        parts.append(_recording(number, entries))
    parts.append(
        '<section class="panel full"><h2>How to make it again</h2><pre>'
        f"{html.escape(shlex.join(command))}</pre></section></main>"
    )
    names = ", ".join(dict.fromkeys(entry.variant.label for row in table for entry in row))
    return render(f"Comparison: {names}", "".join(parts), content, (), "compare.js")


def winners(entries: Sequence[Entry]) -> list[str]:
    """Return in words who was best at what."""
    if entries and not any(entry.data.estimates["contact"].any() for entry in entries):
        return ["None was ever in contact, so there is nothing to compare: hc doctor says why."]
    sentences = []
    for what, of, ideal in (
        ("foretells the force best, half a second ahead", lambda s: s.ahead_rms_n, None),
        ("is closest to the true K", lambda s: float(s.parameter_errors[0]), None),
        ("is the most honest (NEES)", lambda s: s.nees, 4.0),
        ("is the quickest", lambda s: s.microseconds, None),
    ):
        found = [(of(entry.scores), entry.variant.label) for entry in entries]
        found = [(value, label) for value, label in found if math.isfinite(value)]
        if len(found) > 1:
            judge = _distance(ideal) if ideal is not None else _same
            value, label = min(found, key=lambda pair: judge(pair[0]))
            if ideal is not None and judge(value) > math.log(HONEST):
                text = f"NEES {value:.0f} at best, of {label}"
                sentences.append(f"None is honest about K, B, n and p: {text}.")
            else:
                sentences.append(f"{label} {what}.")
    return sentences


def _header(table: Sequence[Sequence[Entry]]) -> str:
    labels = list(dict.fromkeys(entry.variant.label for row in table for entry in row))
    boxes = "".join(
        f'<label class="variant number-{i % 8}"><input type="checkbox" data-variant="{i}" checked> '
        f"<span>{html.escape(label)}</span></label>"
        for i, label in enumerate(labels)
    )
    recordings = len([row for row in table if row])
    has_truth = any(entry.data.truth is not None for row in table for entry in row)
    true = '<span class="key ink">true</span>' if has_truth else ""
    return (
        f'<header><h1>Comparison</h1><p id="headline">{len(labels)} ways to estimate, '
        f"{counted(recordings, 'recording')}</p>"
        '<div class="tools"><button id="whole" type="button" hidden>Whole recording</button>'
        '<button id="theme" type="button" aria-label="light or dark">◐</button></div></header>'
        f'<main class="report"><section class="panel full variants"><h2>Shown</h2>{boxes}'
        f"{true}</section>"
        '<p class="hint">Drag over a chart to look closer; double-click for the whole. '
        "Curves that a frame cuts go on. Bands are left out here: hc report shows them. "
        "Errors and honesty of all are over the same samples: those that most of them used in "
        "contact, without the first second. Errors of the parameters and NEES need a recording "
        "that knows the truth.</p>"
    )


def _recording(number: int, entries: Sequence[Entry]) -> str:
    charts = "".join(
        f'<section class="panel" data-curve="{name}" data-recording="{number}">'
        f"<h2>{html.escape(title)}</h2></section>"
        for name, title in (
            ("K", "K [N/mmⁿ]"),
            ("B", "B [N(s/mm)ᵖ/mmⁿ]"),
            ("n", "n"),
            ("p", "p"),
            ("rms", "force error one step ahead [mN, RMS]"),
            ("nis", "mean NIS"),
        )
    )
    return (
        f'<section class="panel full"><h2>{html.escape(entries[0].data.name)}</h2>'
        f"{items(winners(entries))}{_table(entries)}</section>{charts}"
    )


def _table(entries: Sequence[Entry]) -> str:
    shown = [
        figure for figure in FIGURES if any(math.isfinite(figure[2](e.scores)) for e in entries)
    ]
    group_of: dict[str, str] = {}
    group = ""
    for figure in FIGURES:
        group = figure[0] or group
        group_of[figure[1]] = group
    groups = [
        (name, len(list(members)))
        for name, members in itertools.groupby(shown, lambda figure: group_of[figure[1]])
    ]
    head = "<tr><th></th>" + "".join(
        f'<th colspan="{span}">{html.escape(name)}</th>' for name, span in groups
    )
    head += "</tr><tr><th></th>" + "".join(f"<th>{html.escape(f[1])}</th>" for f in shown) + "</tr>"
    best = [_best(entries, figure) for figure in shown]
    rows = []
    for entry in entries:
        cells = [f"<td>{html.escape(entry.variant.label)}</td>"]
        for figure, least in zip(shown, best, strict=True):
            value = figure[2](entry.scores)
            text = html.escape(figure[3](value)) if math.isfinite(value) else "–"
            wins = math.isfinite(value) and figure[4](value) == least
            cells.append(f'<td class="best">{text}</td>' if wins else f"<td>{text}</td>")
        rows.append("<tr>" + "".join(cells) + "</tr>")
    return (
        f'<div class="scroll"><table class="numbers scores"><thead>{head}</thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _best(entries: Sequence[Entry], figure: Figure) -> float:
    values = [figure[2](entry.scores) for entry in entries]
    judged = [figure[4](value) for value in values if math.isfinite(value)]
    return min(judged) if len(judged) > 1 else math.nan


def _curves(entries: Sequence[Entry]) -> dict[str, Any]:
    """Return the curves of a recording; every variant has times of its own."""
    variants = []
    for entry in entries:
        rows = _thinned(page_rows(entry.data))
        curves = {name: encode_numbers(rows[:, INDEX[name]]) for name in CURVES}
        curves["time"] = encode_numbers(rows[:, INDEX["time"]], exact=True)
        rms, nis = _blocks(entry, rows[:, INDEX["time"]])
        curves["rms"], curves["nis"] = encode_numbers(1e3 * rms), encode_numbers(nis)
        variants.append({"label": entry.variant.label, "curves": curves})
    data = entries[0].data
    rows = _thinned(page_rows(data))
    truth = None
    if data.truth is not None:
        truth = {name: encode_numbers(rows[:, INDEX[f"{name}_true"]]) for name in PARAMETERS}
        truth["time"] = encode_numbers(rows[:, INDEX["time"]], exact=True)
    return {"name": data.name, "variants": variants, "truth": truth}


def _thinned(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    return rows[:: -(-len(rows) // MOST_POINTS)]


def _blocks(
    entry: Entry, times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return force error (RMS) and mean NIS around each time, over a hundredth of it all."""
    data = entry.data
    half = 0.005 * float(data.time_s[-1] - data.time_s[0])
    begin = np.searchsorted(data.time_s, times - half)
    end = np.maximum(np.searchsorted(data.time_s, times + half, side="right"), begin + 1)
    square = (data.force_n - data.force_predicted_n) ** 2
    return np.sqrt(_mean_between(square, begin, end)), _mean_between(data.nis, begin, end)


def _mean_between(
    values: NDArray[np.float64], begin: NDArray[np.intp], end: NDArray[np.intp]
) -> NDArray[np.float64]:
    known = np.isfinite(values)
    sums = np.append(0.0, np.cumsum(np.where(known, values, 0.0)))
    counts = np.append(0, np.cumsum(known))
    end = np.minimum(end, len(values))
    number = counts[end] - counts[begin]
    total = np.maximum(sums[end] - sums[begin], 0.0)
    mean: NDArray[np.float64] = np.where(number > 0, total / np.maximum(number, 1), np.nan)
    return mean
