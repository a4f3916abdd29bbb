"""Has the position's zero stepped while the tool is in the tissue? An encoder that is zeroed, say.

A displacement that jumps is not believed at once (`jumps`). Meanwhile the force says by the law how
deep the tool is. Where the displacement goes the same way, a step beside that, and far enough for
it to be no chance, its zero is another one: the tool is where it was, and so is the tissue. One
that comes back to the zero that was left last is there again. (Ours; also a tracker that is
registered anew, or that takes another marker for its own and finds it again.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import is_plain
from hc_estimator.linear_algebra import clear_vector
from hc_estimator.multiple_model import raw_readings, zero_moves
from hc_estimator.multiple_model.delay_records import RAW
from hc_estimator.multiple_model.hypotheses import DEPTH, EXPONENT
from hc_estimator.multiple_model.judge import SURE
from hc_estimator.multiple_model.kalman import depth_of, log_force_variance
from hc_estimator.multiple_model.landing import depth_at

FEWEST = 10  # readings since the jump,
LEAST_TIME = 0.25  # and time: a dropout ends sooner [s]
STEPS = 8  # between readings that say a velocity
TRAVEL = 10.0  # deviations of a reading that they go at least
LARGEST_RATE = 0.3  # of the way that the tool goes less than they do, at most
KNOWN = 0.1  # deviation of that share
CLEAR = 5.0  # deviations of the step
LEAST_DEPTH = 0.01  # [mm]
BACK = 3.0  # deviations within which a zero is one that was left


@compiled
def reset(gate: Any) -> None:
    """No zero was left."""
    forget(gate)
    gate.zero_before = math.nan


@compiled
def forget(gate: Any) -> None:
    """No reading is known to lie beside the tool."""
    gate.offset_count = 0


@compiled
def look(settings: Any, bank: Any, row: Any, here: int) -> bool:
    """Take a displacement that is not believed; True if it goes on under another zero.

    Args:
        settings: settings record.
        bank: gate is changed.
        row: whose law it is.
        here: number of the displacement.
    """
    gate, clock, finder = bank.gate, bank.clock, bank.delay
    if gate.stuck != 0 or row.model_error > 0.0 or not is_plain(settings.contact_model):
        forget(gate)
        return False
    before = here - STEPS
    if clock.present[1] == 0 or before < raw_readings.oldest(finder, 0):
        return False
    force, began = clock.measurement[1], finder.raw_time[0, before % RAW]
    if force < SURE * math.sqrt(bank.sensor_noise[1]):
        forget(gate)
        return False
    if began < gate.jumped_at:  # a velocity across the jump is none
        return False
    place = clock.measurement[0]
    # Not the mean one since then: where the tool turns that is off the same way each time.
    half = raw_readings.slope_between(finder, 0, here - STEPS // 2, here)
    velocity = 2.0 * half - raw_readings.slope_between(finder, 0, before, here)
    depth = depth_at(row, force, velocity)
    if not depth > LEAST_DEPTH:
        return False
    slope = row.state[EXPONENT] * force / depth  # of the force over the depth
    surface = row.state[DEPTH] - depth_of(row)
    _add(gate, slope * slope, place - surface - depth, place)
    moment, weight = gate.moment, gate.offset_weight
    travel = moment[2] / weight
    far = travel > TRAVEL * TRAVEL * bank.sensor_noise[0]
    long = finder.raw_time[0, here % RAW] - gate.jumped_at > LEAST_TIME
    if gate.offset_count < FEWEST or not (far and long):
        return False
    rate = moment[1] / moment[2]
    scatter = max(moment[0] - rate * moment[1], 0.0) / weight
    known = scatter < KNOWN * KNOWN * travel * gate.offset_count
    clear = gate.offset * gate.offset > CLEAR * CLEAR * scatter / gate.offset_count
    return bool(known and clear and abs(rate) < LARGEST_RATE)


@compiled
def _add(gate: Any, weight: float, offset: float, place: float) -> None:
    """Add a reading to means and moments about them, by what its force says of the depth."""
    moment = gate.moment
    if gate.offset_count == 0:
        gate.offset, gate.place, gate.offset_weight = 0.0, 0.0, 0.0
        clear_vector(moment)
    gate.offset_count += 1
    gate.offset_weight += weight
    share = weight / gate.offset_weight
    aside, on = offset - gate.offset, place - gate.place
    gate.offset += share * aside
    gate.place += share * on
    moment[0] += weight * aside * (offset - gate.offset)
    moment[1] += weight * on * (offset - gate.offset)
    moment[2] += weight * on * (place - gate.place)


@compiled
def take(settings: Any, bank: Any, row: Any, stamp: float) -> None:
    """The position's zero is another one from now on; the tool is where the law says.

    Args:
        settings: settings record.
        bank: changed.
        row: whose law it is.
        stamp: of the present displacement [s].
    """
    gate = bank.gate
    surface = row.state[DEPTH] - depth_of(row)
    depth = max(gate.place - gate.offset - surface, LEAST_DEPTH)
    log_depth = math.log(depth)
    unsure = log_force_variance(row, log_depth)
    of_law = depth / row.state[EXPONENT]
    variance = gate.moment[0] / (gate.offset_weight * gate.offset_count)
    variance += max(unsure, 0.0) * of_law * of_law
    zero, step, deviation = bank.onset.zero[0], gate.offset, math.sqrt(variance)
    if abs(zero + step - gate.zero_before) < BACK * deviation:
        step, deviation = gate.zero_before - zero, 0.0
    gate.zero_before = zero
    zero_moves.step_position(settings, bank, step, deviation)
    raw_readings.take(bank.delay, 0, stamp, bank.clock.measurement[0])
    forget(gate)
