"""Where is the force's zero while nobody sees it? A drift goes on as it did.

A sensor that warms up takes its zero along, for minutes, and in contact nothing shows it: of 30 mN
in ten minutes K was 0.25 % off, eight of its deviations, for all that was felt between two visits
to the air was felt with a zero that was wrong the same way. What two visits on end have in common
is such a drift: the zero goes on at that speed, as long as those have seen it, and is known as much
less well as they differ. One visit alone is none: a driver that tares, or a cable that moves, is
over at once. (Ours; a local linear trend whose slope is the smaller of the last two.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import zero_moves
from hc_estimator.multiple_model.air_window import SMALLEST_ZERO

VISITS = 20.0  # whose mean square of what the zero was off counts
ALIKE = 3.0  # ratio of the speeds of two visits up to which they are one drift


@compiled
def forget(drift: Any) -> None:
    """No drift is known."""
    drift.latest_rate = 0.0
    drift.rate = 0.0
    drift.spread = 0.0
    drift.span = 0.0
    drift.elapsed = 0.0
    drift.carried = 0.0
    drift.wander = 0.0
    drift.visits = 0


@compiled
def note(drift: Any, level: float, wanders: bool, time: float, known_at: float) -> None:
    """Note by how much the zero has moved since it was known.

    Args:
        drift: record; changed.
        level: by how much it is another than it was carried to [N].
        wanders: True if it came to that little by little, and not in a step.
        time: at which it was so [s].
        known_at: time at which it was known before [s].
    """
    if wanders:
        drift.visits += 1
        share = 1.0 / min(float(drift.visits), VISITS)
        drift.wander += share * (level * level / 3.0 - drift.wander)
    elapsed = time - known_at
    before, rate = drift.latest_rate, 0.0
    if elapsed > 0.0:
        rate = (drift.carried + level) / elapsed
    slower, faster = min(abs(rate), abs(before)), max(abs(rate), abs(before))
    drifts = rate * before > 0.0 and faster <= ALIKE * slower
    drift.rate = math.copysign(slower, rate) if drifts else 0.0
    drift.spread = abs(rate - before) if drifts else 0.0
    drift.span = drift.elapsed + elapsed
    drift.latest_rate = rate
    drift.elapsed = elapsed
    drift.known_at = time
    drift.carried = 0.0
    drift.carried_to = time


@compiled
def go_on(bank: Any, time: float) -> None:
    """Let a zero that drifts be where it is by now, at a time [s]."""
    drift = bank.drift
    if drift.rate == 0.0:
        return
    until = min(time, drift.known_at + drift.span)
    further = drift.rate * (until - drift.carried_to)
    if not abs(further) > SMALLEST_ZERO * math.sqrt(bank.sensor_noise[1]):
        return
    drift.carried += further
    drift.carried_to = until
    bank.onset.shift[0] = 0.0
    bank.onset.shift[1] = further
    zero_moves.move_readings(bank)


@compiled
def deviation(bank: Any) -> float:
    """How much less well the zero is known than when it was seen [N].

    What is known of the tissue was felt with a zero that was off by as much as it usually is by the
    next visit; growing evenly until then, by a third of that square.
    """
    drift = bank.drift
    elapsed = max(bank.clock.state_time - drift.known_at, 0.0)
    beyond = max(elapsed - drift.span, 0.0)
    off = drift.spread * elapsed + abs(drift.rate) * beyond
    return math.sqrt(off * off + drift.wander)
