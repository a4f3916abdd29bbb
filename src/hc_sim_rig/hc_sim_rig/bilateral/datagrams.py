"""What master and slave send each other: one datagram of fixed size a sample, and its meaning.

Both directions have the same layout (little-endian): a word that tells the program and version,
who sends, which life of it, a sequence number, three times for the clock exchange, then numbers in
mm, mm/s and N. Whatever is not such a datagram is refused with the reason; nothing that arrives is
ever executed.
"""

from __future__ import annotations

import math
import struct
from typing import Final, NamedTuple

from hc_sim_rig.bilateral.layout import (
    HIGHEST,
    LARGEST_IMPEDANCE,
    LEAST_IMPEDANCE,
    LOWEST,
    METHODS,
    MODEL_SIZE,
)

WORD: Final = b"hct3"
MASTER: Final = 0
SLAVE: Final = 1
_LAYOUT: Final = struct.Struct(f"<4sBBHIQqqq4d3d{MODEL_SIZE}d4dd")
SIZE: Final = _LAYOUT.size
NEVER: Final = -1
"""Echo of somebody who has heard nothing yet."""
LARGEST_MM = 1e4
LARGEST_N = 1e4
LARGEST_WAVE = 1e9
"""Integral of the waves, and their energy in mJ: a million times what an hour of work makes."""


class Datagram(NamedTuple):
    """One sample of one side.

    Attributes:
        side: MASTER or SLAVE, who sends.
        sequence: counts the datagrams of this side's life.
        sent_ns: when it left, by the sender's clock.
        echo_ns: `sent_ns` of the newest datagram that the sender has got, NEVER before one.
        heard_ns: when that one arrived, by the sender's clock.
        position_mm: of the hand, or of the tool.
        velocity_mm_s: the same.
        lateral_mm: sideways.
        force_n: rendered at the hand, or read at the tool.
        model: K, B, n, p, surface [mm]; of the slave, NaN before there is one.
        deviations: standard deviations of K, B, n, p.
        relative_std: of the model's force at working depth; infinite while it is not known.
        sure: whether the newest estimate counts; the model is the newest one that did.
        method: index in METHODS: the master says how force comes back, the slave does it so.
        wave: integral of the waves that this side has sent.
        wave_energy_mj: integral of half their square.
        wave_impedance: of the waves [N s/mm]; the master's counts.
        life: of the side: another number each time that it is started.
    """

    side: int
    sequence: int
    sent_ns: int
    echo_ns: int
    heard_ns: int
    position_mm: float
    velocity_mm_s: float
    lateral_mm: float
    force_n: float
    model: tuple[float, ...] = (math.nan,) * MODEL_SIZE
    deviations: tuple[float, ...] = (math.nan,) * 4
    relative_std: float = math.inf
    sure: bool = False
    method: int = METHODS.index("model_mediated")
    wave: float = 0.0
    wave_energy_mj: float = 0.0
    wave_impedance: float = LEAST_IMPEDANCE
    life: int = 0

    def encode(self) -> bytes:
        """Return the bytes that are sent."""
        return _LAYOUT.pack(
            WORD,
            self.side,
            self.sure,
            self.method,
            self.life,
            self.sequence,
            self.sent_ns,
            self.echo_ns,
            self.heard_ns,
            self.position_mm,
            self.velocity_mm_s,
            self.lateral_mm,
            self.force_n,
            self.wave,
            self.wave_energy_mj,
            self.wave_impedance,
            *self.model,
            *self.deviations,
            self.relative_std,
        )


def decode(data: bytes) -> Datagram:
    """Read a datagram.

    Raises:
        ValueError: it is none, or says what cannot be.
    """
    if len(data) != SIZE:
        raise ValueError(f"{len(data)} bytes, not {SIZE}")
    word, side, sure, method, life, sequence, sent, echo, heard, *numbers = _LAYOUT.unpack(data)
    if word != WORD:
        raise ValueError(f"begins with {word!r}, not {WORD!r}")
    if side not in (MASTER, SLAVE):
        raise ValueError(f"is of side {side}")
    position, velocity, lateral, force = numbers[:4]
    motion = (position, velocity / 10.0, lateral)
    if not (all(abs(v) <= LARGEST_MM for v in motion) and abs(force) <= LARGEST_N):
        raise ValueError("motion or force is out of range or no number")
    if method >= len(METHODS):
        raise ValueError(f"feeds back by method {method}")
    wave, energy, impedance = numbers[4:7]
    if not (
        abs(wave) <= LARGEST_WAVE
        and 0.0 <= energy <= LARGEST_WAVE
        and LEAST_IMPEDANCE <= impedance <= LARGEST_IMPEDANCE
    ):
        raise ValueError("the waves are out of range or no number")
    model = tuple(numbers[7 : 7 + MODEL_SIZE])
    deviations = tuple(numbers[7 + MODEL_SIZE : 11 + MODEL_SIZE])
    if all(map(math.isnan, model)):
        if sure:
            raise ValueError("is sure of no model")
    else:
        _check_model(model)
        if any(deviation < 0.0 for deviation in deviations) or not numbers[-1] >= 0.0:
            raise ValueError("a standard deviation of the model is negative or no number")
    return Datagram(
        side,
        sequence,
        sent,
        echo,
        heard,
        position,
        velocity,
        lateral,
        force,
        model,
        deviations,
        numbers[-1],
        bool(sure),
        method,
        wave,
        energy,
        impedance,
        life,
    )


def _check_model(model: tuple[float, ...]) -> None:
    """Refuse a model that no estimate that counts can be.

    Raises:
        ValueError: names the parameter.
    """
    for name, value, least, most in zip("KBnp", model, LOWEST, HIGHEST, strict=False):
        if not least <= value <= most:
            raise ValueError(f"the model's {name} is {value:g}, not within {least:g} to {most:g}")
    if not abs(model[-1]) <= LARGEST_MM:
        raise ValueError(f"the model's surface is at {model[-1]:g} mm")
