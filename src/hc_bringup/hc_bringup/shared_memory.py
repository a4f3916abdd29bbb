"""Removes what ended middleware processes left in shared memory.

Fast DDS keeps each segment and port as a file in /dev/shm, beside lock files that the owners hold
(flock on NAME_el or NAME_sl). A process that was killed leaves them behind with the locks free:
that is how an orphan is told from one in use, as `fastdds shm clean` does it too. A port that
only writers opened, because its listener had ended already, has no lock file at all; such ports
are removed in the run's own ROS domain, where nobody else is meant to be.
"""

from __future__ import annotations

import fcntl
import os
import re
from pathlib import Path

FOLDER = Path("/dev/shm")
_LOCK_SUFFIXES = ("_el", "_sl")
_NAME = re.compile(r"(fastrtps_(?:port(\d+)|[0-9a-f]+))(_el|_sl)?")
# RTPS 2.2, section 9.6.1.1: ports of domain d begin at 7400 + 250 d.
_PORT_BASE = 7400
_PORTS_PER_DOMAIN = 250


def remove_orphans(folder: Path = FOLDER, *, domain_id: int, since: float = 0.0) -> int:
    """Delete segments and ports that no living process holds.

    Args:
        folder: where the shared-memory files are.
        domain_id: ROS domain whose ports are removed whatever their age, and without a lock.
        since: leave alone what was last changed before this time (seconds since 1970), but for the
            ports of the own domain.

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
    for name, own_port in sorted(names.items()):
        locks = [folder / f"{name}{s}" for s in _LOCK_SUFFIXES if (folder / f"{name}{s}").exists()]
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
