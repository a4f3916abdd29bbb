"""The way between the two sides: UDP, and delay, jitter and loss of its own where it is wanted.

A datagram each way per sample, never repeated and never waited for: what is late is superseded by
the next one. The receiver keeps the newest. With `added` a side holds back and drops what it sends,
so that two sides on one machine are far apart; between two hosts the network does that.
"""

from __future__ import annotations

import heapq
import math
import random
import socket
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from hc_sim_rig.bilateral.clock_offset import ClockOffset
from hc_sim_rig.bilateral.datagrams import NEVER, SIZE, Datagram, decode
from hc_sim_rig.bilateral.playout import Playout

MOST_AT_ONCE = 1000
"""Datagrams that are read at one sample; more wait."""
SET_NS = 1_000_000_000
"""By so much more than the steady clock the own one was set; the exchanges find smaller steps."""
FORMER_LIVES = 1000
"""Of the other side, whose datagrams may still come: late, or twice."""


class Added(NamedTuple):
    """Delay, its standard deviation [s] and share lost, of what is sent."""

    delay_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0


class Clocks(NamedTuple):
    """Clocks of this host [ns]: one that may be set, and one that nobody sets."""

    system: Callable[[], int]
    steady: Callable[[], int]


class LinkError(ValueError):
    """Why a link cannot be, in one line."""


