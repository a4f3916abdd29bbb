"""What the nodes of a run take of the machine over time: memory, file descriptors, threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

SETTLED_SHARE = 0.2
"""Of the run, at its start, that is left out of the growth: pools fill up there."""


class Resources:
    """Looks once a second at the processes of the nodes."""

    def __init__(self) -> None:
        self._next_s = 0.0
        self._times: dict[str, list[float]] = {}
        self._megabytes: dict[str, list[float]] = {}
        self._descriptors: dict[str, list[float]] = {}
        self._threads: dict[str, list[float]] = {}

    def look(self, pids: Mapping[str, int], elapsed_s: float) -> None:
        """Look at the processes by name, if a second has gone by since the last time."""
        if elapsed_s < self._next_s:
            return
        self._next_s = elapsed_s + 1.0
        for name, pid in pids.items():
            folder = Path(f"/proc/{pid}")
            try:
                seen = (_megabytes(folder), _descriptors(folder), _threads(folder))
            except OSError:
                continue  # it has ended meanwhile
            self._times.setdefault(name, []).append(elapsed_s)
            kinds = (self._megabytes, self._descriptors, self._threads)
            for kind, value in zip(kinds, seen, strict=True):
                kind.setdefault(name, []).append(value)

    def memory_mb(self) -> dict[str, float]:
        """Return the newest memory of each node [MB]."""
        return {name: values[-1] for name, values in self._megabytes.items()}

    def memory_growth(self) -> dict[str, float]:
        """Return the slope of a least-squares line for each node [MB/h], start left out."""
        return self._each(
            self._megabytes, lambda t, v: 3600.0 * float(np.polyfit(t, v, 1)[0]), least=3
        )

    def descriptor_growth(self) -> dict[str, float]:
        """Return by how many descriptors each node has more at the end, start left out."""
        return self._each(self._descriptors, _difference)

    def thread_growth(self) -> dict[str, float]:
        """Return the same for threads."""
        return self._each(self._threads, _difference)

    def _each(
        self,
        kind: dict[str, list[float]],
        figure: Callable[[NDArray[np.float64], NDArray[np.float64]], float],
        least: int = 2,
    ) -> dict[str, float]:
        result = {}
        for name, values in kind.items():
            time_s = np.array(self._times[name])
            settled = time_s >= SETTLED_SHARE * time_s[-1]
            enough = np.count_nonzero(settled) >= least
            result[name] = (
                figure(time_s[settled], np.array(values)[settled]) if enough else float("nan")
            )
        return result


def _difference(_time_s: NDArray[np.float64], values: NDArray[np.float64]) -> float:
    tenth = max(1, len(values) // 10)
    return float(np.median(values[-tenth:]) - np.median(values[:tenth]))


def _megabytes(folder: Path) -> float:
    pages = int((folder / "statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 1e6


def _descriptors(folder: Path) -> float:
    return float(len(os.listdir(folder / "fd")))


def _threads(folder: Path) -> float:
    return float(len(os.listdir(folder / "task")))
