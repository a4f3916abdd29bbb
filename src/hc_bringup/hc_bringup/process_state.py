"""Whether a process of this machine is stopped: by Ctrl-Z, SIGSTOP or a debugger."""

from __future__ import annotations

from pathlib import Path

PROCESSES = Path("/proc")
_STOPPED = ("T", "t")
"""States of a process: stopped by a signal, or by a debugger."""


def is_stopped(number: int) -> bool:
    """Return whether a process is there and stopped.

    Raises:
        OSError: if there is no such process.
    """
    # The name of the program stands in brackets and may hold anything.
    text = (PROCESSES / str(number) / "stat").read_text(errors="replace")
    return text.rpartition(")")[2].split()[0] in _STOPPED
