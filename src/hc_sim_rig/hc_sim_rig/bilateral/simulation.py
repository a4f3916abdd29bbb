"""Runs a bilateral teleoperation, deterministic for a seed.

The compiled loop runs in blocks; after each block the slave's estimator, where there is one, takes
the block's readings, and its model is what the packets of the next block carry.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hc_estimator.kinds import available_filters
from hc_estimator.stream.effort_filters import (
    EffortSettings,
    error_in_motion,
    make_force_filter,
)
from hc_estimator.stream.force_filter import ForceFilter
from hc_sim_rig.bilateral import layout
from hc_sim_rig.bilateral.kernel import advance
from hc_sim_rig.bilateral.mediator import Mediator
from hc_sim_rig.bilateral.parts import Bilateral
from hc_sim_rig.bilateral.task import Task, palpation_task, tremor
from hc_sim_rig.layout import (
    DRAW_BURST,
    DRAW_JITTER,
    DRAW_LOSS,
    DRAWS,
    NO_PACKET,
    PACKET_COLUMNS,
    PACKET_LAST_ARRIVAL,
    PACKET_SEQUENCE,
    PACKETS_LOST,
    RING,
)
from hc_sim_rig.schema import ScenarioError

Array = NDArray[np.float64]

BLOCK_SAMPLES = 10
"""The model is renewed at a hundredth of a second."""


@dataclass(frozen=True)
class BilateralSeries:
    """What happened. Units: mm, mm/s, N, s; energies mJ."""

    rows: Array
    """(samples, OUT_COLUMNS), columns in layout.py."""
    task: Task
    settings: Bilateral
    lost: tuple[int, int]
    """Packets lost forward and backward."""
    trusted_share: float
    """Share of the model's renewals after the first contact that were trusted; 0 without."""

    def column(self, index: int) -> Array:
        """One column, shape (samples,)."""
        values: Array = self.rows[:, index]
        return values

    @property
    def time_s(self) -> Array:
        """Time, shape (samples,)."""
        return self.column(layout.OUT_TIME)

    @property
    def master_mm(self) -> Array:
        """Position of the hand."""
        return self.column(layout.OUT_MASTER)

    @property
    def slave_mm(self) -> Array:
        """Position of the tool."""
        return self.column(layout.OUT_SLAVE)

    @property
    def hand_force_n(self) -> Array:
        """Force that the device lets the hand feel."""
        return self.column(layout.OUT_HAND_FORCE)

    @property
    def tissue_force_n(self) -> Array:
        """True force of the tissue on the tool."""
        return self.column(layout.OUT_TISSUE_FORCE)

    @property
    def model(self) -> Array:
        """K, B, n, p and surface that are rendered, shape (samples, 5); NaN without a model."""
        values: Array = self.rows[:, layout.OUT_MODEL : layout.OUT_MODEL + layout.MODEL_SIZE]
        return values


