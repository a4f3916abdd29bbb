"""How a robot's sensors are to be read, found from readings of a tool that presses some times.

The force of a press changes along one direction of the force sensor, and the tool moves along one
direction of the position sensor; which way is "into the tissue" is where the force rises steeper
and steeper, for tissue stiffens and free motion is flat.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.free_motion import free_motion
from hc_estimator.stream.readings import (
    CLEAR,
    LEAST_SAMPLES,
    FloatArray,
    noise,
    robust_range,
    whole,
)
from hc_estimator.stream.sign_checks import pressed_way
from hc_estimator.stream.surface import find_surface
from hc_estimator.stream.vector_readings import VectorReadings, at_even_times, each_once

AXIS_ALIGNED = math.cos(math.radians(10.0))
"""A direction that is so near to an axis is taken for that axis."""
RELATED = 0.4
"""Correlation of force and position from which on they belong to one tool."""
SURFACE_SHARE = 0.05
"""Of the stroke: deviation of a surface of which only pieces of approaches told."""
NO_SURFACE = (
    "no approach from free motion into the tissue was seen, so that nobody knows where the "
    "surface is: hc find-surface while it runs"
)
NOT_FREE = "nor was the tool free of contact: hc tare while it runs"
_AXES = "xyz"
_RIDGE = 0.02
"""Of the position's whole variance."""


class SetupError(ValueError):
    """Why the readings do not show how the sensors are to be read, in one line."""


class SensorProposal(NamedTuple):
    """How one sensor is to be read, as the parameters input.force.* and input.position.* say it.

    Attributes:
        axis: x, y, z or direction; empty for a joint.
        direction: unit vector in the sensor's frame, shape (3,); along the axis if it is one.
        sign: 1 or -1; 1 for a direction.
        joint: name of the joint; empty for a vector.
        zero: reading free of contact [N] or at the surface [mm]; NaN if that is not shown.
        zero_std: its standard deviation.
        noise: standard deviation of the reading's noise [N] or [mm].
        rate_hz: median rate of the readings.
        scale: N or mm that one of the reading stands for.
        held: whether its topic repeats the last reading until there is a new one.
        late_s: by how much its stamps are off, which are those of arrival [s]; 0 where they are
            those of measurement.
    """

    axis: str
    direction: tuple[float, ...]
    sign: int
    joint: str
    zero: float
    zero_std: float
    noise: float
    rate_hz: float
    scale: float = 1.0
    held: bool = False
    late_s: float = 0.0

    def rescaled(self, factor: float) -> SensorProposal:
        """Return the proposal for readings that stand for so many times as much."""
        return self._replace(
            zero=self.zero * factor,
            zero_std=self.zero_std * factor,
            noise=self.noise * factor,
            scale=self.scale * factor,
        )


class SetupProposal(NamedTuple):
    """How both sensors are to be read, and the readings read that way.

    Attributes:
        force: the force sensor.
        position: the position sensor.
        time_s: stamps of both, in order, shape (n,).
        displacement_mm: zero taken off if it is known, shape (n,); NaN at a stamp of the force.
        force_n: zero taken off, shape (n,); NaN at a stamp of the position alone.
        notes: what a user should know, one line each.
        force_limit: force from which on readings are to be left out, for the sensor's range ends
            there [N]; NaN if it was not reached.
        mechanics: what lies between force sensor and tissue, by the names of the node's settings
            below `input.force`.
    """

    force: SensorProposal
    position: SensorProposal
    time_s: FloatArray
    displacement_mm: FloatArray
    force_n: FloatArray
    notes: tuple[str, ...]
    force_limit: float = math.nan
    mechanics: Mapping[str, float] = MappingProxyType({})

    def rescaled(self, force: float, position: float) -> SetupProposal:
        """Return the proposal for readings that stand for so many times as much."""
        return self._replace(
            force=self.force.rescaled(force),
            position=self.position.rescaled(position),
            force_n=self.force_n * force,
            displacement_mm=self.displacement_mm * position,
        )

    def corrected(self, force_n: float, displacement_mm: float) -> SetupProposal:
        """Return the proposal with zeros that were found to be off by so much; 0: they are not.

        One that was not known, so that nothing was taken off, is known then.
        """
        known = {NOT_FREE: force_n != 0.0, NO_SURFACE: displacement_mm != 0.0}
        return self._replace(
            force=self.force._replace(zero=_moved(self.force.zero, force_n)),
            position=self.position._replace(zero=_moved(self.position.zero, displacement_mm)),
            force_n=self.force_n - force_n,
            displacement_mm=self.displacement_mm - displacement_mm,
            notes=tuple(note for note in self.notes if not known.get(note, False)),
        )

    def with_surface_known_to(self, deviation_mm: float) -> SetupProposal:
        """Return the proposal with another deviation of the position's zero."""
        return self._replace(position=self.position._replace(zero_std=deviation_mm))


