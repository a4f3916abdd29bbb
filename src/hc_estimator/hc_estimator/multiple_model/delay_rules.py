"""From when on a delay is believed, and what a change of it means; for all that look for one."""

from __future__ import annotations

from hc_estimator.compilation import compiled

APART = 0.012  # delays further apart are rivals [s]
RIVAL = 4.0  # log likelihood ratio to the best rival
LEAD = 8.0  # log likelihood ratio to what is in use
SMALLEST = 0.001  # delay worth the name [s]
SMALL = 4.0  # deviations of a normal distribution, for a delay of less than a step
CORRECTION = 0.0002  # by which a delay in use is corrected, at least [s]
SMALLEST_DEVIATION = 0.0001  # no more is claimed [s]
FAR = 3.0  # deviations, from which on it is another delay
CORRECTED = 2.0  # standard deviations by which it is corrected, at least
BEGIN_ANEW = 0.002  # change of the delay from which on the rows begin anew [s]


@compiled
def student_quantile(freedom: float) -> float:
    """Student's distribution at `SMALL` deviations of the normal one (Cornish and Fisher 1937)."""
    return SMALL + (SMALL**3 + SMALL) / (4.0 * max(freedom, 1.0))
