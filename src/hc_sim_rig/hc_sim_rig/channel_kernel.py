"""Compiled link between master and slave: delay, jitter, loss, bursts, overtaking.

A packet carries its sequence number and one value. It is put into the slot of the tick at which
it will arrive, so that sending and receiving cost the same however long the delay is.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.compilation import inlined
from hc_sim_rig.layout import (
    DRAW_BURST,
    DRAW_JITTER,
    DRAW_LOSS,
    LINK_BURST_BEGIN,
    LINK_BURST_END,
    LINK_JITTER,
    LINK_LOSS,
    LINK_NEWEST,
    LINK_OVERTAKING,
    LINK_VARIATION,
    LINK_VARIATION_RATE,
    NO_PACKET,
    PACKET_BURST,
    PACKET_LAST_ARRIVAL,
    PACKET_SEQUENCE,
    PACKET_VALUE,
    PACKETS_LOST,
    PACKETS_OVERTAKEN,
    RING,
)

JITTER_LIMIT = 6.0
"""Standard deviations at which the jitter is cut, so that a packet's delay has a bound."""


@inlined
def send(
    side: int,
    value: float,
    tick: int,
    rate: float,
    delay: float,
    links: NDArray[np.float64],
    packets: NDArray[np.float64],
    ring: NDArray[np.float64],
    draw: NDArray[np.float64],
) -> None:
    """Send a packet.

    Args:
        side: 0 forward (master to slave), 1 backward.
        value: what it carries.
        tick: now; also its sequence number.
        rate: ticks per second [Hz].
        delay: base delay [s].
        links: (2, LINK_COLUMNS) constants.
        packets: (2, PACKET_COLUMNS) memory, changed in place.
        ring: (2, RING, 2) packets under way: value and sequence, changed in place.
        draw: (DRAWS,) random draws of this sample.
    """
    if packets[side, PACKET_BURST] > 0.0:
        if draw[DRAW_BURST + side] < links[side, LINK_BURST_END]:
            packets[side, PACKET_BURST] = 0.0
    elif draw[DRAW_BURST + side] < links[side, LINK_BURST_BEGIN]:
        packets[side, PACKET_BURST] = 1.0
    if packets[side, PACKET_BURST] > 0.0 or draw[DRAW_LOSS + side] < links[side, LINK_LOSS]:
        packets[side, PACKETS_LOST] += 1.0
        return
    jitter = min(max(draw[DRAW_JITTER + side], -JITTER_LIMIT), JITTER_LIMIT)
    delay += links[side, LINK_JITTER] * jitter
    delay += links[side, LINK_VARIATION] * math.sin(links[side, LINK_VARIATION_RATE] * tick / rate)
    arrival = tick + min(max(round(delay * rate), 0), RING - 1)
    if links[side, LINK_OVERTAKING] == 0.0:
        arrival = max(arrival, int(packets[side, PACKET_LAST_ARRIVAL]))
        packets[side, PACKET_LAST_ARRIVAL] = arrival
    slot = arrival % RING
    if ring[side, slot, 1] != NO_PACKET:  # two in one tick: the later one counts
        packets[side, PACKETS_OVERTAKEN] += 1.0
    ring[side, slot, 0] = value
    ring[side, slot, 1] = tick


@inlined
def receive(
    side: int,
    tick: int,
    links: NDArray[np.float64],
    packets: NDArray[np.float64],
    ring: NDArray[np.float64],
) -> float:
    """Take what arrives at a tick and return the value that the receiver has now."""
    slot = tick % RING
    sequence = ring[side, slot, 1]
    if sequence != NO_PACKET:
        ring[side, slot, 1] = NO_PACKET
        if sequence < packets[side, PACKET_SEQUENCE] and links[side, LINK_NEWEST] > 0.0:
            packets[side, PACKETS_OVERTAKEN] += 1.0
        else:
            packets[side, PACKET_VALUE] = ring[side, slot, 0]
            packets[side, PACKET_SEQUENCE] = sequence
    return float(packets[side, PACKET_VALUE])
