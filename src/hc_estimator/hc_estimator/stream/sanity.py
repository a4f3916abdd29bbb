"""Readings that cannot be right, each in a sentence: what is seen, and what to do about it.

A wrong sign, unit or zero gives estimates that look like estimates. Soft tissue pushes back the
harder the deeper the tool goes, it does not push before it is touched, and its stiffness lies in a
range that no mistaken unit reaches. The checks speak only where the readings show the fault: what
passes them may still be wrong, what does not is worth a look.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from hc_estimator.stream import channel_checks, range_checks, stamp_checks
from hc_estimator.stream.both_channels import check_both
from hc_estimator.stream.exchanged import exchanged
from hc_estimator.stream.free_motion import RISE_SHARE, free_motion
from hc_estimator.stream.friction_checks import find_friction, held_back
from hc_estimator.stream.readings import (
    LEAST_SAMPLES,
    Check,
    FloatArray,
    Parts,
    Readings,
    Suspicion,
    moves,
    robust_range,
    usable,
    whole,
)
from hc_estimator.stream.sign_checks import RELATED, turned_channels
from hc_estimator.stream.smoothing_checks import smoothed
from hc_estimator.stream.tool_motion_checks import find_tool_motion, less_motion, takes_force
from hc_estimator.stream.zero_steps import find_steps

SCALES = "force.scale, position.scale"
"""Settings that a wrong unit is mended with, as a sentence names them; `hc setup` has options."""
STIFFNESS = (1e-3, 100.0)
"""Secant stiffness of soft tissue and phantoms under a tool [N/mm]: brain and fat to silicone."""
STROKE_MM = (0.02, 60.0)
PEAK_N = (0.005, 1500.0)
GRAM_FORCE = 9.80665e-3
"""N in a gram-force, which no range tells from ten millinewtons."""

HELD_BACK = (Check.FRICTION, Check.DAMPING, Check.INERTIA)
"""A part of the force is of what moving the tool takes."""
LOOKS_LATE = (*HELD_BACK, Check.SMOOTHED, Check.HYSTERESIS)
"""What passes for a delay and is more than that."""
_ZERO_SHARE = 0.05
_SURFACE_SHARE = 0.4
"""Of the depth: a stiffening tissue is hardly felt in the first quarter."""
_FREE_BUT_PRESSED = 0.2
_FAR = 10.0


def check_samples(
    time_s: FloatArray,
    displacement_mm: FloatArray,
    force_n: FloatArray,
    force_limit_n: float = math.inf,
    counted_once: Collection[str] = (),
) -> list[Suspicion]:
    """Check a recording of both channels at common times.

    Args:
        time_s: stamps [s], shape (samples,).
        displacement_mm: penetration [mm], shape (samples,); NaN where there is no reading.
        force_n: contact force [N], shape (samples,); NaN where there is no reading.
        force_limit_n: the estimator's; a range of the sensor that ends beyond it does no harm.
        counted_once: channels ("displacement", "force") whose repeated readings were left out.

    Returns:
        What is suspicious, the most fundamental first; empty for readings that may be right.
    """
    displacement = usable("displacement", "mm", time_s, displacement_mm)
    force = usable("force", "N", time_s, force_n)
    result = less_gaps(check_channels(displacement, force, force_limit_n), counted_once)
    with np.errstate(all="ignore"):
        wrong = exchanged(*_at_common_times(displacement, force))
    of_both = check_both(time_s, displacement_mm, force_n)
    if any(s.check is Check.STUCK for s in of_both):
        wrong = of_both[0]
    if wrong is not None:  # all else is of other channels, or of none
        return [*(s for s in result if s.check is Check.TIMES), wrong]
    if any(s.check is Check.TIMES for s in result):  # nothing is known of rates
        of_both = [s for s in of_both if s.check is not Check.RATE]
    order = list(Check)
    return sorted((*result, *of_both), key=lambda s: order.index(s.check))


def less_gaps(suspicions: list[Suspicion], counted_once: Collection[str]) -> list[Suspicion]:
    """Return the suspicions without rates of channels that have gaps on purpose.

    Args:
        suspicions: of both channels.
        counted_once: channels whose repeated readings were left out.
    """
    return [s for s in suspicions if s.check is not Check.RATE or s.channel not in counted_once]


def check_channels(
    displacement: Readings, force: Readings, force_limit_n: float = math.inf
) -> list[Suspicion]:
    """Check two channels, each at times of its own.

    Args:
        displacement: penetration [mm].
        force: contact force [N].
        force_limit_n: as `check_samples`.

    Returns:
        As `check_samples`.
    """
    with np.errstate(all="ignore"):  # steps of 1e-300 beside steps of 1e12
        return whole(check_in_parts(displacement, force, force_limit_n))


def check_in_parts(
    displacement: Readings, force: Readings, force_limit_n: float = math.inf
) -> Parts[list[Suspicion]]:
    """Check as `check_channels`, in parts; whoever runs them ignores numpy's warnings meanwhile."""
    result: list[Suspicion] = []
    for readings, other in ((displacement, force), (force, displacement)):
        if len(readings.values) >= LEAST_SAMPLES:
            yield from _check_one(readings, other, result)
    if min(len(displacement.values), len(force.values)) >= LEAST_SAMPLES:
        coarse = any(suspicion.check is Check.QUANTISATION for suspicion in result)
        if not coarse:
            result += yield from find_steps(displacement, force)
        yield
        result += yield from _check_together(displacement, force, fine=not coarse)
        if any(s.check in HELD_BACK for s in result):  # whose turns look like steps
            result[:] = [s for s in result if (s.check, s.channel) != (Check.ZERO_STEP, "force")]
        yield
        seen = {(s.check, s.channel) for s in result}
        turned = seen & {(Check.SIGN, "displacement"), (Check.SIGN, "both")}
        if not (turned or (Check.SATURATION, "force") in seen):
            flattened, keep = yield from range_checks.flattened(displacement, force)
            _add(result, Check.SATURATION, force, flattened, keep)
    yield
    if len(displacement.values) >= LEAST_SAMPLES:
        doubted = {s.check for s in result if s.channel == "displacement"}
        # Nothing is known of its speed; or what it jumped by is known.
        if doubted.isdisjoint((Check.UNITS, Check.TIMES, Check.RATE, Check.ZERO_STEP)):
            _add(result, Check.JUMP, displacement, channel_checks.jumping(displacement))
    order = list(Check)
    doubted_of = [s for s in result if not _is_refused(s, force_limit_n)]
    return sorted(doubted_of, key=lambda s: order.index(s.check))


