"""A hand that is simulated while the rest is live: the operator's arm on the device, at 1 kHz."""

from __future__ import annotations

from collections import deque

import numpy as np

from hc_sim_rig.bilateral import layout
from hc_sim_rig.bilateral.live_kernel import move_hand
from hc_sim_rig.bilateral.parts import Bilateral
from hc_sim_rig.bilateral.task import Task, tremor

_READINGS = 1


class SimulatedHand:
    """The operator's arm on the device: moves by what it wants, its tremor, and what it feels."""

    def __init__(self, settings: Bilateral, task: Task, seed: int) -> None:
        """Begin where the task begins."""
        self._constants = settings.constants()
        self._task = task
        arm = settings.operator
        self._tremor = tremor(
            task.samples,
            settings.rate_hz,
            arm.tremor_std_n,
            arm.tremor_low_hz,
            arm.tremor_high_hz,
            seed,
        )
        self._random = np.random.default_rng([seed, _READINGS])  # apart from the tremor
        self._noise = settings.device.position_noise_std_mm
        self._y = np.zeros(layout.Y_SIZE)
        self._y[layout.Y_MASTER] = task.path[0]
        self._late: deque[tuple[float, float]] = deque()
        self._correction = 0.0
        self._k = 0

    @property
    def finished(self) -> bool:
        """Whether the task is done; the hand then stays where it wanted to be last."""
        return self._k >= self._task.samples

    @property
    def lateral_mm(self) -> float:
        """Where the hand is sideways."""
        return float(self._task.lateral[min(self._k, self._task.samples)])

    def reading_mm(self) -> float:
        """Read the device's position."""
        return float(self._y[layout.Y_MASTER] + self._noise * self._random.standard_normal())

    def move(self, force_n: float) -> None:
        """Go on to the next sample with a force held."""
        constants, k, last = self._constants, self._k, self._task.samples
        path = self._task.path
        here = float(path[min(k, last)])
        self._late.append((here, float(self._y[layout.Y_MASTER])))
        if len(self._late) > constants.reaction_samples:
            wanted, was = self._late.popleft()
            limit = constants.correction_limit
            correction = self._correction + constants.correction_rate * constants.step * (
                wanted - was
            )
            self._correction = min(max(correction, -limit), limit)
        rate = (float(path[min(k + 1, last)]) - here) * constants.rate
        shaking = float(self._tremor[k % last])
        move_hand(here + self._correction, rate, shaking, force_n, constants, self._y)
        self._k += 1
