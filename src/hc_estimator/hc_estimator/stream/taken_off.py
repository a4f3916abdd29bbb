"""What is taken off the readings of a sample: zeros, what the robot gave way, what held it back.

One place for who is given samples as they were read: the node, who verifies its estimates, and who
judges its input. To the last bit the same, one by one and in batches.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from hc_estimator.stream.dry_friction import DryFriction
from hc_estimator.stream.frame_compliance import SETTING, FrameCompliance
from hc_estimator.stream.readings import FloatArray

FORCE_ZERO, POSITION_ZERO = "input.force.zero", "input.position.zero"


class TakenOff:
    """Makes of samples as they were read those to estimate from; they come in their order."""

    def __init__(self) -> None:
        self._force_zero = self._position_zero = 0.0
        self._frame, self._friction = FrameCompliance(), DryFriction()

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other settings, by their names of the node; of what is left out nothing is off."""
        self._force_zero = values.get(FORCE_ZERO, 0.0)
        self._position_zero = values.get(POSITION_ZERO, 0.0)
        self._frame.mm_per_n = values.get(SETTING.name, 0.0)
        self._friction.configure(values)

    def of_one(self, stamp_ns: int, displacement_mm: float, force_n: float) -> tuple[float, float]:
        """Return displacement [mm] and force [N] of a sample, NaN for what is not known.

        Args:
            stamp_ns: of the sample.
            displacement_mm: as it was read [mm]; NaN without a reading.
            force_n: as it was read [N]; NaN without a reading.
        """
        place_mm, push_n = displacement_mm - self._position_zero, force_n - self._force_zero
        place_mm -= self._frame.yielded_mm(stamp_ns, force_n, self._force_zero)
        return place_mm, push_n - self._friction.at(stamp_ns, place_mm)

    def of_many(
        self, stamps_ns: NDArray[Any], displacements_mm: FloatArray, forces_n: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """As `of_one` for each of many samples, shape (n,) each."""
        places, pushes = displacements_mm - self._position_zero, forces_n - self._force_zero
        places -= self._frame.of_many(stamps_ns, forces_n, self._force_zero)
        pushes -= self._friction.of_many(stamps_ns, places)
        return places, pushes
