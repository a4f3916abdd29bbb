"""The one kind of error that the command line shows: a line for the user and an exit status."""

from __future__ import annotations

import re
from typing import Final

WRONG_USE: Final = 2
FAILURE: Final = 1
_LONGEST_WORD: Final = 300
"""Of a path there are longer ones, but none that somebody reads to its end."""
_KEPT: Final = (80, 20)


class UserError(Exception):
    """Something the user can act on: one line that says what is wrong and what to do."""

    def __init__(self, message: str, status: int = FAILURE) -> None:
        super().__init__(shortened(" ".join(message.split())))
        self.status = status


def shortened(line: str) -> str:
    """Return a line whose words of hundreds of characters are cut in their middle.

    A file given for a name, or a value that a script put together, would push what is wrong with it
    off the screen.
    """

    def cut(word: re.Match[str]) -> str:
        text = word[0]
        return f"{text[: _KEPT[0]]}...({len(text)} characters)...{text[-_KEPT[1] :]}"

    return re.sub(rf"\S{{{_LONGEST_WORD},}}", cut, line)
