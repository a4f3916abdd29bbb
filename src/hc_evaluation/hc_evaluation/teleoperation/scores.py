"""What a bilateral simulation is judged by; definitions in docs/teleoperation.md.

Nothing here looks at the method: hand, tissue and their forces are all that counts. What the hand
should feel is what the tissue would answer to the hand's own motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from hc_estimator.contact.arrays import hunt_crossley_force
from hc_sim_rig.bilateral import BilateralSeries, layout
from hc_sim_rig.bilateral.task import LUMP_PLACE, PALPATION_HZ, Span

Array = NDArray[np.float64]

OSCILLATION_FLOOR_MM = 0.05
"""RMS of a hand that holds still: tremor alone moves it by 0.02 mm."""
SUSTAINED = 0.7
"""An oscillation above the floor that keeps so much of its amplitude does not die out."""
RINGING_FLOOR_MM = 0.15
"""RMS of the hand's motion above RINGING_ABOVE_HZ, in the worst RINGING_WINDOW_S of the task."""
RINGING_ABOVE_HZ = 4.0
RINGING_WINDOW_S = 2.0
ENERGY_FLOOR_MJ = 0.2
"""Energy that a hand may get back in the last third of a hold."""


class Scores(NamedTuple):
    """Judgement of one run. Units: N, mm, mJ."""

    stable: bool
    force_error_n: float
    transparency: float
    peak_force_n: float
    lump_contrast: float
    first_press_contrast: float
    oscillation_mm: float
    ringing_mm: float
    growth: float
    energy_to_hand_mj: float
    energy_made_mj: float
    largest_update_n: float
    lowest_tank_mj: float
    trusted_share: float


def force_at_the_hand(series: BilateralSeries) -> Array:
    """What the tissue would answer to the hand's own motion, at the hand's place [N]."""
    tissue = series.settings.tissue
    lateral = series.column(layout.OUT_LATERAL)
    bell = np.exp(-0.5 * ((lateral - tissue.lump_centre_mm) / tissue.lump_width_mm) ** 2)
    parameters = np.empty((len(lateral), 4))
    parameters[:, 0] = tissue.stiffness * (1.0 + (tissue.lump_stiffness_factor - 1.0) * bell)
    parameters[:, 1] = tissue.damping * (1.0 + (tissue.lump_damping_factor - 1.0) * bell)
    parameters[:, 2] = tissue.displacement_exponent
    parameters[:, 3] = tissue.velocity_exponent
    depth = series.master_mm - tissue.surface_mm
    return hunt_crossley_force(depth, series.column(layout.OUT_MASTER_VELOCITY), parameters)


def score(series: BilateralSeries) -> Scores:
    """Judge one run; a run that left the numbers gives NaN and is not stable."""
    update = float(np.max(np.abs(series.column(layout.OUT_UPDATE_CHANGE))))
    tank = float(np.min(series.column(layout.OUT_TANK)))
    if not np.all(np.isfinite(series.rows[:, : layout.OUT_MODEL])):
        nothing = Scores(False, *(np.nan,) * (len(Scores._fields) - 1))
        return nothing._replace(
            largest_update_n=update, lowest_tank_mj=tank, trusted_share=series.trusted_share
        )
    true = force_at_the_hand(series)
    work = (series.time_s >= series.task.first_contact.begin) & (
        series.time_s < series.task.presses[-1].end
    )
    error = series.hand_force_n[work] - true[work]
    oscillation, growth, energy = hold_motion(series)
    ringing = task_ringing(series)
    sustained = oscillation > OSCILLATION_FLOOR_MM and growth > SUSTAINED
    return Scores(
        stable=not sustained and energy <= ENERGY_FLOOR_MJ and ringing <= RINGING_FLOOR_MM,
        force_error_n=float(np.sqrt(np.mean(error**2))),
        transparency=transparency(series, true),
        peak_force_n=float(np.max(series.tissue_force_n)),
        lump_contrast=lump_contrast(series, true, series.task.presses),
        first_press_contrast=lump_contrast(series, true, series.task.first_presses),
        oscillation_mm=oscillation,
        ringing_mm=ringing,
        growth=growth,
        energy_to_hand_mj=energy,
        energy_made_mj=energy_made(series),
        largest_update_n=update,
        lowest_tank_mj=tank,
        trusted_share=series.trusted_share,
    )


