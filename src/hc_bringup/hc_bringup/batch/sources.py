"""Which recordings a batch works on: files, folders and patterns; and what tells them apart."""

from __future__ import annotations

import errno
import glob
import hashlib
import os
import stat
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from hc_bringup.errors import WRONG_USE, UserError
from hc_logger.csv_open import COMPRESSED_SUFFIXES, TEXT_SUFFIXES

BAG_SUFFIX: Final = ".mcap"
_SUFFIXES: Final = (
    ".csv",
    ".tsv",
    BAG_SUFFIX,
    *(f"{table}{packed}" for table in (".csv", ".tsv") for packed in COMPRESSED_SUFFIXES),
)
"""Of recordings in a folder; other endings must be named, or be in the pattern (*.dat)."""
_MAY_BE: Final = (
    *TEXT_SUFFIXES,
    *(".db3", ".bag", ".mat", ".xls", ".xlsx", ".tdms"),
    *COMPRESSED_SUFFIXES,
    ".zst",
)
"""Endings of files in a folder that somebody may take for recordings of the batch."""
MANIFEST: Final = "manifest.json"
"""What every folder of results has."""
_BLOCK: Final = 1024 * 1024
NO_FILE: Final = "a pipe, a socket or a device, and no file"


class Found(NamedTuple):
    """What patterns name.

    Attributes:
        recordings: absolute, each once, in the order of their paths.
        left_out: files of folders that may be recordings and are not taken, for their ending.
    """

    recordings: list[Path]
    left_out: list[Path]


def find_recordings(patterns: Sequence[str], besides: Path) -> Found:
    """Return the recordings that patterns name, and what of folders is none; looks at each once.

    A bag folder is a recording; any other folder stands for all recordings below it. Files of a
    bag that is taken whole are no recordings of their own; nothing below `besides` is one, nor
    below the results of another batch.

    Args:
        patterns: files, folders, and patterns with *, ?, [] and ** for folders.
        besides: folder of the results.

    Raises:
        UserError: if one of them names no recording.
    """
    found: set[Path] = set()
    others: set[Path] = set()
    for pattern in patterns:
        named = set(_named_by(pattern, others))
        some = {path for path in named if not path.is_relative_to(besides)}
        if named and not some:
            raise UserError(
                f"all that {pattern} names is in the folder of the results: choose another one "
                "with -o",
                WRONG_USE,
            )
        if not some:
            if not os.path.lexists(pattern) and not any(sign in pattern for sign in "*?["):
                raise UserError(f"{pattern} does not exist", WRONG_USE)
            raise UserError(f"{pattern} names no recording (CSV, .mcap or bag folder)", WRONG_USE)
        found |= some
    return Found(
        sorted(p for p in found if p.suffix.lower() != BAG_SUFFIX or p.parent not in found),
        sorted(p for p in others - found if not p.is_relative_to(besides)),
    )


_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def names_of(paths: Sequence[Path]) -> list[str]:
    """Return what the recordings are called in tables: the paths below the folder of them all.

    A spreadsheet takes a cell that begins with = + - or @ for a formula, and works it out: the
    folder stands before such a name, as `./=1+1.csv`.
    """
    root = os.path.commonpath([str(path.parent) for path in paths])
    names = [path.relative_to(root).as_posix() for path in paths]
    return [f"./{name}" if name.startswith(_FORMULA) else name for name in names]


def content_hash(path: Path) -> tuple[str, int]:
    """Return the SHA-256 of a recording's content, and its bytes.

    That of a file is what sha256sum says; that of a folder covers names and contents of its files.

    Raises:
        OSError: if it cannot be read.
    """
    digest = hashlib.sha256()
    if not path.is_dir():
        total = _add(digest, path)
        return digest.hexdigest(), total
    total = 0
    for file in sorted(p for p in path.rglob("*") if p.is_file()):
        inner = hashlib.sha256()
        total += _add(inner, file)
        name = os.fsencode(file.relative_to(path).as_posix())
        digest.update(name + b"\0" + inner.digest())
    return digest.hexdigest(), total


