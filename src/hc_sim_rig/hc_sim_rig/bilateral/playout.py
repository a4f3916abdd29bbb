"""When it is a wave's turn: late enough for nearly all packets, by the transit times as they are.

The simulation knows its network's delay and jitter; a live side measures them. Mean and standard
deviation are of arrival by the own clock less departure by the other's, so what the clocks differ
by is in the mean, and falls out: no clock needs to be right. (RFC 3550 and players of audio do it
alike.)
"""

from __future__ import annotations

import math

PLAYOUT_DEVIATIONS = 3.0
PLAYOUT_SAMPLES = 9
"""One for the way itself, eight for packets that are lost."""
REMEMBERED = 2000
"""Datagrams over which mean and deviation are taken (exponentially weighted): two seconds."""


class Playout:
    """Follows the transit time of datagrams and its scatter."""

    def __init__(self) -> None:
        """Begin knowing nothing."""
        self.forget()

    def forget(self) -> None:
        """A clock was set, or the other side was started again."""
        self._count = 0
        self._mean_ns = self._variance_ns2 = 0.0

    def add(self, sent_ns: int, arrived_ns: int) -> None:
        """Take in a datagram: when it left by the other clock, when it came by this one."""
        self._count += 1
        weight = max(1.0 / self._count, 1.0 / REMEMBERED)
        change = (arrived_ns - sent_ns) - self._mean_ns
        self._mean_ns += weight * change
        self._variance_ns2 = (1.0 - weight) * (self._variance_ns2 + weight * change * change)

    def lead(self, sent_ns: int, now_ns: int, step_ns: float) -> int:
        """Samples from now until the turn of the datagram that left at a time; may be negative."""
        late = self._mean_ns + PLAYOUT_DEVIATIONS * math.sqrt(self._variance_ns2)
        return round((sent_ns + late - now_ns) / step_ns) + PLAYOUT_SAMPLES
