"""Readings that come later than younger ones: used in their place, exactly, by going back.

Poses travel over slower ways than forces do. A reading whose stamp lies before the last one used,
but not by more than a window, is put where it belongs: the memory of a moment before it is taken up
again, and what came since is used once more, with the late reading among it. The result is that of
readings in order, whatever the filter.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.estimate import COLUMNS, REJECTED

Runner = Callable[[NDArray[np.float64], NDArray[np.float64]], None]
FEWEST = 16  # samples between two checkpoints, at least


@dataclasses.dataclass
class _Checkpoint:
    """The memory after all samples up to a time, and the samples since."""

    time: float
    memory: NDArray[Any]
    particles: NDArray[np.float64]
    since: list[NDArray[np.float64]]


class LateReadings:
    """Goes back for late readings of one estimator.

    Args:
        window_s: how late a reading may be.
    """

    def __init__(self, window_s: float) -> None:
        self._window = window_s
        self._checkpoints: list[_Checkpoint] = []
        # Not all that came is used: forces alone are refused for want of a displacement after a
        # gap, and one that is older than they are may still come late.
        self._youngest = -np.inf  # of the stamps that came
        self._used = -np.inf  # stamp of the last sample used

    @property
    def memories(self) -> list[NDArray[Any]]:
        """The memories that may be gone back to; what is changed in them stays changed."""
        return [checkpoint.memory for checkpoint in self._checkpoints]

    def forget(self) -> None:
        """There is nothing to go back to."""
        self._checkpoints = []
        self._youngest = -np.inf

    def run(
        self,
        runner: Runner,
        memory: NDArray[Any],
        particles: NDArray[np.float64],
        last_time: Callable[[], float],
        samples: NDArray[np.float64],
        rows: NDArray[np.float64],
    ) -> None:
        """Use samples, late ones in their place.

        Args:
            runner: uses samples in the order given and fills their rows.
            memory: of the estimator; changed by the runner, and gone back to.
            particles: the same.
            last_time: stamp of the last sample used [s].
            samples: time, displacement, force; shape (samples, 3).
            rows: takes the estimates, shape (samples, COLUMNS).
        """
        start = 0
        while start < len(samples):
            newest = self._youngest
            time = samples[start, 0]
            if newest - self._window <= time < newest and self._go_back(
                runner, memory, particles, samples[start], rows[start]
            ):
                self._used = last_time()
                start += 1
                continue
            if not self._checkpoints:
                self._used = last_time()
            end = self._end_of_stretch(samples, start, newest)
            self._keep(memory, particles, newest if self._checkpoints else time, samples, start)
            runner(samples[start:end], rows[start:end])
            self._checkpoints[-1].since.append(samples[start:end].copy())
            self._note(samples[start:end, 0], last_time())
            start = end

    def _note(self, times: NDArray[np.float64], used: float) -> None:
        """Keep the youngest stamp that came, after samples in order.

        Args:
            times: their stamps [s].
            used: stamp of the last sample used [s].
        """
        if used < self._used:
            self.forget()  # the clock was set back: no reading to come is of before
            return
        if used != self._used and used < self._youngest - self._window:
            self._youngest = used  # what was so far ahead, and refused, had a wrong stamp
        known = times[np.isfinite(times)]
        self._youngest = float(np.max(known, initial=self._youngest))
        self._used = used
        if self._checkpoints[-1].time > self._youngest:
            self.forget()

    def _end_of_stretch(self, samples: NDArray[np.float64], start: int, newest: float) -> int:
        """End of the samples that come in order, and need no checkpoint in between."""
        times = samples[start:, 0]
        highest = np.fmax.accumulate(np.append(newest, times[:-1]))
        late = np.flatnonzero(times[1:] < highest[1:])
        end = int(late[0]) + 1 if late.size else len(times)
        return start + min(end, max(FEWEST, self._fill(times[:end])))

    def _fill(self, times: NDArray[np.float64]) -> int:
        """How many of the samples lie within one window from the first."""
        return int(np.count_nonzero(~(times > times[0] + self._window)))

    def _keep(
        self,
        memory: NDArray[Any],
        particles: NDArray[np.float64],
        newest: float,
        samples: NDArray[np.float64],
        start: int,
    ) -> None:
        """Make a checkpoint if it is time to; two are kept that reach a window back."""
        points = self._checkpoints
        if points and sum(map(len, points[-1].since)) < FEWEST:
            return
        if points and newest < points[-1].time + self._window:
            return
        points.append(_Checkpoint(newest, memory.copy(), particles.copy(), []))
        self._drop(samples[start, 0])

    def _go_back(
        self,
        runner: Runner,
        memory: NDArray[Any],
        particles: NDArray[np.float64],
        late: NDArray[np.float64],
        row: NDArray[np.float64],
    ) -> bool:
        """Put one late sample in its place; False if nothing reaches back so far."""
        points = self._checkpoints
        while len(points) > 1 and points[-1].time > late[0]:
            younger = points.pop()
            points[-1].since += younger.since
        point = points[-1]
        if point.time > late[0]:
            return False
        memory[:] = point.memory
        particles[:] = point.particles
        samples = np.concatenate(point.since) if point.since else np.zeros((0, len(late)))
        known = np.flatnonzero(samples[:, 0] <= late[0])
        place = int(known[-1]) + 1 if known.size else 0
        before, after = samples[:place], np.concatenate([late[None], samples[place:]])
        if len(before):
            runner(before, np.empty((len(before), COLUMNS)))
            point.since = [before]
            time = float(np.nanmax(before[:, 0]))
            points.append(_Checkpoint(time, memory.copy(), particles.copy(), []))
        rows = np.empty((len(after), COLUMNS))
        runner(after, rows)
        points[-1].since = [after]
        row[:] = rows[-1]
        row[REJECTED] = rows[0, REJECTED]
        self._drop(late[0])
        return True

    def _drop(self, time: float) -> None:
        """Give up checkpoints that no late reading will need."""
        points = self._checkpoints
        while len(points) > 2 and points[1].time <= time - self._window:
            points.pop(0)
