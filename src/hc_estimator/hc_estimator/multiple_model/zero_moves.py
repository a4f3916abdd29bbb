"""Another zero: all that was remembered in the old ones is moved to the new ones.

Whoever finds a zero to be off (`contact_onset`, `air_zero`, `zero_fit`, `another_place`) leaves in
onset.shift by how much; readings that are held, points, motion and rows are all moved here, for one
that was forgotten is off by the whole zero.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import air_window, delay_points, plausible
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import search as searches
from hc_estimator.multiple_model.hypotheses import DEPTH, OWN, SURFACE


@compiled
def move(bank: Any) -> None:
    """Move the zeros by onset.shift, and with them all readings that are remembered."""
    move_readings(bank)
    histories.move(bank.history, bank.onset.shift[0], bank.onset.shift[1], 0.0, 0.0)


@compiled
def move_position(bank: Any, displacement: float, deviation: float) -> None:
    """Move the contact position by so much, now that it is known to a deviation [mm]."""
    onset = bank.onset
    onset.shift[0] = displacement
    onset.shift[1] = 0.0
    onset.position_deviation = deviation
    move(bank)


@compiled
def step_force(settings: Any, bank: Any, force: float, deviation: float, since: float) -> None:
    """The force's zero has stepped; what was read before is the same.

    Args:
        settings: settings record.
        bank: changed.
        force: by how much [N].
        deviation: of that [N].
        since: stamp of the first force after it [s].
    """
    onset, finder = bank.onset, bank.delay
    onset.zero[1] += force
    before = onset.force_deviation
    if math.isnan(before):
        before = settings.force_zero_std
    onset.force_deviation = math.hypot(before, deviation)
    onset.first_force = 0.0
    bank.clock.measurement[1] -= force
    bank.noise[1].readings -= force
    if finder.delay <= 0.0:
        bank.held.value -= force
    begun = since - finder.delay
    searches.move(bank, force, begun - 0.5 * bank.clock.period, begun)
    # Parabolas about the jump are of neither zero.
    grids.restart(finder)
    delay_points.forget(finder)
    bank.given.predicted_force -= force
    bank.given.reconstructed_force -= force


@compiled
def step_position(settings: Any, bank: Any, displacement: float, deviation: float) -> None:
    """The contact position counts from elsewhere; what was read before is the same.

    Args:
        settings: settings record.
        bank: changed; no reading since the step was used but the present one.
        displacement: by how much [mm].
        deviation: of that [mm].
    """
    onset, finder = bank.onset, bank.delay
    before = onset.position_deviation
    if onset.zero[0] == 0.0:
        before = max(before, settings.contact_position_std)
    onset.zero[0] += displacement
    onset.position_deviation = math.hypot(before, deviation)
    bank.maneuver.count = 0
    bank.clock.measurement[0] -= displacement
    if finder.delay > 0.0:
        bank.held.value -= displacement
    grids.restart(finder)
    delay_points.forget(finder)
    for m in range(bank.rows.shape[0]):
        row = bank.rows[m]
        if row.position_deviation > 0.0:
            row.position_deviation = onset.position_deviation
        if SURFACE[m]:
            row.covariance[OWN, OWN] += deviation * deviation


@compiled
def move_readings(bank: Any) -> None:
    """The same, but for the points of `history`."""
    onset, finder, held = bank.onset, bank.delay, bank.held
    for i in range(2):
        shift = onset.shift[i]
        if shift == 0.0:
            continue
        onset.zero[i] += shift
        bank.noise[i].readings -= shift
        finder.raw_value[i] -= shift
        if (finder.delay > 0.0) == (i == 0):
            held.value -= shift
    displacement, force = onset.shift[0], onset.shift[1]
    grids.move(finder, displacement, force)
    delay_points.move(finder, displacement, force)
    for m in range(bank.rows.shape[0]):
        bank.rows[m].state[DEPTH] -= displacement
    plausible.move(bank.tool, displacement, force)
    bank.motion.first -= displacement
    bank.motion.states[:, 0] -= displacement
    bank.gate.zero_before += displacement
    onset.free_at -= displacement
    onset.about -= displacement
    onset.highest_level -= force
    onset.highest_at -= displacement
    onset.lowest_level -= force
    onset.inside_at -= displacement
    onset.rise_lowest -= force
    onset.rise_highest -= force
    air_window.move(onset.window, displacement, force)
    air_window.move(onset.inside, displacement, force)
    air_window.move(onset.rise, displacement, force)
    air_window.move(bank.air.window, displacement, force)
    bank.air.sum -= bank.air.seen * force
    onset.floor -= force
    if force != 0.0:
        onset.first_force = 0.0
    if displacement != 0.0:
        for m in range(bank.rows.shape[0]):
            bank.rows[m].position_deviation = onset.position_deviation
    bank.given.predicted_force -= force
    bank.given.reconstructed_force -= force
