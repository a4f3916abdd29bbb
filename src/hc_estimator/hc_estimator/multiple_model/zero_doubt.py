"""What is not known of contact position and force zero, in the covariance that is given out.

A zero that is off is no noise of a sample: it is the same for all, and a covariance without it
would claim too much. Rows that take a zero for exact do not consider it, so it is added to what is
given out, by what it does to a power law at the largest depth and at half of it (ours; the law's
logarithm ln K + n ln x there is what the force determines best). How well a zero is known is the
user's to say (a service that found it, `hc setup`), or follows where the filter found it itself
(`zero_fit`), or is about to (`zero_average`).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator import estimate as columns
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.hypotheses import (
    EXPONENT,
    OWN,
    SURFACE,
    SURFACE_ROW,
)
from hc_estimator.multiple_model.zero_records import NONE, OF_FORCE
from hc_estimator.specification import ParameterSpecification

SHALLOWEST = 0.1  # depth from which something is said of the contact position [mm]
SMALLEST_FORCE = 1e-9  # [N]

SPECIFICATIONS = (
    ParameterSpecification(
        "contact_position_std",
        "float",
        0.0,
        "Standard deviation of the contact position that displacements count from; what it leaves "
        "open of K, B and n is in their covariance, until the motion shows it better.",
        minimum=0.0,
        maximum=1e3,
        unit="mm",
    ),
    ParameterSpecification(
        "force_zero_std",
        "float",
        0.0,
        "Standard deviation of the zero that forces count from; what it leaves open of K, B and n "
        "is in their covariance.",
        minimum=0.0,
        maximum=1e3,
        unit="N",
    ),
)


@compiled
def add(settings: Any, bank: Any, row: Any, out: NDArray[np.float64]) -> None:
    """Add to the covariance in `out` what is not known of the zeros.

    Args:
        settings: settings record.
        bank: record of the bank.
        row: whose estimate is given out.
        out: row of numbers; its covariance is changed.
    """
    add_joint(bank.zeros.doubt, out)
    add_joint(bank.place.open, out)
    zeros, exponent = bank.zeros, row.state[EXPONENT]
    depth = max(bank.tool.deepest, SHALLOWEST)
    # Where the surface moves its position is a state; what a fit has found is in the doubt above.
    if zeros.unknown == NONE and not SURFACE[row.index]:
        variance = _position_variance(settings, bank)
        if variance > 0.0:  # a position that is off by s changes ln F at the depth x by -n s / x
            slope = -exponent / depth
            _add_bent(variance, slope, 2.0 * slope, depth, out)
    if zeros.unknown & OF_FORCE != 0 or zeros.off[1] > 0.0:
        return
    deviation = force_deviation(settings, bank)
    # No row knows the force's zero; one that is off by s changes ln F by -s / F.
    if deviation > 0.0:
        slope = -1.0 / max(out[columns.PARAMETERS] * depth**exponent, SMALLEST_FORCE)
        _add_bent(deviation**2, slope, 2.0**exponent * slope, depth, out)


@compiled
def force_deviation(settings: Any, bank: Any) -> float:
    """Give the deviation of the force's zero [N]; NaN where nobody has said anything of it."""
    if bank.zeros.off[1] > 0.0:
        return bank.zeros.off[1]  # type: ignore[no-any-return]
    found = math.sqrt(bank.onset.force_deviation**2 + bank.air.wander)
    given = settings.force_zero_std
    if given > 0.0 and not found < given:
        return given  # type: ignore[no-any-return]
    return found


@compiled
def _position_variance(settings: Any, bank: Any) -> float:
    """Give the mean square error of the contact position in use [mm^2]; 0 if it is exact."""
    if bank.onset.zero[0] != 0.0:
        return _error_by(bank.rows[SURFACE_ROW])
    variance = settings.contact_position_std**2
    if variance > 0.0 and bank.rows[SURFACE_ROW].active != 0:
        return min(variance, _error_by(bank.rows[SURFACE_ROW]))  # type: ignore[no-any-return]
    return variance  # type: ignore[no-any-return]


@compiled
def _error_by(surface: Any) -> float:
    """Give the mean square error of the position in use, by the row whose surface moves freely."""
    return surface.covariance[OWN, OWN] + surface.state[OWN] ** 2  # type: ignore[no-any-return]


@compiled
def _add_bent(
    variance: float, deep: float, half: float, depth: float, out: NDArray[np.float64]
) -> None:
    """Add to the covariance what passes for ln K + n ln x of an error of ln F.

    Args:
        variance: of what is off.
        deep: what it changes in ln F at the largest depth, per unit.
        half: the same at half of it.
        depth: the largest [mm].
        out: its covariance is changed.
    """
    by_exponent = (deep - half) / math.log(2.0)
    by_stiffness = deep - by_exponent * math.log(depth)
    add_along(variance, (by_stiffness, by_stiffness, by_exponent, 0.0), out)


@compiled
def add_along(
    variance: float, way: tuple[float, float, float, float], out: NDArray[np.float64]
) -> None:
    """Add to the covariance in `out` a variance along a way in ln K, ln B, n and p."""
    for i in range(4):
        first = way[i] * (out[columns.PARAMETERS + i] if i < 2 else 1.0)
        for j in range(4):
            second = way[j] * (out[columns.PARAMETERS + j] if j < 2 else 1.0)
            out[columns.COVARIANCE + 4 * i + j] += variance * (first * second)


@compiled
def add_joint(doubt: Any, out: NDArray[np.float64]) -> None:
    """Add a covariance of ln K, ln B, n and p, of which the lower triangle is used."""
    for i in range(4):
        first = out[columns.PARAMETERS + i] if i < 2 else 1.0
        for j in range(4):
            second = out[columns.PARAMETERS + j] if j < 2 else 1.0
            out[columns.COVARIANCE + 4 * i + j] += doubt[max(i, j), min(i, j)] * (first * second)
