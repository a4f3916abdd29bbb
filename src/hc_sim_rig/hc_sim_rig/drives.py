"""What carries the tool, as a scenario names it: a stage, or master and slave with a channel.

Symbols and values are those of paper C, tables I and II; docs/rig.md has the loop as a picture.
"""

# ruff: noqa: RUF009 - the field functions of schema.py are made for defaults

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.layout import RING
from hc_sim_rig.motions import ConstantVelocity, MultiSine, StepHold, Waypoints
from hc_sim_rig.schema import ScenarioError, Section, number, section, word
from hc_sim_rig.sensors import Noise

JITTER_BOUND = 6.0


@dataclass(frozen=True, kw_only=True)
class ProcessNoise(Section):
    """Noise in the plant's own motion, added once per sample."""

    enters: str = word("none", "none", "position", "velocity")
    std: float = number(0.0, minimum=0.0, maximum=1e3, unit="mm or mm/s per sample")
    noise: Noise = section(Noise)


@dataclass(frozen=True, kw_only=True)
class Stage(Section):
    """A position-controlled linear stage that carries the tool.

    ideal: the tool is where the motion says. servo: a velocity loop inside a position loop,
    critically damped, with limits of velocity and acceleration.
    """

    PRESETS: ClassVar[dict[str, dict[str, Any]]] = {
        # Linear magnetic motor of paper A, section 5.4 (class values, rounded): the loop's
        # bandwidth is a choice, the limits are far below the motor's own.
        "linear_motor": {
            "dynamics": "servo",
            "bandwidth_hz": 25.0,
            "velocity_limit_mm_s": 500.0,
            "acceleration_limit_mm_s2": 20000.0,
        },
    }

    kind: str = word(None, "stage")
    preset: str = word("none", "none", "linear_motor")
    motion: ConstantVelocity | MultiSine | StepHold | Waypoints = section()
    lateral: ConstantVelocity | MultiSine | StepHold | Waypoints | None = None
    dynamics: str = word("ideal", "ideal", "servo")
    bandwidth_hz: float = number(25.0, above=0.0, maximum=1e3, unit="Hz")
    velocity_limit_mm_s: float = number(1e4, above=0.0, unit="mm/s")
    acceleration_limit_mm_s2: float = number(1e7, above=0.0, unit="mm/s^2")
    process_noise: ProcessNoise = section(ProcessNoise)

    def __post_init__(self) -> None:
        """Check that noise has something to act on."""
        super().__post_init__()
        if self.dynamics == "ideal" and self.process_noise.enters != "none":
            raise ScenarioError(
                "process_noise enters the motion, but dynamics is ideal: choose dynamics servo"
            )


@dataclass(frozen=True, kw_only=True)
class Master(Section):
    """Master manipulator (Eq. 10) and what its controller makes of it (Eq. 16, 17)."""

    inertia: float = number(0.05, above=0.0, about="j_m")
    damping: float = number(0.03, minimum=0.0, about="b_m")
    spring: float = number(0.1, minimum=0.0, about="k_m")
    desired_inertia: float = number(0.2, above=0.0, about="j_dm")
    desired_damping: float = number(4.0, minimum=0.0, about="b_dm")
    desired_spring: float = number(2.0, minimum=0.0, about="k_dm")
    start_rad: float = number(0.0, minimum=-100.0, maximum=100.0, unit="rad")


@dataclass(frozen=True, kw_only=True)
class Slave(Section):
    """Slave manipulator (Eq. 11) and what its controller makes of it (Eq. 13 to 15).

    In the length unit of the section that it stands in.
    """

    mass: float = number(0.07, above=0.0, about="m_s")
    damping: float = number(0.05, minimum=0.0, about="b_s")
    spring: float = number(0.08, minimum=0.0, about="k_s")
    desired_mass: float = number(1.0, above=0.0, about="m_ds")
    desired_damping: float = number(15.0, minimum=0.0, about="b_ds")
    desired_spring: float = number(50.0, minimum=0.0, about="k_ds")
    tuning: float = number(300.0, above=0.0, about="K_tun")
    position_scale: float = number(math.pi, above=0.0, about="k_x, length per rad")
    start: float = number(0.0, minimum=-1e4, maximum=1e4, about="first position")


@dataclass(frozen=True, kw_only=True)
class Readings(Section):
    """Which reading of paper C holds where its print cannot be meant (docs/rig.md).

    Each default is the correction, except eq13_adds_contact_force: the print is what the paper
    simulates, and leaving the force out is the more stable choice.
    """

    eq12_subtracts_surface: bool = True
    eq13_adds_contact_force: bool = True
    eq18_force_opposes_slave: bool = True
    tracking_prefilter: bool = False


