"""Which numbers of an estimate are which fields of hc_msgs/HuntCrossleyEstimate, and their units.

One list for those who write many estimates at once, show them, or compare them with recorded ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from numpy.typing import NDArray

from hc_msgs_py.units import METRE_IN_MM

PARAMETERS: Final = ("stiffness", "damping", "displacement_exponent", "velocity_exponent")
LENGTHS: Final = (
    "displacement",
    "velocity",
    "displacement_noise_std",
    "contact_position",
    "contact_position_std",
)
"""In mm or mm/s in an estimate, in metres in a message."""
AS_THEY_ARE: Final = (
    "force_predicted",
    "force_reconstructed",
    "nis",
    "force_noise_std",
    "channel_delay",
    "channel_delay_std",
    "force_zero",
    "force_zero_std",
    "contact",
    "change_detected",
    "model_mismatch",
    "rejected",
    "hypothesis",
    "hypothesis_scores",
)


def estimate_fields(series: Any, force_n: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield each field of the message that follows from the samples.

    The same divisions as in the estimator's EstimateEncoder, or the last bit would differ.

    Args:
        series: hc_estimator.EstimateSeries of N samples.
        force_n: measured forces [N], shape (N,).
    """
    for i, name in enumerate(PARAMETERS):
        yield name, series.parameters[:, i]
        yield f"{name}_std", series.parameters_std[:, i]
        yield f"{name}_identifiability", series.identifiability[:, i]
    for name in LENGTHS:
        yield name, getattr(series, name) / METRE_IN_MM
    yield "force_measured", force_n
    yield "innovation_displacement", series.innovation[:, 0] / METRE_IN_MM
    yield "innovation_force", series.innovation[:, 1]
    for name in AS_THEY_ARE:
        yield name, getattr(series, name)
    yield "covariance", series.covariance.reshape(-1, 16)
