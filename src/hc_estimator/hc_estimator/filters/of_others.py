"""Filters of other packages: what goes wrong in one is said to be its fault, not the suite's.

A kernel that raises, or that writes what no estimate may be, ends the command or the node with one
line that names the filter and its module. The suite's own kernels are tested instead.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hc_estimator import estimate as columns
from hc_msgs_py.entry_points import FaultOfAnotherError

PARAMETERS = slice(columns.PARAMETERS, columns.PARAMETERS + 4)
COVARIANCE = slice(columns.COVARIANCE, columns.COVARIANCE + 16)
REJECTIONS = np.array([float(rejection) for rejection in columns.Rejection])


def watched(name: str, run: Callable[..., None]) -> Callable[..., None]:
    """Wrap the loop over samples of another package's filter.

    Args:
        name: of the filter.
        run: its loop, as `FilterEntry.run`.

    Returns:
        The same loop, which raises FaultOfAnotherError if that fails or gives no estimates.
    """
    whose = f"filter {name} of {getattr(run, '__module__', 'another package')}"

    def fault(what: str) -> FaultOfAnotherError:
        return FaultOfAnotherError(
            f"{whose} {what}; the suite is in order, ask whoever made the filter"
        )

    def watched_run(settings: Any, memory: Any, particles: Any, samples: Any, rows: Any) -> None:
        try:
            run(settings, memory, particles, samples, rows)
        except Exception as error:
            raise fault(f"failed: {type(error).__name__}: {error}") from error
        what = _what_is_wrong(rows)
        if what:
            raise fault(f"gave {what}")

    return watched_run


def _what_is_wrong(rows: Any) -> str:
    """Say what of the rows is no estimate; empty where all is right."""
    if not np.isin(rows[:, columns.REJECTED], REJECTIONS).all():
        return "no code of a rejection where one belongs (estimate.REJECTED)"
    if not np.isfinite(rows[:, PARAMETERS]).all():
        return "parameters that are no numbers (estimate.PARAMETERS)"
    if not np.isfinite(rows[:, COVARIANCE]).all():
        return "a covariance that is no numbers (estimate.COVARIANCE)"
    if (rows[:, COVARIANCE].reshape(-1, 4, 4).diagonal(axis1=1, axis2=2) < 0.0).any():
        return "a negative variance (estimate.COVARIANCE)"
    return ""
