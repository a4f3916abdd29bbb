"""What the filter's own innovations say of the delay in use, half a second at a time.

Every row knows how its estimate, and with it each innovation, would be different with another delay
(`delay_sensitivity`). So its innovations are a measurement of the delay's error: of a row with the
innovations nu, their variances S and their derivatives g by the delay,

    score = - sum g nu / S,    information = sum g^2 / S,    error = score / information

(a bias beside a Kalman filter: Friedland, IEEE Trans. AC 14(4), 1969). This uses every reading, all
that was felt before, and the n and p that the filter has found, and is ten times as fine as what
the windows of `delay` say, but holds near the delay in use only, and for a law that fits. Half
seconds differ by more than each says of itself; how much is found from their scatter (random
effects; DerSimonian and Laird, 1986), and with few of them Student's distribution decides. The
delay is not a state of the rows: far from it the likelihood has another, false optimum.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import delay_sensitivity
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model.delay_records import WINDOWS
from hc_estimator.multiple_model.hypotheses import EXPONENT, LOG_DAMPING, LOG_STIFFNESS
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "delay_by_innovations",
        "bool",
        True,
        "Refine the delay by the filter's own innovations.",
    ),
)

# What a correction of a delay is, and when it is another one; for `delay` as well.
CORRECTION = 0.0002  # by which a delay in use is corrected, at least [s]
FAR = 3.0  # deviations, from which on it is another delay
CORRECTED = 2.0  # standard deviations by which it is corrected, at least
SMALLEST_DEVIATION = 0.0001  # no more is claimed [s]
FARTHEST = 0.02  # error of which a half second still says something [s]
LINEAR = 0.01  # error that is believed [s]
BENT = 0.1  # share of an error by which it may be off, for what is not linear
ALIKE = 0.5  # of a step of the grid: by what smoothing may put the fit of all points off
LAG = 0.02  # of the slower sensor's period: error of a delay by the motion model's lag
FEWEST = 3  # half seconds
FEWEST_ALIKE = 2.0  # the same, if all of them said equally much


@compiled
def reset(finder: Any) -> None:
    """No half second has said anything."""
    finder.evidence_count = 0


@compiled
def learn(finder: Any, rows: Any, row: Any) -> bool:
    """Take what the innovations since the last time have said; True if the delay is to change.

    The new delay is then finder.delay.

    Args:
        finder: changed.
        rows: all of them; each begins to add up anew.
        row: the one that is believed.
    """
    score, information = row.delay_score, row.delay_information
    for m in range(rows.shape[0]):
        delay_sensitivity.forget_evidence(rows[m])
    error = score / information if information > 0.0 else math.inf
    if not abs(error) < FARTHEST:
        return False
    half = finder.evidence[finder.evidence_count % WINDOWS]
    half[0] = finder.delay + error
    half[1] = 1.0 / information + (BENT * error) ** 2
    finder.evidence_count += 1
    if finder.delay == 0.0 or finder.evidence_count < FEWEST:
        return False
    alike = join(finder)
    if not alike > FEWEST_ALIKE:
        return False
    freedom = alike - 1.0
    mean, deviation = finder.fine[0], finder.fine[1] * math.sqrt(1.0 + 2.0 / freedom)
    if not abs(mean - finder.delay) < LINEAR or contradicted(finder, mean):
        return False
    if finder.found_deviation > 0.0:
        # Both come of the same readings: weighed by what they know, they do not know more.
        deviation = math.hypot(deviation, LAG * grids.slowest_period(finder))
        share = deviation**2 / (deviation**2 + finder.found_deviation**2)
        mean += share * (finder.found - mean)
        deviation = min(deviation, finder.found_deviation)
    changes = abs(mean - finder.delay) > max(CORRECTED * deviation, CORRECTION)
    if changes:
        finder.delay = mean
    finder.deviation = math.hypot(deviation, mean - finder.delay)
    finder.doubt = finder.deviation**2
    return bool(changes)


@compiled
def contradicted(finder: Any, delay: float) -> bool:
    """True if the last fit that was clear says another delay.

    It is one of the sensors: that of another tissue, whose points are forgotten, still holds.
    """
    largest = max(FAR * finder.found_deviation, ALIKE * finder.grid_step)
    return bool(finder.found_deviation > 0.0 and abs(finder.found - delay) > largest)


@compiled
def agrees(finder: Any) -> bool:
    """True if the half seconds say clearly that it is none that is in use, and the way of the fit.

    Alone they begin none, for the motion model's lag looks like one.
    """
    if finder.evidence_count < FEWEST:
        return False
    alike = join(finder)
    if not alike > FEWEST_ALIKE:
        return False
    away = finder.fine[0] - finder.delay
    deviation = finder.fine[1] * math.sqrt(1.0 + 2.0 / (alike - 1.0))
    deviation = math.hypot(deviation, LAG * grids.slowest_period(finder))
    same_way = away * (finder.found - finder.delay) > 0.0
    return bool(same_way and abs(away) > FAR * deviation)


@compiled
def note_fit(finder: Any, row: Any) -> None:
    """Note the K, B and n of a row as the fit to begin anew with."""
    state, fit = row.state, finder.fit
    fit[0] = math.exp(state[LOG_STIFFNESS])
    fit[1] = math.exp(state[LOG_DAMPING])
    fit[2] = state[EXPONENT]


@compiled
def join(finder: Any) -> float:
    """Delay and its deviation by all half seconds, in finder.fine.

    Returns:
        How many half seconds would say as much if each said the same (Kish's effective number).
    """
    count = min(finder.evidence_count, WINDOWS)
    total, squares, mean, between = 0.0, 0.0, 0.0, 0.0
    for attempt in range(2):
        total, squares, mean = 0.0, 0.0, 0.0
        for w in range(count):
            weight = 1.0 / (finder.evidence[w, 1] + between)
            total += weight
            squares += weight * weight
            mean += weight * finder.evidence[w, 0]
        mean /= total
        if attempt == 0:
            scatter = 0.0
            for w in range(count):
                scatter += (finder.evidence[w, 0] - mean) ** 2 / finder.evidence[w, 1]
            freedom = total - squares / total
            between = max((scatter - (count - 1)) / freedom, 0.0) if freedom > 0.0 else 0.0
    finder.fine[0] = mean
    finder.fine[1] = math.sqrt(1.0 / total + SMALLEST_DEVIATION**2)
    return float(total * total / squares)
