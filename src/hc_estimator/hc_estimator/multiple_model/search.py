"""Least squares that take longer than a sample: asked of the points of one moment, step by step.

What the zeros are (`zero_fit`) and what tissue and surface do (`moving_fit`) takes dozens of steps
of a third of a millisecond. Taken at once, a sensor of 1 kHz waited for thirty of its readings. So
a search keeps the points as they were when it began, and takes a step for each millisecond that has
passed by the stamps: as many at any rate, and the same whether a recording is replayed or live.
One search goes on at a time. Zeros and delays that move meanwhile move its points as well; where
the tissue is another from now on it ends. (Ours; `hc bench speed` has the longest sample.)
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import spline, spline_descent
from hc_estimator.multiple_model.spline_records import PASS_BEGINS, SOLVED

STEP_TIME = 0.001  # that passes for each step [s]
LONGEST = 0.1  # time that counts at once: after a gap there are no more steps than that [s]


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
    search.time = bank.clock.state_time
    search.credit = max(bank.clock.period - STEP_TIME, 0.0)  # there is time until the next sample


@compiled
def end(bank: Any) -> None:
    """Give up a search."""
    bank.zeros.stage = 0
    bank.moving.stage = 0


@compiled
def let_time_pass(bank: Any) -> None:
    """There is time for more steps."""
    search, now = bank.search, bank.clock.state_time
    search.credit = min(search.credit + max(now - search.time, 0.0), LONGEST)
    search.time = now


@compiled
def is_due(bank: Any) -> bool:
    """True if there is time for a step of a search; one of a tissue that was left is given up."""
    if not is_busy(bank):
        return False
    if bank.search.history.version != bank.history.version:
        end(bank)
        return False
    return bool(bank.search.credit >= STEP_TIME)


@compiled
def take_step(settings: Any, bank: Any) -> bool:
    """Take a step; True once the fit is solved."""
    search = bank.search
    search.credit -= STEP_TIME
    noise = search.noise[0], search.noise[1], search.noise[2]
    return spline_descent.go_on(settings, search.history, bank.fit, noise)


@compiled
def move(bank: Any, force: float, begun: float, now: float) -> None:
    """Move the force's zero [N] for all that was felt, and for a search; as `histories.move`."""
    histories.move(bank.history, 0.0, force, begun, now)
    if is_busy(bank):
        histories.move(bank.search.history, 0.0, force, begun, now)
        fit = bank.fit
        fit.values[spline.FORCE_ZERO] -= force
        fit.air_zero -= force
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
