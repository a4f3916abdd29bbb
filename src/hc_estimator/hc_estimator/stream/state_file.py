"""Saving a session's state and going on from it, in one folder and nowhere else.

`saved_state.json` is written when somebody asks for it; `running_state.json` is written every
second or so and removed at a clean end, so that it is there only after a crash. Whoever goes on
from it first puts it on trial under another name: a state that ends the process is found under that
name at the next start, is set aside as `set_aside_state.json`, and ends no process again.

A file is written under a random name that nobody can have prepared, forced to the disk, and then
renamed: at any moment there is the old state or the new one, whole. It ends with a checksum of what
it holds: a disk that turns one bit of it leaves a number a number, which nothing else would notice.
A file of format 1, of versions that wrote none, is read without.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from hc_estimator import packed_state
from hc_estimator.packed_state import FrozenState
from hc_estimator.stream.session import EstimationSession

SAVED = "saved_state.json"
RUNNING = "running_state.json"
ON_TRIAL = "running_state_on_trial.json"
SET_ASIDE = "set_aside_state.json"
_NAMES = (SAVED, RUNNING, ON_TRIAL, SET_ASIDE)
_FORMAT = 2
_WITHOUT_CHECKSUM = 1
"""The format of files that have none."""
_CHECKSUM = "checksum"
LARGEST_BYTES = 100_000_000
"""A state has some 100 kB; reading one stops here."""


LATEST_NS = (2**31 - 1) * 1_000_000_000
"""What the stamp of a message holds."""
LAST_REVISION = 2**32 - 2
"""What a message holds, with room for the next one."""
_KINDS: dict[str, type] = {"filter": str, "state_space": str, "contact_model": str}
_KINDS |= {"configuration": dict, "memory": dict}


class SavedState(NamedTuple):
    """What a state file holds."""

    estimator: dict[str, Any]  # Estimator.state()
    time_origin_ns: int
    revision: int
    age_s: float  # below zero where the clock was set back since, and the machine began anew
    settings: dict[str, Any]  # of the node, that were changed while it ran


def snapshot(session: EstimationSession) -> dict[str, Any]:
    """Return a session's state as plain data.

    Raises:
        ValueError: if there is nothing to save yet.
    """
    if session.time_origin_ns is None:
        raise ValueError("nothing to save: no sample came yet")
    return {**_head(session), "estimator": session.estimator.state()}


def _head(session: EstimationSession) -> dict[str, Any]:
    return {
        "format": _FORMAT,
        "time_origin_ns": session.time_origin_ns,
        "revision": session.revision.number,
        "saved_at_s": time.time(),
        "saved_at_boot_time_s": time.clock_gettime(time.CLOCK_BOOTTIME),
        "boot": boot_name(),
    }


class Frozen(NamedTuple):
    """What `snapshot` returns, before it is made plain."""

    head: dict[str, Any]
    estimator: FrozenState

    def packed(self) -> dict[str, Any]:
        """Return it as plain data, the estimator's memory as its bytes."""
        return {**self.head, "estimator": self.estimator.packed()}


def freeze(session: EstimationSession, settings: Mapping[str, Any]) -> Frozen:
    """Copy a session's state, in no time to speak of: it has seen a sample.

    Args:
        session: the session.
        settings: of its node, without which the state would be one of other readings: numbers,
            texts, and lists of them.
    """
    head = {**_head(session), "settings": dict(settings)}
    return Frozen(head, packed_state.freeze(session.estimator))


def sealed(data: Mapping[str, Any]) -> str:
    """Return plain data as the text of a state file, its checksum at the end."""
    text = json.dumps(data)
    return f'{text[:-1]}, "{_CHECKSUM}": "{_digest(text)}"}}'


def _check(data: dict[str, Any]) -> None:
    """See that the data of a file are those that were written, and take the checksum out.

    Raises:
        ValueError: they are others, or of another version.
    """
    if data["format"] not in (_FORMAT, _WITHOUT_CHECKSUM):
        raise ValueError(f"format {data['format']!r} instead of {_FORMAT}")
    given = data.pop(_CHECKSUM, None)
    if given is None and data["format"] == _WITHOUT_CHECKSUM:
        return
    if given != _digest(json.dumps(data)):
        raise ValueError(
            "its checksum is of other numbers: the file was damaged or edited; remove it"
        )


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


