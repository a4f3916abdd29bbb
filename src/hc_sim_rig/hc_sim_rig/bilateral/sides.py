"""Master and slave as two live sides: what each does at every sample, without ROS.

The master has the hand (simulated, or a haptic device), renders the force and sends where the hand
is; the slave follows, reads its sensors and sends the model that its estimator gives it. Between
them is a link with delay and loss, which neither waits for.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.bilateral import layout
from hc_sim_rig.bilateral.datagrams import MASTER, SLAVE, Datagram
from hc_sim_rig.bilateral.live_kernel import (
    hand_force,
    move_hand,
    move_slave,
    slave_force,
    tissue_force,
)
from hc_sim_rig.bilateral.mediator import PROVISIONAL_FORCE, PROVISIONAL_STIFFNESS, ModelGate
from hc_sim_rig.bilateral.parts import Bilateral
from hc_sim_rig.bilateral.task import Task, tremor
from hc_sim_rig.bilateral.udp_link import UdpLink

Array = NDArray[np.float64]

SILENCE_S = 0.5
"""Without a datagram for so long the other side is not there: no force is sent on, no motion."""
FASTEST_COMMAND_MM_S = 500.0
"""A command that jumps (another hand, a device that is moved while nobody listened) is followed
no faster."""
LIVE_METHODS = ("model_mediated", "direct")
NO_MODEL = (math.nan,) * layout.MODEL_SIZE


class MasterSample(NamedTuple):
    """What the master did at one sample; mm, mm/s, N."""

    position_mm: float
    velocity_mm_s: float
    lateral_mm: float
    force_n: float
    update_n: float
    """Change of the force by this sample's model update."""
    tank_mj: float
    model: tuple[float, ...]
    """K, B, n, p, surface as rendered; NaN without a model."""


class SlaveSample(NamedTuple):
    """What the slave's sensors read at one sample, and the truth behind it; mm, mm/s, N."""

    position_mm: float
    velocity_mm_s: float
    force_n: float
    effort_n: float
    command_mm: float
    lateral_mm: float
    stiffness: float
    true_position_mm: float
    true_velocity_mm_s: float
    true_force_n: float


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
        self._random = np.random.default_rng(seed)
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


class MasterSide:
    """Renders the force at the hand and sends the hand's motion."""

    def __init__(self, settings: Bilateral, link: UdpLink) -> None:
        """Begin without a model.

        Raises:
            ValueError: the method of the feedback is not one of LIVE_METHODS.
        """
        if settings.feedback.method not in LIVE_METHODS:
            raise ValueError(
                f"feedback {settings.feedback.method!r} is not one of {', '.join(LIVE_METHODS)}"
            )
        self._constants = settings.constants()
        self._link = link
        self._memory = np.zeros(layout.MEMORY_SIZE)
        self._memory[layout.MEMORY_TANK] = settings.feedback.tank_mj
        self._arrived = np.zeros(layout.SENT_COLUMNS)
        self._begun = False

    def warm_up(self) -> None:
        """Compile; leaves no trace."""
        memory, y = self._memory.copy(), np.zeros(layout.Y_SIZE)
        hand_force(0.0, self._arrived, self._constants, memory)
        move_hand(0.0, 0.0, 0.0, 0.0, self._constants, y)

    def forget_motion(self) -> None:
        """The hand is not seen: when it is seen again, it has not moved meanwhile."""
        self._begun = False
        self._memory[layout.MEMORY_FORCE_BEFORE] = 0.0
        self._memory[layout.MEMORY_MASTER_VELOCITY] = 0.0

    def step(self, now_ns: int, position_mm: float, lateral_mm: float) -> MasterSample:
        """One sample: take what came, render, send.

        Args:
            now_ns: by this side's clock.
            position_mm: reading of the hand.
            lateral_mm: of the hand.
        """
        link, memory, arrived = self._link, self._memory, self._arrived
        if not self._begun:
            memory[layout.MEMORY_MASTER_BEFORE] = position_mm
            self._begun = True
        link.receive(now_ns)
        newest = link.newest
        if newest is not None:
            silent = link.silence_s(now_ns) > SILENCE_S
            arrived[layout.SENT_FORCE] = 0.0 if silent else newest.force_n
            if not math.isnan(newest.model[0]):
                # A model that is no longer renewed is still the tissue: it goes on being felt.
                arrived[layout.SENT_KNOWN] = 1.0
                arrived[layout.SENT_MODEL : layout.SENT_MODEL + layout.MODEL_SIZE] = newest.model
        force, velocity, update = hand_force(position_mm, arrived, self._constants, memory)
        link.send(Datagram(MASTER, 0, 0, 0, 0, position_mm, velocity, lateral_mm, force), now_ns)
        model = NO_MODEL
        if memory[layout.MEMORY_RENDERED] > 0.0:
            first = layout.MEMORY_MODEL
            model = tuple(memory[first : first + layout.MODEL_SIZE].tolist())
        tank = float(memory[layout.MEMORY_TANK])
        return MasterSample(position_mm, velocity, lateral_mm, force, update, tank, model)


