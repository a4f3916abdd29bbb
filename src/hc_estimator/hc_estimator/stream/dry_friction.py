"""Dry friction between the force sensor and the tissue, taken off the force.

Where the sensor sits outside and the tool goes in through a cannula (a trocar's seal, a bearing, a
cable), it feels what holds the tool back: more force on the way in, less on the way out, and K, B,
n and p are bent to explain it. Prandtl's elasto-plastic element (Popov and Gray, "Prandtl-Tomlinson
model", ZAMM 92 (2012) 683) describes it by the way alone, without a velocity, which a position's
noise would make chatter: after a turn the friction follows the way like a spring, until it slides.

What it is while it turns nobody knows well, and a force that is off by twice the friction for some
samples spoils more than it tells: those readings are left out, unless the tool rests there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.fading_memory import FadingMemory
from hc_estimator.stream.readings import BEYOND_ANY_SENSOR, FloatArray
from hc_estimator.stream.vocabulary import recorded_less
from hc_msgs_py.specification import setting

DRY_FRICTION = setting(
    "input.force.dry_friction",
    0.0,
    "What holds the tool back on its way from the force sensor to the tissue (a cannula's seal, a "
    "bearing): taken off the force on the way in, added to it on the way out; readings while it "
    "turns are left out. `hc doctor` finds it where the tool moves free of contact. Not of source "
    "effort, which has its own.",
    minimum=0.0,
    maximum=1000.0,
    unit="N",
)
PRESLIDING = setting(
    "input.force.presliding",
    0.02,
    "Of dry_friction: how far the tool moves from rest until it slides; twice as far after a turn.",
    minimum=1e-4,
    maximum=100.0,
    unit="mm",
)
SETTINGS = (DRY_FRICTION, PRESLIDING)
TAKEN_OFF_ALREADY = recorded_less(DRY_FRICTION.name)
PLAY = 1.5
"""Deviations of the position's noise, by which a tool that slides may seem to go back."""
SHORTEST = 5.0
"""Deviations of the position's noise, below which no presliding counts: a tool at rest would seem
to slide to and fro."""
NOISE_WEIGHT = 0.02
"""Of a reading, in the mean by which the noise is known."""
MOST_NOISES = 10.0
"""Times the noise, as which a jump counts."""
THIRD_DIFFERENCES = 3.568
"""Their mean size for white noise of deviation 1: sqrt(20) sqrt(2 / pi)."""
SLIDES_SHARE = 0.1
"""Of presliding: who goes less far slides no further."""
AHEAD_NS = 30_000_000
"""From so long before a turn on that is foreseen, readings are left out."""
TURN_NS = 500_000_000
"""So long a turn may take: of a tool that rests, friction is what the element says."""


class DryFriction:
    """Says what friction does to the force at each sample of a stream.

    Attributes:
        newtons: friction of the tool that slides [N]; while it is 0 no displacement is kept.
        presliding_mm: displacement from rest at which the tool begins to slide [mm].
    """

    def __init__(self, newtons: float = 0.0, presliding_mm: float = 0.02) -> None:
        self.newtons, self.presliding_mm = newtons, presliding_mm
        self._strain = 0.0  # -1 on the way out, 1 on the way in
        self._slid_ns: int | None = None  # when it slid last, and where
        self._slid_mm = math.nan
        self._place_mm = self._middle_mm = math.nan  # without noise; where friction would be none
        self._last_mm = (math.nan, math.nan, math.nan)
        self._noise_mm = 0.0
        self._motion = FadingMemory()

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other settings, by their names of the node; what is left out is its default."""
        self.newtons = values.get(DRY_FRICTION.name, DRY_FRICTION.default)
        self.presliding_mm = values.get(PRESLIDING.name, PRESLIDING.default)

    def at(self, stamp_ns: int, displacement_mm: float) -> float:
        """Take in a sample; return what friction adds to its force [N], negative on the way out.

        Args:
            stamp_ns: of the sample.
            displacement_mm: penetration [mm]; NaN without a reading: the last one counts.

        Returns:
            NaN where it turns, and nobody knows; what the element says before it ever slid.
        """
        if self.newtons == 0.0:
            return 0.0
        if abs(displacement_mm) < BEYOND_ANY_SENSOR:  # which NaN is not
            self._motion.take(stamp_ns, displacement_mm)
            self._go(stamp_ns, displacement_mm)
        slides = abs(self._strain) == 1.0 and self._goes_on(stamp_ns)
        recent = self._slid_ns is not None and 0 <= stamp_ns - self._slid_ns <= TURN_NS
        return self.newtons * self._strain if slides or not recent else math.nan

    def _goes_on(self, stamp_ns: int) -> bool:
        """Whether the tool goes on the way that it slides, now and a little later.

        A place shows a turn only once the tool has gone back by more than its noise, which takes
        tens of milliseconds; the velocity shows it as it comes.
        """
        now, later = (self._motion.velocity_at(stamp_ns + ns) for ns in (0, AHEAD_NS))
        return self._strain * now >= 0.0 and self._strain * later >= 0.0

    def _go(self, stamp_ns: int, displacement_mm: float) -> None:
        """Follow the tool to another place."""
        last, before, first = self._last_mm
        self._last_mm = (displacement_mm, last, before)
        third = abs(displacement_mm - 3.0 * last + 3.0 * before - first) / THIRD_DIFFERENCES
        if math.isfinite(third):
            known = self._noise_mm
            third = min(third, MOST_NOISES * known) if known else third
            self._noise_mm = known + NOISE_WEIGHT * (third - known) if known else third
        if math.isnan(self._place_mm):
            self._place_mm = self._middle_mm = displacement_mm
        play = PLAY * self._noise_mm
        place = min(max(self._place_mm, displacement_mm - play), displacement_mm + play)
        way = max(self.presliding_mm, SHORTEST * self._noise_mm)
        strain = (place - self._middle_mm) / way
        if abs(strain) >= 1.0:
            strain = math.copysign(1.0, strain)
            self._middle_mm = place - strain * way
            # What rests slides no more, though its last strain stays and the play still settles.
            least_mm = SLIDES_SHARE * way
            if displacement_mm != last and not abs(place - self._slid_mm) <= least_mm:
                self._slid_ns, self._slid_mm = stamp_ns, place
        self._place_mm, self._strain = place, strain

    def of_many(self, stamps_ns: NDArray[np.int64], displacements_mm: FloatArray) -> FloatArray:
        """As `at` for each of many samples, shape (n,) each."""
        if self.newtons == 0.0:
            return np.zeros(len(displacements_mm))
        rows = zip(stamps_ns.tolist(), displacements_mm.tolist(), strict=True)
        result: FloatArray = np.array([self.at(*row) for row in rows], np.float64)
        return result
