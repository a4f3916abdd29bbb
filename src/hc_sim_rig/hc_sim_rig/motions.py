"""Motions of the stage, as a scenario names them, and their profiles.

Positions are those of the tool, positive into the tissue [mm]; its penetration is the position
minus the tissue's surface_mm, which is 0 unless the scenario says otherwise.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

from hc_sim_rig.layout import SHAPE_LINEAR, SHAPE_MINIMUM_JERK
from hc_sim_rig.profile import Profile, leg_duration, profile_from_legs, profile_from_points
from hc_sim_rig.schema import ScenarioError, Section, number, section, short, word

ACCELERATION_MM_S2 = 1000.0
"""A tenth of gravity: what a stage does without effort. No motion's velocity jumps."""


@dataclass(frozen=True, kw_only=True)
class Sine(Section):
    """One sine of a motion."""

    amplitude: float = number(None, about="amplitude", unit="mm, or N of an operator")
    frequency_hz: float = number(None, above=0.0, maximum=1e4, unit="Hz")
    phase_rad: float = number(0.0, unit="rad")


@dataclass(frozen=True, kw_only=True)
class ConstantVelocity(Section):
    """In at constant velocity, hold, and out again if wanted (papers A and B, simulations)."""

    kind: str = word(None, "constant_velocity")
    start_mm: float = number(0.0, about="where it begins", unit="mm")
    depth_mm: float = number(None, about="where it turns or stops", unit="mm")
    velocity_mm_s: float = number(None, above=0.0, maximum=1e5, unit="mm/s")
    acceleration_mm_s2: float = number(
        ACCELERATION_MM_S2, minimum=1e-3, maximum=1e8, about="at both ends of a way", unit="mm/s^2"
    )
    hold_s: float = number(0.0, minimum=0.0, about="time at depth", unit="s")
    retract: bool = False

    def profile(self) -> Profile:
        """Return the motion's tables."""
        legs = [(0.0, self.depth_mm)]
        if self.retract:
            way = self.depth_mm - self.start_mm
            lasts = leg_duration(way, self.velocity_mm_s, self.acceleration_mm_s2)
            legs.append((lasts + self.hold_s, self.start_mm))
        return profile_from_legs(self.start_mm, legs, self.velocity_mm_s, self.acceleration_mm_s2)


@dataclass(frozen=True, kw_only=True)
class MultiSine(Section):
    """A sum of sines about a depth: the excitation that makes all four parameters observable."""

    kind: str = word(None, "multisine")
    offset_mm: float = number(None, about="depth about which it swings", unit="mm")
    components: tuple[Sine, ...] = section()

    def __post_init__(self) -> None:
        """Check that there is something to sum."""
        super().__post_init__()
        if not self.components:
            raise ScenarioError("components is empty, must name at least one sine")

    def profile(self) -> Profile:
        """Return the motion's tables."""
        sines = [(c.amplitude, c.frequency_hz, c.phase_rad) for c in self.components]
        return profile_from_points([(0.0, self.offset_mm)], SHAPE_LINEAR, sines)


@dataclass(frozen=True, kw_only=True)
class StepHold(Section):
    """Steps at given times, held in between (paper B, section 5.2.2)."""

    kind: str = word(None, "step_hold")
    start_mm: float = number(0.0, about="depth before the first step", unit="mm")
    step_mm: float = number(None, about="size of each step", unit="mm")
    times_s: tuple[float, ...] = section(about="when the steps begin")
    velocity_mm_s: float = number(None, above=0.0, maximum=1e5, unit="mm/s")
    acceleration_mm_s2: float = number(
        ACCELERATION_MM_S2, minimum=1e-3, maximum=1e8, about="at both ends of a step", unit="mm/s^2"
    )

    def __post_init__(self) -> None:
        """Check that the steps do not overlap."""
        super().__post_init__()
        check_times(self.times_s, "times_s")
        duration = leg_duration(self.step_mm, self.velocity_mm_s, self.acceleration_mm_s2)
        for earlier, later in zip(self.times_s, self.times_s[1:], strict=False):
            if later < earlier + duration:
                raise ScenarioError(
                    f"times_s has a step at {later:g} s while the one of {earlier:g} s "
                    f"still lasts (until {earlier + duration:g} s)"
                )

    def profile(self) -> Profile:
        """Return the motion's tables."""
        legs = [
            (time, self.start_mm + (count + 1) * self.step_mm)
            for count, time in enumerate(self.times_s)
        ]
        return profile_from_legs(self.start_mm, legs, self.velocity_mm_s, self.acceleration_mm_s2)


@dataclass(frozen=True, kw_only=True)
class Waypoints(Section):
    """Any path through points (time, value), straight or with minimum jerk, plus sines."""

    kind: str = word(None, "waypoints")
    points: tuple[tuple[float, ...], ...] = section(about="pairs of time [s] and value")
    shape: str = word("linear", "linear", "minimum_jerk")
    sines: tuple[Sine, ...] = section(tuple)

    def __post_init__(self) -> None:
        """Check that the points are pairs in order of time."""
        super().__post_init__()
        if not self.points:
            raise ScenarioError("points is empty, must have at least one [time, value]")
        for point in self.points:
            if len(point) != 2 or not all(is_number(value) for value in point):
                raise ScenarioError(f"points has {short(list(point))}, must be pairs [time, value]")
        check_times(tuple(point[0] for point in self.points), "points")

    def profile(self) -> Profile:
        """Return the motion's tables."""
        shape = SHAPE_MINIMUM_JERK if self.shape == "minimum_jerk" else SHAPE_LINEAR
        points = [(float(time), float(value)) for time, value in self.points]
        sines = [(s.amplitude, s.frequency_hz, s.phase_rad) for s in self.sines]
        return profile_from_points(points, shape, sines)


Motion = ConstantVelocity | MultiSine | StepHold | Waypoints


def is_number(value: object) -> bool:
    """Whether a value from a YAML list is a finite number, also as a float64."""
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number of more than 308 digits
        return False


def check_times(times: tuple[float, ...], name: str) -> None:
    """Raise ScenarioError unless times are numbers, not negative, in strictly rising order."""
    for time in times:
        if not is_number(time) or time < 0.0:
            raise ScenarioError(f"{name} has the time {short(time)}, must be a number >= 0 s")
    for earlier, later in itertools.pairwise(times):
        if later <= earlier:
            raise ScenarioError(f"{name} has {later:g} s after {earlier:g} s, must be rising")
