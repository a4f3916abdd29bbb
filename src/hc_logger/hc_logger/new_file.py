"""New files on disks that fill up and fail: written whole, or not there, or said.

Every write of the package goes through here, so that a test can let each of them fail in turn.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import secrets
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Protocol

from hc_logger.errors import BagError, BagExistsError

NOT_SUPPORTED = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EROFS)
"""What fsync says where there is nothing to sync: not a failure of the disk."""


class RawFile:
    """A new, unbuffered file whose write() writes everything or raises.

    Unbuffered, because writers hand over large blocks and a failed write must show at once. The
    system may write a part only (a nearly full disk does); the rest is tried again. It is locked
    until it is closed, by which a reader knows that more is to come: see is_being_written().
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Make the file.

        Raises:
            OSError: if it cannot be made; FileExistsError if it exists, be it as a dead link.
        """
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        self._number = os.open(path, flags, 0o666)
        with contextlib.suppress(OSError):  # no locks there: readers cannot tell, no more
            fcntl.flock(self._number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._position = 0
        self._has_names = os.fstat(self._number).st_nlink > 0  # some file systems count none

    def write(self, data: bytes) -> int:
        """Write all of it.

        Raises:
            OSError: if the disk is full or gone; a part may have been written.
        """
        view = memoryview(data)
        while view:
            written = os.write(self._number, view)
            if not written:
                raise OSError(errno.EIO, "the disk takes no more bytes")
            self._position += written
            view = view[written:]
        return len(data)

    def tell(self) -> int:
        """Return how many bytes were written."""
        return self._position

    def cut(self, length: int) -> None:
        """Forget what was written beyond a length [bytes], and go on there.

        Raises:
            OSError: if the disk is gone.
        """
        os.ftruncate(self._number, length)
        self._position = os.lseek(self._number, length, os.SEEK_SET)

    def flush(self) -> None:
        """Do nothing: nothing is held back."""

    def duplicate(self) -> int:
        """Return a file descriptor of its own, for a sync in another thread.

        Raises:
            FileNotFoundError: if somebody has deleted the file: what is written goes nowhere.
        """
        if self._has_names and not os.fstat(self._number).st_nlink:
            raise FileNotFoundError(errno.ENOENT, "its file was deleted meanwhile")
        return os.dup(self._number)

    def sync(self) -> None:
        """Hand everything to the disk, as the function of that name does."""
        sync(self._number)

    @classmethod
    def none(cls) -> RawFile:
        """Return one that is closed already."""
        file = cls.__new__(cls)
        file._number, file._position, file._has_names = -1, 0, False
        return file

    @property
    def closed(self) -> bool:
        """True after close()."""
        return self._number < 0

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        number, self._number = self._number, -1
        if number >= 0:
            os.close(number)


def is_being_written(number: int) -> bool:
    """Whether a RawFile has this file open, in this process or another one of this machine.

    Args:
        number: descriptor of the file, open for reading.
    """
    try:
        fcntl.flock(number, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # a file system without locks: nobody can tell
        return False
    fcntl.flock(number, fcntl.LOCK_UN)
    return False


def sync(number: int) -> None:
    """Hand what was written to the disk; fine where the file system has nothing to sync.

    Raises:
        OSError: if the disk failed.
    """
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno not in NOT_SUPPORTED:
            raise


class Target(Protocol):
    """What new_file() gives to write to."""

    def write(self, data: bytes) -> int:
        """Write all of it."""


@contextlib.contextmanager
def new_file(path: str | os.PathLike[str], *, overwrite: bool = False) -> Iterator[Target]:
    """Write a file under a temporary name beside it, and name it when all of it is on the disk.

    If the block or a write fails nothing is left, and what was there before stays.

    Args:
        path: the file.
        overwrite: whether to replace one that exists.

    Raises:
        FileExistsError: if it exists and is not to be replaced.
        OSError: if it cannot be written.
    """
    path = Path(path)
    if not overwrite and os.path.lexists(path):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(8)}")
    left = [temporary]
    file = RawFile(temporary)
    try:
        try:
            yield file
            file.sync()
        finally:
            file.close()
        if overwrite:
            os.replace(temporary, path)
        else:
            _name(temporary, path)
            left.append(path)
        _sync_folder(path.parent)
    except BaseException:
        for name in left:
            with contextlib.suppress(OSError):  # the failure that matters is the one on its way
                os.unlink(name)
        raise


def _sync_folder(folder: Path) -> None:
    """Hand the new name to the disk as well: a power cut must not take it back."""
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        sync(number)
    finally:
        os.close(number)


def _name(temporary: Path, path: Path) -> None:
    """Give a file its name unless somebody has taken it meanwhile."""
    try:
        os.link(temporary, path)  # fails where the name exists, as rename does not
    except OSError as error:
        if error.errno not in (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK):
            raise
        if os.path.lexists(path):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path)) from None
        os.replace(temporary, path)  # a file system without hard links
        return
    os.unlink(temporary)


def write_new_text(
    path: str | os.PathLike[str], parts: Iterable[str], *, overwrite: bool = False
) -> None:
    """Write a text file, whole or not at all; the parts may be long.

    Raises:
        BagExistsError: if the file exists and overwrite is not set.
        BagError: if it cannot be written; nothing is left of it then.
    """
    with failures_in_words(path), new_file(path, overwrite=overwrite) as file:
        for part in parts:
            file.write(part.encode())


@contextlib.contextmanager
def failures_in_words(path: str | os.PathLike[str]) -> Iterator[None]:
    """Say in one line why a new file could not be written.

    Raises:
        BagExistsError: if it exists.
        BagError: if it could not be written.
    """
    try:
        yield
    except FileExistsError:
        raise BagExistsError(
            f"{path} exists already and is not overwritten; give another name or delete it"
        ) from None
    except OSError as error:
        raise BagError(f"cannot write {path}: {error.strerror or error}") from error
