"""How an error of the delay in use passes into the estimate, and what the estimate owes to it.

A delay that was found is known to some tenths of a millisecond. That error is no noise of a sample:
it is the same for all, so that no number of samples brings it down, and a covariance without it
would claim too much. It is considered, as Schmidt (1966) does with a bias that is not estimated
(Bierman, Factorization Methods, 1977, chapter VIII): every row carries the derivative s of its
state by the error of the delay. Measurements act on it as on any error of the state,

    s <- Phi s,        s <- s + K (h' - H s),

with the gain K that the update has anyway and the derivative h' of the measurement: a force that
belongs to a state some time later shows H dx/dt more. What is given out adds s s^T times the
variance of the delay's error. The gains stay those without it.
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector
from hc_estimator.multiple_model.hypotheses import (
    ACCELERATION,
    COUNTS,
    DEPTH,
    DRIVEN,
    DRIVES,
    FIRST_PARAMETER,
    LAST_PARAMETER,
    OWN,
    VELOCITY,
)

LARGEST = 1e12  # derivative of a force [N/s] that is a number


@compiled
def clear(row: Any, first: int, last: int) -> None:
    """The states from `first` to before `last` do not depend on the delay."""
    for i in range(first, last):
        row.by_delay[i] = 0.0


@compiled
def forget_evidence(row: Any) -> None:
    """The innovations have said nothing of the delay."""
    row.delay_score = 0.0
    row.delay_information = 0.0


@compiled
def take(source: Any, row: Any, first: int, last: int) -> None:
    """Take the states from `first` to before `last` from another row."""
    for i in range(first, last):
        row.by_delay[i] = source.by_delay[i]


@compiled
def predict(row: Any, elapsed: float, goes_on: bool) -> None:
    """Over a time [s]; `goes_on` is False where the parameters stay as they are."""
    slope = row.by_delay
    slope[DEPTH] += elapsed * (slope[VELOCITY] + 0.5 * elapsed * slope[ACCELERATION])
    slope[VELOCITY] += elapsed * slope[ACCELERATION]
    if not goes_on:
        return
    for own in range(COUNTS[row.index] - OWN):
        for k in range(DRIVEN):
            target = FIRST_PARAMETER + k if k < DRIVEN - 1 else OWN
            slope[target] += DRIVES[row.index, own, k] * elapsed * slope[OWN + own]


@compiled
def of_displacement(row: Any, offset: float) -> float:
    """Give h' - H s of a displacement that was taken some time [s] later than the state [mm/s]."""
    slope = row.by_delay
    depth = slope[DEPTH] + offset * (slope[VELOCITY] + 0.5 * offset * slope[ACCELERATION])
    return -depth  # type: ignore[no-any-return]


@compiled
def of_force(row: Any) -> float:
    """Give h' - H s of the force [N/s], from its sensitivity to the columns of the factor, H L."""
    state, factor, whitened = row.state, row.factor, row.whitened
    total = 0.0
    for j in range(COUNTS[row.index]):
        rest = -row.by_delay[j]
        if j == DEPTH:
            rest += state[VELOCITY]
        elif j == VELOCITY:
            rest += state[ACCELERATION]
        for k in range(j):
            rest -= factor[j, k] * whitened[k]
        whitened[j] = rest / factor[j, j] if factor[j, j] > 0.0 else 0.0
        total += row.sensitivity[j] * whitened[j]
    if not abs(total) < LARGEST:
        clear_vector(row.by_delay)
        return 0.0
    return total


@compiled
def correct(rows: Any, change: float) -> None:
    """The delay in use was changed [s]: the parameters become those of the better delay."""
    for m in range(rows.shape[0]):
        row = rows[m]
        if row.active == 0:
            continue
        for i in range(FIRST_PARAMETER, LAST_PARAMETER):
            row.state[i] += change * row.by_delay[i]