class SlaveModel(NamedTuple):
    """What the slave's estimator knows, ready to be sent."""

    model: tuple[float, ...] = NO_MODEL
    deviations: tuple[float, ...] = (math.nan,) * 4
    relative_std: float = math.inf
    sure: bool = False


class ModelSource:
    """Makes the model to send of estimates; holds the last one that counted."""

    def __init__(self) -> None:
        """Begin without a model: a soft spring stands in where force is first felt."""
        self._gate = ModelGate()
        self.current = SlaveModel()

    def feel(self, position_mm: float, force_n: float) -> None:
        """Hear of a force before the surface is known."""
        if math.isnan(self.current.model[0]) and force_n > PROVISIONAL_FORCE:
            spring = (PROVISIONAL_STIFFNESS, 0.0, 1.0, 1.0, position_mm)
            self.current = SlaveModel(model=spring)

    def take(
        self,
        parameters: Array,
        covariance: Array,
        surface_mm: float,
        depth_mm: float,
        seconds: float,
    ) -> None:
        """Take in an estimate.

        Args:
            parameters: K, B, n, p, shape (4,).
            covariance: of them, shape (4, 4).
            surface_mm: where contact begins, in the slave's own position.
            depth_mm: penetration now.
            seconds: since the estimate before.
        """
        self._gate.went(depth_mm, seconds)
        if self._gate.trusts(parameters, covariance, surface_mm):
            deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
            self.current = SlaveModel(
                (*parameters.tolist(), surface_mm),
                tuple(deviations.tolist()),
                self._gate.relative_std,
                True,
            )
        else:
            self.current = self.current._replace(sure=False)


class SlaveSide:
    """Follows the hand, presses on simulated tissue, reads its sensors and sends the model."""

    def __init__(self, settings: Bilateral, link: UdpLink, start_mm: float, seed: int) -> None:
        """Begin at rest at a position."""
        self._constants = settings.constants()
        self._link = link
        slave = settings.slave
        self._noise = (
            slave.position_noise_std_mm,
            slave.force_noise_std_n,
            slave.effort_noise_std_n,
        )
        self._random = np.random.default_rng(seed)
        self._y = np.zeros(layout.Y_SIZE)
        self._y[layout.Y_SLAVE] = start_mm
        self._memory = np.zeros(layout.MEMORY_SIZE)
        self._memory[layout.MEMORY_SLAVE_BEFORE] = start_mm
        self._memory[layout.MEMORY_SLAVE_STIFFNESS] = slave.stiffness_low
        self._memory[layout.MEMORY_SLAVE_TANK] = slave.tank_mj
        self._fixed = slave.stiffness if slave.impedance == "fixed" else 0.0
        self._model = np.zeros(layout.SLAVE_MODEL_SIZE)
        self._command, self._lateral = start_mm, 0.0

    def warm_up(self) -> None:
        """Compile; leaves no trace."""
        y, memory = self._y.copy(), self._memory.copy()
        slave_force(0.0, 0.0, 0.0, self._model, self._constants, memory)
        move_slave(0.0, 0.0, self._constants, y)
        tissue_force(y, 0.0, self._constants)

    def step(self, now_ns: int, known: SlaveModel, felt_n: float | None = None) -> SlaveSample:
        """One sample: take what came, control, read, send, move.

        Args:
            now_ns: by this side's clock.
            known: what the estimator knows.
            felt_n: force that is sent; the sensor's if None.
        """
        link, constants, y = self._link, self._constants, self._y
        link.receive(now_ns)
        wanted_velocity = 0.0
        newest = link.newest
        if newest is not None and link.silence_s(now_ns) <= SILENCE_S:
            longest = FASTEST_COMMAND_MM_S * constants.step
            change = newest.position_mm - self._command
            self._command += min(max(change, -longest), longest)
            self._lateral = newest.lateral_mm
            if abs(change) <= longest:
                fastest = FASTEST_COMMAND_MM_S
                wanted_velocity = min(max(newest.velocity_mm_s, -fastest), fastest)
        noise = self._random.standard_normal(3) * self._noise
        true_position, true_velocity = float(y[layout.Y_SLAVE]), float(y[layout.Y_SLAVE_VELOCITY])
        true_force = tissue_force(y, self._lateral, constants)
        position, force = true_position + noise[0], true_force + noise[1]
        model = self._model
        model[0] = 0.0 if math.isnan(known.model[0]) else 1.0
        model[1 : layout.MODEL_SURE] = known.model
        model[layout.MODEL_SURE] = float(known.sure)
        push, velocity = slave_force(
            position, self._command, wanted_velocity, model, constants, self._memory
        )
        link.send(
            Datagram(
                SLAVE,
                0,
                0,
                0,
                0,
                position,
                velocity,
                self._lateral,
                force if felt_n is None else felt_n,
                known.model,
                known.deviations,
                known.relative_std,
                known.sure,
            ),
            now_ns,
        )
        move_slave(self._lateral, push, constants, y)
        return SlaveSample(
            position,
            velocity,
            force,
            push + noise[2],
            self._command,
            self._lateral,
            self._fixed or float(self._memory[layout.MEMORY_SLAVE_STIFFNESS]),
            true_position,
            true_velocity,
            true_force,
        )
