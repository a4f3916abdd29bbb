"""From when on a delay is believed, and what a change of it means; for all that look for one."""

from __future__ import annotations

APART = 0.012  # delays further apart are rivals [s]
RIVAL = 4.0  # log likelihood ratio to the best rival
LEAD = 8.0  # log likelihood ratio to what is in use
CORRECTION = 0.0002  # by which a delay in use is corrected, at least [s]
SMALLEST_DEVIATION = 0.0001  # no more is claimed [s]
FAR = 3.0  # deviations, from which on it is another delay
CORRECTED = 2.0  # standard deviations by which it is corrected, at least
BEGIN_ANEW = 0.002  # change of the delay from which on the rows begin anew [s]