class UdpLink:
    """One side of the link.

    Attributes:
        newest: the newest datagram of the other side; None before one has come.
        clock: the other side's clock.
        playout: how late its datagrams come.
        restarts: times that the other side was started again.
        sent, unsent, received, overtaken, refused, lost: datagrams. Unsent ones the network did
            not take; overtaken ones were older than one that was there; refused ones were no
            datagrams of ours; lost ones never came, by their numbers.
        why_refused: reason of the last one that was refused.
    """

    def __init__(
        self,
        side: int,
        bind: str,
        port: int,
        peer: str,
        peer_port: int,
        added: Added,
        seed: int,
        clocks: Clocks | None = None,
    ) -> None:
        """Open the socket.

        Args:
            side: MASTER or SLAVE.
            bind: address of this host.
            port: of this side.
            peer: host of the other side.
            peer_port: of the other side; what comes from elsewhere is refused.
            added: to what is sent.
            seed: of what is added.
            clocks: for what a datagram's arrival, silence and what is held back go by; None: all
                is at the times that are given.

        Raises:
            LinkError: an address cannot be, or the port is in use.
        """
        self._side = side
        self._added = added
        self._random = random.Random(seed)
        self._waiting: list[tuple[int, int, bytes]] = []
        self.newest: Datagram | None = None
        self.clock = ClockOffset()
        self.playout = Playout()
        self.restarts = 0
        # Numbers, clocks and ports begin anew with a process; this tells one life from another.
        self._life = random.SystemRandom().getrandbits(32)
        self._former: deque[int] = deque(maxlen=FORMER_LIVES)
        self._whom = f"{peer}:{peer_port}"
        self._clocks = clocks
        self._ahead_ns: int | None = None  # of the own clock before the steady one
        self.sent = self.unsent = self.received = self.overtaken = self.refused = 0
        self.why_refused = ""
        self._first_sequence = 0
        self._heard_ns = self._heard_steady_ns = NEVER
        try:
            family, _, _, _, address = socket.getaddrinfo(peer, peer_port, type=socket.SOCK_DGRAM)[
                0
            ]
            self._peer = address
            self._socket = socket.socket(family, socket.SOCK_DGRAM)
            self._socket.setblocking(False)
            self._socket.bind((bind, port))
        except (OSError, OverflowError) as error:
            raise LinkError(f"link from {bind}:{port} to {peer}:{peer_port}: {error}") from error

    @property
    def port(self) -> int:
        """Port that this side listens on."""
        return int(self._socket.getsockname()[1])

    @property
    def lost(self) -> int:
        """Datagrams of the other side that never came, or have not come yet."""
        if self.newest is None:
            return 0
        expected = self.newest.sequence - self._first_sequence + 1
        return max(0, expected - self.received)

    def age_s(self, now_ns: int) -> float:
        """Time since the newest datagram left, by both clocks; infinite before one has come."""
        if self.newest is None:
            return math.inf
        return (now_ns - (self.newest.sent_ns - self.clock.offset_ns)) * 1e-9

    def silence_s(self, now_ns: int) -> float:
        """Time since the newest datagram came; infinite before one has come."""
        if self._heard_ns == NEVER:
            return math.inf
        return (self._steady(now_ns) - self._heard_steady_ns) * 1e-9

    def receive(self, now_ns: int) -> None:
        """Read what has come; `newest` is the newest of it.

        Args:
            now_ns: by this side's clock.
        """
        ahead_ns, before_ns = now_ns - self._steady(now_ns), self._ahead_ns
        self._ahead_ns = ahead_ns
        if before_ns is not None and abs(ahead_ns - before_ns) > SET_NS:
            self.clock.was_set(now_ns)
            self.playout.forget()
        for _ in range(MOST_AT_ONCE):
            try:
                data, source = self._socket.recvfrom(SIZE + 1)
            except BlockingIOError:
                return
            except ConnectionError:  # the other side is not there: its host says so
                continue
            if source[:2] != self._peer[:2]:
                self._refuse(f"comes from {source[0]}:{source[1]}, not from {self._whom}")
                continue
            # A time of before the arrival would break the bound of the clock's offset.
            came_ns = now_ns if self._clocks is None else self._clocks.system()
            try:
                self._take(decode(data), came_ns)
            except ValueError as error:
                self._refuse(str(error))

    def send(self, datagram: Datagram, now_ns: int) -> None:
        """Send a datagram, with the times of the clock exchange put in, and what was held back.

        Args:
            datagram: its times and its sequence do not matter.
            now_ns: by this side's clock.
        """
        newest = self.newest
        data = datagram._replace(
            side=self._side,
            life=self._life,
            sequence=self.sent,
            sent_ns=now_ns,
            echo_ns=NEVER if newest is None else newest.sent_ns,
            heard_ns=self._heard_ns,
        ).encode()
        self.sent += 1
        steady_ns = self._steady(now_ns)
        delay, jitter, loss = self._added
        if self._random.random() >= loss:
            wait = max(0.0, self._random.gauss(delay, jitter)) if delay or jitter else 0.0
            heapq.heappush(self._waiting, (steady_ns + round(wait * 1e9), self.sent, data))
        while self._waiting and self._waiting[0][0] <= steady_ns:
            self._put(heapq.heappop(self._waiting)[2])

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _put(self, data: bytes) -> None:
        try:
            self._socket.sendto(data, self._peer)
        except OSError:  # it is lost like any other that gets lost: the next one follows at once
            self.unsent += 1

    def _steady(self, now_ns: int) -> int:
        return now_ns if self._clocks is None else self._clocks.steady()

    def _refuse(self, reason: str) -> None:
        self.refused += 1
        self.why_refused = reason

    def _take(self, datagram: Datagram, now_ns: int) -> None:
        if datagram.side == self._side:
            raise ValueError("is of this same side: two masters, or two slaves")
        if datagram.life in self._former:
            self.overtaken += 1
            return
        newest = self.newest
        restarted = newest is not None and datagram.life != newest.life
        if newest is not None and restarted:
            self._former.append(newest.life)
            self.restarts += 1
        if newest is None or restarted:
            self._first_sequence, self.received = datagram.sequence, 0
        self.received += 1
        steps = self.clock.steps
        if datagram.echo_ns != NEVER:
            self.clock.add(datagram.echo_ns, datagram.heard_ns, datagram.sent_ns, now_ns)
        if restarted or self.clock.steps != steps:
            self.playout.forget()
        self.playout.add(datagram.sent_ns, now_ns)
        if newest is not None and datagram.sequence <= newest.sequence and not restarted:
            self.overtaken += 1
            return
        self.newest, self._heard_ns = datagram, now_ns
        self._heard_steady_ns = self._steady(now_ns)
