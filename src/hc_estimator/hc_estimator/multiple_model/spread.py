"""What the hypotheses that were not chosen leave open of the parameters.

One hypothesis is given out, and its covariance holds only as far as that hypothesis does. Where
another explains what was felt next to as well, K and n are as uncertain as the two are apart, and
as the other is by itself. (Covariance of a mixture, in static multiple-model estimation: Bar-
Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, 1.4.16
and 11.6; the prior odds are ours, see `hc bench accuracy troubles`.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix
from hc_estimator.multiple_model import contradiction
from hc_estimator.multiple_model.choice import REFUTED, explains, steadiest_nis
from hc_estimator.multiple_model.hypotheses import FITTED, FRESH, LOG_STIFFNESS
from hc_estimator.multiple_model.kalman import RATE_MEMORY
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "mixture_covariance",
        "bool",
        True,
        "Count into the covariance what hypotheses that were not chosen leave open.",
    ),
)

VARIED_FOR = 10.0  # time in contact for which tissue that varied may vary again [s]
STEEP_FOR = 0.3  # time in contact with a rate that is clearly none, after which it varies [s]
# Logarithm of the largest odds of another row: the chosen one was chosen for its predictions.
LARGEST_ODDS = 3.0


@compiled
def find(settings: Any, judge: Any, rows: Any, clock: float) -> None:
    """Find what the other rows leave open of the chosen one's ln K, ln B, n and p.

    The odds of a row are its likelihood's over the chosen one's, and e^-REFUTED of that if it is a
    freer one.

    Args:
        settings: settings record.
        judge: its `spread` is changed.
        rows: the hypotheses.
        clock: contact clock [s].
    """
    spread, chosen = judge.spread, judge.chosen
    clear_matrix(spread)
    row, is_calm = rows[chosen], chosen <= FITTED
    if row.model_error == 0.0 and settings.mixture_covariance != 0:
        steadiest, total = steadiest_nis(judge, rows), 1.0
        for m in range(FITTED + 1 if is_calm else 0, FRESH):
            if m == chosen or not explains(judge, rows, m, clock, steadiest):
                continue
            odds = rows[m].log_likelihood - row.log_likelihood
            weight = math.exp(min(odds - (REFUTED if m > chosen else 0.0), LARGEST_ODDS))
            total += weight
            _add_distance(spread, row, rows[m], weight)
            _add_own(spread, rows[m], weight)
        for i in range(4):
            for j in range(4):
                spread[i, j] /= total
    if chosen == 0 and rows[FITTED].active != 0:
        _add_distance(spread, row, rows[FITTED], contradiction.share_left_open(row))
    # Between two inclusions constant tissue explains the force again, and a row of constant
    # tissue is very sure of itself; that the tissue varies is not forgotten with it.
    if is_calm and varied_lately(judge, clock):
        _add_distance(spread, row, rows[judge.varying], 1.0)


@compiled
def find_in_air(settings: Any, judge: Any, rows: Any, clock: float) -> None:
    """The same where nothing is felt: what varied may be another tissue at the next contact."""
    if judge.chosen > FITTED or not varies(judge, clock) or settings.mixture_covariance == 0:
        return
    clear_matrix(judge.spread)
    _add_distance(judge.spread, rows[judge.chosen], rows[judge.varying], 1.0)
    _add_own(judge.spread, rows[judge.varying], 1.0)


@compiled
def growth_in_air(judge: Any, tool: Any, elapsed: float) -> float:
    """Variance that ln K gains in a time in the air [s], beneath a tool that may move along tissue.

    A rate as large as the one that was felt, of a piece for `RATE_MEMORY` only, makes a random walk
    of ln K. Not in a tap, which is over before that.
    """
    if not (tool.away_time > RATE_MEMORY and varies(judge, tool.contact_clock)):
        return 0.0
    return 2.0 * RATE_MEMORY * judge.square_rate * elapsed  # type: ignore[no-any-return]


@compiled
def varies(judge: Any, clock: float) -> bool:
    """True if the tissue varied lately, and clearly along the way."""
    return bool(varied_lately(judge, clock) and judge.steep_time > STEEP_FOR)


@compiled
def varied_lately(judge: Any, clock: float) -> bool:
    """True if the tissue varied so lately that it may vary again.

    Args:
        judge: record of the judge.
        clock: contact clock [s].
    """
    return bool(judge.varying > 0 and clock - judge.varied_at < VARIED_FOR)


@compiled
def _add_distance(spread: Any, row: Any, other: Any, weight: float) -> None:
    """Add the square of what lies between two rows."""
    for i in range(4):
        for j in range(4):
            a = other.state[LOG_STIFFNESS + i] - row.state[LOG_STIFFNESS + i]
            b = other.state[LOG_STIFFNESS + j] - row.state[LOG_STIFFNESS + j]
            spread[i, j] += weight * (a * b)


@compiled
def _add_own(spread: Any, other: Any, weight: float) -> None:
    """Add what a row does not know by itself; the lower triangle of its covariance is used."""
    for i in range(4):
        for j in range(4):
            row, column = LOG_STIFFNESS + max(i, j), LOG_STIFFNESS + min(i, j)
            spread[i, j] += weight * other.covariance[row, column]
