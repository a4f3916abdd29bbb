"""What lies between tissue and readings, and is in no contact law: mass, friction, memory, play.

The contacts of `drawn_contact` with one of them each. No filter here knows of any. What counts is
the same as in `troubles`: whether a user is told something wrong without being told that the law
does not fit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter

from hc_estimator.stream.dry_friction import DryFriction
from hc_estimator.stream.frame_compliance import FrameCompliance
from hc_estimator.stream.tool_motion import TONNES, ToolMotion
from hc_evaluation.accuracy.bench import Bench, Result, Row, target
from hc_evaluation.accuracy.drawn_contact import Between, Draw, DrawnContact, drawn_contact
from hc_evaluation.accuracy.measure import Numbers
from hc_evaluation.accuracy.scenarios import log_uniform
from hc_evaluation.accuracy.troubles import NOTHING, TroubleTask, believed, rows_of
from hc_evaluation.behind_sensor import from_rest
from hc_evaluation.play import behind_play
from hc_msgs_py.units import NANOSECONDS

FloatArray = NDArray[np.float64]
Read = tuple[FloatArray, FloatArray]
"""Place of the tool [mm] and force [N] as sensors find them."""

TOLD_WRONG = 0.1
SLOWEST_MM_S = 0.2  # from which on friction is that of motion


def _inertia(draw: Draw, time: FloatArray, place: FloatArray, force: FloatArray) -> Read:
    """The mass between sensor and tip; the sensor holds it, too."""
    acceleration = np.gradient(np.gradient(place, time), time)
    return place, force + TONNES * _mass_kg(draw) * acceleration


def _mass_kg(draw: Draw) -> float:
    return log_uniform(draw, 0.02, 0.5)


def _drag(draw: Draw, time: FloatArray, place: FloatArray, force: FloatArray) -> Read:
    """A seal or a guide holds the tool back, the more the faster it goes."""
    return place, force + _damping(draw, time, place, force) * np.gradient(place, time)


def _damping(draw: Draw, time: FloatArray, place: FloatArray, force: FloatArray) -> float:
    fastest = max(float(np.max(np.abs(np.gradient(place, time)))), 1e-3)
    return _largest_friction(draw, force) / fastest


def _friction(draw: Draw, time: FloatArray, place: FloatArray, force: FloatArray) -> Read:
    """A trocar or a guide holds the tool back, whichever way it goes."""
    return place, force + _friction_of(_largest_friction(draw, force), time, place)


def _largest_friction(draw: Draw, force: FloatArray) -> float:
    return log_uniform(draw, 0.005, 0.05) * float(np.max(force))


def _friction_of(largest: float, time: FloatArray, place: FloatArray) -> FloatArray:
    friction: FloatArray = largest * np.tanh(np.gradient(place, time) / SLOWEST_MM_S)
    return friction


def _hysteresis(draw: Draw, time: FloatArray, place: FloatArray, force: FloatArray) -> Read:
    """A force sensor whose spring remembers."""
    del time
    return place, behind_play(force, 2.0 * log_uniform(draw, 0.002, 0.02) * float(np.max(force)))


def _play(draw: Draw, time: FloatArray, place: FloatArray, force: FloatArray) -> Read:
    """Play between the tool and what its position is read from."""
    del time
    return behind_play(place, 2.0 * log_uniform(draw, 0.01, 0.1)), force


def _low_pass(draw: Draw, time: FloatArray, place: FloatArray, force: FloatArray) -> Read:
    """A force sensor with a filter of its own (second order, Butterworth)."""
    rate_hz = 1.0 / float(np.median(np.diff(time)))
    corner_hz = min(log_uniform(draw, 5.0, 50.0), 0.4 * rate_hz)
    return place, from_rest(*butter(2, corner_hz, fs=rate_hz), force)


def _mm_per_n(draw: Draw, place: FloatArray, force: FloatArray) -> float:
    """Compliance of a robot that is ten to a hundred times as stiff as the tissue."""
    deepest = max(float(np.max(place)), 1e-3)
    return deepest / log_uniform(draw, 10.0, 100.0) / float(np.max(force))


def _compliance(draw: Draw, time: FloatArray, place: FloatArray, force: FloatArray) -> Read:
    """A robot that gives way."""
    del time
    return place + _mm_per_n(draw, place, force) * force, force


MECHANICS: dict[str, Between] = {
    "inertia": _inertia,
    "drag": _drag,
    "friction": _friction,
    "hysteresis": _hysteresis,
    "play": _play,
    "low-pass": _low_pass,
    "compliance": _compliance,
}


def _less_compliance(deviation: float, seed: int) -> DrawnContact:
    known: list[float] = []

    def between(draw: Draw, time: FloatArray, place: FloatArray, force: FloatArray) -> Read:
        mm_per_n = _mm_per_n(draw, place, force)
        known.append(mm_per_n * (1.0 + deviation * float(draw.standard_normal())))
        return place + mm_per_n * force, force

    contact = drawn_contact((), seed, between)
    yielded = FrameCompliance(known[0]).of_many(_stamps(contact), contact.force_n)
    return replace(contact, displacement_mm=contact.displacement_mm - yielded)


def _less_friction(deviation: float, seed: int) -> DrawnContact:
    known: list[float] = []

    def between(draw: Draw, time: FloatArray, place: FloatArray, force: FloatArray) -> Read:
        largest = _largest_friction(draw, force)
        known.append(largest * (1.0 + deviation * float(draw.standard_normal())))
        return place, force + _friction_of(largest, time, place)

    contact = drawn_contact((), seed, between)
    friction = DryFriction(known[0]).of_many(_stamps(contact), contact.displacement_mm)
    return replace(contact, force_n=contact.force_n - friction)


def _less_motion(of_mass: bool, deviation: float, seed: int) -> DrawnContact:
    motion = ToolMotion()

    def between(draw: Draw, time: FloatArray, place: FloatArray, force: FloatArray) -> Read:
        velocity = np.gradient(place, time)
        mass_kg, damping = 0.0, 0.0
        if of_mass:
            mass_kg = _mass_kg(draw)
        else:
            damping = _damping(draw, time, place, force)
        known = 1.0 + deviation * float(draw.standard_normal())
        motion.mass_kg, motion.damping = known * mass_kg, known * damping
        taken_n = damping * velocity + TONNES * mass_kg * np.gradient(velocity, time)
        return place, force + taken_n

    contact = drawn_contact((), seed, between)
    less = motion.of_many(_stamps(contact), contact.displacement_mm, contact.force_n)
    return replace(contact, force_n=less)


def _stamps(contact: DrawnContact) -> NDArray[np.int64]:
    return np.round(contact.time_s * NANOSECONDS).astype(np.int64)


TAKEN_OFF: dict[str, tuple[Callable[[float, int], DrawnContact], float]] = {
    "inertia, taken off": (partial(_less_motion, True), 0.0),
    "inertia, known to 5 %": (partial(_less_motion, True), 0.05),
    "drag, taken off": (partial(_less_motion, False), 0.0),
    "drag, known to 5 %": (partial(_less_motion, False), 0.05),
    "friction, taken off": (_less_friction, 0.0),
    "friction, known to 5 %": (_less_friction, 0.05),
    "compliance, taken off": (_less_compliance, 0.0),
    "compliance, known to 5 %": (_less_compliance, 0.05),
}
"""What is taken off the readings, and how well it is known: a deviation."""


def mechanics_run(task: TroubleTask) -> Numbers:
    """Errors of K, what was claimed of them, changes and misfit told."""
    if task.trouble in TAKEN_OFF:
        less, deviation = TAKEN_OFF[task.trouble]
        contact = less(deviation, task.seed)
    else:
        contact = drawn_contact((), task.seed, MECHANICS.get(task.trouble))
    return believed(task.setup, contact)


def mechanics(bench: Bench) -> Result:
    """Everything drawn, with what lies between tissue and readings."""
    rows = rows_of(bench, mechanics_run, (NOTHING, *MECHANICS, *TAKEN_OFF))
    # What a robot gives way is part of the tissue for all who look at these readings.
    judged: list[Row] = [row for row in rows if row["trouble"] != "compliance"]
    targets = [
        target(f"{row['trouble']}: share told wrong", row["wrong"], high=TOLD_WRONG)
        for row in judged
    ]
    return {"rows": rows, "targets": targets}
