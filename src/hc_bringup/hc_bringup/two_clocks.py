"""A delay between the channels that grows: their stamps are of two clocks.

A crystal is off by up to 100 us in a second, which are 0.36 s after an hour. One offset that is
right at the end of a recording is then wrong at its beginning.
"""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.finding import DISTURBED_SHARE, Finding, cost_of, fits_worse
from hc_bringup.treated_samples import Estimated, Samples
from hc_estimator.stream.readings import Check, Suspicion
from hc_evaluation.channels import CLEAR, diagnose_channels, evenly_spaced, unbroken
from hc_evaluation.clock_rates import ClockRates, find_clock_rates

Array = NDArray[np.float64]

_TO_DO: Final = (
    "their stamps are of two clocks, and no one offset serves; stamp both by one clock (PTP, "
    "chrony), or where they arrive"
)
LEAST_GROWTH_S: Final = 0.002
"""A delay that changes by less changes B by less than anybody tells."""
LEAST_SHIFT_S: Final = 20.0
"""Between the middles of the two parts that are compared."""


def delay_that_grows(
    even: tuple[Array, Array, Array], longest: int, delay_s: float, delay_std_s: float
) -> str:
    """Return a sentence about a delay that is not the same at the beginning; empty if it is.

    Args:
        even: evenly spaced stamps [s], penetration [mm] and force [N], each of shape (n,).
        longest: samples that a comparison of the channels gets.
        delay_s: by which the force is late in the last of them.
        delay_std_s: standard deviation of that.
    """
    rows = len(even[0])
    part = min(longest, rows)
    first, last = slice(0, min(longest, rows // 2)), slice(rows - part, rows)
    apart_s = float(np.mean(even[0][last]) - np.mean(even[0][first]))
    if apart_s < LEAST_SHIFT_S:
        return ""
    try:
        early = diagnose_channels(*(column[first] for column in even))
    except ValueError:
        return ""  # too little was felt at first, and nothing can be said of it
    growth_s = delay_s - early.delay_s
    if abs(growth_s) < max(LEAST_GROWTH_S, CLEAR * float(np.hypot(delay_std_s, early.delay_std_s))):
        return ""
    behind, before = ("force", "position") if growth_s > 0.0 else ("position", "force")
    at_first, at_last = (1e3 * np.sign(growth_s) * delay for delay in (early.delay_s, delay_s))
    return (
        f"the {behind} falls behind the {before} by {1e6 * abs(growth_s) / apart_s:.0f} us a "
        f"second ({at_first:.1f} ms late at first, {at_last:.1f} ms at last): {_TO_DO}"
    )


def rates_words(rates: ClockRates, span_s: float) -> str:
    """Say which channel falls behind, and what to do.

    Args:
        rates: of the clocks.
        span_s: of the recording [s].
    """
    behind, before = ("force", "position") if rates.rate > 0.0 else ("position", "force")
    each_second_us, whole_ms = 1e6 * abs(rates.rate), 1e3 * abs(rates.rate) * span_s
    return (
        f"the {behind} falls behind the {before} by {each_second_us:.0f} us a second, by "
        f"{whole_ms:.3g} ms in {span_s:.3g} s: {_TO_DO}"
    )


def clocks_put_together(
    samples: Samples, before: Estimated | None
) -> tuple[list[Finding], Estimated | None]:
    """Say so where the law does not fit for clocks that go unlike, and put them together.

    Args:
        samples: readings as far as they were put right; they are put right.
        before: what they give.

    Returns:
        What was found, and the estimate then.
    """
    if before is None or before.mismatch <= DISTURBED_SHARE:
        return [], before
    try:
        even = evenly_spaced(*unbroken(samples.time_s, samples.displacement_mm, samples.force_n))
        rates = find_clock_rates(*even)
    except ValueError:  # too little, or mostly gaps
        return [], before
    if rates is None:
        return [], before
    together = dataclasses.replace(samples)
    together.let_clocks_agree(rates)
    after = together.estimate()
    if fits_worse(before, after):
        return [], before
    samples.take_over(together)
    words = rates_words(rates, float(np.ptp(even[0])))
    return [Finding(words, {}, cost_of(before, after, True))], after


def doubted_clocks(even: tuple[Array, Array, Array]) -> Suspicion | None:
    """Return the doubt that two clocks stamped a recording which the law does not fit.

    Args:
        even: evenly spaced stamps [s], penetration [mm] and force [N], each of shape (n,).
    """
    rates = find_clock_rates(*even)
    if rates is None:
        return None
    words = rates_words(rates, float(np.ptp(even[0])))
    return Suspicion(
        Check.CLOCK, "both", f"{words} (hc doctor says K, B, n and p with that put right)"
    )
