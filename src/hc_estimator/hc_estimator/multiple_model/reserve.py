"""Hypotheses in reserve: two things at once, tried only while one alone does not do.

A lump on a surface that sinks, or under a zero that is off, needs a row in which both are states;
a damping that goes its own way needs a rate of its own beside that of the stiffness. Such rows are
the freest of all, and on constant tissue they would only cost time. So they take no part until a
freer row than constant tissue has been chosen for a while, or a misfit told; they begin from the
row in charge, or from the one that they refine, wait before they count, and leave once constant
tissue has done for long. (Variable-structure multiple-model estimation: Li and Bar-Shalom, IEEE
Trans. AC 41(4), 1996; when is ours, see `hc bench accuracy together` and `scan`.)
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.choice import seed_behind
from hc_estimator.multiple_model.hypotheses import (
    FITTED,
    FRESH,
    OWN,
    PLAIN,
    REFINES,
    RESERVE,
    SURFACE,
    is_tried,
)
from hc_estimator.multiple_model.rows import free_damping, free_parameters

NEEDED_TIME = 0.3  # in contact for which constant tissue must not do [s]
UNNEEDED_TIME = 10.0  # in contact for which it must have done [s]
# Of ln K, ln B, n and p about those of the chosen row: with one thing wrong, n is wrong by as much.
DEVIATIONS = (1.0, 1.0, 0.3, 0.1)
DAMPING_DEVIATION = 0.3  # of ln B, once it has gone its own way for some tenths of a second


@compiled
def review(settings: Any, bank: Any) -> None:
    """Call the reserve, or send it away, after each snapshot of what the rows said."""
    judge, rows, elapsed = bank.judge, bank.rows, bank.judge.waited
    chosen = rows[judge.chosen]
    if judge.chosen > FITTED or chosen.model_error > 0.0:
        judge.needed_time += elapsed
        judge.unneeded_time = 0.0
    else:
        judge.needed_time = 0.0
        judge.unneeded_time += elapsed
    for m in range(FRESH):
        if not RESERVE[m] or not is_tried(settings, m) or not is_tried(settings, PLAIN[m]):
            continue
        if rows[m].active == 0 and judge.needed_time > NEEDED_TIME:
            source = rows[PLAIN[m]] if REFINES[m] else chosen
            _begin(settings, source, rows[m], bank.tool.contact_clock)
        elif judge.unneeded_time > UNNEEDED_TIME:
            rows[m].active = 0


@compiled
def _begin(settings: Any, source: Any, row: Any, clock: float) -> None:
    """Begin a row from the chosen one, or from the one that it refines."""
    seed_behind(source, row, clock)
    if REFINES[row.index]:
        free_damping(settings, row, DAMPING_DEVIATION)
    else:
        free_parameters(settings, row, DEVIATIONS)
    if SURFACE[row.index] and SURFACE[source.index]:
        row.state[OWN] = source.state[OWN]
    row.active = 1
