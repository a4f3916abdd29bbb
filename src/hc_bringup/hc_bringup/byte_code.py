"""Byte code of Python that was written by halves: kept from arising, recognized, and cleared.

Python up to 3.11 at least takes a .pyc of which a full disk or a limit of size let only the
beginning be written for a whole one, and from then on no command that needs the module starts.
`./hc` keeps byte code in the folder byte_code of its environment, which can go at any time: the
next import makes it anew. Where Python does not even reach our first line, `./hc` clears it: see
`arrived`.
"""

from __future__ import annotations

import os
import resource
import sys
from typing import Final

FREE_BYTES: Final = 64_000_000
"""On a disk with less than this nothing is added: all byte code together is larger."""
_SIGNS: Final = ("marshal data", "Non-code object in ")
_AGAIN: Final = "HC_BYTE_CODE_CLEARED"


def arrived() -> None:
    """Take away the marker that `./hc` left for a start that does not get to our code."""
    marker = f"{sys.prefix}/.starting.{os.getpid()}"
    if os.path.exists(marker):
        os.unlink(marker)


def spare_a_full_disk() -> None:
    """Write no byte code, here and in the nodes to come, where it might not fit."""
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    folder = _folder()
    try:
        free = FREE_BYTES if folder is None else _free_bytes(folder)
    except OSError:  # it is not there yet
        free = FREE_BYTES
    if free < FREE_BYTES or limit != resource.RLIM_INFINITY:
        sys.dont_write_bytecode = True
        os.environ["PYTHONDONTWRITEBYTECODE"] = "1"


def is_damaged(error: BaseException | None) -> bool:
    """Whether an import failed because byte code is not whole."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        kinds = (EOFError, ValueError, TypeError, ImportError)
        if isinstance(error, kinds) and in_output(str(error)):
            return True
        error = error.__cause__ or error.__context__
    return False


def in_output(output: str) -> bool:
    """Whether what a process left behind says so."""
    return any(sign in output for sign in _SIGNS)


def clear() -> str:
    """Delete the byte code; say so, or what is to be deleted, in one line."""
    what = "Python's byte code is not whole, as it is after a disk was full or a file too large"
    folder = _folder()
    if folder is None:
        return f"{what}: delete {sys.pycache_prefix or 'the folders __pycache__'}"
    import shutil  # not at every start

    shutil.rmtree(folder, ignore_errors=True)
    if os.path.exists(folder):
        return f"{what}: delete {folder}"
    return f"{what}; it has been cleared: give the command once more"


def start_again(error: BaseException) -> None:
    """Clear damaged byte code and start the command anew, once; return if that was not it.

    Only for a command that has not done anything yet.
    """
    if not is_damaged(error) or _folder() is None or _AGAIN in os.environ:
        return
    clear()
    os.environ[_AGAIN] = "1"
    os.execv(sys.executable, sys.orig_argv)


def _folder() -> str | None:
    """Return the folder that `./hc` keeps byte code in; None for one that is somebody else's."""
    ours = os.path.join(sys.prefix, "byte_code")
    return ours if sys.pycache_prefix == ours else None


def _free_bytes(folder: str) -> int:
    found = os.statvfs(folder)
    return found.f_bavail * found.f_frsize
