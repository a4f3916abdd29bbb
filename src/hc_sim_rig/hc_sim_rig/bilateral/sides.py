"""Master and slave as two live sides: what each does at every sample, without ROS.

The master has the hand (simulated, or a haptic device), renders the force and sends where the hand
is; the slave follows, reads its sensors and sends the model that its estimator gives it. Between
them is a link with delay and loss, which neither waits for.
"""

from __future__ import annotations

import math
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
from hc_sim_rig.bilateral.model_source import NO_MODEL, SlaveModel
from hc_sim_rig.bilateral.parts import Bilateral
from hc_sim_rig.bilateral.udp_link import UdpLink
from hc_sim_rig.bilateral.wave_arrivals import SILENCE_S, WaveArrivals

Array = NDArray[np.float64]

FASTEST_COMMAND_MM_S = 500.0
"""A command that jumps (another hand, a device that is moved while nobody listened) is followed
no faster."""
ALIGNED_MM = 0.2
"""With waves the tool first goes to where the hand is: they carry motion, and no place."""


_SLAVE_READINGS = 2
"""Keeps the errors of its readings apart from those of a simulated hand with the same seed."""


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


class MasterSide:
    """Renders the force at the hand and sends the hand's motion."""

    def __init__(self, settings: Bilateral, link: UdpLink, scale: float = 1.0) -> None:
        """Begin without a model.

        Args:
            settings: of the teleoperation.
            link: to the slave.
            scale: motion of the slave over that of the device. The bounds of what is rendered are
                meant at the device, all else is in the slave's millimetres.
        """
        constants = settings.constants()
        self._constants = constants._replace(
            largest_stiffness=constants.largest_stiffness / scale,
            largest_damping=constants.largest_damping / scale,
            controller_damping=constants.controller_damping / scale,
        )
        self._step_ns = 1e9 / settings.rate_hz
        self._method = layout.METHODS.index(settings.feedback.method)
        self._waves = WaveArrivals(link, layout.BACKWARD)
        self._link = link
        self._memory = np.zeros(layout.MEMORY_SIZE)
        self._memory[layout.MEMORY_TANK] = settings.feedback.tank_mj
        self._arrived = np.zeros(layout.SENT_COLUMNS)
        self._begun = False

    def warm_up(self) -> None:
        """Compile; leaves no trace."""
        memory, y = self._memory.copy(), np.zeros(layout.Y_SIZE)
        hand_force(0.0, 0.001, self._arrived, False, 1, self._constants, memory)
        move_hand(0.0, 0.0, 0.0, 0.0, self._constants, y)

    def rest(self, now_ns: int) -> None:
        """One sample without a hand: it gets no force, and is as at first contact when seen again.

        It may be deep in the rendered tissue by then, without having done the work: the surface
        begins under it anew, and what the spring held is given up, as are waves that came.

        Args:
            now_ns: by this side's clock.
        """
        self._link.receive(now_ns)
        self._waves.forget()
        self._begun = False
        for place in (
            layout.MEMORY_FORCE_BEFORE,
            layout.MEMORY_MASTER_VELOCITY,
            layout.MEMORY_RENDERED,
            layout.MEMORY_ELASTIC,
        ):
            self._memory[place] = 0.0

    def step(
        self, now_ns: int, position_mm: float, lateral_mm: float, elapsed_s: float | None = None
    ) -> MasterSample:
        """One sample: take what came, render, send.

        Args:
            now_ns: by this side's clock.
            position_mm: reading of the hand.
            lateral_mm: of the hand.
            elapsed_s: time since the reading before; 0 if it is the same one, None: a sample.
        """
        link, memory, arrived = self._link, self._memory, self._arrived
        if not self._begun:
            memory[layout.MEMORY_MASTER_BEFORE] = position_mm
            self._begun = True
        link.receive(now_ns)
        newest, heard, lead = link.newest, False, 1
        if newest is not None:
            heard = link.silence_s(now_ns) <= SILENCE_S
            self._waves.take(newest, heard, arrived, memory)
            lead = link.playout.lead(newest.sent_ns, now_ns, self._step_ns)
            arrived[layout.SENT_FORCE] = newest.force_n if heard else 0.0
            arrived[layout.SENT_POSITION] = newest.position_mm
            arrived[layout.SENT_VELOCITY] = newest.velocity_mm_s
            if not math.isnan(newest.model[0]):
                # A model that is no longer renewed is still the tissue: it goes on being felt.
                arrived[layout.SENT_KNOWN] = 1.0
                arrived[layout.SENT_MODEL : layout.SENT_MODEL + layout.MODEL_SIZE] = newest.model
        constants = self._constants
        elapsed = constants.step if elapsed_s is None else elapsed_s
        force, velocity, update = hand_force(
            position_mm, elapsed, arrived, heard, lead, constants, memory
        )
        link.send(
            Datagram(
                MASTER,
                0,
                0,
                0,
                0,
                position_mm,
                velocity,
                lateral_mm,
                force,
                method=self._method,
                wave=float(memory[layout.MEMORY_WAVE_SENT + layout.FORWARD]),
                wave_energy_mj=float(memory[layout.MEMORY_WAVE_ENERGY_SENT + layout.FORWARD]),
                wave_impedance=constants.wave_impedance,
            ),
            now_ns,
        )
        model = NO_MODEL
        if memory[layout.MEMORY_RENDERED] > 0.0:
            first = layout.MEMORY_MODEL
            model = tuple(memory[first : first + layout.MODEL_SIZE].tolist())
        tank = float(memory[layout.MEMORY_TANK])
        return MasterSample(position_mm, velocity, lateral_mm, force, update, tank, model)


