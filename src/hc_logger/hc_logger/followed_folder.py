"""A folder that is found again under whatever name somebody gave it meanwhile."""

from __future__ import annotations

import os
from pathlib import Path


class FollowedFolder:
    """Keeps hold of a folder; where the system does not tell its name, the first one stays."""

    def __init__(self, path: Path) -> None:
        """Follow nothing yet: `hold` does.

        Args:
            path: the folder's name now.
        """
        self._path = path
        self._number = -1

    def hold(self) -> None:
        """Begin to follow the folder, which must be there.

        Raises:
            OSError: if it cannot be opened.
        """
        self._number = os.open(self._path, os.O_RDONLY | os.O_DIRECTORY)

    @property
    def path(self) -> Path:
        """The name that it has now, or had when it was let go; the last one if it was removed."""
        if self._number >= 0:
            now = os.path.realpath(f"/proc/self/fd/{self._number}")
            moved = not self._is_at(self._path)
            if moved and self._is_at(now):
                self._path = Path(now)
        return self._path

    def _is_at(self, path: str | os.PathLike[str]) -> bool:
        try:
            return os.path.samestat(os.stat(path), os.fstat(self._number))
        except OSError:
            return False

    def let_go(self) -> Path:
        """Follow it no longer; returns its name."""
        path = self.path
        if self._number >= 0:
            os.close(self._number)
            self._number = -1
        return path
