"""Do least squares say another damping than the row of constant tissue, and by how much?

A recursive filter knows the motion of the tool by a model of it: that its jerk is white. A hand
that trembles at 8 Hz is none such, and where the noise of the position hides that, the filter lags
behind it by some tenths of a millisecond; a force that is early by that is damping. It is 2 to 60 %
of B then, and the row is as sure as if the motion were what it takes it for. Least squares over
what was felt (`batch_fit`) ask for no model of the motion, and know less. Both say the same where
the model holds, and so their distance says whether it does (specification test; Hausman,
Econometrica 46, 1978): what is left open is that distance, and from `REFUTED` on the fit is given
out instead. (Hands that tremble by 0.02 to 0.05 mm at 5 to 11 Hz, a position noise of 0.01 to 0.1
mm: `test_hand_tremor.py`.)
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.hypotheses import LOG_DAMPING, VELOCITY_EXPONENT
from hc_estimator.multiple_model.rows import is_held

REFUTED = 6.0  # squared deviations of ln B and p together: one in twenty is beyond by chance
USUAL = 2.0  # expected by chance
SETTLED = 3.0  # below which a row that was refuted is none any more


@compiled
def of_damping(settings: Any, history: Any, row: Any) -> float:
    """Squared distance of a row from the fit, of ln B and p, in deviations of the fit.

    Args:
        settings: settings record.
        history: fitted.
        row: of constant tissue; a row that was refuted stays so down to `SETTLED`.

    Returns:
        0 where the law does not fit the points, where B or p are held, or where the motion is as
        the displacement shows it.
    """
    if history.left > 0.0 or row.active == 0 or history.trembles == 0:
        return 0.0
    if is_held(settings, 1) or is_held(settings, 3):
        return 0.0
    fit = history.covariance
    damping, exponent, tied = fit[1, 1], fit[3, 3], fit[1, 3]
    determinant = damping * exponent - tied * tied
    if not determinant > 0.0:
        return 0.0
    off_b = row.state[LOG_DAMPING] - history.fit[1]
    off_p = row.state[VELOCITY_EXPONENT] - history.fit[3]
    squares = exponent * off_b * off_b - 2.0 * tied * off_b * off_p + damping * off_p * off_p
    squares /= determinant
    if row.contradiction >= REFUTED and squares > SETTLED:
        return max(float(squares), REFUTED)
    return float(squares)


@compiled
def refutes(row: Any) -> bool:
    """True if the fit is to be given out instead of a row."""
    return bool(row.contradiction >= REFUTED)


@compiled
def share_left_open(row: Any) -> float:
    """Share of the squared distance from the fit that a row leaves open, 0 to 1."""
    share = (row.contradiction - USUAL) / (REFUTED - USUAL)
    return min(max(share, 0.0), 1.0)  # type: ignore[no-any-return]