class SlaveSide:
    """Follows the hand, presses on simulated tissue, reads its sensors and sends the model."""

    def __init__(self, settings: Bilateral, link: UdpLink, start_mm: float, seed: int) -> None:
        """Begin at rest at a position."""
        self._constants = settings.constants()
        self._step_ns = 1e9 / settings.rate_hz
        self._link = link
        self._waves = WaveArrivals(link, layout.FORWARD)
        self._arrived = np.zeros(layout.SENT_COLUMNS)
        self._feedback: tuple[int, float, int] | None = None
        self.aligned = False
        slave = settings.slave
        self._noise = (
            slave.position_noise_std_mm,
            slave.force_noise_std_n,
            slave.effort_noise_std_n,
        )
        self._random = np.random.default_rng([seed, _SLAVE_READINGS])
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
        slave_force(0.0, 0.0, 0.0, self._arrived, 1, self._model, self._constants, memory)
        move_slave(0.0, 0.0, self._constants, y)
        tissue_force(y, 0.0, self._constants)

    def step(self, now_ns: int, known: SlaveModel, sent_n: float | None = None) -> SlaveSample:
        """One sample: take what came, control, read, send, move.

        Args:
            now_ns: by this side's clock.
            known: what the estimator knows.
            sent_n: force that is sent; the sensor's if None.
        """
        link, y, memory = self._link, self._y, self._memory
        link.receive(now_ns)
        wanted_velocity, lead = self._follow(now_ns)
        constants = self._constants
        by_waves = constants.method == layout.WAVE_VARIABLES
        control = constants
        if by_waves and not self.aligned:
            control = constants._replace(method=float(layout.DIRECT))
        noise = self._random.standard_normal(3) * self._noise
        true_position, true_velocity = float(y[layout.Y_SLAVE]), float(y[layout.Y_SLAVE_VELOCITY])
        true_force = tissue_force(y, self._lateral, constants)
        position, force = true_position + noise[0], true_force + noise[1]
        model = self._model
        model[0] = 0.0 if math.isnan(known.model[0]) else 1.0
        model[1 : layout.MODEL_SURE] = known.model
        model[layout.MODEL_SURE] = float(known.sure)
        push, velocity = slave_force(
            position, self._command, wanted_velocity, self._arrived, lead, model, control, memory
        )
        if by_waves and self.aligned:
            self._command = float(memory[layout.MEMORY_WAVE_COMMAND])
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
                force if sent_n is None else sent_n,
                known.model,
                known.deviations,
                known.relative_std,
                known.sure,
                int(constants.method),
                float(memory[layout.MEMORY_WAVE_SENT + layout.BACKWARD]),
                float(memory[layout.MEMORY_WAVE_ENERGY_SENT + layout.BACKWARD]),
                constants.wave_impedance,
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
            self._stiffness(control.method),
            true_position,
            true_velocity,
            true_force,
        )

    @property
    def method(self) -> str:
        """How force comes back: what the master says."""
        return layout.METHODS[int(self._constants.method)]

    def _stiffness(self, method: float) -> float:
        """Of the spring between command and tool [N/mm]."""
        if method == layout.WAVE_VARIABLES:
            return self._constants.wave_stiffness
        if method == layout.POSITION_POSITION:
            return self._constants.position_stiffness
        return self._fixed or float(self._memory[layout.MEMORY_SLAVE_STIFFNESS])

    def _follow(self, now_ns: int) -> tuple[float, int]:
        """Take the master's newest: velocity wanted [mm/s], samples until its wave's turn."""
        link, constants = self._link, self._constants
        newest = link.newest
        if newest is None:
            return 0.0, 1
        heard = link.silence_s(now_ns) <= SILENCE_S
        self._waves.take(newest, heard, self._arrived, self._memory)
        feedback = (newest.method, newest.wave_impedance, link.restarts)
        if not heard or feedback != self._feedback:
            self.aligned = False
        if not heard:
            return 0.0, 1
        if feedback != self._feedback:
            self._feedback = feedback
            self._constants = constants = constants._replace(
                method=float(newest.method), wave_impedance=newest.wave_impedance
            )
        longest = FASTEST_COMMAND_MM_S * constants.step
        self._lateral += min(max(newest.lateral_mm - self._lateral, -longest), longest)
        if self.aligned and newest.method == layout.WAVE_VARIABLES:
            return 0.0, link.playout.lead(newest.sent_ns, now_ns, self._step_ns)
        change = newest.position_mm - self._command
        self._command += min(max(change, -longest), longest)
        if abs(change) > longest:
            return 0.0, 1
        if abs(self._command - self._memory[layout.MEMORY_SLAVE_BEFORE]) <= ALIGNED_MM:
            # From here on the waves lead: this datagram's place is where they begin.
            self._memory[layout.MEMORY_WAVE_COMMAND] = self._command
            self._waves.begin(newest, self._memory)
            self.aligned = True
        fastest = FASTEST_COMMAND_MM_S
        return min(max(newest.velocity_mm_s, -fastest), fastest), 1
