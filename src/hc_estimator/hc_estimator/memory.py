"""The memory of an estimator and its settings, as records that compiled code and Python share.

Everything that an estimator knows between two samples stands in one record, so that saving and
restoring it is copying it. Fields named in `SCRATCH_FIELDS` hold intermediate results within one
sample; they are written before they are read and are no part of the saved state.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np


class Field(NamedTuple):
    """One field of a record.

    Attributes:
        name: its name.
        kind: float64, int64, or the type of a nested record.
        shape: of an array; () for one value.
        low: smallest value that makes sense, for whole numbers; what is restored is checked.
        high: largest such value.
    """

    name: str
    kind: Any
    shape: tuple[int, ...] = ()
    low: int | None = None
    high: int | None = None


# Between samples, besides `screening.CLOCK_FIELDS`.
CORE_FIELDS: tuple[Field, ...] = (
    Field("state", np.float64, (7,)),
    Field("covariance", np.float64, (7, 7)),
    Field("prior_variance", np.float64, (4,)),  # of the parameters, in the state space's coordinates
    Field("noise", np.float64, (2,)),  # variances in use: displacement [mm^2], force [N^2]
    Field("change_detected", np.int64, (), 0, 1),  # at the last accepted sample
    Field("random_counter", np.int64, (), 0),  # numbers drawn so far
    Field("process_noise_scale", np.float64),  # of the adapted part of Q against the settings
)

# Within one sample.
SCRATCH_FIELDS: tuple[Field, ...] = (
    Field("measurement_noise", np.float64, (2,)),  # variances R, tempering included
    Field("process_noise", np.float64, (7, 7)),  # Q
    Field("predicted_state", np.float64, (7,)),
    Field("predicted_covariance", np.float64, (7, 7)),
    Field("updated_state", np.float64, (7,)),
    Field("updated_covariance", np.float64, (7, 7)),
    Field("factor", np.float64, (7, 7)),  # Cholesky factor L of the predicted covariance
    Field("predicted_measurement", np.float64, (2,)),
    Field("sensitivity", np.float64, (7, 2)),  # D with P_xy = L D: measurement per whitened state
    Field("curvature", np.float64, (2, 2)),  # covariance that the nonlinearity of h adds
    Field("innovation", np.float64, (2,)),
    Field("innovation_covariance", np.float64, (2, 2)),  # S
    Field("inverse", np.float64, (2, 2)),  # of S
    Field("nis", np.float64, ()),
    Field("gain", np.float64, (7, 2)),
    Field("half", np.float64, (7, 7)),  # square-root-like part of the updated covariance
    Field("point", np.float64, (7,)),
    Field("images", np.float64, (15, 7)),  # sigma points through the process
    Field("outputs", np.float64, (15, 2)),  # sigma points through the measurement function
    Field("gradient", np.float64, (6,)),
    Field("process_jacobian", np.float64, (7, 7)),
    Field("measurement_jacobian", np.float64, (2, 7)),
    Field("next_noise", np.float64, (2,)),
    Field("next_process_noise_scale", np.float64, ()),
    Field("first_square", np.float64, ()),  # of the innovation of a first pass
    Field("parameters", np.float64, (4,)),
    Field("slopes", np.float64, (4,)),
)


def record_type(fields: tuple[Field, ...]) -> np.dtype[np.void]:
    """Structured type of the given fields."""
    description: Any = [(field.name, field.kind, field.shape) for field in fields]
    result: np.dtype[np.void] = np.dtype(description, align=True)
    return result
