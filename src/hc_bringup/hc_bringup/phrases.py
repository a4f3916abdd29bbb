"""The phrases of what a node says is wrong; they are compared without their numbers."""

from __future__ import annotations

import re

SEPARATOR = "; "
_NUMBER = re.compile(r"\d[\d.]*")


def phrases(said: str) -> list[str]:
    """Return the parts of a line between its semicolons."""
    return [part for part in said.split(SEPARATOR) if part.strip()]


def without_numbers(said: str) -> set[str]:
    """Return the phrases of a line with all numbers left out: they change with every look."""
    return {_NUMBER.sub("", phrase) for phrase in phrases(said)}


def left_of(said: str, others: list[str]) -> str:
    """Return what of a line none of the others says as well; numbers do not count."""
    known = set().union(*map(without_numbers, others))
    return SEPARATOR.join(p for p in phrases(said) if not without_numbers(p) <= known)
