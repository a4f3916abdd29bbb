"""What a zero that is off would make of K: for a person who cannot know how exact zeros must be.

A filter takes contact position and force zero for exact where neither a touch nor the motion
contradicts them. Another zero bends the power law that fits the same forces; here the law through
the same two points, the largest depth and half of it (as in the filter's own
`multiple_model.zero_doubt`).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

POSITION_MM = 0.1
ZERO_SHARE = 0.01  # of the force at the largest depth


def zero_effect(depth_mm: float, exponent: float) -> tuple[float, float]:
    """By what share K would be another, with each zero off.

    Args:
        depth_mm: largest depth that was felt.
        exponent: n of the law that was found.

    Returns:
        For a contact position that is `POSITION_MM` deeper, and for a force zero of `ZERO_SHARE`
        of the force there; NaN where the depth is too small to say so.
    """
    half = 0.5 * depth_mm
    if not (half > 2.0 * POSITION_MM and math.isfinite(exponent)):
        return math.nan, math.nan
    ratio = 2.0**exponent  # of the two forces; the one at half the depth is 1
    bent = math.log(ratio) / math.log((depth_mm - POSITION_MM) / (half - POSITION_MM))
    by_position = exponent * math.log(depth_mm) - bent * math.log(depth_mm - POSITION_MM)
    left = ratio * (1.0 - ZERO_SHARE)
    bent = math.log(left / (1.0 - ZERO_SHARE * ratio)) / math.log(2.0)
    by_zero = math.log(left / ratio) + (exponent - bent) * math.log(depth_mm)
    return math.expm1(by_position), math.expm1(by_zero)


def effect_in(estimator: Any, recording: Any, series: Any) -> tuple[float, float]:
    """The same for a recording that was estimated; NaN where its zeros are not taken for exact.

    Args:
        estimator: that made the series.
        recording: with its displacements.
        series: its estimates.
    """
    settings = estimator.configuration
    deviations = [settings.get(f"{name}_std", 1.0) for name in ("contact_position", "force_zero")]
    touching = series.contact & (series.rejected == 0)
    found = series.contact_position[-1] != 0.0 or series.force_zero[-1] != 0.0
    if any(deviations) or found or not touching.any():
        return math.nan, math.nan
    depth = float(np.nanmax(recording.displacement_mm[touching], initial=0.0))
    return zero_effect(depth, float(series.parameters[-1, 2]))


def zero_lines(by_position: float, by_zero: float) -> list[str]:
    """Return a line about what zeros that are off would do; none where that is not known."""
    if not (math.isfinite(by_position) and math.isfinite(by_zero)):
        return []
    return [
        f"contact position and force zero are taken for exact: {POSITION_MM:g} mm off makes K "
        f"{100 * abs(by_position):.2g} % wrong, {100 * ZERO_SHARE:g} % of the largest force "
        f"{100 * abs(by_zero):.2g} % (how well you know them: --param contact_position_std=MM "
        "--param force_zero_std=N)"
    ]
