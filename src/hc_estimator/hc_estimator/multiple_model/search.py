"""Least squares that take longer than a sample: asked of the points of one moment, step by step.

What the zeros are (`zero_fit`), what tissue and surface do (`moving_fit`) and what is late
(`delay`) takes dozens of steps of a third of a millisecond. Taken at once, a sensor of 1 kHz waited
for thirty of its readings. So one step is taken for each millisecond that has passed by the stamps:
as many at any rate, and the same whether a recording is replayed or live.

The first two go on one at a time, and keep the points as they were when they began. Zeros and
delays that move meanwhile move these as well; where the tissue is another from now on they end.
(Ours; `docs/evidence/performance.md` has the longest sample.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import spline, spline_descent, spline_start
from hc_estimator.multiple_model.spline_records import PASS_BEGINS, SOLVED

STEP_TIME = 0.001  # that passes for each step [s]
MOST_USED = 256  # points of a step of a fit, from which on the next one waits: 0.2 to 0.4 ms


@compiled
def reset(bank: Any) -> None:
    """Nothing is asked."""
    histories.reset(bank.search.history)
    bank.search.credit = 0.0
    end(bank)


@compiled
def is_busy(bank: Any) -> bool:
    """True while a search goes on."""
    return bool(bank.zeros.stage != 0 or bank.moving.stage != 0)


@compiled
def begin(bank: Any) -> None:
    """Keep the points as they are now."""
    search = bank.search
    histories.copy(bank.history, search.history)
    noise = histories.noise_of_points(bank)
    for i in range(3):
        search.noise[i] = noise[i]


@compiled
def begin_fit(settings: Any, bank: Any) -> None:
    """Begin a fit that is laid out over the kept points near the row in charge."""
    row = bank.rows[bank.judge.chosen]
    spline_start.begin(settings, bank.search.history, bank.fit, row)
    spline_descent.begin(settings, bank.fit)


@compiled
def end(bank: Any) -> None:
    """Give up a search."""
    bank.zeros.stage = 0
    bank.moving.stage = 0


@compiled
def let_time_pass(bank: Any) -> None:
    """There is time for more steps."""
    search, now = bank.search, bank.clock.state_time
    most = max(bank.clock.period + 0.5 * STEP_TIME, STEP_TIME)
    search.credit = min(search.credit + max(now - search.time, 0.0), most)
    search.time = now


@compiled
def is_due(bank: Any) -> bool:
    """True if there is time for a step, and one to take; a tissue that was left is given up."""
    if is_busy(bank) and bank.search.history.version != bank.history.version:
        end(bank)
    waits = bank.delay.stage != 0 or is_busy(bank)
    return bool(waits and bank.search.credit >= STEP_TIME)


@compiled
def spend(bank: Any) -> None:
    """A step takes its time."""
    bank.search.credit -= STEP_TIME


@compiled
def take_step(settings: Any, bank: Any) -> bool:
    """Take a step, or some where the points are few; True once the fit is solved."""
    search, fit, used = bank.search, bank.fit, 0
    noise = search.noise[0], search.noise[1], search.noise[2]
    while used < MOST_USED:
        if spline_descent.go_on(settings, search.history, fit, noise):
            return True
        used += max(fit.last - fit.first, 1)
    return False


@compiled
def move(bank: Any, force: float, begun: float, now: float) -> None:
    """Move the force's zero [N] for all that was felt, and for a search; as `histories.move`."""
    histories.move(bank.history, 0.0, force, begun, now)
    if is_busy(bank):
        histories.move(bank.search.history, 0.0, force, begun, now)
        fit, zeros = bank.fit, bank.zeros
        if fit.held[spline.FORCE_ZERO] == 0:
            fit.values[spline.FORCE_ZERO] -= force
        if zeros.air_deviation < math.inf:
            fit.air_zero -= force
            zeros.air_zero -= force
        _begin_pass(fit)


@compiled
def realign(bank: Any, change: float) -> None:
    """The force is later by so much [s], for all that was felt and for a search."""
    histories.realign(bank.history, change)
    if is_busy(bank):
        histories.realign(bank.search.history, change)
        _begin_pass(bank.fit)


@compiled
def _begin_pass(fit: Any) -> None:
    """Weigh anew: the cost that was known is of points that were elsewhere."""
    if fit.phase != SOLVED:
        fit.phase = PASS_BEGINS
