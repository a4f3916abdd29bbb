"""Which of the other side's waves count: those since both sides have heard of each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.bilateral import layout
from hc_sim_rig.bilateral.datagrams import Datagram
from hc_sim_rig.bilateral.udp_link import UdpLink

Array = NDArray[np.float64]

SILENCE_S = 0.5
"""Without a datagram for so long the other side is not there: no force is sent on, no motion."""


class WaveArrivals:
    """What has come of the other side's waves: from when on it counts.

    What was sent before the two sides heard of each other, or while they did not for SILENCE_S, is
    owed to nobody: it is dropped, with its energy.
    """

    def __init__(self, link: UdpLink, direction: int) -> None:
        """Begin; `direction` is FORWARD for what the slave gets, BACKWARD for the master."""
        self._link = link
        self._direction = direction
        self._restarts = 0
        self._begun = False

    def take(self, newest: Datagram, heard: bool, arrived: Array, memory: Array) -> None:
        """Take the newest datagram.

        Args:
            newest: of the other side.
            heard: whether the other side is there.
            arrived: (SENT_COLUMNS,), changed in place.
            memory: (MEMORY_SIZE,), changed in place where the waves begin anew.
        """
        if not heard or self._restarts != self._link.restarts:
            self._begun = False
        self._restarts = self._link.restarts
        if not self._begun:
            self.begin(newest, memory)
        self._begun = heard
        arrived[layout.SENT_WAVE] = newest.wave
        arrived[layout.SENT_ENERGY] = newest.wave_energy_mj

    def forget(self) -> None:
        """What comes until the next datagram that is taken is owed to nobody."""
        self._begun = False

    def begin(self, newest: Datagram, memory: Array) -> None:
        """From this datagram on the waves count."""
        memory[layout.MEMORY_WAVE_USED + self._direction] = newest.wave
        memory[layout.MEMORY_WAVE_ENERGY_USED + self._direction] = newest.wave_energy_mj
