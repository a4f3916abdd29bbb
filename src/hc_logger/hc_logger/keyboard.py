"""Single keys of a terminal, as they are pressed."""

from __future__ import annotations

import os
import select
import termios
import tty
from types import TracebackType

STANDARD_INPUT = 0
_SEQUENCES = {
    b"\x1b[A": "up",
    b"\x1b[B": "down",
    b"\x1b[C": "right",
    b"\x1b[D": "left",
    b"\x1bOA": "up",
    b"\x1bOB": "down",
    b"\x1bOC": "right",
    b"\x1bOD": "left",
    b" ": "space",
}
"""Arrow keys in normal and in application mode."""


def key_names(data: bytes) -> tuple[list[str], bytes]:
    """Return the names of the keys in what a terminal sent: space, up, down, left, right.

    Other keys give their character; other escape sequences are left out.

    Returns:
        The names, and what may be the beginning of an arrow key whose rest has yet to come.
    """
    names = []
    while data:
        for sequence, name in _SEQUENCES.items():
            if data.startswith(sequence):
                names.append(name)
                data = data[len(sequence) :]
                break
        else:
            if data in (b"\x1b", b"\x1b[", b"\x1bO"):
                return names, data
            if data[0] == 0x1B:
                return names, b""  # some other sequence: what follows belongs to it
            names.append(chr(data[0]))
            data = data[1:]
    return names, b""


class Keyboard:
    """The terminal in key-by-key mode, from __enter__ to __exit__ (signals work as before)."""

    def __init__(self, descriptor: int = STANDARD_INPUT) -> None:
        """Take a terminal.

        Args:
            descriptor: its file descriptor.

        Raises:
            ValueError: if it is no terminal, or that of another process in the foreground.
        """
        self._descriptor = descriptor
        if not os.isatty(self._descriptor):
            raise ValueError("there is no terminal, so there is no keyboard")
        try:
            foreground = os.tcgetpgrp(self._descriptor)
        except OSError:  # not the controlling terminal: nobody else reads from it
            foreground = os.getpgrp()
        if foreground != os.getpgrp():
            raise ValueError("the terminal belongs to another process, so there is no keyboard")
        self._begun = b""

    def __enter__(self) -> Keyboard:
        self._before = termios.tcgetattr(self._descriptor)
        tty.setcbreak(self._descriptor)
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)

    def read(self, timeout_s: float) -> list[str]:
        """Wait for keys; returns their names, none after the timeout.

        Raises:
            EOFError: if the terminal has gone.
        """
        ready, _, _ = select.select([self._descriptor], [], [], timeout_s)
        if not ready:
            return []
        try:
            data = os.read(self._descriptor, 64)
        except OSError as error:
            raise EOFError("the terminal has gone") from error
        if not data:
            raise EOFError("the terminal has gone")
        names, self._begun = key_names(self._begun + data)
        return names
