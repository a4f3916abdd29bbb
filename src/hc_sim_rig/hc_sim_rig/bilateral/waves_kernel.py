"""Compiled wave variables that stay passive on a network that delays, jitters and loses.

Source: Niemeyer and Slotine, Stable adaptive teleoperation (1991), and Telemanipulation with time
delays (2004): what is sent is the integral of the wave and of its energy; the receiver brings out
at most the energy that it knows to have been put in. Equations in docs/teleoperation.md.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.bilateral.layout import (
    MEMORY_WAVE_ENERGY_SENT,
    MEMORY_WAVE_ENERGY_USED,
    MEMORY_WAVE_SENT,
    MEMORY_WAVE_USED,
)
from hc_sim_rig.compilation import inlined


@inlined
def wave_out(
    side: int,
    integral: float,
    energy: float,
    lead: int,
    step: float,
    memory: NDArray[np.float64],
) -> float:
    """The wave that comes out of the network at this sample [sqrt(N mm/s)].

    What the newest packet says is still owed is brought out evenly until that packet's own turn
    comes, so that loss and jitter within the buffer leave no trace. Never more energy comes out
    than is known to have gone in, whatever the network does.

    Args:
        side: direction.
        integral: newest integral of the wave that arrived.
        energy: newest integral of half its square [mJ].
        lead: samples until it is the newest packet's turn; less than one counts as one.
        step: sample period [s].
        memory: (MEMORY_SIZE,), changed in place.
    """
    owed = integral - memory[MEMORY_WAVE_USED + side]
    allowed = max(energy - memory[MEMORY_WAVE_ENERGY_USED + side], 0.0)
    wave = owed / (max(lead, 1) * step)
    limit = math.sqrt(2.0 * allowed / step)
    wave = float(min(max(wave, -limit), limit))
    memory[MEMORY_WAVE_USED + side] += wave * step
    memory[MEMORY_WAVE_ENERGY_USED + side] += 0.5 * wave * wave * step
    return wave


@inlined
def wave_in(side: int, wave: float, step: float, memory: NDArray[np.float64]) -> None:
    """Put a wave into the network: its integral and energy grow."""
    memory[MEMORY_WAVE_SENT + side] += wave * step
    memory[MEMORY_WAVE_ENERGY_SENT + side] += 0.5 * wave * wave * step


@inlined
def master_wave_force(velocity: float, wave: float, impedance: float) -> float:
    """Force at the hand F_m = b v_m - sqrt(2 b) w_m [N]."""
    return impedance * velocity - math.sqrt(2.0 * impedance) * wave


@inlined
def master_wave(velocity: float, wave: float, impedance: float) -> float:
    """Wave u_m = sqrt(2 b) v_m - w_m that the master sends."""
    return math.sqrt(2.0 * impedance) * velocity - wave


@inlined
def slave_wave_force(
    wave: float,
    position_error: float,
    velocity: float,
    stiffness: float,
    damping: float,
    impedance: float,
) -> float:
    """Force of the slave's controller [N].

    F_s = K (x_sd - x_s) + B (v_sd - v_s) with the velocity v_sd = (sqrt(2 b) u_s - F_s) / b that
    the wave and this same force ask for, solved for F_s.
    """
    wanted = math.sqrt(2.0 / impedance) * wave
    return (stiffness * position_error + damping * (wanted - velocity)) / (
        1.0 + damping / impedance
    )


@inlined
def slave_wave_velocity(wave: float, force: float, impedance: float) -> float:
    """Velocity v_sd that the wave asks of the slave [mm/s]."""
    return (math.sqrt(2.0 * impedance) * wave - force) / impedance


@inlined
def slave_wave(wave: float, force: float, impedance: float) -> float:
    """Wave w_s = u_s - sqrt(2 / b) F_s that the slave sends back."""
    return wave - math.sqrt(2.0 / impedance) * force
