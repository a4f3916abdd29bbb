"""One self-contained HTML file: data, charts, styles; nothing is fetched from anywhere.

Data stand in the page as JSON with numbers in base64; a policy in the page allows its own scripts
by their hashes and nothing else, so that no name in a recording can become a script.
"""

from __future__ import annotations

import base64
import hashlib
import html
import itertools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.plain_json import finite

LIVE: Final = Path(__file__).resolve().parents[1] / "dashboard" / "page"
OWN: Final = Path(__file__).with_name("page")
CHARTS: Final = ("uPlot.iife.min.js", "kit.js", "store.js")
PANELS: Final = ("panels.js", "depth.js", "map.js", "timeline.js", "health.js")


def encode_numbers(values: NDArray[np.float64], *, exact: bool = False) -> dict[str, str]:
    """Return numbers for a page: base64 of float32, or of float64 where that is not enough."""
    kind = "<f8" if exact else "<f4"
    with np.errstate(over="ignore"):
        data = np.ascontiguousarray(values, kind).tobytes()
    return {"type": kind[1:], "base64": base64.b64encode(data).decode("ascii")}


def render(
    title: str, body: str, data: Mapping[str, Any], scripts: Sequence[str], own_script: str
) -> str:
    """Return the page.

    Args:
        title: of the window, plain text.
        body: HTML, every name in it escaped already.
        data: plain data and what encode_numbers gives.
        scripts: files of the live page, beside the charts.
        own_script: file of this package that starts the page.
    """
    code = [
        *(_script((LIVE / name).read_text(encoding="utf-8")) for name in (*CHARTS, *scripts)),
        _script((OWN / own_script).read_text(encoding="utf-8")),
    ]
    style = "\n".join(
        (
            (LIVE / "uPlot.min.css").read_text(encoding="utf-8"),
            (LIVE / "style.css").read_text(encoding="utf-8"),
            (OWN / "report.css").read_text(encoding="utf-8"),
        )
    )
    licence = (LIVE / "uPlot.LICENSE.txt").read_text(encoding="utf-8")
    hashes = " ".join(_hash(text) for text in code)
    policy = (
        f"default-src 'none'; script-src {hashes}; style-src {_hash(style)}; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )
    content = json.dumps(finite(dict(data)), separators=(",", ":"), allow_nan=False)
    # Inside a script element only these could end it or begin a comment.
    content = content.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    return "\n".join(
        (
            "<!doctype html>",
            '<html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{html.escape(policy)}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            f"<title>{html.escape(title)}</title>",
            f"<style>{style}</style></head>",
            f"<body>{body}",
            f"<!-- Charts: uPlot.\n{licence.replace('--', '- -')}-->",
            f'<script type="application/json" id="data">{content}</script>',
            *(f"<script>{text}</script>" for text in code),
            "</body></html>\n",
        )
    )


def table(
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    css_class: str = "",
    notes: Sequence[str] = (),
) -> str:
    """Return a table; all cells are plain text.

    Args:
        head: names of the columns.
        rows: their cells.
        css_class: of the table.
        notes: what stands below each row, across all columns; nothing where it is empty.
    """

    def line(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(c)}</{tag}>" for c in cells) + "</tr>"

    def below(note: str) -> str:
        if not note:
            return ""
        cell = f'<td colspan="{len(head)}"><div>{html.escape(note)}</div></td>'
        return f'<tr class="note">{cell}</tr>'

    lines = [
        line(row, "td") + below(note)
        for row, note in itertools.zip_longest(rows, notes, fillvalue="")
    ]
    return (
        f'<div class="scroll"><table class="{html.escape(css_class)}"><thead>{line(head, "th")}'
        f"</thead><tbody>{''.join(lines)}</tbody></table></div>\n"
    )


def items(lines: Sequence[str]) -> str:
    """Return a list of plain texts; nothing where there are none."""
    if not lines:
        return ""
    return "<ul>" + "".join(f"<li>{html.escape(line)}</li>" for line in lines) + "</ul>\n"


def _script(text: str) -> str:
    """Return a script's text; it must not end its element."""
    if "</script" in text.lower() or "<!--" in text:
        raise ValueError("a script of the page would end its own element")
    return text


def _hash(text: str) -> str:
    digest = hashlib.sha256(text.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"
