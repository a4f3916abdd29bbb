"""Force and presses of a tool while somebody presses with it, before an axis or sign is known."""

from __future__ import annotations

import numpy as np

from hc_bringup.robot_streams import Recorder
from hc_estimator.stream.readings import CLEAR, FloatArray, noise

FEWEST = 20
"""Readings from which a noise can be estimated."""
PRESSED, RELEASED = 0.5, 0.25
"""Parts of the largest change of force at which a press begins and ends."""


class PressMonitor:
    """Takes up what a recorder has got since it was asked last.

    Attributes:
        force_n: largest change of the force from its value at rest, as it is read [N].
        noise_n: its noise at rest, as it is read [N].
        moved_mm: largest distance of the tool from where it rested, as it is read; of joints, of
            the one that moved most, in thousandths of its unit.
        presses: how many times the force rose clearly and fell again.
    """

    def __init__(self, recorder: Recorder, scales: tuple[float, float] = (1.0, 1.0)) -> None:
        """Take all that was recorded so far for rest.

        Args:
            recorder: what it is asked for.
            scales: N and m that one of the readings of force and position stands for.
        """
        self._recorder = recorder
        self._scales = scales
        forces, places = recorder.since(0, 0)
        self._rows = [len(forces), len(places)]
        self._free = _middle(forces)
        self._place = _middle(places)
        few = len(forces) < FEWEST
        self.noise_n = 0.0 if few else max(noise(column) for column in forces.T)
        self.force_n = 0.0
        self.moved_mm = 0.0
        self.presses = 0
        self._pressing = False

    def update(self) -> None:
        """Take up what came since the last time."""
        forces, places = self._recorder.since(*self._rows)
        self._rows[0] += len(forces)
        self._rows[1] += len(places)
        if self._free is None:
            self._free = _middle(forces)
        if self._place is None:
            self._place = _middle(places)
        if len(places) and self._place is not None:
            self.moved_mm = max(self.moved_mm, self._distance(places - self._place))
        if not len(forces) or self._free is None:
            return
        change = np.linalg.norm(forces - self._free, axis=1)
        self.force_n = max(self.force_n, float(np.nanmax(change)))
        for size in change:
            if not self._pressing and self.has_pressed and size > PRESSED * self.force_n:
                self._pressing = True
                self.presses += 1
            elif self._pressing and size < RELEASED * self.force_n:
                self._pressing = False

    @property
    def has_pressed(self) -> bool:
        """Whether the force has changed clearly: the tool has pressed."""
        return self.force_n > max(CLEAR * self.noise_n, 1e-9)

    def _distance(self, apart: FloatArray) -> float:
        if self._recorder.is_joint:  # one joint presses, others may do anything
            return float(np.nanmax(np.abs(apart)))
        return float(np.nanmax(np.linalg.norm(apart, axis=1)))

    @property
    def sentence(self) -> str:
        """What was measured so far."""
        of_force, of_position = self._scales
        way = f"{self.moved_mm * of_position:.3g} mm"
        if self._recorder.is_joint and of_position == 1.0:
            way = f"a joint by {1e-3 * self.moved_mm:.3g} m or rad"
        return (
            f"force changed by {self.force_n * of_force:.3g} N (noise "
            f"{self.noise_n * of_force:.2g}), tool moved {way}, "
            f"{self.presses} press{'' if self.presses == 1 else 'es'}"
        )


def resting(recorder: Recorder, scales: tuple[float, float] = (1.0, 1.0)) -> str:
    """Say why the newest recording is not one of a tool at rest in the air; nothing if it is.

    Args:
        recorder: that has it.
        scales: N and m that one of the readings of force and position stands for.
    """
    forces, places = recorder.since(0, 0)
    if len(forces) < FEWEST or len(places) < FEWEST:
        return ""
    low, high = np.quantile(forces, (0.02, 0.98), axis=0)
    noisy = max(noise(column) for column in forces.T)
    if (high - low).max() > max(CLEAR * noisy, 1e-9):
        changed, noisy = (high - low).max() * scales[0], noisy * scales[0]
        return f"the force changed by {changed:.3g} N meanwhile (noise {noisy:.2g})"
    near, far = np.quantile(places, (0.02, 0.98), axis=0)
    moved_mm = (far - near).max() * scales[1]
    if not recorder.is_joint and moved_mm > STILL_MM:
        return f"the tool moved by {moved_mm:.3g} mm meanwhile"
    return ""


STILL_MM = 0.5
"""A tool that moves less rests; an electromagnetic tracker's noise is below it."""


def _middle(rows: FloatArray) -> FloatArray | None:
    return np.asarray(np.median(rows, axis=0)) if len(rows) else None