def _is_refused(suspicion: Suspicion, force_limit_n: float) -> bool:
    """Whether a limit refuses the forces at the end of a range: one did as was said, and knows."""
    ends = suspicion.check is Check.SATURATION and suspicion.channel == "force"
    return ends and force_limit_n <= _ROUNDED * abs(suspicion.remedy)


_ROUNDED = 1.001
"""What is said with four digits."""


def _check_one(readings: Readings, other: Readings, result: list[Suspicion]) -> Parts[None]:
    """Check what one channel shows, of which there is enough; add what is found."""
    is_force = readings.name == "force"
    saturated, keep = "", math.nan
    if is_force:
        saturated, keep = yield from range_checks.saturated(readings, other)
    _add(result, Check.SATURATION, readings, saturated, keep)
    short = ""
    if not is_force and len(other.values) >= LEAST_SAMPLES:
        short = range_checks.stopped_short(readings, other)
        _add(result, Check.SATURATION, readings, short)
    yield
    if not (saturated or short):
        _add(result, Check.STUCK, readings, channel_checks.stuck(readings, other))
        stands, is_lost = channel_checks.standing(readings, other)
        _add(result, Check.STUCK if is_lost else Check.PAUSE, readings, stands)
    yield
    mistimed = "" if is_force else stamp_checks.mistimed(readings)
    _add(result, Check.TIMES, readings, mistimed)
    if not mistimed:
        mean, length_s = yield from smoothed(readings)
        _add(result, Check.SMOOTHED, readings, mean, length_s)
        yield
        uneven, repeats = (yield from stamp_checks.irregular(readings)), math.nan
        if not (uneven or mean):
            uneven, repeats = channel_checks.held(readings)
        _add(result, Check.RATE, readings, uneven, repeats)
    yield
    _add(result, Check.QUANTISATION, readings, channel_checks.coarse(readings))
    yield


