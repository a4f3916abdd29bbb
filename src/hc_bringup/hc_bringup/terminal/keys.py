"""Keys of the terminal while a run goes on: each is one thing that the run is asked for."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import ExitStack
from typing import Final

from hc_logger.keyboard import Keyboard

REQUESTS: Final = {
    "m": ("mark", "mark"),
    "r": ("reset", "reset"),
    "t": ("tare", "tare"),
    "f": ("find_surface", "find surface"),
}
"""Key to what the run is asked for, and how the panel calls it."""
STOP: Final = "q"
CHOICES: Final = "123456789"
"""Of several estimators, the one that the keys are for from now on."""


class Keys:
    """Reads keys without waiting. Use as a context manager; without a terminal there are none."""

    def __init__(self) -> None:
        self._keyboard: Keyboard | None = None
        self._stack = ExitStack()

    def __enter__(self) -> Keys:
        try:
            self._keyboard = self._stack.enter_context(Keyboard(sys.stdin.fileno()))
        except (ValueError, OSError):
            self._keyboard = None  # input comes from elsewhere, or belongs to another process
        return self

    def __exit__(self, *_exception: object) -> None:
        self._stack.close()
        self._keyboard = None

    @property
    def legend(self) -> tuple[tuple[str, str], ...]:
        """Keys and their meanings; empty where none can be pressed."""
        if self._keyboard is None:
            return ()
        return ((STOP, "stop"), *((key, words) for key, (_, words) in REQUESTS.items()))

    def requests(self) -> list[str]:
        """Return what has been asked for since the last call, of CHOICES the key itself.

        The key to stop ends the run.
        """
        if self._keyboard is None:
            return []
        try:
            names = self._keyboard.read(0.0)
        except EOFError:
            self._keyboard = None
            return []
        if STOP in names:
            os.kill(os.getpid(), signal.SIGINT)  # the same clean end as Ctrl-C
        return [
            REQUESTS[name][0] if name in REQUESTS else name
            for name in names
            if name in REQUESTS or name in CHOICES
        ]
