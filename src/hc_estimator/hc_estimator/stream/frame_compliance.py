"""What a robot gives way under the force that it presses with, taken off the displacement.

Where the tool's place is read at the flange or by the joints' encoders, what lies between (gears,
arm, force sensor, tool) yields by compliance times force, and passes for tissue. Instrumented
indentation takes it off as the compliance of the machine's frame: h = h_measured - C F (Oliver and
Pharr, J. Mater. Res. 7 (1992) 1564; ISO 14577-1).

A displacement that comes without a force at its stamp has the last one: nothing is foretold. Where
that is too old, or none has come, nobody knows how far the robot gave way, and there is no
displacement.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.readings import FloatArray
from hc_estimator.stream.together import LONGEST_GAP_NS
from hc_estimator.stream.vocabulary import recorded_less
from hc_msgs_py.specification import setting

SETTING = setting(
    "input.position.frame_compliance",
    0.0,
    "What gives way between the tissue and where the position is read (tool, force sensor, arm): "
    "this times the force, its zero taken off, is taken off the position. `hc compliance` finds it "
    "in a press on something rigid.",
    minimum=0.0,
    maximum=1000.0,
    unit="mm/N",
)
"""What is softer than 1 N/m holds no tool."""
TAKEN_OFF_ALREADY = recorded_less(SETTING.name)


class FrameCompliance:
    """Says by how much a robot gave way at each sample of a stream.

    Attributes:
        mm_per_n: the compliance [mm/N]; while it is 0 no force is kept.
    """

    def __init__(self, mm_per_n: float = 0.0) -> None:
        self.mm_per_n = mm_per_n
        self._force_n, self._stamp_ns = math.nan, 0  # as it was read: zeros may change meanwhile

    def yielded_mm(self, stamp_ns: int, force_n: float, zero_n: float = 0.0) -> float:
        """Take in a sample; return how far the robot gave way [mm], NaN where nobody knows.

        Args:
            stamp_ns: of the sample.
            force_n: as it was read [N]; NaN if there is no reading.
            zero_n: what counts as no force [N].
        """
        if self.mm_per_n == 0.0:
            return 0.0
        if math.isfinite(force_n):
            self._force_n, self._stamp_ns = force_n, stamp_ns
        elif abs(stamp_ns - self._stamp_ns) > LONGEST_GAP_NS:
            return math.nan
        return self.mm_per_n * (self._force_n - zero_n)

    def of_many(
        self, stamps_ns: NDArray[np.int64], forces_n: FloatArray, zero_n: float = 0.0
    ) -> FloatArray:
        """As `yielded_mm` for each of many samples."""
        if self.mm_per_n == 0.0:
            return np.zeros(len(stamps_ns))
        rows = zip(stamps_ns.tolist(), forces_n.tolist(), strict=True)
        return np.array([self.yielded_mm(stamp, force, zero_n) for stamp, force in rows])
