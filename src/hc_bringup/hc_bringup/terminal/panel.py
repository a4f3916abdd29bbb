"""The panel of a run, drawn for a terminal of 60 to 200 columns: every line fits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from rich.box import ROUNDED
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.text import Text

from hc_bringup.terminal.numbers import (
    NOTHING,
    SteadyDecimals,
    engineering,
    file_size,
    fixed,
)
from hc_bringup.terminal.sparkline import sparkline
from hc_bringup.terminal.view import HYPOTHESES, PanelView

NARROWEST: Final = 40
WIDEST: Final = 200
SYMBOLS: Final = ("K", "B", "n", "p")
UNITS: Final = ("N/mm^n", "N(s/mm)^p/mm^n", "", "")
STYLES: Final = {"good": "green", "idle": "dim", "warn": "yellow", "bad": "bold red"}
MARKS: Final = {"good": "●", "idle": "○", "warn": "▲", "bad": "■"}
_NUMBER, _UNIT, _KNOWN, _SPARK = 11, 14, 6, 100
_GAP: Final = "  "


class PanelPainter:
    """Draws panels; remembers how many decimals each parameter had."""

    def __init__(self) -> None:
        self._decimals = [SteadyDecimals() for _ in SYMBOLS]

    def draw(self, view: PanelView, width: int) -> RenderableType:
        """Return the panel for a terminal of a width."""
        outer = max(NARROWEST, min(width, WIDEST))
        inner = outer - 4  # border and padding
        lines = _state(view, inner)
        if view.with_estimates:
            lines = [*self._parameters(view, inner), *_motion(view, inner), *lines]
        lines += [Text("")] if view.warnings() else []
        for warning in view.warnings():
            lines += _wrapped(f"▲ {warning}", inner, "bold yellow")
        lines += _figures(view, inner)
        for other in view.others:
            lines += _wrapped(other, inner, "")
        if view.keys:
            lines.append(Text(""))
            lines += _flow([f"[{key}] {meaning}" for key, meaning in view.keys], inner, "dim")
        if view.choice():
            lines += _wrapped(view.choice(), inner, "dim")
        if view.answer:
            lines += _wrapped(view.answer, inner, "cyan")
        return Panel(
            Group(*lines),
            title=_cut(_title(view), outer - 6),
            title_align="left",
            box=ROUNDED,
            width=outer,
            padding=(0, 1),
        )

    def _parameters(self, view: PanelView, width: int) -> list[Text]:
        """Return the table of the parameters; columns that do not fit are left out."""
        columns = 1 + 2 * (len(_GAP) + _NUMBER) + len(_GAP) + _KNOWN
        with_truth = view.truth is not None and width >= columns + len(_GAP) + _NUMBER
        columns += (len(_GAP) + _NUMBER) if with_truth else 0
        with_unit = width >= columns + len(_GAP) + _UNIT
        columns += (len(_GAP) + _UNIT) if with_unit else 0
        spark = min(_SPARK, width - columns - len(_GAP))

        def line(cells: Sequence[str], unit: str, curve: str) -> str:
            text = cells[0] + "".join(_GAP + cell.rjust(_NUMBER) for cell in cells[1:3])
            if with_unit:
                text += _GAP + unit.ljust(_UNIT)
            text += _GAP + cells[3].rjust(_KNOWN)
            if with_truth:
                text += _GAP + cells[4].rjust(_NUMBER)
            return text + (_GAP + curve if spark >= 6 else "")

        lines = [Text(line((" ", "estimate", "± 2 sd", "known", "true"), "", ""), style="dim")]
        for i, symbol in enumerate(SYMBOLS):
            value, deviation = view.parameters[i], view.deviations[i]
            places = self._decimals[i].update(value, 2.0 * deviation)
            known = view.known[i]
            truth = view.truth[i] if view.truth is not None else math.nan
            cells = (
                symbol,
                fixed(value, places),
                fixed(2.0 * deviation, places),
                f"{math.floor(100.0 * known)} %" if 0.0 <= known <= 1.0 else NOTHING,
                fixed(truth, places),
            )
            curve = sparkline(view.history.parameters[i], spark) if spark >= 6 else ""
            text = Text(line(cells, UNITS[i], curve))
            text.stylize("bold", 0, 1 + len(_GAP) + _NUMBER)
            if curve:
                text.stylize("cyan", len(text) - spark)
            lines.append(text)
        return lines


def _title(view: PanelView) -> str:
    until = f" of {view.duration_s:.0f}" if view.duration_s else ""
    parts = [f"hc: {view.phase} {view.elapsed_s:.1f}{until} s", view.scenario, view.filter]
    return " · ".join(part for part in parts if part)


def _motion(view: PanelView, width: int) -> list[Text]:
    """Return force and depth with their curves."""
    if not math.isfinite(view.force_n):
        return [Text("")]
    half = (width - len(_GAP)) // 2
    cells = []
    for name, value, unit, places, curve in (
        ("force", view.force_n, "N", 3, view.history.force),
        ("depth", view.depth_mm, "mm", 3, view.history.depth),
    ):
        head = f"{name} {fixed(value, places).rjust(9)} {unit}"
        room = half - len(head) - 1
        cells.append((head + " " + sparkline(curve, room) if room >= 4 else head).ljust(half))
    return [Text(""), Text((_GAP.join(cells))[:width])]


def _state(view: PanelView, width: int) -> list[Text]:
    words, level = view.state()
    style = STYLES[level]
    parts = [f"{MARKS[level]} {words}"]
    if view.hypothesis is not None and view.several_hypotheses and not view.silent:
        parts.append(f"leads: {HYPOTHESES[view.hypothesis]}")
    if len(parts[0]) > width:  # why it is silent is worth a second line
        return _wrapped(parts[0], width, style) + _flow(parts[1:], width, style)
    return _flow(parts, width, style)


def _figures(view: PanelView, width: int) -> list[Text]:
    """Return rates and losses, load, bag."""
    figures = [
        f"{view.rate_hz:.0f} Hz",
        f"lost {view.lost}",
        f"refused {view.refused}",
        f"changes {view.changes}",
        f"force error {engineering(view.force_error_n, 'N')}",
    ]
    if view.latency_s is not None:
        median, most = view.latency_s
        figures.append(f"latency {engineering(median, 's')}, 99 % {engineering(most, 's')}")
    lines = [Text(""), *_flow(figures, width)] if view.with_estimates else []
    if view.processor:
        use = [f"{name} {percent:.0f} %" for name, percent in view.processor.items()]
        lines += _flow(["core:", *use], width, "dim")
    if view.bag:
        size = f", {file_size(view.bag_bytes)}" if math.isfinite(view.bag_bytes) else ""
        lines += [Text(_cut(f"bag {view.bag}{size}", width), style="dim")]
    return lines


def _flow(items: Sequence[str], width: int, style: str = "") -> list[Text]:
    """Return items side by side, in as many lines as it takes; none is broken."""
    lines: list[str] = []
    for item in items:
        item = _cut(item, width)
        if lines and len(lines[-1]) + len(_GAP) + len(item) <= width:
            lines[-1] += _GAP + item
        else:
            lines.append(item)
    return [Text(line, style=style) for line in lines]


def _wrapped(text: str, width: int, style: str) -> list[Text]:
    """Return a sentence in lines that fit; the later ones are indented."""
    lines = [""]
    for word in text.split():
        word = _cut(word, width - 2)
        if len(lines[-1]) + 1 + len(word) <= width:
            lines[-1] += f" {word}" if lines[-1].strip() else word
        else:
            lines.append("  " + word)
    return [Text(line, style=style) for line in lines]


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[: max(0, width - 1)] + "…"
