"""What the rig gives back: one sample, or many as arrays with the same names."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.layout import (
    OUT_COMMAND,
    OUT_CONTACT,
    OUT_DISPLACEMENT,
    OUT_FEEDBACK_FORCE,
    OUT_FORCE,
    OUT_LATERAL,
    OUT_MASTER,
    OUT_OPERATOR_FORCE,
    OUT_PARAMETERS,
    OUT_SENT_FORCE,
    OUT_SLAVE,
    OUT_TIME,
    OUT_TRUE_DISPLACEMENT,
    OUT_TRUE_FORCE,
    OUT_TRUE_VELOCITY,
)

Array = NDArray[np.float64]


class Truth(NamedTuple):
    """What no sensor tells. Scalars of a sample, or arrays with a leading sample axis."""

    displacement_mm: Any
    velocity_mm_s: Any
    force_n: Any
    parameters: Any
    """(4,) or (N, 4): K, B, n, p; NaN where the plant has no such parameter."""
    contact: Any

    def each(self) -> Iterator[Truth]:
        """Yield the truth of every sample."""
        for i in range(len(self.force_n)):
            yield Truth(*(column[i] for column in self))


class Joint(NamedTuple):
    """Motion of the master or the slave, both in millimetres of the slave [mm, mm/s, N].

    The master of a stage is its commanded motion. Effort: the actuator's force (u_m, u_s of
    paper C); of a stage the force that it exerts on the tissue.
    """

    position_mm: Any
    velocity_mm_s: Any
    effort_n: Any


class Coupling(NamedTuple):
    """What passes between operator, master and slave."""

    operator_force_n: Any
    command_mm: Any
    """Position of the master as the slave has received it."""
    feedback_force_n: Any
    """Contact force as the master has received it."""
    sent_force_n: Any
    """Contact force as the slave sends it."""


class RigSample(NamedTuple):
    """One sample: what the sensors read, and the truth behind it."""

    time_s: float
    sequence: int
    displacement_mm: float
    force_n: float
    truth: Truth
    master: Joint
    slave: Joint
    lateral_mm: float
    coupling: Coupling


@dataclass(frozen=True)
class RigSeries:
    """Many samples: the fields of RigSample as arrays with a leading sample axis."""

    time_s: Array
    sequence: NDArray[np.int64]
    displacement_mm: Array
    force_n: Array
    truth: Truth
    master: Joint
    slave: Joint
    lateral_mm: Array
    coupling: Coupling

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.time_s)


def sample_from_row(row: Array, sequence: int) -> RigSample:
    """One row of the compiled rig's output as a sample."""
    values = row.tolist()
    return RigSample(
        values[OUT_TIME],
        sequence,
        values[OUT_DISPLACEMENT],
        values[OUT_FORCE],
        Truth(
            values[OUT_TRUE_DISPLACEMENT],
            values[OUT_TRUE_VELOCITY],
            values[OUT_TRUE_FORCE],
            row[OUT_PARAMETERS : OUT_PARAMETERS + 4].copy(),
            values[OUT_CONTACT] > 0.0,
        ),
        Joint(*values[OUT_MASTER : OUT_MASTER + 3]),
        Joint(*values[OUT_SLAVE : OUT_SLAVE + 3]),
        values[OUT_LATERAL],
        Coupling(
            values[OUT_OPERATOR_FORCE],
            values[OUT_COMMAND],
            values[OUT_FEEDBACK_FORCE],
            values[OUT_SENT_FORCE],
        ),
    )


def series_from_rows(rows: Array, first: int) -> RigSeries:
    """Rows of the compiled rig's output, the first with sequence `first`, as a series."""
    columns = np.ascontiguousarray(rows.T)
    return RigSeries(
        columns[OUT_TIME],
        np.arange(first, first + len(rows)),
        columns[OUT_DISPLACEMENT],
        columns[OUT_FORCE],
        Truth(
            columns[OUT_TRUE_DISPLACEMENT],
            columns[OUT_TRUE_VELOCITY],
            columns[OUT_TRUE_FORCE],
            np.ascontiguousarray(rows[:, OUT_PARAMETERS : OUT_PARAMETERS + 4]),
            columns[OUT_CONTACT] > 0.0,
        ),
        Joint(*columns[OUT_MASTER : OUT_MASTER + 3]),
        Joint(*columns[OUT_SLAVE : OUT_SLAVE + 3]),
        columns[OUT_LATERAL],
        Coupling(
            columns[OUT_OPERATOR_FORCE],
            columns[OUT_COMMAND],
            columns[OUT_FEEDBACK_FORCE],
            columns[OUT_SENT_FORCE],
        ),
    )
