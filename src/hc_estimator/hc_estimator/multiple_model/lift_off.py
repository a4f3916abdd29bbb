"""What goes on once the tool has left the tissue?

A row that drifts follows a tissue that relaxes until it lets go, and stands at what the very end of
that contact said: parameters under which the next press would begin all wrong. So it is asked what
its law makes of the whole contact that is over. Where that is far off, and the fit to all that was
felt is not, the fit goes on instead, and the rows that drift begin there anew. A row that follows a
tissue that really drifts is not far off in its last contact, and goes on. (Ours; `hc bench accuracy
ablation`.)
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import batch_fit
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import judge as judging
from hc_estimator.multiple_model.hypotheses import (
    FITTED,
    SURFACE,
)
from hc_estimator.multiple_model.kalman import force_at, squared_forces, squares_left
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "review_contact",
        "bool",
        True,
        "Once the tool has left, hold what drifted against the whole contact that is over.",
    ),
)

AWAY_TIME = 0.1  # without contact until it is asked [s]
PAUSE = 0.3  # between two points from which on they are of two contacts [s]
FEWEST = 12  # points
# Squares left by the fit over those left by the row, and those of the row over those of the forces,
# both as RMS. A tissue that drifts was not at its end what it had been, either, but not far off.
CLEARLY = 0.3
FAR_OFF = 0.3
# Squares left by the fit over those of the forces, as RMS, up to which it explains the contact, and
# it was the row that went astray. Where it leaves more, the tissue may have become stiffer along
# the way, which none that relaxes does: then it varies, also where it becomes softer.
EXPLAINED = 0.03


@compiled
def look(settings: Any, bank: Any, elapsed: float) -> None:
    """Ask once, when the tool has been away for `AWAY_TIME` after another time [s]."""
    away = bank.tool.away_time
    if away < AWAY_TIME and away + elapsed >= AWAY_TIME:
        judging.end_contact(bank.judge)
        review(settings, bank)


@compiled
def review(settings: Any, bank: Any) -> None:
    """Let the fit go on if it explains the contact that is over better than the chosen row.

    Args:
        settings: settings record.
        bank: who is chosen is changed, and the rows begin anew.
    """
    rows, judge, history = bank.rows, bank.judge, bank.history
    fitted, chosen = rows[FITTED], rows[judge.chosen]
    drifts = judge.chosen > FITTED and not SURFACE[judge.chosen]
    if settings.review_contact == 0 or fitted.active == 0 or not drifts:
        return
    first = _begin_of_contact(history)
    if history.count - first < FEWEST:
        return
    points, last = history.points, history.count
    left = squares_left(settings, points, first, last, chosen)
    forces = squared_forces(points, first, last)
    fits = chosen.model_error == 0.0  # what does not fit claims nothing
    if fits and left < FAR_OFF**2 * forces:
        return
    if history.fitted != 0:  # the row itself may have begun anew with the chosen one since
        batch_fit.give(history, rows[0], fitted)
    largest = CLEARLY**2 * left if fits else left
    by_fit = squares_left(settings, points, first, last, fitted)
    if by_fit > largest:
        return
    if by_fit > EXPLAINED**2 * forces:
        if not _has_let_go(settings, points, first, last, chosen):
            judging.note_stiffened(judge)
        if judge.stiffened != 0:
            return
    judging.go_on_with_fit(judge, rows, bank.tool.contact_clock)


@compiled
def _has_let_go(settings: Any, points: Any, first: int, last: int, row: Any) -> bool:
    """True if the tissue resisted more in the contact that is over than a row says of its end."""
    total = 0.0
    for i in range(first, last):
        point = points[i % POINTS]
        total += point.force - force_at(settings, row, point.depth, point.velocity)
    return total > 0.0


@compiled
def _begin_of_contact(history: Any) -> int:
    """Number of the first remembered point of the contact that is over."""
    first = history.count - 1
    while first > histories.oldest(history):
        after, before = history.points[first % POINTS], history.points[(first - 1) % POINTS]
        if after.time - before.time > PAUSE:
            break
        first -= 1
    return max(first, histories.oldest(history))  # type: ignore[no-any-return]
