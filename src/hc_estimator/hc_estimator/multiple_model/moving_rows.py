"""Let the rows that say what a fit of `moving_fit` has found begin with it.

A row whose surface stays remembers more than the fit has seen, and begins only where the fit
contradicts it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import delay_sensitivity
from hc_estimator.multiple_model.choice import trusted_motion
from hc_estimator.multiple_model.hypotheses import (
    BREATHES,
    COUNTS,
    FRESH,
    LOG_STIFFNESS,
    OWN,
    ROWS,
    STATES,
    SURFACE,
    SURFACE_ROW,
    TREND_ROW,
    is_tried,
)
from hc_estimator.multiple_model.rows import cut, is_held, limit, seed
from hc_estimator.multiple_model.spline_outcome import OUTCOME, note_outcome
from hc_estimator.multiple_model.spline_records import MOVES, SINKS, STAYS, VARIES


def _kind_of(m: int) -> int:
    """Which kind of fit says what a row says; -1 for a row that none begins."""
    row = ROWS[m]
    if not row.surface:
        return VARIES if m == TREND_ROW else -1
    kind = MOVES if BREATHES[m] else SINKS
    return kind + (VARIES if any(drives[0] > 0.0 for drives in row.drives) else STAYS)


KINDS_OF = np.array([_kind_of(m) for m in range(len(ROWS))])
# Where the outcome of a fit goes in the state of such a row; STATES: nowhere.
TARGETS = np.array(
    [
        [
            *range(LOG_STIFFNESS, LOG_STIFFNESS + 4),
            *((OWN, OWN + 1, OWN + 2) if row.surface else (STATES, STATES, OWN)),
        ]
        for row in ROWS
    ]
)
CONTRADICTS = 3.0  # deviations between a row and the fit from which it begins anew


@compiled
def are_tried(settings: Any, kind: int) -> bool:
    """True if a row says what a kind does."""
    count = 0
    for m in range(FRESH):
        count += 1 if KINDS_OF[m] == kind and is_tried(settings, m) else 0
    return count > 0


@compiled
def begin(settings: Any, bank: Any, kind: int) -> None:
    """Let the rows that say what a kind does begin with its fit, which is solved.

    Args:
        settings: settings record.
        bank: its records `moving`, `judge` and `rows` are changed.
        kind: of the fit.
    """
    fit, moving, judge, clock = bank.fit, bank.moving, bank.judge, bank.tool.contact_clock
    note_outcome(fit, moving, bank.clock.state_time)
    for m in range(FRESH):
        if KINDS_OF[m] != kind or not is_tried(settings, m):
            continue
        explained = fit.squares < fit.expected
        if SURFACE[m] or (explained and _contradicts(moving, bank.rows[m])):
            judge.found = m
            judge.found_at = clock
            _take(settings, bank, bank.rows[m], clock)


@compiled
def begin_moving(settings: Any, bank: Any) -> None:
    """Begin with the last fit, of tissue that stays under a surface that moves."""
    judge, clock = bank.judge, bank.tool.contact_clock
    if is_tried(settings, SURFACE_ROW):
        note_outcome(bank.fit, bank.moving, bank.clock.state_time)
        judge.chosen = SURFACE_ROW
        judge.found = SURFACE_ROW
        judge.found_at = clock
        bank.moving.moved_at = clock
        _take(settings, bank, bank.rows[SURFACE_ROW], clock)


@compiled
def _contradicts(moving: Any, row: Any) -> bool:
    """True if K or n of the fit is not what a row says that follows the stiffness."""
    for i in (0, 2):
        place = TARGETS[row.index, i]
        off = moving.outcome[i] - row.state[place]
        variance = moving.covariance[i, i] + row.covariance[place, place]
        if off * off > CONTRADICTS * CONTRADICTS * variance:
            return True
    return False


@compiled
def _take(settings: Any, bank: Any, row: Any, clock: float) -> None:
    """Begin a row with what was found."""
    moving, rows, judge = bank.moving, bank.rows, bank.judge
    chosen = rows[judge.chosen]
    score, likelihood = chosen.score, chosen.log_likelihood
    source = rows[trusted_motion(judge, rows)]
    if source.index != row.index:
        seed(source, row, clock, clock)
    row.active = 1
    row.since = clock
    row.counts_from = clock
    row.model_error = 0.0
    row.position_deviation = 0.0
    row.score = score
    row.log_likelihood = likelihood
    delay_sensitivity.clear(row, LOG_STIFFNESS, LOG_STIFFNESS + 4)
    delay_sensitivity.clear(row, OWN, STATES)
    targets = TARGETS[row.index]
    for i in range(OUTCOME):
        if _is_taken(settings, row, i):
            cut(row, targets[i])
    for i in range(OUTCOME):
        if not _is_taken(settings, row, i):
            continue
        row.state[targets[i]] = moving.outcome[i]
        for j in range(OUTCOME):
            if _is_taken(settings, row, j):
                row.covariance[targets[i], targets[j]] = moving.covariance[i, j]
    limit(settings, row)


@compiled
def _is_taken(settings: Any, row: Any, i: int) -> bool:
    """True if a row takes a number of the outcome: a state of its own that is not held fixed."""
    has_it = TARGETS[row.index, i] < COUNTS[row.index]
    return bool(has_it and (i >= 4 or not is_held(settings, i)))
