"""The error of the force one step ahead, and the samples that count: one rule for all commands.

One step ahead means: the force that was expected at the sample's own stamp before any reading of
that sample was used, against the force that was then measured. A displacement that comes late (a
`channel_delay` below zero) makes this harder, for the motion since its last reading must be
extrapolated; that belongs to a prediction in real time, so it is not taken out.

The innovation of an estimate is another thing: the readings that belong to the same moment, a held
force beside the displacement that came later. It says how well the law describes the tissue, and
is told as the error "of readings brought to the same time". Without a delay both are equal.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

SETTLING_S: Final = 1.0
"""From the first contact on, left out of force errors: the estimator knows nothing yet."""
DISHONEST_NIS: Final = 20.0
"""Mean NIS, ideally 2, from which on nothing that stands behind ± holds."""


def dishonest_line(nis: float) -> str:
    """Say that errors are too large for the deviations that are told; empty if they are not.

    Args:
        nis: mean normalised innovation squared, of both readings.
    """
    if not nis > DISHONEST_NIS:
        return ""
    return (
        f"errors are far larger than the filter admits: mean NIS {nis:.4g} (ideal 2); take what "
        "stands behind ± for too small"
    )


def one_step_error(measured_n: Any, predicted_n: Any) -> Any:
    """Return measured minus predicted force [N]: of one sample, or of arrays of one shape.

    Args:
        measured_n: force of the sample [N]; NaN where it has none.
        predicted_n: `force_predicted` of the estimate that the sample gave [N].
    """
    return measured_n - predicted_n


def settled(time_s: NDArray[np.float64], touching: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark the samples whose force error counts, shape (n,).

    Args:
        time_s: stamps [s], shape (n,).
        touching: in contact, and used, shape (n,).

    Returns:
        Those of `touching` from `SETTLING_S` after the first of them; of a contact shorter than
        twice that, its second half.
    """
    if not touching.any():
        return touching
    elapsed = time_s - time_s[touching][0]
    late: NDArray[np.bool_] = elapsed >= settling_s(time_s, touching)
    return touching & late


def settling_s(time_s: NDArray[np.float64], touching: NDArray[np.bool_]) -> float:
    """Return how much of the contact is left out [s], from its first sample on.

    Args:
        time_s: stamps [s], shape (n,).
        touching: in contact, and used, shape (n,).
    """
    times = time_s[touching]
    return min(SETTLING_S, 0.5 * float(np.max(times - times[0]))) if len(times) else SETTLING_S


def root_mean_square(values: NDArray[np.float64]) -> float:
    """Return the RMS of the values that are there; NaN if none is."""
    values = values[~np.isnan(values)]  # a sample may have no force
    with np.errstate(over="ignore"):  # what is infinite then is told
        return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")