def propose(
    force: VectorReadings, position: VectorReadings, *, rest_s: float | None = None
) -> SetupProposal:
    """Find out how two sensors are to be read.

    Args:
        force: force readings [N], three components, or efforts of joints, one column a joint.
        position: positions [mm], three components, or joint positions, one column a joint; with
            efforts, those of the same joints at the same stamps.
        rest_s: until when the tool rested free of contact; None if nobody said so.

    Raises:
        SetupError: if the readings do not show it.
    """
    for readings, what in ((force, "force"), (position, "position")):
        if len(readings.time_s) < LEAST_SAMPLES:
            raise SetupError(f"{len(readings.time_s)} readings of the {what} are too few")
    repeated, late_s = [False, False], [0.0, 0.0]
    if force.of_joints:
        force, position = _one_joint(force, position)
    else:
        force, late_s[0] = at_even_times(force)
        position, late_s[1] = at_even_times(position)
        force, repeated[0] = each_once(force)
        position, repeated[1] = each_once(position)
    resting = None if rest_s is None else force.time_s <= rest_s
    push = main_direction(force.values)
    pushed = force.values @ push
    low, high = robust_range(pushed)
    noise_n = noise(pushed)
    if high - low < CLEAR * max(noise_n, 1e-9):
        raise SetupError(
            f"the force changes by {high - low:.2g} N only, hardly more than its noise "
            f"({noise_n:.2g} N): press into the tissue meanwhile"
        )
    order = np.argsort(position.time_s, kind="stable")
    inside = (force.time_s >= position.time_s.min()) & (force.time_s <= position.time_s.max())
    if inside.sum() < LEAST_SAMPLES:
        behind_s = float(np.median(position.time_s) - np.median(force.time_s))
        way = "behind" if behind_s > 0.0 else "ahead of"
        raise SetupError(
            f"the stamps of the force are {abs(behind_s):.0f} s {way} those of the position, and "
            "were recorded together: two clocks; set one by the other (PTP, chrony), or have both "
            "drivers stamp by this computer's clock"
        )
    places = np.column_stack(
        [
            np.interp(force.time_s[inside], position.time_s[order], column[order])
            for column in position.values.T
        ]
    )
    find = _joint if position.of_joints else _towards
    move = find(places, pushed[inside])
    moved = places @ move
    related = abs(float(np.corrcoef(moved, pushed[inside])[0, 1]))
    if not related > RELATED:
        raise SetupError(
            f"force and position hardly go together (correlation {related:.2f}): are both of the "
            "tool that presses?"
        )
    if _presses_backwards(moved, pushed, inside, resting):
        push, move = -push, -move
    # From here on along the directions that are told: far from the frame's origin a degree matters.
    push, move = _snapped(push), _snapped(move)
    pushed, moved = force.values @ push, places @ move
    zero_n, surface_mm, surface_std, notes = _zeros(moved, pushed, inside, resting)
    return SetupProposal(
        _described(push, force, zero_n, noise_n / math.sqrt(LEAST_SAMPLES), noise_n)._replace(
            held=repeated[0], late_s=late_s[0]
        ),
        _described(move, position, surface_mm, surface_std, noise(position.values @ move))._replace(
            held=repeated[1], late_s=late_s[1]
        ),
        *_at_own_stamps(
            force.time_s[inside],
            pushed[inside] - (0.0 if math.isnan(zero_n) else zero_n),
            position.time_s[order],
            position.values[order] @ move - (0.0 if math.isnan(surface_mm) else surface_mm),
        ),
        tuple(notes),
    )


def _one_joint(
    force: VectorReadings, position: VectorReadings
) -> tuple[VectorReadings, VectorReadings]:
    """Return effort and position of the joint whose effort goes with its own position.

    Raises:
        SetupError: if there is no such joint.
    """
    related = []
    for effort, place in zip(force.values.T, position.values.T, strict=True):
        low, high = robust_range(effort)
        clear = high - low > CLEAR * max(noise(effort), 1e-9) and np.ptp(place) > 0.0
        related.append(abs(float(np.corrcoef(effort, place)[0, 1])) if clear else 0.0)
    best = int(np.argmax(related))
    if not related[best] > 0.0:
        raise SetupError(
            "no joint has an effort that changes clearly while it moves: press into the tissue "
            "meanwhile; or is it a revolute joint, or one without a motor?"
        )
    return (
        VectorReadings(force.time_s, force.values[:, [best]], (force.names[best],), True),
        VectorReadings(position.time_s, position.values[:, [best]], (position.names[best],), True),
    )


