"""What a bilateral simulation is made of: operator, master, network, slave, tissue, feedback.

The numbers are choices of this project, of the order of published ones; docs/teleoperation.md says
which. Every section checks its values, and every error is one line.
"""

# ruff: noqa: RUF009 - the field functions of schema.py are made for defaults

from __future__ import annotations

import math
from dataclasses import dataclass

from hc_estimator.stream.effort_filters import METHODS as FORCE_FILTERS
from hc_sim_rig.bilateral.layout import LARGEST_IMPEDANCE, LEAST_IMPEDANCE, METHODS, Constants
from hc_sim_rig.bilateral.playout import PLAYOUT_DEVIATIONS, PLAYOUT_SAMPLES
from hc_sim_rig.drives import Link, check_kept
from hc_sim_rig.schema import ScenarioError, Section, number, section, word

TONNE_PER_KG = 1e-3
"""A mass in N s^2/mm."""


@dataclass(frozen=True, kw_only=True)
class Operator(Section):
    """Arm and hand on the device: a mass on spring and damper, pulled along a path.

    The voluntary part corrects what the eye sees of the hand's error, after a reaction delay.
    Tremor is a force with random phases between two frequencies.
    """

    mass_kg: float = number(0.4, above=0.0, maximum=10.0, unit="kg", about="of arm and hand")
    stiffness: float = number(0.6, above=0.0, maximum=10.0, unit="N/mm")
    damping: float = number(0.01, minimum=0.0, maximum=1.0, unit="N s/mm")
    reaction_s: float = number(0.2, minimum=0.0, maximum=2.0, unit="s")
    correction_rate: float = number(0.8, minimum=0.0, maximum=20.0, unit="1/s")
    correction_limit_mm: float = number(2.0, minimum=0.0, maximum=50.0, unit="mm")
    tremor_std_n: float = number(0.05, minimum=0.0, maximum=10.0, unit="N")
    tremor_low_hz: float = number(8.0, above=0.0, maximum=50.0, unit="Hz")
    tremor_high_hz: float = number(12.0, above=0.0, maximum=50.0, unit="Hz")


@dataclass(frozen=True, kw_only=True)
class Device(Section):
    """The master: a haptic device of one degree of freedom."""

    mass_kg: float = number(0.1, above=0.0, maximum=10.0, unit="kg")
    damping: float = number(0.002, minimum=0.0, maximum=1.0, unit="N s/mm")
    force_limit_n: float = number(8.0, above=0.0, maximum=1e3, unit="N")
    position_noise_std_mm: float = number(0.0005, minimum=0.0, maximum=1.0, unit="mm")


