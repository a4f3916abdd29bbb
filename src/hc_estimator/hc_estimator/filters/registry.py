"""The filters by name. To add one: write its file, then add it to FILTERS here."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

from hc_estimator.adaptation import policy
from hc_estimator.filters import ekf, ukf
from hc_estimator.memory import CORE_FIELDS, SCRATCH_FIELDS, Field
from hc_estimator.specification import ParameterSpecification, ParameterValue


@dataclasses.dataclass(frozen=True)
class FilterEntry:
    """What the estimator needs to know of a filter.

    Attributes:
        run: compiled loop over samples, see `filters.ukf.run`.
        specifications: parameters of the filter and of the adaptations that it uses.
        summary: one line for users.
        defaults: defaults that differ from the specifications', by state space and name.
        state_spaces: state spaces that it combines with.
    """

    run: Callable[..., None]
    specifications: tuple[ParameterSpecification, ...]
    summary: str
    defaults: Mapping[str, Mapping[str, ParameterValue]] = dataclasses.field(default_factory=dict)
    state_spaces: tuple[str, ...] = ("kinematic", "paper")


# On the papers' own state space the filters are the papers' unless told otherwise.
_PLAIN_PAPER: Mapping[str, Any] = {
    "paper": {
        "tempering_amplitude": 0.0,
        "noise_adaptation": "fixed",
        "change_detection": "none",
    }
}

FILTERS: dict[str, FilterEntry] = {
    "ukf": FilterEntry(
        run=ukf.run,
        specifications=ukf.SPECIFICATIONS,
        summary="scaled unscented Kalman filter with redrawn sigma points",
        defaults=_PLAIN_PAPER,
    ),
    "ekf": FilterEntry(
        run=ekf.run,
        specifications=ekf.SPECIFICATIONS,
        summary="extended Kalman filter with analytic Jacobians",
        defaults=_PLAIN_PAPER,
    ),
}

FIELDS: tuple[Field, ...] = CORE_FIELDS + policy.FIELDS
SCRATCH: tuple[Field, ...] = SCRATCH_FIELDS
