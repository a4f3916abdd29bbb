"""Nodes of this machine that are there and do not answer, because their process is stopped.

A process that was stopped (Ctrl-Z, SIGSTOP, a debugger) announces nothing, so whoever looks at the
graph afterwards does not see its nodes. The kernel knows it.
"""

from __future__ import annotations

from pathlib import Path

from hc_bringup.domain_lock import domain_id
from hc_bringup.process_state import PROCESSES, is_stopped

_ROS_LIBRARY = b"librcl.so"
_MOST_NAMED = 3


def stopped_processes() -> list[tuple[int, str]]:
    """Return number and command of each process that speaks ROS in this domain and is stopped.

    Of other users' processes nothing is known.
    """
    found = []
    for folder in PROCESSES.iterdir():
        if not folder.name.isdigit():
            continue
        try:
            stopped = is_stopped(int(folder.name))
            if not stopped or _ROS_LIBRARY not in (folder / "maps").read_bytes():
                continue
            environment = (folder / "environ").read_bytes().split(b"\0")
            words = (folder / "cmdline").read_bytes().decode(errors="replace").split("\0")
        except OSError:
            continue  # it has ended, or is another user's
        if _domain_of(environment) == domain_id():
            named = " ".join(Path(word).name for word in words).strip()
            found.append((int(folder.name), "".join(filter(str.isprintable, named))[:60]))
    return sorted(found)


def _domain_of(environment: list[bytes]) -> int:
    text = next((e[14:] for e in environment if e.startswith(b"ROS_DOMAIN_ID=")), b"")
    return int(text) if text.isdigit() else 0


def stopped_note() -> str:
    """Return who is stopped and how it goes on; nothing if nobody is."""
    stopped = stopped_processes()
    if not stopped:
        return ""
    named = ", ".join(f"{number} ({words})" for number, words in stopped[:_MOST_NAMED])
    if len(stopped) > _MOST_NAMED:
        named += f" and {len(stopped) - _MOST_NAMED} more"
    numbers = " ".join(str(number) for number, _ in stopped)
    return (
        f"stopped, so that it is there but does not answer: process {named}; "
        f"kill -CONT {numbers} lets it go on"
    )


def stopped_hint() -> str:
    """Return the same for the end of a message."""
    note = stopped_note()
    return f"; {note}" if note else ""