@dataclass(frozen=True, kw_only=True)
class SlaveArm(Section):
    """The slave with its impedance controller, and its sensors."""

    mass_kg: float = number(0.5, above=0.0, maximum=100.0, unit="kg")
    damping: float = number(0.005, minimum=0.0, maximum=10.0, unit="N s/mm")
    stiffness: float = number(10.0, above=0.0, maximum=1e3, unit="N/mm")
    controller_damping: float = number(0.12, minimum=0.0, maximum=10.0, unit="N s/mm")
    force_limit_n: float = number(30.0, above=0.0, maximum=1e4, unit="N")
    position_noise_std_mm: float = number(0.002, minimum=0.0, maximum=1.0, unit="mm")
    force_noise_std_n: float = number(0.01, minimum=0.0, maximum=10.0, unit="N")
    effort_noise_std_n: float = number(0.01, minimum=0.0, maximum=10.0, unit="N")
    dry_friction_n: float = number(0.0, minimum=0.0, maximum=100.0, unit="N")
    impedance: str = word("fixed", "fixed", "adaptive", about="adaptive: to the estimate")
    stiffness_low: float = number(1.0, above=0.0, maximum=1e3, unit="N/mm", about="when unsure")
    stiffness_high: float = number(10.0, above=0.0, maximum=1e3, unit="N/mm")
    stiffness_ratio: float = number(8.0, above=0.0, maximum=1e3, about="over the tissue's")
    stiffness_rate: float = number(10.0, above=0.0, maximum=1e4, unit="N/mm/s")
    stiffness_force_rate_n_s: float = number(20.0, above=0.0, maximum=1e4, unit="N/s")
    tank_mj: float = number(2.0, minimum=0.0, maximum=1e3, unit="mJ")

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ScenarioError: if a value cannot be.
        """
        super().__post_init__()
        if self.stiffness_low > self.stiffness_high:
            raise ScenarioError(
                f"stiffness_low is {self.stiffness_low:g}, must not be above stiffness_high, "
                f"{self.stiffness_high:g}"
            )


@dataclass(frozen=True, kw_only=True)
class LumpyTissue(Section):
    """Unilateral Hunt-Crossley tissue with a lump: a bell over the place, on K and B."""

    surface_mm: float = number(0.0, minimum=-100.0, maximum=100.0, unit="mm")
    stiffness: float = number(0.25, above=0.0, maximum=100.0, unit="N/mm^n")
    damping: float = number(0.006, minimum=0.0, maximum=10.0, unit="N (s/mm)^p / mm^n")
    displacement_exponent: float = number(1.6, minimum=0.5, maximum=4.0)
    velocity_exponent: float = number(0.9, minimum=0.2, maximum=2.0)
    lump_centre_mm: float = number(12.0, unit="mm")
    lump_width_mm: float = number(2.0, above=0.0, maximum=1e3, unit="mm", about="standard dev.")
    lump_stiffness_factor: float = number(2.2, above=0.0, maximum=100.0)
    lump_damping_factor: float = number(1.5, above=0.0, maximum=100.0)

    def parameters_at(self, lateral_mm: float) -> tuple[float, float, float, float]:
        """Return K, B, n, p at a place sideways, as `kernel.tissue_at` has them."""
        distance = (lateral_mm - self.lump_centre_mm) / self.lump_width_mm
        bell = math.exp(-0.5 * distance * distance)
        return (
            self.stiffness * (1.0 + (self.lump_stiffness_factor - 1.0) * bell),
            self.damping * (1.0 + (self.lump_damping_factor - 1.0) * bell),
            self.displacement_exponent,
            self.velocity_exponent,
        )


@dataclass(frozen=True, kw_only=True)
class Network(Section):
    """The way there and back. The delay is the same both ways, jitter a share of it."""

    round_trip_ms: float = number(0.0, minimum=0.0, maximum=3000.0, unit="ms")
    jitter_share: float = number(0.1, minimum=0.0, maximum=0.1, about="std / one-way delay")
    loss: float = number(0.1, minimum=0.0, maximum=1.0, about="probability per packet")

    def playout_s(self) -> float:
        """Time from a wave's stamp to its turn at the receiver: later than nearly all packets."""
        link = self.link()
        return link.delay_s + PLAYOUT_DEVIATIONS * link.jitter_s

    def link(self) -> Link:
        """One direction, as the rig's channel knows it."""
        delay = 0.5e-3 * self.round_trip_ms
        return Link(delay_s=delay, jitter_s=self.jitter_share * delay, loss=self.loss)


@dataclass(frozen=True, kw_only=True)
class Feedback(Section):
    """How force comes back to the hand."""

    method: str = word("model_mediated", *METHODS)
    filter: str = "self_tuning_ukf"
    force_source: str = word(
        "sensor", "sensor", "effort", about="of the estimator: a sensor, or the motor's effort"
    )
    force_filter: str = word("observer", *FORCE_FILTERS, about="with the effort as force source")
    friction_known: float = number(
        1.0, minimum=0.0, maximum=2.0, about="share of the dry friction that is taken off"
    )
    observer_bandwidth_hz: float = number(15.0, above=0.0, maximum=500.0, unit="Hz")
    position_stiffness: float = number(2.0, above=0.0, maximum=100.0, unit="N/mm")
    position_damping: float = number(0.03, minimum=0.0, maximum=10.0, unit="N s/mm")
    wave_impedance: float = number(
        0.03, minimum=LEAST_IMPEDANCE, maximum=LARGEST_IMPEDANCE, unit="N s/mm"
    )
    wave_stiffness: float = number(2.0, above=0.0, maximum=100.0, unit="N/mm")
    update_rate_n_per_s: float = number(20.0, above=0.0, maximum=1e4, unit="N/s")
    update_time_s: float = number(0.05, above=0.0, maximum=10.0, unit="s")
    largest_stiffness: float = number(
        10.0, above=0.0, maximum=1e3, unit="N/mm", about="slope of the rendered spring"
    )
    largest_damping: float = number(0.03, minimum=0.0, maximum=1.0, unit="N s/mm")
    controller_damping: float = number(0.03, minimum=0.0, maximum=1.0, unit="N s/mm")
    tank_mj: float = number(2.0, minimum=0.0, maximum=1e3, unit="mJ")


