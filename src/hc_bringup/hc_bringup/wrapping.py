"""Long lines at a terminal, broken between words; files and pipes get them whole."""

from __future__ import annotations

import shutil
import sys
import textwrap
from typing import Final, TextIO

from hc_bringup import heartbeat

INDENT: Final = "  "
"""Of the second and further lines, more than that of the first."""


def wrapped(text: str, width: int | None = None, stream: TextIO | None = None) -> str:
    """Return a text as the terminal shows it, every line of it broken between words.

    Args:
        text: any number of lines.
        width: of the terminal; None takes that of the stream, and breaks nothing if it is none.
        stream: where it will be written; None is standard output.
    """
    if width is None:
        if not (stream or sys.stdout).isatty():
            return text
        width = shutil.get_terminal_size().columns
    return "\n".join(_broken(line, width) for line in text.split("\n"))


def _broken(line: str, width: int) -> str:
    if len(line) < width:
        return line
    start = line[: len(line) - len(line.lstrip())]
    return textwrap.fill(
        line.strip(),
        max(width - 1, 20),  # what fills the last column makes some terminals begin a new line
        initial_indent=start,
        subsequent_indent=start + INDENT,
        break_long_words=False,
        break_on_hyphens=False,
    )


def say(text: str) -> None:
    """Print a text now, wrapped at a terminal."""
    print(wrapped(text), flush=True)
    heartbeat.spoke()
