"""The word that was probably meant, for messages about one that is not known."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def hint(word: str, known: Iterable[str], what: str) -> str:
    """Return "did you mean ...?" where a known word is near, else all that are known.

    Args:
        word: what was typed.
        known: what there is.
        what: its kind, in the plural.
    """
    known = list(known)
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.7)
    return f"did you mean {close[0]}?" if close else f"{what}: {', '.join(known) or 'none'}"
