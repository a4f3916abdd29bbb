"""A recording under treatment: its samples as far as they were put right, and what they give."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator import Rejection, create_estimator
from hc_estimator.kinds import DEFAULT_FILTER
from hc_estimator.stream.in_pieces import run_in_pieces
from hc_estimator.stream.repeats import new_readings
from hc_msgs_py.units import NANOSECONDS

FloatArray = NDArray[np.float64]
FORCE_LIMIT = "force_limit"
"""The estimator's setting beyond which a force is refused [N]."""


@dataclass(frozen=True)
class Estimated:
    """What the estimator made of a recording.

    Attributes:
        parameters: K, B, n, p, shape (4,).
        deviations: their standard deviations, shape (4,).
        covariance: shape (4, 4).
        identifiability: how much of each is known from the data, shape (4,).
        force_noise_std: deviation of the force from the law [N].
        mismatch: share of the samples in which the law did not fit.
        rejected: refused samples by reason.
    """

    parameters: FloatArray
    deviations: FloatArray
    covariance: FloatArray
    identifiability: FloatArray
    force_noise_std: float
    mismatch: float
    rejected: dict[str, int]


@dataclass
class Samples:
    """A recording under treatment, and the settings that it has got so far.

    Attributes:
        time_s: stamps [s].
        displacement_mm: penetration [mm], as far as it was put right.
        force_n: contact force [N], as far as it was put right.
        surface_std_mm: how well the position is known that displacements count from [mm].
        force_end_n: force from which on readings are left out, for the sensor's range ends there
            [N]; NaN where none are.
    """

    time_s: FloatArray
    displacement_mm: FloatArray
    force_n: FloatArray
    surface_std_mm: float
    force_end_n: float = math.nan

    def scale_force(self, factor: float) -> None:
        """Multiply the forces, and what counts in them."""
        self.force_n = self.force_n * factor
        self.force_end_n *= factor

    def take_force_zero(self, zero_n: float) -> None:
        """Let the forces count from a zero [N]."""
        self.force_n = self.force_n - zero_n
        self.force_end_n -= zero_n

    @property
    def limits(self) -> dict[str, Any]:
        """The estimator's setting that leaves out what is at the end of the sensor's range."""
        end = abs(self.force_end_n)
        return {} if math.isnan(end) else {FORCE_LIMIT: float(f"{end:.4g}")}

    def count_once(self, channel: str) -> None:
        """Leave out the readings of a channel that only repeat the one before."""
        values = self.displacement_mm if channel == "displacement" else self.force_n
        there = np.flatnonzero(~np.isnan(values))
        stamps = np.round(self.time_s[there] * NANOSECONDS).astype(np.int64)
        left = values.copy()
        left[there[~new_readings(stamps, values[there])]] = np.nan
        if channel == "displacement":
            self.displacement_mm = left
        else:
            self.force_n = left

    def shift_force(self, seconds: float) -> None:
        """Stamp the forces so much later; each reading then stands at its own stamp."""
        has_depth, has_force = ~np.isnan(self.displacement_mm), ~np.isnan(self.force_n)
        nothing = np.full(len(self.time_s), np.nan)
        time_s = np.concatenate([self.time_s[has_depth], self.time_s[has_force] + seconds])
        order = np.argsort(time_s, kind="stable")
        self.displacement_mm = np.concatenate(
            [self.displacement_mm[has_depth], nothing[has_force]]
        )[order]
        self.force_n = np.concatenate([nothing[has_depth], self.force_n[has_force]])[order]
        self.time_s = time_s[order]

    def estimate(self) -> Estimated | None:
        """Run the default estimator; None if it was never in contact."""
        estimator = create_estimator(
            DEFAULT_FILTER,
            missing_readings=True,
            contact_position_std=self.surface_std_mm,
            **self.limits,
        )
        series = run_in_pieces(estimator, self.time_s, self.displacement_mm, self.force_n)
        touched = series.contact & (series.rejected == 0)
        if not touched.any():
            return None
        last = series[int(np.flatnonzero(touched)[-1])]
        codes, counts = np.unique(series.rejected[series.rejected != 0], return_counts=True)
        return Estimated(
            last.parameters.copy(),
            last.parameters_std.copy(),
            last.covariance.copy(),
            last.identifiability.copy(),
            last.force_noise_std,
            float(np.mean(series.model_mismatch[touched])),
            {Rejection(c).name.lower(): int(n) for c, n in zip(codes, counts, strict=True)},
        )
