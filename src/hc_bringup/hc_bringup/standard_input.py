"""A recording that comes through a pipe: `zcat press.csv.gz | hc estimate -`, `hc report <(...)`.

A recording is read more than once, and by its ending it is known what it is. So what comes is
written to a file of its own first, which has the ending of what it begins with and is taken away
when the command ends.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import os
import select
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Final

from hc_bringup import heartbeat
from hc_bringup.errors import WRONG_USE, UserError

_NAMES: Final = ("-", "/dev/stdin", "/dev/fd/0", "/proc/self/fd/0")
NAME: Final = "standard input"
_BLOCK: Final = 1 << 16
_WAIT_S: Final = 0.2


@contextlib.contextmanager
def kept(arguments: argparse.Namespace, *, tell_waiting: bool = False) -> Iterator[None]:
    """Have `arguments.input` name a file for as long as a command runs, if it names a pipe.

    What the user typed is then in `arguments.piped`.

    Args:
        arguments: parsed options; `input` is looked at, if there is one.
        tell_waiting: begin a heartbeat that says what is waited for, for a command that has none;
            it ends when all has come.

    Raises:
        UserError: if nothing comes, if it is no recording, or if it cannot be kept; and whatever
            the command raises, with the file called what it is.
    """
    typed = getattr(arguments, "input", None)
    if not isinstance(typed, str) or not _is_pipe(typed):
        yield
        return
    with contextlib.ExitStack() as stack:
        stream, name = _opened(typed, stack)
        try:
            folder = tempfile.mkdtemp(prefix="hc_pipe_")
        except OSError as error:
            raise _no_room(name, tempfile.gettempdir(), error) from error
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        if tell_waiting:
            heartbeat.begin(f"waiting for {name}")
        path = _spool(stream, name, Path(folder))
        if tell_waiting:
            heartbeat.end()
        arguments.input, arguments.piped = str(path), typed
        try:
            yield
        except UserError as error:
            text = str(error).replace(str(path), name)
            raise type(error)(text, error.status) from error


def name_of(arguments: argparse.Namespace) -> str:
    """Return what lines about the input call it."""
    piped = getattr(arguments, "piped", "")
    return NAME if piped in _NAMES else str(piped or arguments.input)


def typed(arguments: argparse.Namespace) -> str:
    """Return what was typed for the input, for a command line that says what to type next."""
    return str(getattr(arguments, "piped", "") or arguments.input)


def _is_pipe(path: str) -> bool:
    if path in _NAMES:
        return True
    try:
        return stat.S_ISFIFO(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False  # whoever reads it says what is wrong with it


def _opened(path: str, stack: contextlib.ExitStack) -> tuple[IO[bytes], str]:
    if path not in _NAMES:
        try:  # at once: a named pipe that nobody writes to yet is waited for with words
            descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
            return stack.enter_context(open(descriptor, "rb")), path
        except OSError as error:
            raise UserError(f"cannot read {path}: {error.strerror}") from error
    if sys.stdin.isatty():
        raise UserError(
            f"{NAME} is the terminal: name a file, or pipe a recording into this "
            "(zcat press.csv.gz | hc estimate -)",
            WRONG_USE,
        )
    return sys.stdin.buffer, NAME


def _spool(stream: IO[bytes], name: str, folder: Path) -> Path:
    """Write what comes to a file with the right ending; returns its path."""
    from hc_logger.other_files import LONGEST_BEGINNING

    heartbeat.doing(f"waiting for {name}")
    try:
        blocks = _blocks(stream.fileno())
        first = b""
        while len(first) < LONGEST_BEGINNING and (block := next(blocks, b"")):
            first += block
        path = folder / f"piped{_suffix(first, name)}"
        size = 0
        with path.open("wb") as file:
            for block in itertools.chain((first,), blocks):
                try:
                    file.write(block)
                except OSError as error:
                    raise _no_room(name, str(folder), error) from error
                size += len(block)
                heartbeat.telling(f"reading {name}", f"reading {name}: {size / 1e6:.1f} MB")
    except OSError as error:
        raise UserError(f"cannot read {name}: {error.strerror or error}") from error
    heartbeat.nothing()
    return path


def _blocks(descriptor: int) -> Iterator[bytes]:
    """Yield what comes, to its end.

    A signal that arrives just before a reading that waits would be answered after it only, and the
    reader of a file object goes from one to the next without asking: so the waiting has an end.
    """
    while True:
        if not select.select([descriptor], [], [], _WAIT_S)[0]:
            continue
        block = os.read(descriptor, _BLOCK)
        if not block:
            return
        yield block


def _suffix(first: bytes, name: str) -> str:
    """Return the ending of what begins so; of what is nothing else, that of a table in text."""
    from hc_logger.compressions import compression_of
    from hc_logger.mcap_scan import MAGIC
    from hc_logger.other_files import JSON, what_begins_with

    if not first:
        raise UserError(f"{name} is empty: nothing was piped into it")
    if first.startswith(MAGIC):
        return ".mcap"
    packed = compression_of(first)
    if packed is not None and packed.opener is not None:
        return f".csv{packed.suffix}"
    said = JSON if first.lstrip().startswith(b"{") else what_begins_with(first)
    if said:
        raise UserError(f"{name} {said}")
    return ".csv"


def _no_room(name: str, folder: str, error: OSError) -> UserError:
    return UserError(
        f"cannot keep {name} in {folder}: {error.strerror or error}; TMPDIR=FOLDER chooses another "
        "place"
    )
