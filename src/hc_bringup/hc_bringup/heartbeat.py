"""Says what a command is doing while nothing else is shown, so that nobody takes it for a hang.

On a busy machine the imports alone take half a minute. A command whose module has HEARTBEAT = True
names what it does (`doing`, `telling`) and where it speaks for itself (`nothing`); a thread writes
that on standard error for as long as it lasts. These are functions, not an object that is handed
on: what takes long is deep inside, and where no command has begun the heartbeat they do nothing.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from typing import Final

MARK: Final = "... "
"""By it a line is known: what a program says of itself is neither a result nor an error."""
FIRST_S: Final = 3.0
"""So long nothing is said of a step, or less where nothing was said before it either."""
LEAST_S: Final = 1.0
AGAIN_S: Final = 4.0
SELDOM_S: Final = 15.0
"""Between two lines, and between those of a step that has lasted for a minute."""
_LONG_S: Final = 60.0
_TICK_S: Final = 0.2


class Heartbeat:
    """Writes a line about the present step when it lasts, from a thread of its own."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._step = self._text = ""
        self._since = self._due = self._spoken = 0.0
        self._end: threading.Event | None = None

    def start(self) -> None:
        """Begin to look; until then nothing is written."""
        if self._end is None:
            self._end = threading.Event()
            threading.Thread(target=self._beat, args=(self._end,), daemon=True).start()

    def stop(self) -> None:
        """Write nothing any more."""
        if self._end is not None:
            self._end.set()
            self._end = None
        self.set("")

    def set(self, step: str, text: str = "") -> None:
        """Say what is done now.

        Args:
            step: its name; a new one starts the clock anew, none ends the lines.
            text: told instead of the step and for how long it has lasted.
        """
        with self._lock:
            if step != self._step:
                now = self._since = time.monotonic()
                if not self._step:  # the command spoke for itself until now
                    self._spoken = now
                self._due = max(now + LEAST_S, min(now + FIRST_S, self._spoken + AGAIN_S))
            self._step, self._text = step, text

    def spoke(self) -> None:
        """Note that the command itself has just said something."""
        with self._lock:
            self._spoken = time.monotonic()
            self._due = max(self._due, self._spoken + FIRST_S)

    def _beat(self, end: threading.Event) -> None:
        while not end.wait(_TICK_S):
            line = self.due()
            if line:
                sys.stderr.write(f"{line}\n")
                sys.stderr.flush()

    def due(self) -> str:
        """Return the line that is due now, if one is."""
        now = time.monotonic()
        with self._lock:
            if not self._step or now < self._due:
                return ""
            lasted, self._spoken = now - self._since, now
            self._due = now + (AGAIN_S if lasted < _LONG_S else SELDOM_S)
            return f"{MARK}{self._text or f'{self._step}, since {lasted:.0f} s'}{busy()}"


_heartbeat = Heartbeat()


def begin(step: str) -> None:
    """Begin the heartbeat of this process's command."""
    _heartbeat.spoke()
    _heartbeat.set(step)
    _heartbeat.start()


def end() -> None:
    """End it: the command is done."""
    _heartbeat.stop()


def doing(step: str) -> None:
    """Name the step that begins now; it is told if it lasts."""
    _heartbeat.set(step)


def telling(step: str, text: str) -> None:
    """Name the step that goes on, and what is to be told of it at this moment."""
    _heartbeat.set(step, text)


def nothing() -> None:
    """Tell nothing: the command speaks for itself now, or waits for its user."""
    _heartbeat.set("")


def spoke() -> None:
    """Note that the command itself has just said something: the next line can wait."""
    _heartbeat.spoke()


def busy() -> str:
    """Return a note that the machine is busy, where it is."""
    load, processors = os.getloadavg()[0], len(os.sched_getaffinity(0))
    if load <= processors:
        return ""
    return f" (machine busy: load {load:.1f} on {processors} processors)"
