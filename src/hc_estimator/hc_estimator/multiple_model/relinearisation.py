"""Where next to nothing damps, the row of constant tissue takes the fit if it was misled.

What a recursive filter has learnt rests on the parameters that it had then. Where damping is a
hundredth of the force and less, a B that was too high by chance made the force seem to say more of
B and p than it did: after two seconds B was 60 % too high and p too low, six deviations each, and
stayed so. Least squares linearise all that was felt at the parameters of now (as an iterated
smoother does; Bell 1994). As long as they remember all that the row has learnt from, a row that is
far off in B and p, or claims to know them much better, takes what they say. Of tissue that damps
more the recursion is right, and knows more: it also learns where no parabola fits.
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.hypotheses import LOG_DAMPING, VELOCITY_EXPONENT
from hc_estimator.multiple_model.normal_equations import TAIL, prior_off
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import is_held

FAR = 2.0  # squared deviations of the fit, of ln B and p together, by which both may differ
SURER = 0.5  # of the fit's variance of ln B or p; a row that claims less knows too much


@compiled
def is_misled(settings: Any, history: Any, row: Any) -> bool:
    """True if the fit remembers all that a row has learnt from, and says something else.

    Args:
        settings: settings record.
        history: with a fit.
        row: of constant tissue.
    """
    whole = history.count <= POINTS and history.first == 0
    if not whole or row.active == 0 or history.left > 0.0:
        return False
    if is_held(settings, 1) or is_held(settings, 3):
        return False
    if not prior_off(settings, history, history.fit, 1) < -TAIL:
        return False
    fit = history.covariance
    damping, exponent, tied = fit[1, 1], fit[3, 3], fit[1, 3]
    surer = row.covariance[LOG_DAMPING, LOG_DAMPING] < SURER * damping
    if surer or row.covariance[VELOCITY_EXPONENT, VELOCITY_EXPONENT] < SURER * exponent:
        return True
    off_b = row.state[LOG_DAMPING] - history.fit[1]
    off_p = row.state[VELOCITY_EXPONENT] - history.fit[3]
    squares = exponent * off_b * off_b - 2.0 * tied * off_b * off_p + damping * off_p * off_p
    return bool(squares > FAR * (damping * exponent - tied * tied))
