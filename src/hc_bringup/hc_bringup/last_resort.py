"""Ends a command that was asked to end by a signal and does not come to answer it.

Python answers a signal between two of its own instructions. A compiler, a kernel over a long
recording or a middleware that waits for a lock keep it from that for as long as they last, and
Ctrl-C then does nothing. The signal itself still arrives: it writes a byte into a pipe, and a small
process at the other end, made before anything heavy was loaded, says after a moment that this must
end. A thread of the command hears that and ends it with the status of the signal: a compiler lets
other threads run. Where none runs either, the small process kills the command.

Where Python answers the signal within a call that C made (the compiler's cache asks for its files,
a destructor runs) nobody gets the KeyboardInterrupt. `again` raises another one then.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
import time
from types import FrameType
from typing import TYPE_CHECKING, Final, NoReturn

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

PATIENCE_S: Final = 1.5
"""So long Python has to notice the signal."""
ORDERLY_S: Final = 10.0
"""And so long a command that noticed it has to end."""
_THREAD_S: Final = 1.0
"""And so long its thread, before the command is killed."""
_AGAIN_S: Final = 0.01
_HEARD: Final = b"\0"  # no signal has this number
_ASKS: Final = frozenset((signal.SIGINT, signal.SIGTERM, signal.SIGHUP))

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
    answer, telling = os.pipe()
    command = os.getpid()
    line = f"{name}: ended at once: it was too busy to end in order\n".encode()
    child = os.fork()
    if child == 0:
        os.close(writing)
        os.close(answer)
        _watch(reading, telling, command, line)
    os.close(reading)
    os.close(telling)
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=_end_when_answered, args=(answer, line), daemon=True).start()
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


def again(lost: UnraisableHookArgs) -> None:
    """Raise KeyboardInterrupt once more where nobody got it; as sys.unraisablehook."""
    if issubclass(lost.exc_type, KeyboardInterrupt):
        signal.signal(signal.SIGALRM, _interrupt)
        signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
    else:
        sys.__unraisablehook__(lost)


def _interrupt(_number: int, _frame: FrameType | None) -> NoReturn:
    raise KeyboardInterrupt


def _end_when_answered(answer: int, line: bytes) -> None:
    """Wait for the child's word, the number of a signal, and end the process; the thread's life."""
    number = os.read(answer, 1)
    os.close(answer)
    if number:
        os.write(sys.stderr.fileno(), line)
        os._exit(128 + number[0])


def _watch(reading: int, telling: int, command: int, line: bytes) -> NoReturn:
    """Wait for a signal's byte, and end the command if that does not; the child's whole life."""
    for number in _ASKS:
        signal.signal(number, signal.SIG_IGN)  # a terminal sends Ctrl-C and its end to both
    asked, asked_at, patience_s = 0, 0.0, PATIENCE_S
    while True:
        left = max(0.0, asked_at + patience_s - time.monotonic()) if asked else None
        if not select.select([reading], [], [], left)[0]:
            break
        data = os.read(reading, 64)
        if not data:  # the command has ended, or needs nobody any more
            os._exit(0)
        if not asked and (asks := _ASKS & set(data)):
            asked, asked_at = max(asks), time.monotonic()
        if _HEARD in data:
            patience_s = ORDERLY_S
    os.write(telling, bytes((asked,)))
    end = time.monotonic() + _THREAD_S
    while (left := end - time.monotonic()) > 0.0:
        if select.select([reading], [], [], left)[0] and not os.read(reading, 64):
            os._exit(0)
    os.kill(command, signal.SIGKILL)
    os.write(sys.stderr.fileno(), line)
    os._exit(0)