@dataclass(frozen=True, kw_only=True)
class Signals(Section):
    """Which force and motion the controllers use; each still travels through the channel."""

    feedback_force: str = word("true", "true", "sensor", "filtered", "estimated", "none")
    compensation_force: str = word("true", "true", "sensor", "filtered", "estimated")
    slave_motion: str = word("true", "true", "sensor", "filtered", "estimated")
    filter_hz: float = number(30.0, above=0.0, maximum=1e4, about="of filtered", unit="Hz")
    estimator: dict[str, Any] = section(dict, about="arguments of create_estimator")

    def uses_estimator(self) -> bool:
        """Whether any controller needs estimates."""
        choices = (self.feedback_force, self.compensation_force, self.slave_motion)
        return "estimated" in choices


@dataclass(frozen=True, kw_only=True)
class Link(Section):
    """One direction of the channel. Every sample sends a packet with its sequence number."""

    delay_s: float = number(0.0, minimum=0.0, maximum=2.0, unit="s")
    variation_s: float = number(0.0, minimum=0.0, maximum=1.0, about="slow, a sine", unit="s")
    variation_hz: float = number(0.1, minimum=0.0, maximum=100.0, unit="Hz")
    jitter_s: float = number(0.0, minimum=0.0, maximum=0.2, about="standard deviation", unit="s")
    loss: float = number(0.0, minimum=0.0, maximum=1.0, about="probability per packet")
    burst_probability: float = number(0.0, minimum=0.0, maximum=1.0, about="to begin, per packet")
    burst_packets: float = number(10.0, minimum=1.0, maximum=1e6, about="mean length")
    overtaking: bool = True
    receiver: str = word("newest", "newest", "last_arrived")

    def __post_init__(self) -> None:
        """Check that the delay cannot become negative."""
        super().__post_init__()
        if self.variation_s > self.delay_s:
            raise ScenarioError(
                f"variation_s is {self.variation_s:g}, must be at most delay_s {self.delay_s:g}"
            )

    def constants(self) -> NDArray[np.float64]:
        """(LINK_COLUMNS,) constants in the order of layout.py."""
        return np.array(
            [
                self.variation_s,
                2.0 * math.pi * self.variation_hz,
                self.jitter_s,
                self.loss,
                self.burst_probability,
                1.0 / self.burst_packets,
                1.0 if self.overtaking else 0.0,
                1.0 if self.receiver == "newest" else 0.0,
            ]
        )

    def longest_s(self) -> float:
        """Longest time that a packet can travel [s]."""
        return self.delay_s + self.variation_s + JITTER_BOUND * self.jitter_s


def check_kept(what: str, longest_s: float, rate_hz: float) -> None:
    """Check that nothing travels longer than the rig can keep it.

    Args:
        what: travels, for the message.
        longest_s: that it can take [s].
        rate_hz: at which it is sent [Hz].

    Raises:
        ScenarioError: if it can take too long.
    """
    if longest_s * rate_hz > RING - 2:
        raise ScenarioError(
            f"{what} can take {longest_s:g} s, must stay below {(RING - 2) / rate_hz:g} s at "
            f"{rate_hz:g} Hz"
        )


@dataclass(frozen=True, kw_only=True)
class Channel(Section):
    """Both directions between master and slave."""

    forward: Link = section(Link)
    backward: Link = section(Link)

    def check(self, rate_hz: float) -> None:
        """Raise ScenarioError if packets could travel longer than the rig can keep them."""
        for side in ("forward", "backward"):
            self.check_link(side, rate_hz)

    def check_link(self, side: str, rate_hz: float, longer_s: float = 0.0) -> None:
        """Check one direction, "forward" or "backward", with a delay that is so much longer."""
        link: Link = getattr(self, side)
        check_kept(f"drive.channel.{side}", link.longest_s() + longer_s, rate_hz)


@dataclass(frozen=True, kw_only=True)
class ForceOperator(Section):
    """An operator who pushes with a force given in time (values of the profile in N)."""

    kind: str = word(None, "force")
    profile: ConstantVelocity | MultiSine | StepHold | Waypoints = section()


@dataclass(frozen=True, kw_only=True)
class MotionOperator(Section):
    """An operator who wants the slave to follow a motion (mm), through the hand's impedance."""

    kind: str = word(None, "motion")
    profile: ConstantVelocity | MultiSine | StepHold | Waypoints = section()
    hand_stiffness_n_per_mm: float = number(0.2, minimum=0.0, maximum=1e3, unit="N/mm")
    hand_damping_n_s_per_mm: float = number(0.02, minimum=0.0, maximum=1e3, unit="N s/mm")


@dataclass(frozen=True, kw_only=True)
class Teleoperation(Section):
    """Operator, master, channel and slave with their impedance controllers (paper C)."""

    kind: str = word(None, "teleoperation")
    length_unit: str = word("cm", "mm", "cm", about="of master, slave and their controllers")
    operator: ForceOperator | MotionOperator = section()
    master: Master = section(Master)
    slave: Slave = section(Slave)
    control: str = word("impedance", "impedance", "none")
    feedback_gain: float = number(0.1, minimum=0.0, maximum=1e3, about="k_f")
    signals: Signals = section(Signals)
    readings: Readings = section(Readings)
    channel: Channel = section(Channel)
    process_noise: ProcessNoise = section(ProcessNoise)
