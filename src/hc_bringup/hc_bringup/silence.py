"""When estimates that came and come no more are called silent: one answer for run and panel."""

from __future__ import annotations

from typing import Final

SILENT_S: Final = 1.0


def is_silent(since_s: float) -> bool:
    """Whether so long without an estimate [s] is silence."""
    return since_s > SILENT_S
