"""The options that say how a recording is read, as words of a command line that does it again."""

from __future__ import annotations

import argparse
from typing import Any

from hc_bringup.file_preset import CSV_OPTIONS


def option_words(arguments: argparse.Namespace, name: str, usual: Any = None) -> list[str]:
    """Return an option and its value; nothing where it has its usual one."""
    value = getattr(arguments, name)
    return [] if value == usual else [f"--{name.replace('_', '-')}", str(value)]


def reading_words(arguments: argparse.Namespace) -> list[str]:
    """Return what `recording_input.add_reading_options` declares, a preset's values among them.

    Args:
        arguments: parsed, the preset applied (`recording_input.check`).
    """
    words: list[str] = []
    for name in CSV_OPTIONS:
        words += option_words(arguments, name)
    for name, value in arguments.sensors:
        words += ["--input", f"{name}={value}"]
    return [*words, "--find-surface"] if arguments.find_surface else words