@dataclass(frozen=True, kw_only=True)
class Bilateral(Section):
    """A whole bilateral teleoperation."""

    operator: Operator = section(Operator)
    device: Device = section(Device)
    slave: SlaveArm = section(SlaveArm)
    tissue: LumpyTissue = section(LumpyTissue)
    network: Network = section(Network)
    feedback: Feedback = section(Feedback)
    rate_hz: float = number(1000.0, minimum=100.0, maximum=1e4, unit="Hz")
    substeps: int = number(2, minimum=1, maximum=100)
    velocity_bandwidth_hz: float = number(60.0, above=0.0, maximum=1e4, unit="Hz")

    def __post_init__(self) -> None:
        """Check that no packet travels longer than it can be kept.

        Raises:
            ScenarioError: if one could.
        """
        super().__post_init__()
        packet = f"network.round_trip_ms is {self.network.round_trip_ms:g}: a packet"
        check_kept(packet, self.network.link().longest_s(), self.rate_hz)

    def constants(self) -> Constants:
        """What the compiled loop takes."""
        hand, device, slave, tissue = self.operator, self.device, self.slave, self.tissue
        feedback = self.feedback
        return Constants(
            step=1.0 / self.rate_hz,
            rate=self.rate_hz,
            substeps=float(self.substeps),
            method=float(METHODS.index(feedback.method)),
            velocity_rate=2.0 * math.pi * self.velocity_bandwidth_hz,
            master_mass=TONNE_PER_KG * (hand.mass_kg + device.mass_kg),
            device_damping=device.damping,
            force_limit=device.force_limit_n,
            hand_stiffness=hand.stiffness,
            hand_damping=hand.damping,
            reaction_samples=float(round(hand.reaction_s * self.rate_hz)),
            correction_rate=hand.correction_rate,
            correction_limit=hand.correction_limit_mm,
            slave_mass=TONNE_PER_KG * slave.mass_kg,
            slave_damping=slave.damping,
            slave_stiffness=slave.stiffness,
            slave_controller_damping=slave.controller_damping,
            slave_force_limit=slave.force_limit_n,
            slave_friction=slave.dry_friction_n,
            adaptive=float(slave.impedance == "adaptive"),
            stiffness_low=slave.stiffness_low,
            stiffness_high=slave.stiffness_high,
            stiffness_ratio=slave.stiffness_ratio,
            stiffness_rate=slave.stiffness_rate,
            stiffness_force_rate=slave.stiffness_force_rate_n_s,
            slave_tank=slave.tank_mj,
            surface=tissue.surface_mm,
            stiffness=tissue.stiffness,
            damping=tissue.damping,
            displacement_exponent=tissue.displacement_exponent,
            velocity_exponent=tissue.velocity_exponent,
            lump_centre=tissue.lump_centre_mm,
            lump_width=tissue.lump_width_mm,
            lump_stiffness=tissue.lump_stiffness_factor - 1.0,
            lump_damping=tissue.lump_damping_factor - 1.0,
            position_stiffness=feedback.position_stiffness,
            position_damping=feedback.position_damping,
            wave_impedance=feedback.wave_impedance,
            wave_stiffness=feedback.wave_stiffness,
            playout=float(round(self.network.playout_s() * self.rate_hz) + PLAYOUT_SAMPLES),
            update_rate=feedback.update_rate_n_per_s,
            update_time=feedback.update_time_s,
            largest_stiffness=feedback.largest_stiffness,
            largest_damping=feedback.largest_damping,
            controller_damping=feedback.controller_damping,
            tank_limit=feedback.tank_mj,
            delay=0.5e-3 * self.network.round_trip_ms,
        )