def simulate(settings: Bilateral, seed: int = 0, task: Task | None = None) -> BilateralSeries:
    """Run a bilateral teleoperation.

    Args:
        settings: everything that takes part.
        seed: of tremor, sensors and network.
        task: what the operator does; the palpation task if None.

    Returns:
        The series.

    Raises:
        ScenarioError: the seed is negative, or there is no such filter.
    """
    if seed < 0:
        raise ScenarioError(f"seed is {seed}, must not be negative")
    feedback, rate = settings.feedback, settings.rate_hz
    mediator = None
    if feedback.method == "model_mediated":
        if feedback.filter not in available_filters():
            known = ", ".join(available_filters())
            raise ScenarioError(f"filter is {feedback.filter!r}, must be one of {known}")
        mediator = Mediator(feedback.filter, rate, least_noise_n(settings))
    observer = force_observer(settings) if feedback.force_source == "effort" else None
    if task is None:
        task = palpation_task(rate, settings.tissue.surface_mm)
    samples = task.samples
    sensors, network, hand_seed, motor = np.random.SeedSequence(seed).spawn(4)
    noise = np.empty((samples, 4))
    noise[:, :3] = np.random.default_rng(sensors).normal(size=(samples, 3))
    noise[:, 3] = np.random.default_rng(motor).normal(size=samples)
    noise *= (
        settings.device.position_noise_std_mm,
        settings.slave.position_noise_std_mm,
        settings.slave.force_noise_std_n,
        settings.slave.effort_noise_std_n,
    )
    hand = settings.operator
    shaking = tremor(
        samples,
        rate,
        hand.tremor_std_n,
        hand.tremor_low_hz,
        hand.tremor_high_hz,
        int(hand_seed.generate_state(1)[0]),
    )
    link = settings.network.link().constants()
    packets = np.zeros((2, PACKET_COLUMNS))
    packets[:, PACKET_SEQUENCE] = packets[:, PACKET_LAST_ARRIVAL] = -1.0
    packets[:, 0] = -1.0  # no sample has arrived
    ring = np.zeros((2, RING, 2))
    ring[:, :, 1] = NO_PACKET
    sent = np.zeros((2, samples + 1, layout.SENT_COLUMNS))
    start = task.path[0]
    y = np.array([start, 0.0, start, 0.0])
    memory = np.zeros(layout.MEMORY_SIZE)
    memory[[layout.MEMORY_MASTER_BEFORE, layout.MEMORY_SLAVE_BEFORE]] = start
    memory[layout.MEMORY_WAVE_COMMAND] = start
    memory[layout.MEMORY_TANK] = feedback.tank_mj
    memory[layout.MEMORY_SLAVE_STIFFNESS] = settings.slave.stiffness_low
    memory[layout.MEMORY_SLAVE_TANK] = settings.slave.tank_mj
    model = np.zeros(layout.SLAVE_MODEL_SIZE)
    rows = np.zeros((samples, layout.OUT_COLUMNS))
    constants, links, draws = settings.constants(), np.stack([link, link]), _draws(network, samples)
    block = BLOCK_SAMPLES if mediator is not None else samples
    for first in range(0, samples, block):
        count = min(block, samples - first)
        advance(
            first,
            count,
            constants,
            task.path,
            task.lateral,
            shaking,
            noise,
            draws,
            links,
            packets,
            ring,
            sent,
            model,
            y,
            memory,
            rows,
        )
        if mediator is not None:
            part = rows[first : first + count]
            time, position = part[:, layout.OUT_TIME], part[:, layout.OUT_POSITION_READING]
            force = part[:, layout.OUT_FORCE_READING]
            if observer is not None:
                effort = part[:, layout.OUT_EFFORT_READING]
                position, force = observer.run(time, position, effort)
            mediator.take(time, position, force)
            model[: layout.MODEL_SURE] = mediator.model
            model[layout.MODEL_SURE] = mediator.sure
    lost = (int(packets[0, PACKETS_LOST]), int(packets[1, PACKETS_LOST]))
    share = mediator.trusted_share if mediator is not None else 0.0
    return BilateralSeries(rows, task, settings, lost, share)


def effort_settings(settings: Bilateral) -> EffortSettings:
    """What the filter that takes the place of the slave's force sensor is told.

    Paper C's particles know the tissue (with p = 1) and not its lump.
    """
    slave, feedback, tissue = settings.slave, settings.feedback, settings.tissue
    return EffortSettings(
        method=feedback.force_filter,
        mass_kg=slave.mass_kg,
        damping=slave.damping,
        dry_friction_n=feedback.friction_known * slave.dry_friction_n,
        friction_velocity_mm_s=layout.FRICTION_VELOCITY,
        bandwidth_hz=feedback.observer_bandwidth_hz,
        position_noise_mm=max(slave.position_noise_std_mm, 1e-6),
        effort_noise_n=max(slave.effort_noise_std_n, 1e-3),
        tissue=(tissue.stiffness, tissue.damping, tissue.displacement_exponent),
        surface_mm=tissue.surface_mm,
    )


def force_observer(settings: Bilateral) -> ForceFilter:
    """The filter that takes the place of the slave's force sensor."""
    return make_force_filter(effort_settings(settings))


def least_noise_n(settings: Bilateral) -> float:
    """Error of the force in free motion that no noise at rest shows [N]; a sensor has none."""
    if settings.feedback.force_source == "sensor":
        return 0.0
    unknown = abs(1.0 - settings.feedback.friction_known) * settings.slave.dry_friction_n
    true = replace(effort_settings(settings), dry_friction_n=settings.slave.dry_friction_n)
    return error_in_motion(true) + unknown


def _draws(seed: np.random.SeedSequence, samples: int) -> Array:
    """Random draws of the network; columns that the channel does not read stay zero."""
    draws = np.zeros((samples, DRAWS))
    jitter, loss, burst = (np.random.default_rng(s) for s in seed.spawn(3))
    draws[:, DRAW_JITTER : DRAW_JITTER + 2] = jitter.normal(size=(samples, 2))
    draws[:, DRAW_LOSS : DRAW_LOSS + 2] = loss.uniform(size=(samples, 2))
    draws[:, DRAW_BURST : DRAW_BURST + 2] = burst.uniform(size=(samples, 2))
    return draws
