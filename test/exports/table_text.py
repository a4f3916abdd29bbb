"""A press as a table of text, which tests write as others write their files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

TIME = np.arange(60) * 0.002
DEPTH = np.round(1.0 + 0.5 * np.sin(9 * TIME), 4)
FORCE = np.round(0.2 * DEPTH**1.8, 5)


def write(path: Path, text: str, encoding: str = "utf-8", mark: bytes = b"") -> Path:
    """Write a text; its path."""
    path.write_bytes(mark + text.encode(encoding))
    return path


def rows(form: str, *columns: Any, decimal: str = ".") -> str:
    """Rows of columns, each in the form of a format string."""
    lines = [form.format(*row) for row in zip(*columns, strict=True)]
    return "".join(line.replace(".", decimal) + "\n" for line in lines)
