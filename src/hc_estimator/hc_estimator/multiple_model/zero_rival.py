"""Does a surface that moves explain what zeros that are off would explain?

A stiffness that varies as it likes, at zeros that are off, explains a surface that breathes to
within the noise, and for two seconds even tissue that stays does: a force zero of half a newton was
found so, nine seconds after the surface had been, and K stayed at a third. So where the row in
charge says that the surface moves, least squares say the same with the zeros as they are, and that
and the zeros that are off are compared by their evidence (`spline_prior.log_evidence`), for which
they are as likely beforehand as for `zero_average`. (Ours; `test_moving_delay.py`.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import search as searches
from hc_estimator.multiple_model import spline
from hc_estimator.multiple_model.hypotheses import BREATHES
from hc_estimator.multiple_model.moving_rows import KINDS_OF
from hc_estimator.multiple_model.spline_fit import CONSISTENT
from hc_estimator.multiple_model.spline_prior import log_evidence
from hc_estimator.multiple_model.zero_average import LIKELY_POSITION, LIKELY_ZERO


@compiled
def kind_in_charge(bank: Any) -> int:
    """Which kind of fit says what the row in charge says."""
    return KINDS_OF[bank.judge.chosen]  # type: ignore[no-any-return]


@compiled
def begin(settings: Any, bank: Any, first: int) -> bool:
    """Begin to fit what the row in charge says; False if its surface may not breathe.

    Args:
        settings: settings record.
        bank: its record `fit` is changed; `search` has begun.
        first: number of the oldest point.
    """
    history, fit, row = bank.search.history, bank.fit, bank.rows[bank.judge.chosen]
    if not BREATHES[row.index] or row.model_error > 0.0:
        return False
    kind = kind_in_charge(bank)
    if not spline.lay_out_at_zeros(settings, history, fit, first, history.count, kind):
        return False
    searches.begin_fit(settings, bank)
    return True


@compiled
def evidence_of_surface(fit: Any) -> float:
    """Logarithm of the evidence of that fit, once it is solved; its matrix `seen` is overwritten.

    Returns:
        Minus infinity where it leaves more than noise.
    """
    if not fit.squares < CONSISTENT * fit.expected:
        return -math.inf
    return log_evidence(fit, fit.squares)


@compiled
def evidence_of_zeros(fit: Any, squares: float, largest: tuple[float, float]) -> float:
    """Logarithm of the evidence for the zeros of a fit that is solved.

    Args:
        fit: solved, any zero being as likely in it; overwritten.
        squares: weighted sum of squares.
        largest: depth [mm] and force [N].
    """
    deviations, cost = (LIKELY_POSITION * largest[0], LIKELY_ZERO * largest[1]), 0.0
    for i in range(2):
        zero = spline.POSITION + i
        if fit.fixed[zero] == 0 and deviations[i] > 0.0:
            relative = fit.values[zero] / deviations[i]
            cost += 2.0 * math.log(deviations[i]) + relative * relative
            fit.fixed[zero] = 1  # its prior is counted here
    return log_evidence(fit, squares) - 0.5 * cost
