"""Columns of the rows that go to the page: names, places, and what each is."""

from __future__ import annotations

from typing import Final

HYPOTHESES: Final = (
    "constant",
    "constant, fitted",
    "stiffness trend",
    "all drift",
    "changed",
    "surface moves",
)
"""In the order of the constants of HuntCrossleyEstimate.hypothesis."""

PARAMETERS: Final = ("K", "B", "n", "p")

COLUMNS: Final = (
    # Values without a suffix are those of the row's last sample that has a force.
    "time",  # s since the origin
    "sequence",
    "samples",  # in the row
    "lost",  # sequence numbers missing before and within the row
    "rejected",
    "displacement",  # mm, filtered by the estimator; the sample's where no estimate is
    "displacement_min",
    "displacement_max",
    "velocity",  # mm/s
    "force",  # N, measured
    "force_min",
    "force_max",
    "predicted",  # N, one step ahead
    "predicted_min",
    "predicted_max",
    "error",  # N, one step ahead (force_error.py)
    "error_min",
    "error_max",
    "nis_sum",
    "nis_count",  # estimates with both readings; those with one count half
    *PARAMETERS,
    *(f"{name}_std" for name in PARAMETERS),
    "K_n_covariance",
    *(f"{name}_known" for name in PARAMETERS),
    *(f"{name}_true" for name in PARAMETERS),
    "contact",
    "mismatch",
    "change",
    "hypothesis",
    *(f"score_{number}" for number in range(len(HYPOTHESES))),
    "delay",  # s
    "delay_std",
    "contact_position",  # mm
    "contact_position_std",
    "force_zero",  # N
    "force_zero_std",
    "latency",  # s, the longest in the row
    "tip_x",  # mm, where the tip is sideways
    "tip_y",
)

INDEX: Final = {name: place for place, name in enumerate(COLUMNS)}
