"""A series of estimates as a table: columns by name, with the unit in the name."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator import estimate as columns
from hc_estimator.estimate import PARAMETER_NAMES, Rejection

_NUMBERS = {
    **{f"{name}": columns.PARAMETERS + i for i, name in enumerate(PARAMETER_NAMES)},
    **{
        f"{name}_identifiability": columns.IDENTIFIABILITY + i
        for i, name in enumerate(PARAMETER_NAMES)
    },
    "force_predicted_N": columns.FORCE_PREDICTED,
    "force_reconstructed_N": columns.FORCE_RECONSTRUCTED,
    "innovation_displacement_mm": columns.INNOVATION,
    "innovation_force_N": columns.INNOVATION + 1,
    "nis": columns.NIS,
    "displacement_filtered_mm": columns.DISPLACEMENT,
    "velocity_mm_s": columns.VELOCITY,
    "force_noise_std_N": columns.FORCE_NOISE_STD,
    "displacement_noise_std_mm": columns.DISPLACEMENT_NOISE_STD,
    "channel_delay_s": columns.CHANNEL_DELAY,
    "channel_delay_std_s": columns.CHANNEL_DELAY_STD,
    "contact_position_mm": columns.CONTACT_POSITION,
    "contact_position_std_mm": columns.CONTACT_POSITION_STD,
    "force_zero_N": columns.FORCE_ZERO,
    "force_zero_std_N": columns.FORCE_ZERO_STD,
}
_FLAGS = {
    "contact": columns.CONTACT,
    "change_detected": columns.CHANGE_DETECTED,
    "model_mismatch": columns.MODEL_MISMATCH,
}


def table_of(rows: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """Return rows of estimates as arrays by name, without their last axis.

    Args:
        rows: by the columns named in `hc_estimator.estimate`, shape (..., COLUMNS).

    Returns:
        K, B, n, p under their own names in N/mm^n, N (s/mm)^p / mm^n, 1 and 1, and the others;
        under `rejected` the names of `Rejection` in lower case, empty for a sample that was used.
    """
    table: dict[str, NDArray[Any]] = {name: rows[..., i] for name, i in _NUMBERS.items()}
    variances = rows[..., columns.COVARIANCE : columns.COVARIANCE + 16 : 5]
    deviations = np.sqrt(variances)
    table |= {f"{name}_std": deviations[..., i] for i, name in enumerate(PARAMETER_NAMES)}
    table |= {name: rows[..., i] != 0.0 for name, i in _FLAGS.items()}
    names = np.array([code.name.lower() if code else "" for code in Rejection])
    table["rejected"] = names[rows[..., columns.REJECTED].astype(int)]
    return table


def dataframe_of(rows: NDArray[np.float64], time_s: NDArray[np.float64] | None = None) -> Any:
    """Return `table_of` the rows as a pandas DataFrame, by time [s] if it is given.

    Raises:
        ImportError: if pandas is not installed; the suite itself does not need it.
    """
    try:
        import pandas  # type: ignore[import-not-found,import-untyped,unused-ignore]
    except ImportError as error:
        raise ImportError("to_dataframe() needs pandas: pip install pandas") from error
    frame = pandas.DataFrame(table_of(rows))
    return frame if time_s is None else frame.set_index(pandas.Index(time_s, name="time_s"))


def chosen_by(index: Any) -> int | slice | NDArray[Any]:
    """Return what numpy chooses rows by.

    Args:
        index: a whole number; or a slice, or a mask or whole numbers, shape (n,).

    Raises:
        TypeError: if it is something else.
    """
    if isinstance(index, slice):
        return index
    if isinstance(index, (list, np.ndarray)) and np.ndim(index) == 1:
        chosen = np.asarray(index) if len(index) else np.empty(0, np.intp)
        if chosen.dtype == np.bool_ or np.issubdtype(chosen.dtype, np.integer):
            return chosen
    elif hasattr(index, "__index__") and np.ndim(index) == 0 and not isinstance(index, bool):
        return operator.index(index)
    raise TypeError(
        "estimates are chosen by a whole number, a slice, or an array of whole numbers or of truth "
        f"values, shape (n,), not by {index!r:.60}"
    )
