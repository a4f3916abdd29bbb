"""Questions at a terminal, with something done while nobody has answered yet."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import termios
import time
from collections.abc import Callable

from hc_bringup.errors import FAILURE, UserError
from hc_bringup.wrapping import say, wrapped

_POLL_S = 0.1


class Asker:
    """Asks at the terminal. Lines that were typed before a question are no answer to it."""

    def __init__(self) -> None:
        self._number = sys.stdin.fileno()

    def ask(self, question: str, meanwhile: Callable[[float], None] = time.sleep) -> str:
        """Return the answer, without space around it and in small letters.

        Args:
            question: printed before.
            meanwhile: called again and again with the time [s] that it is to take.

        Raises:
            UserError: if the terminal is gone or the user ended the input (Ctrl-D).
        """
        with contextlib.suppress(termios.error):  # what is no terminal has nothing to forget
            termios.tcflush(self._number, termios.TCIFLUSH)
        print(wrapped(question), end=" ", flush=True)
        typed = b""
        while not typed.endswith(b"\n"):
            if not select.select([self._number], [], [], 0.0)[0]:
                meanwhile(_POLL_S)
                continue
            try:
                more = os.read(self._number, 1024)
            except OSError:
                more = b""
            if not more:
                print()
                raise UserError("the input ended: nothing more was done", FAILURE)
            typed += more
        return typed.decode(errors="replace").splitlines()[0].strip().lower()

    def choose(
        self,
        question: str,
        answers: dict[str, str],
        meanwhile: Callable[[float], None] = time.sleep,
    ) -> str:
        """Ask until the answer is one of some, and return that one.

        Args:
            question: printed before; says what can be answered.
            answers: whatever may be typed, and what it means; "" is Enter alone.
            meanwhile: as in `ask`.
        """
        while True:
            typed = self.ask(question, meanwhile)
            if typed in answers:
                return answers[typed]
            words = ", ".join(answer or "Enter" for answer in answers)
            say(f"{typed!r} is no answer here; type one of: {words}")


def yes_or_no(asker: Asker, question: str) -> bool:
    """Ask until the answer is yes or no; Enter alone is yes."""
    answers = {"": "y", "y": "y", "yes": "y", "n": "n", "no": "n"}
    return asker.choose(f"{question} [Y/n]", answers) == "y"
