"""Saving a session's state and going on from it, in one folder and nowhere else.

Two files: `saved_state.json` is written when somebody asks for it; `running_state.json` is written
every second or so and removed at a clean end, so that it is there only after a crash.
"""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any, NamedTuple

from hc_estimator.online.session import EstimationSession

SAVED = "saved_state.json"
RUNNING = "running_state.json"
_FORMAT = 1


class SavedState(NamedTuple):
    """What a state file holds."""

    estimator: dict[str, Any]  # Estimator.state()
    time_origin_ns: int
    revision: int
    age_s: float


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
        if session.time_origin_ns is None:
            raise ValueError("nothing to save: no sample came yet")
        path = self._path(name)
        data = {
            "format": _FORMAT,
            "time_origin_ns": session.time_origin_ns,
            "revision": session.revision.number,
            "saved_at_s": time.time(),
            "estimator": session.estimator.state(),
        }
        temporary = path.with_suffix(".tmp")
        temporary.write_text(json.dumps(data), encoding="utf-8")
        os.replace(temporary, path)
        return path

    def load(self, name: str) -> SavedState:
        """Read a state file.

        Args:
            name: SAVED or RUNNING.

        Raises:
            ValueError: if the file is damaged or of another version.
            OSError: if there is no such file or it cannot be read.
        """
        path = self._path(name)
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            if data["format"] != _FORMAT:
                raise ValueError(f"format {data['format']!r} instead of {_FORMAT}")
            estimator = dict(data["estimator"])
            for name in ("filter", "state_space", "contact_model", "configuration"):
                estimator[name]  # KeyError where it lacks
            return SavedState(
                estimator,
                int(data["time_origin_ns"]),
                int(data["revision"]),
                time.time() - float(data["saved_at_s"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{path} is no state of an estimator: {error}") from error

    def exists(self, name: str) -> bool:
        """Whether there is a state file of the name."""
        return self._path(name).is_file()

    def remove(self, name: str) -> None:
        """Remove a state file if there is one."""
        self._path(name).unlink(missing_ok=True)

    def _path(self, name: str) -> Path:
        if name not in (SAVED, RUNNING):  # names are ours alone: no path comes from a client
            raise ValueError(f"{name!r} is no state file")
        return self._folder / name
