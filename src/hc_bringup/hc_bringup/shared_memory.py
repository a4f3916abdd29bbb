"""Removes what ended middleware processes left in shared memory.

Fast DDS keeps each segment and port as a file in /dev/shm, beside lock files that the owners hold
(flock on NAME_el or NAME_sl). A process that was killed leaves them behind with the locks free:
that is how an orphan is told from one in use, as `fastdds shm clean` does it too. A port that
only writers opened, because its listener had ended already, has no lock file at all; such ports
are removed in the run's own ROS domain, where nobody else is meant to be.

A participant that is just starting has made its files and not locked them yet. Deleting those, or
holding such a lock to see whether it is free, leaves two processes that have found each other and
never hear a word: what is younger than a second is left alone.
"""

from __future__ import annotations

import fcntl
import os
import re
import time
from pathlib import Path

FOLDER = Path("/dev/shm")
_LOCK_SUFFIXES = ("_el", "_sl")
_NAME = re.compile(r"(fastrtps_(?:port(\d+)|[0-9a-f]+))(_el|_sl)?")
# RTPS 2.2, section 9.6.1.1: ports of domain d begin at 7400 + 250 d.
_PORT_BASE = 7400
_PORTS_PER_DOMAIN = 250
STARTING_S = 1.0  # from its first file to its last lock a participant takes some milliseconds


def remove_orphans(
    folder: Path = FOLDER, *, domain_id: int, since: float = 0.0, starting_s: float = STARTING_S
) -> int:
    """Delete segments and ports that no living process holds.

    Args:
        folder: where the shared-memory files are.
        domain_id: ROS domain whose ports are removed whatever their age, and without a lock.
        since: leave alone what was last changed before this time (seconds since 1970), but for the
            ports of the own domain.
        starting_s: leave alone what is younger than this [s].

    Returns:
        How many were removed.
    """
    names: dict[str, bool] = {}
    for path in folder.glob("fastrtps_*"):
        match = _NAME.fullmatch(path.name)
        if match:
            port = match[2]
            names[match[1]] = port is not None and _in_domain(int(port), domain_id)
    removed = 0
    latest = time.time() - starting_s
    for name, own_port in sorted(names.items()):
        locks = [folder / f"{name}{s}" for s in _LOCK_SUFFIXES if (folder / f"{name}{s}").exists()]
        if any(_made_after(path, latest) for path in (folder / name, *locks)):
            continue
        earliest = 0.0 if own_port else since
        orphan = all(_is_free(lock, earliest) for lock in locks) if locks else own_port
        if orphan:
            for path in (folder / name, folder / f"sem.{name}_mutex", *locks):
                path.unlink(missing_ok=True)
            removed += 1
    return removed


def _in_domain(port: int, domain_id: int) -> bool:
    first = _PORT_BASE + _PORTS_PER_DOMAIN * domain_id
    return first <= port < first + _PORTS_PER_DOMAIN


def _made_after(path: Path, moment: float) -> bool:
    try:
        return path.stat().st_mtime > moment
    except OSError:  # gone meanwhile
        return False


def _is_free(lock: Path, since: float) -> bool:
    try:
        descriptor = os.open(lock, os.O_RDONLY)
    except OSError:  # gone meanwhile, or another user's: not ours to remove
        return False
    try:
        if os.fstat(descriptor).st_mtime < since:
            return False
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(descriptor)
    return True