class StateFolder:
    """The folder of one node's state files."""

    def __init__(self, folder: Path) -> None:
        """Use a folder, made if need be.

        Raises:
            OSError: if it cannot be made or is no folder.
        """
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def save(self, name: str, session: EstimationSession) -> Path:
        """Write a session's state; an older file of the name is replaced in one step.

        Args:
            name: SAVED or RUNNING.
            session: its estimator must have seen a sample.

        Raises:
            ValueError: if there is nothing to save yet.
            OSError: if the file cannot be written.
        """
        return self.write(name, snapshot(session))

    def write_frozen(self, name: str, frozen: Frozen) -> Path:
        """Write what `freeze` returned: in a thread of its own, for a disk takes its time.

        Raises:
            OSError: see `write`.
        """
        return self.write(name, frozen.packed())

    def write(self, name: str, data: dict[str, Any]) -> Path:
        """Write what `snapshot` returned, as `save` does.

        Raises:
            OSError: if the file cannot be written; an older one is as it was.
        """
        path = self._path(name)
        # mkstemp: a random name, O_EXCL and O_NOFOLLOW, readable by its owner only.
        descriptor, temporary = tempfile.mkstemp(prefix=".state_", dir=self._folder)
        try:
            with os.fdopen(descriptor, "w", encoding="utf-8") as file:
                file.write(sealed(data))
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
        self._sync()
        return path

    def load(self, name: str) -> SavedState:
        """Read a state file.

        Args:
            name: SAVED or RUNNING, or ON_TRIAL.

        Raises:
            ValueError: if the file is damaged, edited by hand or of another version.
            OSError: if there is no such file, it is a link, or it cannot be read.
        """
        path = self._path(name)
        try:
            data = json.loads(self._read(path))
            if not isinstance(data, dict) or "format" not in data:
                raise ValueError("it says no format")
            _check(data)
            estimator = packed_state.unpacked(data["estimator"])
            for name, kind in _KINDS.items():
                if not isinstance(estimator[name], kind):
                    raise ValueError(f"{name} is {estimator[name]!r:.40}")
            settings = data.get("settings", {})
            if not isinstance(settings, dict):
                raise ValueError(f"settings is {settings!r:.40}")
            return SavedState(
                estimator,
                _whole(data, "time_origin_ns", LATEST_NS),
                _whole(data, "revision", LAST_REVISION),
                _age_s(data),
                settings,
            )
        except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
            raise ValueError(f"{path} is no state of an estimator: {error}") from error

    def exists(self, name: str) -> bool:
        """Whether there is a state file of the name."""
        return self._path(name).is_file()

    def remove(self, name: str) -> None:
        """Remove a state file if there is one."""
        self._path(name).unlink(missing_ok=True)

    # A state on trial.

    def begin_trial(self) -> None:
        """Put the running state on trial: should it end this process, it is found there."""
        self._rename(RUNNING, ON_TRIAL)

    def end_trial(self) -> None:
        """The state on trial did no harm; it is the running one again if there is no newer."""
        if self.exists(RUNNING):
            self.remove(ON_TRIAL)
        elif self.exists(ON_TRIAL):
            self._rename(ON_TRIAL, RUNNING)

    def set_aside(self) -> Path | None:
        """Set aside a state on trial; returns where it is now, or None if there is none."""
        if not self.exists(ON_TRIAL):
            return None
        self._rename(ON_TRIAL, SET_ASIDE)
        return self._path(SET_ASIDE)

    def _rename(self, name: str, other: str) -> None:
        os.replace(self._path(name), self._path(other))
        self._sync()

    def _read(self, path: Path) -> str:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK)
        with os.fdopen(descriptor, "rb") as file:
            data = file.read(LARGEST_BYTES + 1)
        if len(data) > LARGEST_BYTES:
            raise ValueError(f"it has more than {LARGEST_BYTES} bytes")
        return data.decode("utf-8")

    def _sync(self) -> None:
        """Force the folder's entries to the disk."""
        descriptor = os.open(self._folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def _path(self, name: str) -> Path:
        if name not in _NAMES:  # names are ours alone: no path comes from a client
            raise ValueError(f"{name!r} is no state file")
        return self._folder / name


def _whole(data: dict[str, Any], name: str, largest: int) -> int:
    """Return a whole number of a state file, which a message must be able to hold."""
    value = data[name]
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= largest:
        raise ValueError(f"{name} is {value!r:.40} instead of a number from 0 to {largest}")
    return value


def boot_name() -> str:
    """Return what the system calls the time since the machine began; empty if it does not say."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except (OSError, ValueError):
        return ""


def _age_s(data: dict[str, Any]) -> float:
    """Return how long ago a state was saved [s].

    By the time since the machine began, which nobody sets, if it has not begun anew since: a
    machine without a clock of its own begins in the past and is put right a minute later.
    """
    by_clock_s = time.time() - _finite(data, "saved_at_s")
    if not data.get("boot") or data["boot"] != boot_name():
        return by_clock_s
    return time.clock_gettime(time.CLOCK_BOOTTIME) - _finite(data, "saved_at_boot_time_s")


def _finite(data: dict[str, Any], name: str) -> float:
    value = float(data[name])
    if not math.isfinite(value):
        raise ValueError(f"{name} is {value}")
    return value
