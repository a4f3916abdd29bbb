"""Is a reading an outlier? It is refused where no hypothesis explains it, a few times in a row.

No tool jumps: a displacement that does is not believed for a while, however many readings agree
(a tracker that gives zeros while it has lost its marker, an encoder with a bad contact). A force
may jump, as where tissue tears: many in a row are an alarm (`maneuver`, `change`).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.adaptation import difference_noise
from hc_estimator.adaptation.policy import DIFFERENCES
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model import raw_readings, readings
from hc_estimator.multiple_model.delay_records import RAW
from hc_estimator.multiple_model.hypotheses import DEPTH, FRESH
from hc_estimator.multiple_model.kalman import displacement_of

OPEN_SAMPLES = 30  # inside the gate before it closes again
JUMP_TIME = 0.5  # for which a displacement that has jumped is not believed [s]
JUMPS_BACK = 0.5  # of the half width of the gate, that a displacement comes back by at least


@compiled
def forget(bank: Any) -> None:
    """The motion begins anew: no displacement has jumped."""
    bank.gate.jumped_at = math.nan


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

    A displacement that jumped is not believed for `JUMP_TIME`: no tool jumps.

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
    if outside and bank.change.testing != 0:  # an outlier is what neither tissue explains
        other, by_other = innovation_of(bank, bank.rows[FRESH], channel)
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
        bank.gate.jumped_at = math.nan
    if channel == 0 and not math.isnan(bank.gate.jumped_at):
        return _is_still_off(bank, stamp, outside, math.sqrt(limit_squared * variance))
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
        if channel == 0 and count > 0 and _has_jumped(bank, stamp, count):
            bank.gate.jumped_at = stamp
            return True
        counts[channel] = settings.outlier_limit + OPEN_SAMPLES
        return False
    counts[channel] = count + 1
    return True


@compiled
def waits(settings: Any, bank: Any) -> bool:
    """True as long as nobody knows whether readings that were refused are wrong."""
    counts, limit = bank.clock.outlier_counts, settings.outlier_limit
    return bool(0 < counts[0] <= limit or 0 < counts[1] <= limit)


@compiled
def _has_jumped(bank: Any, stamp: float, count: int) -> bool:
    """True if the displacements that were refused, up to this one, jumped.

    Args:
        bank: with the raw readings.
        stamp: of this one [s].
        count: of those before it.
    """
    finder = bank.delay
    last = raw_readings.latest_up_to(finder, 0, stamp + _half_step(bank, 0))
    first = max(last - count, raw_readings.oldest(finder, 0) + 2)
    return raw_readings.has_jumped(finder, 0, first, last)


@compiled
def _is_still_off(bank: Any, stamp: float, outside: bool, half_width: float) -> bool:
    """Refuse displacements that have jumped, until they jump back or for `JUMP_TIME`.

    What is not known any more grows, and with it the gate: a reading that was not outside by
    itself comes back only by a jump.

    Args:
        bank: changed.
        stamp: of the reading [s].
        outside: True if it is outside of the gate.
        half_width: of that [mm].
    """
    finder = bank.delay
    here = raw_readings.latest_up_to(finder, 0, stamp + _half_step(bank, 0))
    if not outside and here > raw_readings.oldest(finder, 0):
        step = finder.raw_value[0, here % RAW] - finder.raw_value[0, (here - 1) % RAW]
        if abs(step) > JUMPS_BACK * half_width:
            _replace_refused(bank, 0, stamp)
            bank.clock.outlier_counts[0] = 0
            bank.gate.jumped_at = math.nan
            return False
    if not stamp - bank.gate.jumped_at < JUMP_TIME:
        bank.clock.outlier_counts[0] = 0
        bank.gate.jumped_at = math.nan
        bank.motion_anew = 1
        grids.restart(finder)
    return True


@compiled
def _half_step(bank: Any, channel: int) -> float:
    """Half of the usual time between two readings of a channel [s]."""
    return 0.5 * grids.period(bank.delay, channel)


@compiled
def _replace_refused(bank: Any, channel: int, stamp: float) -> None:
    """Let the readings that were refused before this one bend no point of the grid.

    A force that the law does not expect may be one all the same, as where the tool lands: only
    those that nothing beside them leads to are replaced.
    """
    half = _half_step(bank, channel)
    after, until = bank.gate.refused_from[channel] - half, stamp - half
    raw_readings.replace_refused(bank.delay, channel, after, until, channel == 1)
