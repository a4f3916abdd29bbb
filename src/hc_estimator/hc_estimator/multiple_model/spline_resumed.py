"""Where a fit begins that explained the points a second ago: where it ended, over the knots of now.

A search asks the same kinds each second, of points nine tenths of which it had the last time. From
the row in charge, or by the law turned round, a fit takes 20 to 50 steps; from where the last one
ended a few. What came since lies beyond that: stiffness and exponent begin as they were in the end,
and a surface that moves where the law turned round puts it. A kind that did not explain the points
begins anew, for it may have ended in a valley of its own. (Ours; `docs/default_filter.md` has the
steps.)
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector
from hc_estimator.multiple_model import spline_start
from hc_estimator.multiple_model.kalman import exp_limited
from hc_estimator.multiple_model.spline import (
    EXPONENT,
    POSITION,
    SPEED,
    centre,
    has,
    second_count,
    stiffness_count,
)
from hc_estimator.multiple_model.spline_records import (
    BENDS,
    MOVES,
    SINKS,
    SPLINE_FIRST,
    UNKNOWNS,
)


@compiled
def forget(kept_fit: Any) -> None:
    """No fit is kept."""
    kept_fit.version = -1


@compiled
def keep(history: Any, fit: Any, kept_fit: Any) -> None:
    """Keep a fit that is solved and explains the points.

    Args:
        history: points.
        fit: solved.
        kept_fit: changed.
    """
    copy_vector(fit.values, kept_fit.values)
    copy_vector(fit.knot, kept_fit.knot)
    for i in range(2):
        kept_fit.intervals[i] = fit.intervals[i]
    kept_fit.begin = fit.begin
    kept_fit.latest = fit.latest
    kept_fit.version = history.version


@compiled
def begin(history: Any, fit: Any, kept_fit: Any) -> bool:
    """Set what is unknown of fit.values as it was kept; False if none is kept of this tissue.

    Args:
        history: points.
        fit: laid out for the kind that was kept_fit, its values those of `spline_start`.
        kept_fit: of the same kind.
    """
    if kept_fit.version != history.version or not _has_knots(fit, kept_fit):
        return False
    values = fit.values
    for i in range(SPLINE_FIRST):
        if fit.held[i] == 0:
            values[i] = kept_fit.values[i]
    if has(fit, SINKS):
        values[POSITION] += kept_fit.values[SPEED] * (fit.latest - kept_fit.latest)
    there = SPLINE_FIRST  # among those that were kept
    between = SPLINE_FIRST + stiffness_count(fit)
    if fit.intervals[0] > 0:
        for i in range(SPLINE_FIRST, between):
            values[i] = _coefficient(kept_fit, there, 0, centre(fit, 0, i - SPLINE_FIRST))
        there += kept_fit.intervals[0] + 3
    else:
        values[SPLINE_FIRST] = kept_fit.values[SPLINE_FIRST]
        there += 1
    if has(fit, MOVES + BENDS):
        for i in range(between, fit.unknowns):
            values[i] = _coefficient(kept_fit, there, 1, centre(fit, 1, i - between))
    else:
        for i in range(second_count(fit)):  # shares of the memories
            values[between + i] = kept_fit.values[there + i]
    if has(fit, MOVES):
        slope = exp_limited(values[between - 1] / values[EXPONENT])
        spline_start.lay_surface(history, fit, values[EXPONENT], slope, kept_fit.latest)
    return True


@compiled
def _has_knots(fit: Any, kept_fit: Any) -> bool:
    """True if what is a spline in the fit was one."""
    count = 0
    for i in range(2):
        count += 1 if fit.intervals[i] > 0 and not kept_fit.knot[i] > 0.0 else 0
    return count == 0


@compiled
def _coefficient(kept_fit: Any, first: int, which: int, time: float) -> float:
    """Coefficient of a kept spline about a time [s], between those next to it; the last after it.

    Args:
        kept_fit: fit.
        first: place of the spline's first coefficient.
        which: 0: spline of the stiffness, 1: the second one.
        time: middle of the coefficient.
    """
    last = min(kept_fit.intervals[which] + 2, UNKNOWNS - 1 - first)
    place = min(max((time - kept_fit.begin) / kept_fit.knot[which] + 1.0, 0.0), float(last))
    number = min(int(place), last - 1)
    share = place - number
    before, after = kept_fit.values[first + number], kept_fit.values[first + number + 1]
    return before + share * (after - before)  # type: ignore[no-any-return]
