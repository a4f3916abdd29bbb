"""The tool departs from rest: the motion is let go at the first force that shows it.

Where a tool rests, `motion_density` says that it moves calmly, and is right. When it sets off, the
force shows it within a sample or two, the displacement only tens of samples later; in between every
row would expect a tool that rests, and miss the force by as much as a press rises. `maneuver` goes
back to before that, once many forces could not be. But a rest has taught how the tool moves before
it: as soon as a force is unlikely for a tool that rests, velocity and acceleration are what the
accelerations of the last seconds may have made of them, and the force is foreseen anew.

The acceleration is that of the displacement alone: a law that does not fit cannot make the tool
livelier than it was seen to be. (Variable state dimension filter of Bar-Shalom and Birmiwal, IEEE
Trans. AES 18(5), 1982, with the variance in place of another state; ours: from rest only.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.adaptation import motion_density
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.hypotheses import ACCELERATION, DEPTH, VELOCITY

UNLIKELY = 3.0  # deviations of the force from which on a tool at rest has departed
CERTAIN = 3.0  # deviations of the velocity that are no noise
CERTAIN_ACCELERATION = 4.0  # of the acceleration, whose largest of thousands counts
SLOW = 0.05  # of the largest speed of the last seconds; slower is at rest
DEPARTURE_TIME = 0.15  # after the departure in which it may be let go again [s]
MEMORY = 5.0  # time constant with which the largest acceleration is forgotten [s]
UNSEEN = 2.0  # samples that the motion may have begun earlier


@compiled
def learn(bank: Any) -> None:
    """Take the acceleration of the displacement alone after an accepted sample."""
    maneuver, motion, elapsed = bank.maneuver, bank.motion, bank.clock.elapsed
    maneuver.departed += elapsed
    forgotten = maneuver.square_acceleration * (1.0 - min(elapsed / MEMORY, 1.0))
    square = 0.0
    if motion_density.is_settled(motion):
        variance = motion_density.covariance_of(motion, 2, 2, bank.sensor_noise[0])
        square = motion_density.motion_of(motion, 2) ** 2 - CERTAIN_ACCELERATION**2 * variance
    maneuver.square_acceleration = max(forgotten, square)


@compiled
def let_go(maneuver: Any, rows: Any, chosen: Any, elapsed: float) -> bool:
    """Let the motion go where a foreseen force is unlikely for a tool that rests.

    Args:
        maneuver: changed.
        rows: their motion is changed.
        chosen: the row in charge, with its innovation of the force.
        elapsed: since the last sample [s].

    Returns:
        True if the force is to be foreseen anew.
    """
    if chosen.model_error > 0.0 or not maneuver.square_acceleration > 0.0:
        return False
    square = chosen.innovation[1] * chosen.innovation[1]
    if not square > UNLIKELY * UNLIKELY * chosen.innovation_variance[1]:
        return False
    if maneuver.departed > DEPARTURE_TIME:
        spread = CERTAIN * math.sqrt(chosen.covariance[VELOCITY, VELOCITY])
        if abs(chosen.state[VELOCITY]) > spread + SLOW * math.sqrt(maneuver.square_speed):
            return False
        maneuver.departed = 0.0
    time = UNSEEN * elapsed
    for m in range(rows.shape[0]):
        if rows[m].active != 0:
            _add(rows[m].covariance, maneuver.square_acceleration, time)
    return True


@compiled
def _add(covariance: Any, square: float, time: float) -> None:
    """Add what an acceleration of that mean square has done to the motion in a time [s]."""
    by = (0.5 * time * time, time, 1.0)
    at = (DEPTH, VELOCITY, ACCELERATION)
    for i in range(3):
        for j in range(3):
            covariance[at[i], at[j]] += square * by[i] * by[j]