def hold_motion(series: BilateralSeries) -> tuple[float, float, float]:
    """How the hand moves while it wants to hold still.

    Returns:
        RMS of the last third of the hold [mm], its ratio to that of the first third (each without
        its line), and the energy that the fluctuating force gave to the hand in the last third
        [mJ].
    """
    mask = series.task.hold.mask(series.time_s)
    position, force = series.master_mm[mask], series.hand_force_n[mask]
    third = len(position) // 3
    early = float(np.std(signal.detrend(position[:third])))
    late = float(np.std(signal.detrend(position[-third:])))
    moved = np.diff(position[-third:])
    swing = force[-third:-1] - np.mean(force[-third:-1])
    return late, late / max(early, 1e-12), float(-np.sum(swing * moved))


def task_ringing(series: BilateralSeries) -> float:
    """RMS of the hand's motion above what the task asks for, in the worst window [mm].

    An oscillation in free motion or at first contact may have died out before the hold begins.
    """
    rate = series.settings.rate_hz
    high = signal.butter(2, RINGING_ABOVE_HZ, "highpass", fs=rate, output="sos")
    fast = signal.sosfiltfilt(high, series.master_mm) ** 2
    window = round(RINGING_WINDOW_S * rate)
    total = np.concatenate([[0.0], np.cumsum(fast)])
    return float(np.sqrt(np.max(total[window:] - total[:-window]) / window))


def energy_made(series: BilateralSeries) -> float:
    """Energy that the teleoperator itself made over the whole run [mJ].

    What it put into the tissue and into the hand, less what they put in. Slave and network store
    little of it, so that much more than zero says: not passive (which is not: not stable).
    """
    into_tissue = series.column(layout.OUT_TISSUE_ENERGY)[-1]
    from_hand = series.column(layout.OUT_HAND_ENERGY)[-1]
    return float(into_tissue - from_hand)


def transparency(series: BilateralSeries, true: Array) -> float:
    """1 / (1 + |Z_h - Z_t| / |Z_t|) at the palpation's frequency: 1 is the tissue itself.

    Z is the ratio of the first harmonics of force and of the hand's position while it palpates.
    """
    mask = series.task.palpation.mask(series.time_s)
    turn = np.exp(-2.0j * np.pi * PALPATION_HZ * series.time_s[mask])
    motion = np.sum(turn * series.master_mm[mask])
    rendered = np.sum(turn * series.hand_force_n[mask]) / motion
    wanted = np.sum(turn * true[mask]) / motion
    return float(1.0 / (1.0 + abs(rendered - wanted) / max(abs(wanted), 1e-12)))


def lump_contrast(series: BilateralSeries, true: Array, presses: Sequence[Span]) -> float:
    """Share of the lump's contrast that reaches the hand in a press on it: 1 is all.

    The felt stiffness of a press is the force's regression on what healthy tissue would answer to
    the same motion. The contrast is how much stiffer the lump feels than the places before it,
    relative to these; it is given as a share of the same with the true forces.

    Args:
        series: the run.
        true: `force_at_the_hand`.
        presses: one at each place.
    """
    tissue = series.settings.tissue
    parameters = (tissue.stiffness, tissue.damping, tissue.displacement_exponent)
    healthy = hunt_crossley_force(
        series.master_mm - tissue.surface_mm,
        series.column(layout.OUT_MASTER_VELOCITY),
        np.array([*parameters, tissue.velocity_exponent]),
    )

    def stiffness(force: Array, place: int) -> float:
        mask = presses[place].mask(series.time_s)
        weight = float(healthy[mask] @ healthy[mask])
        return float(force[mask] @ healthy[mask]) / max(weight, 1e-12)

    def contrast(force: Array) -> float:
        # Places before the lump only: after it, what is late still has to come.
        beside = float(np.mean([stiffness(force, place) for place in range(LUMP_PLACE)]))
        return stiffness(force, LUMP_PLACE) / max(abs(beside), 1e-3) - 1.0

    return contrast(series.hand_force_n) / contrast(true)
