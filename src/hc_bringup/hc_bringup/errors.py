"""The one kind of error that the command line shows: a line for the user and an exit status."""

from __future__ import annotations

from typing import Final

WRONG_USE: Final = 2
FAILURE: Final = 1


class UserError(Exception):
    """Something the user can act on: one line that says what is wrong and what to do."""

    def __init__(self, message: str, status: int = FAILURE) -> None:
        super().__init__(" ".join(message.split()))
        self.status = status
