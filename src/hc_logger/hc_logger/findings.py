"""What is unusual about the rows of a recording: counted, and said in a line each."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_RESTART_ROWS = 50
"""The filters' default of clock_restart_samples."""


class Findings(NamedTuple):
    """What is unusual about the rows of a recording.

    Attributes:
        not_finite: rows with infinity, or with NaN for the time or for both readings.
        force_alone: rows with a force and NaN for the displacement.
        displacement_alone: rows with a displacement and NaN for the force.
        repeated: rows with a reading of a channel that has one at the same time before.
        backward: rows with a time before that of the row before, without those of `set_back`.
        set_back: how often the clock was set back: what follows goes on from there.
        problems: what of a bag could not be read, one line each.
        being_recorded: how much was read of a bag that somebody writes, one line for each file.
        notes: what else one should know, one line each.
        counted_once: channels ("displacement", "force") whose repeated readings were left out.
    """

    not_finite: int
    repeated: int
    backward: int
    problems: tuple[str, ...]
    notes: tuple[str, ...] = ()
    force_alone: int = 0
    displacement_alone: int = 0
    counted_once: tuple[str, ...] = ()
    being_recorded: tuple[str, ...] = ()
    set_back: int = 0

    def lines(self) -> list[str]:
        """Return one line for each finding, none for a clean recording."""
        texts = (
            (self.not_finite, "with NaN or infinity"),
            (self.repeated, "with the time of the row before"),
            (self.backward, "with a time before that of the row before"),
        )
        counted = [
            f"{count} {'row' if count == 1 else 'rows'} {text}: the estimator rejects them"
            for count, text in texts
            if count
        ]
        alone = [
            f"{count} {'row' if count == 1 else 'rows'} with a {what} alone"
            for count, what in (
                (self.force_alone, "force"),
                (self.displacement_alone, "displacement"),
            )
            if count
        ]
        one = [f"{', '.join(alone)}: each reading is used at its own stamp"] if alone else []
        often = f" {self.set_back} times" if self.set_back > 1 else ""
        clock = [
            f"the clock was set back{often} (a driver that was started again, or a clock that was "
            "put right): the estimator begins anew there"
        ]
        rows = [*counted, *clock[: self.set_back], *one]
        return [*rows, *self.problems, *self.being_recorded, *self.notes]


def findings_of(
    rows: NDArray[np.float64], steps: NDArray[Any], problems: tuple[str, ...]
) -> Findings:
    """Count the bad rows of a recording.

    Args:
        rows: (n, columns) values that must be finite; the last two are displacement and force, of
            which one may be NaN.
        steps: (n - 1,) steps of time from row to row.
        problems: what could not be read, one line each.
    """
    missing = np.isnan(rows[:, -2:])
    filled = rows.copy()
    filled[:, -2:][missing] = 0.0
    usable = np.isfinite(filled).all(axis=1) & ~missing.all(axis=1)
    set_back = _times_set_back(steps)
    return Findings(
        int(np.count_nonzero(~usable)),
        _repeated(missing, steps),
        int(np.count_nonzero(steps < 0)) - set_back,
        problems,
        force_alone=int(np.count_nonzero(usable & missing[:, 0])),
        displacement_alone=int(np.count_nonzero(usable & missing[:, 1])),
        set_back=set_back,
    )


def _times_set_back(steps: NDArray[Any]) -> int:
    """Count the steps back after which so many rows go on from there that an estimator does, too.

    Args:
        steps: (n - 1,) steps of time from row to row.
    """
    unordered = np.concatenate(([0], np.cumsum(~(steps >= 0))))
    back = np.flatnonzero(steps < 0)
    back = back[back + _RESTART_ROWS <= len(steps)]
    back = back[unordered[back + _RESTART_ROWS] == unordered[back + 1]]
    return sum(bool(steps[row : row + _RESTART_ROWS].sum() < 0) for row in back.tolist())


def _repeated(missing: NDArray[np.bool_], steps: NDArray[Any]) -> int:
    """Count the rows with a reading of a channel that has one with the same time already.

    Readings of the two channels may stand at one time in rows of their own.

    Args:
        missing: (n, 2) where a row has no reading.
        steps: (n - 1,) steps of time from row to row.
    """
    instant = np.concatenate(([0], np.cumsum(steps != 0)))
    again = np.zeros(len(missing), bool)
    for absent in missing.T:
        there = np.flatnonzero(~absent)
        again[there[1:][instant[there[1:]] == instant[there[:-1]]]] = True
    return int(np.count_nonzero(again))