def _named_by(pattern: str, others: set[Path]) -> Iterator[Path]:
    """Yield what a pattern names; adds what of a folder is left out for its ending to others."""
    if os.path.lexists(pattern):
        path = Path(pattern).absolute()
        yield from _below(path, others) if path.is_dir() else (path,)
        return
    any_suffix = bool(Path(pattern).suffix)
    for name in _matching(pattern):
        path = Path(name).absolute()
        if path.is_dir():
            yield from () if _is_batch(path) else _below(path, set())
        elif any_suffix or path.name.lower().endswith(_SUFFIXES):
            yield path


def _matching(pattern: str) -> Iterable[str]:
    """Return the names that a pattern stands for; ** stands for folders, linked ones too.

    Python's glob goes round where a link leads to a folder above it: each recording came forty
    times, and where there are two such links it never ended.
    """
    names: dict[str, str] = {}
    for name in sorted(_expanded(pattern), key=lambda name: (name.count(os.sep), name)):
        folder, file = os.path.split(name)
        names.setdefault(os.path.join(os.path.realpath(folder), file), name)
    return names.values()


def _expanded(pattern: str) -> Iterator[str]:
    """Yield the names, and some by several ways where links lead there."""
    parts = Path(pattern).parts
    if "**" not in parts:
        yield from glob.iglob(pattern)
        return
    at = parts.index("**")
    rest = parts[at + 1 :]
    for top in glob.iglob(os.path.join(*parts[:at])) if at else (os.curdir,):
        for folder, files in _folders_once(top):
            if rest:
                yield from _expanded(os.path.join(glob.escape(folder), *rest))
            else:
                yield from (os.path.join(folder, name) for name in files)


def _folders_once(top: str) -> Iterator[tuple[str, list[str]]]:
    """Yield a folder and all below it, hidden ones left out, each once; with its files."""
    seen: set[str] = set()
    for folder, folders, files in os.walk(top, followlinks=True):
        place = os.path.realpath(folder)
        if place in seen:
            folders.clear()
            continue
        seen.add(place)
        folders[:] = [name for name in folders if not name.startswith(".")]
        # A folder is known by its own name, if it has one there, and not by that of a link.
        linked = [name for name in folders if os.path.islink(os.path.join(folder, name))]
        folders.sort(key=linked.__contains__)
        yield folder, [name for name in files if not name.startswith(".")]


def _below(folder: Path, others: set[Path]) -> Iterator[Path]:
    """Yield what is taken of a folder: bag folders, and files whose ending says what they are.

    Args:
        folder: that is looked through.
        others: takes the files that may be recordings and have another ending.
    """
    for path in _all_below(folder):
        if path.name.lower().endswith(_SUFFIXES) or _is_bag(path):
            yield path
        elif path.suffix.lower() in _MAY_BE:
            others.add(path)


def _all_below(folder: Path) -> Iterator[Path]:
    """Yield bag folders and files below a folder, none of what a bag or a batch made."""
    if _is_bag(folder):
        yield folder
        return
    for path, folders, files in os.walk(folder):
        for name in list(folders):
            if _is_batch(Path(path, name)):
                folders.remove(name)
            elif _is_bag(Path(path, name)):
                folders.remove(name)
                yield Path(path, name)
        yield from (Path(path, name) for name in files)


def _is_bag(folder: Path) -> bool:
    return (folder / "metadata.yaml").is_file()


def _is_batch(folder: Path) -> bool:
    return (folder / MANIFEST).is_file() and (folder / "results").is_dir()


def _add(digest: hashlib._Hash, path: Path) -> int:
    """Add a file's content to a digest; returns its bytes."""
    size = 0
    if not stat.S_ISREG(path.stat().st_mode):  # nobody may ever write into a pipe
        raise OSError(errno.EINVAL, NO_FILE)
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            digest.update(block)
            size += len(block)
    return size