def _add(
    result: list[Suspicion],
    check: Check,
    readings: Readings,
    sentence: str,
    remedy: float = math.nan,
) -> None:
    if sentence:
        result.append(Suspicion(check, readings.name, sentence, remedy))


# Both channels.


def _check_together(
    displacement: Readings, force: Readings, *, fine: bool
) -> Parts[list[Suspicion]]:
    """Check what displacement and force say of each other; zeros only of fine readings."""
    if not (moves(displacement.values) and moves(force.values)):
        return _check_still(displacement, force)
    yield
    depth, newtons = _at_common_times(displacement, force)
    yield
    if len(newtons) < LEAST_SAMPLES or not (moves(depth) and moves(newtons)):
        return []  # both move, but not where both have readings
    yield
    related = float(np.corrcoef(depth, newtons)[0, 1])
    if math.isnan(related):  # motions whose squares are too small for a number
        return []
    result: list[Suspicion] = []
    yield
    result += _units(depth, newtons, related)
    yield
    result += yield from turned_channels(depth, newtons, related)
    yield
    if fine and not result:  # zeros of a channel that is turned or scaled wrongly say nothing
        motion = yield from find_tool_motion(displacement, force)
        yield
        if motion is not None:
            result += takes_force(motion)
            force = yield from less_motion(motion, displacement, force)
            depth, newtons = _at_common_times(displacement, force)
            yield
        friction = yield from find_friction(depth, newtons)
        yield
        if friction is not None:  # nor does a zero of the way in alone
            result.append(held_back(friction))
        else:
            result += yield from _zeros(depth, newtons, related)
    return result


def _at_common_times(displacement: Readings, force: Readings) -> tuple[FloatArray, FloatArray]:
    """Return depth [mm] and force [N] at the times of the forces within those of the depths."""
    if not (len(displacement.values) and len(force.values)):
        return np.empty(0), np.empty(0)
    order = np.argsort(displacement.time_s, kind="stable")
    inside = (force.time_s >= displacement.time_s.min()) & (
        force.time_s <= displacement.time_s.max()
    )
    newtons = force.values[inside]
    depth = np.interp(force.time_s[inside], displacement.time_s[order], displacement.values[order])
    sound = np.isfinite(depth)  # not between stamps that are next to equal
    return depth[sound], newtons[sound]


def _check_still(displacement: Readings, force: Readings) -> list[Suspicion]:
    """A tool that does not move shows at most a zero that was never taken."""
    low, high = robust_range(displacement.values)
    if moves(displacement.values) and low > _FAR * (high - low) > 0.0:
        return [_far_from_zero(low, high)]
    return []


def _far_from_zero(low: float, high: float) -> Suspicion:
    return Suspicion(
        Check.POSITION_ZERO,
        "displacement",
        f"the displacement lies between {low:.4g} and {high:.4g} mm, far from zero: tare at the "
        "surface, or find the surface in an approach (position.zero)",
    )