def _at_own_stamps(
    force_s: FloatArray, force_n: FloatArray, position_s: FloatArray, position_mm: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return both as one recording, NaN for what a stamp does not bring, as the node reads them.

    Interpolated positions of a slow sensor would have a noise that no estimator expects, and the
    law would seem not to fit.
    """
    time_s = np.union1d(force_s, position_s)
    displacement, force = np.full(time_s.size, np.nan), np.full(time_s.size, np.nan)
    displacement[np.searchsorted(time_s, position_s)] = position_mm
    force[np.searchsorted(time_s, force_s)] = force_n
    return time_s, displacement, force


def main_direction(values: FloatArray) -> FloatArray:
    """Return the unit vector along which vectors change most, spikes apart."""
    centred = values - np.median(values, axis=0)
    size = np.linalg.norm(centred, axis=1)
    usual = size <= np.quantile(size, 0.995)
    _values, vectors = np.linalg.eigh(centred[usual].T @ centred[usual])
    direction: FloatArray = vectors[:, -1]
    return direction


def _towards(places: FloatArray, pushed: FloatArray) -> FloatArray:
    """Return the unit vector along which the tool moves as the force rises.

    Ridge regression of the force on the position: a tool that slides meanwhile moves along other
    directions too, and along those that it does not move there is nothing but noise.
    """
    centred = places - places.mean(axis=0)
    spread = centred.T @ centred
    covariance = centred.T @ (pushed - pushed.mean())
    ridge = _RIDGE * float(np.trace(spread))
    if ridge == 0.0:
        raise SetupError("the position does not change: is it that of the tool?")
    direction: FloatArray = np.linalg.solve(spread + ridge * np.eye(3), covariance)
    return direction / float(np.linalg.norm(direction))


def _snapped(direction: FloatArray) -> FloatArray:
    """Return the axis that a direction is near to, or else the direction."""
    largest = int(np.argmax(np.abs(direction)))
    if abs(direction[largest]) < AXIS_ALIGNED:
        return direction
    axis = np.zeros_like(direction)
    axis[largest] = math.copysign(1.0, direction[largest])
    return axis


def _joint(places: FloatArray, pushed: FloatArray) -> FloatArray:
    """Return a vector with 1 or -1 at the joint that moves with the force."""
    spread = places.std(axis=0)
    if not (spread > 0.0).any():
        raise SetupError("no joint moves: is it the right topic?")
    with np.errstate(invalid="ignore", divide="ignore"):
        related = np.array([np.corrcoef(column, pushed)[0, 1] for column in places.T])
    related = np.where(spread > 0.0, np.nan_to_num(related), 0.0)
    # Of joints that go together with the force, the one that moves most.
    strength = np.abs(related) * (np.abs(related) > 0.9 * np.abs(related).max()) * spread
    best = int(np.argmax(strength))
    direction = np.zeros(places.shape[1])
    direction[best] = math.copysign(1.0, related[best])
    return direction


def _presses_backwards(
    moved: FloatArray,
    pushed: FloatArray,
    inside: NDArray[np.bool_],
    resting: NDArray[np.bool_] | None,
) -> bool:
    """Whether the tool presses where position and force are least, not where they are largest."""
    if resting is not None and LEAST_SAMPLES // 2 <= resting.sum() < len(resting):
        free = float(np.median(pushed[resting]))
        low, high = robust_range(pushed[~resting])
        return free - low > high - free
    scale = max(float(np.ptp(moved)), 1e-12)
    centred = (moved - moved.mean()) / scale
    curvature = float(np.polyfit(centred, pushed[inside], 2)[0])
    sense = 1.0 if np.corrcoef(moved, pushed[inside])[0, 1] > 0.0 else -1.0
    return whole(pressed_way(moved, sense * pushed[inside], -curvature)) > 0.0


def _zeros(
    moved: FloatArray,
    pushed: FloatArray,
    inside: NDArray[np.bool_],
    resting: NDArray[np.bool_] | None,
) -> tuple[float, float, float, list[str]]:
    """Return force zero, surface and its deviation, NaN where they are not shown, and notes."""
    coarse = SURFACE_SHARE * float(np.ptp(moved))
    found = find_surface(moved, pushed[inside])
    if found is not None and found.displacement_std_mm <= coarse:
        return found.force_n, found.displacement_mm, found.displacement_std_mm, []
    free = whole(free_motion(moved, pushed[inside]))
    if free is not None:  # pieces of approaches, none of them whole
        return free[0], free[1], coarse, []
    notes = [NO_SURFACE]
    zero = math.nan
    if resting is not None and resting.sum() >= LEAST_SAMPLES // 2:
        zero = float(np.median(pushed[resting]))
    else:
        notes.append(NOT_FREE)
    return zero, math.nan, math.nan, notes


def _moved(zero: float, by: float) -> float:
    """Return a zero that was found to be off; NaN where it is not known, and nothing was found."""
    return zero if by == 0.0 else by + (0.0 if math.isnan(zero) else zero)


def _described(
    direction: FloatArray,
    readings: VectorReadings,
    zero: float,
    zero_std: float,
    noise_level: float,
) -> SensorProposal:
    steps = np.diff(np.sort(readings.time_s))
    rate = 1.0 / float(np.median(steps[steps > 0.0]))
    largest = int(np.argmax(np.abs(direction)))
    sign = 1 if direction[largest] > 0.0 else -1
    if readings.of_joints:
        joint = readings.names[largest]
        return SensorProposal("", (), sign, joint, zero, zero_std, noise_level, rate)
    if abs(direction[largest]) == 1.0:
        unit = tuple(float(i == largest) for i in range(3))
        return SensorProposal(_AXES[largest], unit, sign, "", zero, zero_std, noise_level, rate)
    return SensorProposal(
        "direction", tuple(map(float, direction)), 1, "", zero, zero_std, noise_level, rate
    )
