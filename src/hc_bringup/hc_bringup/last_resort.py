"""Ends a command that was asked to end by a signal and does not come to answer it.

Python answers a signal between two of its own instructions. A compiler, a kernel over a long
recording or a middleware that waits for a lock keep it from that for as long as they last, and
Ctrl-C then does nothing. The signal itself still arrives: it writes a byte into a pipe, and a small
process at the other end, made before anything heavy was loaded, ends the command after a moment.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import time
from typing import Final, NoReturn

PATIENCE_S: Final = 1.5
"""So long Python has to notice the signal."""
ORDERLY_S: Final = 10.0
"""And so long a command that noticed it has to end."""
_HEARD: Final = b"\0"  # no signal has this number
_ASKS: Final = frozenset((signal.SIGINT, signal.SIGTERM))

_pipe = -1
_child = 0


def arm(name: str) -> None:
    """Begin to see that signals end this process; to be called before it has threads.

    Args:
        name: of the command, for the line that says that it was ended.
    """
    global _pipe, _child
    if _pipe >= 0:
        return
    reading, writing = os.pipe()
    command = os.getpid()
    child = os.fork()
    if child == 0:
        os.close(writing)
        _watch(reading, command, name)
    os.close(reading)
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    _pipe, _child = writing, child


def heard() -> None:
    """Tell that the signal was noticed, and the command ends by itself now."""
    if _pipe >= 0:
        os.write(_pipe, _HEARD)


def disarm() -> None:
    """Leave signals to whoever handles them from now on: an orderly end may take its time."""
    global _pipe, _child
    if _pipe < 0:
        return
    signal.set_wakeup_fd(-1)
    os.close(_pipe)
    os.waitpid(_child, 0)
    _pipe = -1


def _watch(reading: int, command: int, name: str) -> NoReturn:
    """Wait for a signal's byte, and end the command if that does not; the child's whole life."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)  # a terminal sends Ctrl-C to both
    asked_at, patience_s = 0.0, PATIENCE_S
    while True:
        left = max(0.0, asked_at + patience_s - time.monotonic()) if asked_at else None
        if not select.select([reading], [], [], left)[0]:
            break
        data = os.read(reading, 64)
        if not data:  # the command has ended, or needs nobody any more
            os._exit(0)
        if not asked_at and _ASKS & set(data):
            asked_at = time.monotonic()
        if _HEARD in data:
            patience_s = ORDERLY_S
    os.kill(command, signal.SIGKILL)
    line = f"{name}: ended at once: it was too busy to end in order\n"
    os.write(sys.stderr.fileno(), line.encode())
    os._exit(0)