def _units(depth: FloatArray, newtons: FloatArray, related: float) -> list[Suspicion]:
    """A unit that was mistaken makes the stiffness a thousand times too large or too small."""
    if abs(related) < RELATED:
        return []
    low, high = robust_range(depth)
    stroke = high - low
    low, high = robust_range(newtons)
    peak = high - low

    def possible(stroke_mm: float, peak_n: float) -> bool:
        return all(
            limits[0] <= value <= limits[1]
            for value, limits in (
                (stroke_mm, STROKE_MM),
                (peak_n, PEAK_N),
                (peak_n / stroke_mm, STIFFNESS),
            )
        )

    if possible(stroke, peak):
        return []
    readings = f"{peak:.3g} N over {stroke:.3g} mm ({peak / stroke:.3g} N/mm)"
    guesses = [
        (channel, unit, factor)
        for channel, unit, factor in (
            ("displacement", "metres", 1e3),
            ("displacement", "micrometres", 1e-3),
            ("force", "millinewtons", 1e-3),
        )
        if possible(
            stroke * (factor if channel == "displacement" else 1.0),
            peak * (factor if channel == "force" else 1.0),
        )
    ]
    if len(guesses) == 1:
        channel, unit, factor = guesses[0]
        name = "position" if channel == "displacement" else "force"
        sentence = (
            f"{readings} is no soft tissue, but would be if the {channel} were in {unit}: scale it "
            f"by {factor:g} ({name}.scale)"
        )
        if unit == "micrometres":  # a table's unit is mm, a topic's m
            sentence += "; of a topic that is in millimetres, not metres"
        if channel == "force" and possible(stroke, peak * GRAM_FORCE):
            sentence += f", or in gram-force: by {GRAM_FORCE:.3g}"
        return [Suspicion(Check.UNITS, channel, sentence, factor)]
    if not STIFFNESS[0] <= peak / stroke <= STIFFNESS[1]:
        sentence = f"{readings} is no soft tissue: check the units of both ({SCALES})"
        return [Suspicion(Check.UNITS, "both", sentence)]
    return []


def _zeros(depth: FloatArray, newtons: FloatArray, related: float) -> Parts[list[Suspicion]]:
    """Zeros, where the readings go from free motion into contact."""
    low, high = robust_range(depth)
    least, most = robust_range(newtons)
    span = most - least
    result = []
    free = yield from free_motion(depth, newtons)
    yield
    if free is not None:
        level, surface = free
        if abs(level) > _ZERO_SHARE * span:
            what = f"the force reads {level:.3g} N free of contact"
            result.append(_force_zero(what, level))
        if abs(surface) > _SURFACE_SHARE * (high - surface):
            result.append(
                Suspicion(
                    Check.POSITION_ZERO,
                    "displacement",
                    f"contact begins near {_short(surface)} mm, not at 0: tare at the surface, "
                    "or find the surface in an approach (position.zero)",
                    surface,
                )
            )
        return result
    if related < RELATED:
        return result
    if most < 0.0:
        result.append(_force_zero(f"the force stays below zero, at most {most:.3g} N, in contact"))
    pressed = (depth <= 0.0) & (newtons > RISE_SHARE * most)
    if low > _FAR * (high - low):
        result.append(_far_from_zero(low, high))
    elif most > 0.0 and np.mean(pressed) > _FREE_BUT_PRESSED:
        result.append(
            Suspicion(
                Check.POSITION_ZERO,
                "displacement",
                f"the force is up to {float(np.max(newtons[pressed])):.3g} N where the "
                "displacement says free motion: tare at the surface, or find the surface in an "
                "approach (position.zero, force.zero)",
            )
        )
    return result


def _force_zero(what: str, level: float = math.nan) -> Suspicion:
    return Suspicion(
        Check.FORCE_ZERO, "force", f"{what}: tare the tool free of contact (force.zero)", level
    )


def _short(value: float) -> str:
    """Return a number with two digits, one with more before the point whole: -200, not -2e+02."""
    return f"{value:.2g}" if abs(value) < 10.0 else f"{value:.0f}"
