"""Removes what killed middleware processes left in shared memory.

Fast DDS keeps each segment and port as a file in /dev/shm, beside lock files that the owners hold
(flock on NAME_el or NAME_sl). A process that was killed leaves them behind with the locks free:
that is how an orphan is told from one in use, as `fastdds shm clean` does it too.
"""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

FOLDER = Path("/dev/shm")
_LOCK_SUFFIXES = ("_el", "_sl")


def remove_orphans(folder: Path = FOLDER, *, since: float = 0.0) -> int:
    """Delete segments and ports that no living process holds.

    Args:
        folder: where the shared-memory files are.
        since: leave alone what was last changed before this time (seconds since 1970).

    Returns:
        How many were removed.
    """
    names = {
        lock.name[:-3] for suffix in _LOCK_SUFFIXES for lock in folder.glob(f"fastrtps_*{suffix}")
    }
    removed = 0
    for name in sorted(names):
        locks = [folder / f"{name}{suffix}" for suffix in _LOCK_SUFFIXES]
        existing = [lock for lock in locks if lock.exists()]
        if not existing or not all(_is_orphan(lock, since) for lock in existing):
            continue
        for path in (folder / name, folder / f"sem.{name}_mutex", *existing):
            path.unlink(missing_ok=True)
        removed += 1
    return removed


def _is_orphan(lock: Path, since: float) -> bool:
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
