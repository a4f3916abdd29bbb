"""Is a reading an outlier? It is refused where no hypothesis explains it, a few times in a row.

A displacement that jumps is not believed at once, however many readings agree, nor one that stands
still (`jumps`). A force may jump, as where tissue tears: many in a row are an alarm (`maneuver`,
`change`).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.adaptation import difference_noise
from hc_estimator.adaptation.policy import DIFFERENCES
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model import jumps, position_step, readings
from hc_estimator.multiple_model.hypotheses import DEPTH, FRESH, ZERO_STEP
from hc_estimator.multiple_model.kalman import displacement_of

OPEN_SAMPLES = 30  # inside the gate before it closes again


@compiled
def innovation_of(bank: Any, row: Any, channel: int) -> tuple[float, float]:
    """Innovation of a row and its variance, of the displacement [mm] or the force [N]."""
    clock = bank.clock
    if channel == 1:
        return row.innovation[1], row.innovation_variance[1]
    innovation = clock.measurement[0] - displacement_of(row, clock.offset)
    return innovation, row.covariance[DEPTH, DEPTH] + bank.sensor_noise[0]


@compiled
def is_outlier(settings: Any, bank: Any, chosen: Any, channel: int, place: float) -> bool:
    """Refuse an innovation far outside its distribution, unless many come one after another.

    Args:
        settings: settings record.
        bank: changed.
        chosen: row.
        channel: 0 or 1.
        place: of the sample in the displacement's time [s].
    """
    clock = bank.clock
    limit_squared = settings.outlier_gate * settings.outlier_gate
    innovation, variance = innovation_of(bank, chosen, channel)
    outside = bank.calibrated != 0 and innovation * innovation > limit_squared * variance
    for m in (FRESH, ZERO_STEP):  # an outlier is what no row under test explains either
        if outside and bank.rows[m].active != 0:
            other, by_other = innovation_of(bank, bank.rows[m], channel)
            outside = other * other > limit_squared * by_other
    counts = clock.outlier_counts
    count = counts[channel]
    if count > settings.outlier_limit:  # the gate is open
        counts[channel] = settings.outlier_limit + OPEN_SAMPLES if outside else count - 1
        if counts[channel] == settings.outlier_limit:
            counts[channel] = 0
        return False
    stamp = place + (clock.offset if channel == 0 else bank.delay.delay)
    if clock.restart != 0:
        jumps.forget(bank.gate)
    if channel == 0 and jumps.goes_on(bank.gate):
        return _is_still_off(
            settings, bank, chosen, stamp, outside, math.sqrt(limit_squared * variance)
        )
    looks = bank.calibrated != 0 and settings.outlier_limit > 0
    if looks and jumps.stands_still(bank, channel, stamp):
        # In the air a force of exactly nothing teaches nothing.
        return channel == 0 or outside or chosen.predicted_force > 0.0
    if not outside:
        if count > 0:
            _replace_refused(bank, channel, stamp)
        counts[channel] = 0
        return False
    if settings.noise_adaptation == DIFFERENCES and difference_noise.learn_refused(
        bank.noise[channel], innovation, math.sqrt(limit_squared * variance)
    ):
        counts[channel] = 0
        readings.follow_noise(bank)
        return True
    if count == 0:
        bank.gate.refused_from[channel] = stamp
    if count == settings.outlier_limit:
        if count > 0 and jumps.begins(bank, channel, stamp):
            return True
        counts[channel] = settings.outlier_limit + OPEN_SAMPLES
        return False
    counts[channel] = count + 1
    return True


@compiled
def waits(settings: Any, bank: Any) -> bool:
    """True as long as nobody knows whether readings that were refused are wrong.

    Nor of which zero the forces are since one that jumped.
    """
    counts, limit = bank.clock.outlier_counts, settings.outlier_limit
    refused = 0 < counts[0] <= limit or 0 < counts[1] <= limit
    return bool(refused or jumps.waits(bank.gate) or bank.change.zero_leads != 0)


@compiled
def _is_still_off(
    settings: Any, bank: Any, chosen: Any, stamp: float, outside: bool, half_width: float
) -> bool:
    """Refuse displacements that have jumped or stand still until they are believed.

    Args:
        settings: settings record.
        bank: changed.
        chosen: row.
        stamp: of the reading [s].
        outside: True if it is outside of the gate.
        half_width: of that [mm].
    """
    if not outside and jumps.is_back(bank, stamp, half_width):
        _replace_refused(bank, 0, stamp)
        bank.clock.outlier_counts[0] = 0
        jumps.forget(bank.gate)
        return False
    if settings.find_zeros != 0 and position_step.look(
        settings, bank, chosen, jumps.number_of(bank, 0, stamp)
    ):
        position_step.take(settings, bank, chosen, stamp)
        bank.clock.outlier_counts[0] = 0
        jumps.forget(bank.gate)
        return False
    if jumps.is_believed(settings, bank, chosen, stamp):
        _begin_anew(bank)
    return True


@compiled
def is_lost(settings: Any, bank: Any, chosen: Any, place: float) -> bool:
    """True if a displacement is not believed, and no other was for long: as if it were lost.

    Args:
        settings: settings record.
        bank: changed.
        chosen: row.
        place: of the sample in the displacement's time [s].
    """
    clock, stamp = bank.clock, place + bank.clock.offset
    if not jumps.goes_on_for_long(settings, bank, stamp):
        return False
    if clock.present[0] == 0 or not jumps.is_found(settings, bank, chosen, stamp):
        return True
    if clock.restart != 0:  # the motion begins with this reading
        jumps.forget(bank.gate)
        clock.outlier_counts[0] = 0
        return False
    _begin_anew(bank)
    return True


@compiled
def _begin_anew(bank: Any) -> None:
    """Believe the displacements from the next one on; of the motion nothing is known."""
    bank.clock.outlier_counts[0] = 0
    jumps.forget(bank.gate)
    bank.motion_anew = 1
    grids.restart(bank.delay)


@compiled
def _replace_refused(bank: Any, channel: int, stamp: float) -> None:
    """Let the readings that were refused before this one bend no point of the grid.

    A force that the law does not expect may be one all the same, as where the tool lands: only
    those that nothing beside them leads to are replaced.
    """
    jumps.replace_refused(bank, channel, bank.gate.refused_from[channel], stamp, channel == 1)
