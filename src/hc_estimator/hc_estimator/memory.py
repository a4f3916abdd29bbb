"""The memory of an estimator and its settings, as records that compiled code and Python share.

Everything that an estimator knows between two samples stands in one record, so that saving and
restoring it is copying it. Fields named in `SCRATCH_FIELDS` hold intermediate results within one
sample; they are written before they are read and are no part of the saved state.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Field = tuple[str, type, tuple[int, ...]]

# Between samples.
CORE_FIELDS: tuple[Field, ...] = (
    ("state", np.float64, (7,)),
    ("covariance", np.float64, (7, 7)),
    ("prior_variance", np.float64, (4,)),  # of the parameters, in the state space's coordinates
    ("started", np.int64, ()),  # 1 once a sample was accepted
    ("accepted", np.int64, ()),  # accepted samples so far
    ("last_time", np.float64, ()),  # of the last accepted sample [s]
    ("backward_time", np.float64, ()),  # of the last sample that was refused as backward [s]
    ("backward_count", np.int64, ()),  # how many such samples came one after another
    ("outlier_count", np.int64, ()),  # outliers one after another
    ("noise", np.float64, (2,)),  # variances in use: displacement [mm^2], force [N^2]
    ("change_detected", np.int64, ()),  # at the last accepted sample
    ("model_mismatch", np.int64, ()),
    ("random_counter", np.int64, ()),  # numbers drawn so far
    ("process_noise_scale", np.float64, ()),  # of the adapted part of Q against the settings
)

# Within one sample.
SCRATCH_FIELDS: tuple[Field, ...] = (
    ("elapsed", np.float64, ()),  # time since the last accepted sample [s]
    ("restart", np.int64, ()),  # 1 if the motion must be forgotten before this sample
    ("measurement", np.float64, (2,)),  # displacement [mm], force [N]
    ("measurement_noise", np.float64, (2,)),  # variances R, tempering included
    ("process_noise", np.float64, (7, 7)),  # Q
    ("predicted_state", np.float64, (7,)),
    ("predicted_covariance", np.float64, (7, 7)),
    ("updated_state", np.float64, (7,)),
    ("updated_covariance", np.float64, (7, 7)),
    ("factor", np.float64, (7, 7)),  # Cholesky factor L of the predicted covariance
    ("predicted_measurement", np.float64, (2,)),
    ("sensitivity", np.float64, (7, 2)),  # D with P_xy = L D: measurement per whitened state
    ("curvature", np.float64, (2, 2)),  # covariance that the nonlinearity of h adds
    ("innovation", np.float64, (2,)),
    ("innovation_covariance", np.float64, (2, 2)),  # S
    ("inverse", np.float64, (2, 2)),  # of S
    ("nis", np.float64, ()),
    ("gain", np.float64, (7, 2)),
    ("half", np.float64, (7, 7)),  # square-root-like part of the updated covariance
    ("point", np.float64, (7,)),
    ("images", np.float64, (15, 7)),  # sigma points through the process
    ("outputs", np.float64, (15, 2)),  # sigma points through the measurement function
    ("gradient", np.float64, (6,)),
    ("process_jacobian", np.float64, (7, 7)),
    ("measurement_jacobian", np.float64, (2, 7)),
    ("next_noise", np.float64, (2,)),
    ("next_process_noise_scale", np.float64, ()),
    ("first_square", np.float64, ()),  # of the innovation of a first pass
    ("parameters", np.float64, (4,)),
    ("slopes", np.float64, (4,)),
)


def record_type(fields: tuple[Field, ...]) -> np.dtype[np.void]:
    """Structured type of the given fields, every one a float64 or an int64 or an array of them."""
    description: Any = [(name, kind, shape) for name, kind, shape in fields]
    result: np.dtype[np.void] = np.dtype(description, align=True)
    return result
