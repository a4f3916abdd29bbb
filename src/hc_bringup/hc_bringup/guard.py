"""What the command line does with errors that nobody expected: one line, and a file with the rest.

Everything that a user can cause is to be told where it is found, as a UserError. What gets here is
a fault of the suite, of what another package brought, or the machine's: memory, disk, permissions.
"""

from __future__ import annotations

import errno
import os
import platform
import sys
import tempfile
import traceback
from datetime import datetime
from pathlib import Path

from hc_bringup import byte_code
from hc_bringup.errors import FAILURE, UserError
from hc_msgs_py.entry_points import FaultOfAnotherError
from hc_msgs_py.free_memory import NotEnoughMemoryError

_OF_THE_MACHINE = frozenset(
    {
        *(errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS),
        *(errno.ENOMEM, errno.EMFILE, errno.ENFILE, errno.EAGAIN),
    }
)
"""What nobody need report."""
_REPORT = "; please report it"
LONGEST = 200
"""Characters of an error's own text that are shown."""


def explain(error: BaseException, words: list[str]) -> UserError:
    """Return the one line for an unexpected error, after writing down the traceback.

    Args:
        error: what was raised.
        words: the command line, for the file.
    """
    if isinstance(error, NotEnoughMemoryError):
        return UserError(str(error), FAILURE)
    if byte_code.is_damaged(error):
        return UserError(byte_code.clear(), FAILURE)
    if isinstance(error, MemoryError):
        return UserError("not enough memory for this (see ulimit -v)", FAILURE)
    if isinstance(error, OSError) and error.strerror:
        if error.filename is not None:
            return UserError(f"{_text(error.filename)}: {error.strerror}", FAILURE)
        written = _write_down(error, words)
        ask = "" if error.errno in _OF_THE_MACHINE else _REPORT
        return UserError(f"{error.strerror} ({written}{ask})", FAILURE)
    said = _text(error)
    if isinstance(error, FaultOfAnotherError):
        return UserError(f"{said} ({_write_down(error, words)})", FAILURE)
    what = f"{type(error).__name__}: {said}" if said else type(error).__name__
    written = _write_down(error, words)
    return UserError(f"internal error: {what[:LONGEST]} ({written}{_REPORT})", FAILURE)


def _text(value: object) -> str:
    """Return a value as one printable line."""
    if isinstance(value, bytes):
        value = os.fsdecode(value)
    return "".join(c if c.isprintable() else " " for c in str(value))


def _write_down(error: BaseException, words: list[str]) -> str:
    """Write the traceback to a new file; say where it is, or why there is none."""
    lines = [
        f"hc {' '.join(map(repr, words))}\n",
        f"Python {sys.version.split()[0]} on {platform.platform()}\n\n",
        *traceback.format_exception(error),
    ]
    name = f"hc_failure_{datetime.now():%Y%m%d_%H%M%S}_{os.getpid()}.txt"
    try:
        path = Path(tempfile.gettempdir()) / name
        number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(number, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.writelines(lines)
    except OSError as reason:
        return f"where it arose could not be written down: {reason.strerror}"
    return f"where it arose is in {path}"
