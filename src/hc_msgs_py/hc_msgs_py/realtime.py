"""Real-time scheduling of a node's process, where it was asked for and the system permits it.

The environment says what is wanted, so that it holds for every process of a run alike: HC_REALTIME
is the priority (1 to 99) of SCHED_FIFO, HC_CPUS the processors to stay on (as `taskset -c` takes
them). With HC_REALTIME memory is locked (mlockall), so that no page fault waits for a disk, and the
garbage collector stays off, for what a stream leaves behind is freed by reference counts.
"""

from __future__ import annotations

import ctypes
import gc
import os
import threading
from pathlib import Path

PRIORITY_VARIABLE = "HC_REALTIME"
CPUS_VARIABLE = "HC_CPUS"
DEFAULT_PRIORITY = 20
"""Above everything ordinary, below the kernel's own threads (50)."""

_CURRENT, _FUTURE, _ON_FAULT = 1, 2, 4  # what mlockall takes
_ADVICE = {
    "scheduling": "`ulimit -r 99` (rtprio in /etc/security/limits.conf), or CAP_SYS_NICE",
    "memory": "`ulimit -l unlimited` (memlock in /etc/security/limits.conf), or CAP_IPC_LOCK",
}


class RealtimeError(Exception):
    """What was asked for cannot be, in one line that says what to do."""


def wanted_priority() -> int:
    """Return the priority that the environment asks for; 0 where it asks for none.

    Raises:
        RealtimeError: if it is no number from 1 to 99.
    """
    text = os.environ.get(PRIORITY_VARIABLE, "")
    if not text:
        return 0
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= 99):
        raise RealtimeError(f"{PRIORITY_VARIABLE} is {text!r}, not a whole number from 1 to 99")
    return int(text)


def processors(text: str) -> set[int]:
    """Return the processors that a list like 0,2-3 names.

    Raises:
        RealtimeError: if it is no such list, or this process may not use one of them.
    """
    found: set[int] = set()
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        numbers = (first, last) if dash else (first, first)
        if not all(n.isascii() and n.isdigit() and len(n) < 6 for n in numbers):
            raise RealtimeError(f"processors {text!r} are not a list like 0,2-3")
        found.update(range(int(numbers[0]), int(numbers[1]) + 1))
    allowed = os.sched_getaffinity(0)
    if not found or not found <= allowed:
        raise RealtimeError(
            f"processors {text!r} are not among those of this machine or process: "
            f"{','.join(map(str, sorted(allowed)))}"
        )
    return found


def stay_on_processors() -> None:
    """Stay on the processors that the environment names; before threads are started.

    Raises:
        RealtimeError: if it names others than there are.
    """
    text = os.environ.get(CPUS_VARIABLE, "")
    if text:
        os.sched_setaffinity(0, processors(text))


def check_permission(priority: int = DEFAULT_PRIORITY) -> None:
    """Try what `enter` does on a thread of this process, and undo it.

    Raises:
        RealtimeError: if the system does not permit it.
    """
    problems: list[RealtimeError] = []

    def attempt() -> None:
        try:
            _schedule(0, priority)
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
            _lock_memory()
            _libc().munlockall()
        except RealtimeError as error:
            problems.append(error)

    thread = threading.Thread(target=attempt)
    thread.start()
    thread.join()
    if problems:
        raise problems[0]


def enter(below: int = 0) -> bool:
    """Do what the environment asks for, at the end of a node's start; returns whether it asks.

    The main thread and the middleware's become real-time threads, and so do those that they start
    from now on. Python's other threads (the compiler's) stay ordinary.

    Args:
        below: so many priorities below the wanted one, for who may wait while others may not;
            negative for one above.

    Raises:
        RealtimeError: if the system does not permit it, or the environment is wrong.
    """
    priority = wanted_priority()
    if not priority:
        return False
    priority = min(99, max(1, priority - below))
    ordinary = {thread.native_id for thread in threading.enumerate()}
    ordinary.discard(threading.main_thread().native_id)
    for task in Path("/proc/self/task").iterdir():
        if int(task.name) not in ordinary:
            _schedule(int(task.name), priority)
    _lock_memory()
    gc.disable()
    return True


def _schedule(task: int, priority: int) -> None:
    try:
        os.sched_setscheduler(task, os.SCHED_FIFO, os.sched_param(priority))
    except ProcessLookupError:
        return  # a thread that has ended meanwhile
    except OSError as error:
        raise _refused("scheduling", f"priority {priority} of SCHED_FIFO", error.errno) from error


def _lock_memory() -> None:
    # On fault: what is mapped and never used (Python maps gigabytes) stays out of memory.
    if _libc().mlockall(_CURRENT | _FUTURE | _ON_FAULT):
        raise _refused("memory", "locked memory", ctypes.get_errno())


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _refused(what: str, asked: str, number: int | None) -> RealtimeError:
    reason = os.strerror(number or 0)
    return RealtimeError(f"no {asked} for real time: {reason}; {_ADVICE[what]} permits it")
