"""Faults that a recording shows in both channels at once: no motion, a freeze, too low a rate.

A stream is not asked for these: a tool may rest, and the node counts equal readings by itself.
"""

from __future__ import annotations

import numpy as np

from hc_estimator.stream.readings import (
    LEAST_SAMPLES,
    Check,
    FloatArray,
    Readings,
    Suspicion,
    noise,
    robust_range,
    runs,
    usable,
)
from hc_estimator.stream.stamp_checks import rate_of
from hc_estimator.stream.together import together

NOISE_ALONE = 6.5
"""Range (99 %) of what is noise alone, in deviations; that of white noise is 5.2."""
_RELATED = 0.5
"""Correlation of channels that see a motion, however few of its readings there are."""
_ALIVE = 0.05
"""Share of readings that equal the one before, at most, in a sensor with noise."""
_NOISY = 0.4
"""Share of bends to the other side than the one before, at least, in one; 0.73 of white noise."""
_LEAST_SLOW = 20
_COARSE_STEP, _FINE_STEP = 0.12, 0.05
"""Of its range: how far a tool goes from reading to reading where too few are taken, and enough."""


def check_both(
    time_s: FloatArray, displacement_mm: FloatArray, force_n: FloatArray
) -> list[Suspicion]:
    """Check a recording of both channels.

    Args:
        time_s: stamps [s], shape (samples,).
        displacement_mm: penetration [mm], shape (samples,); NaN where there is no reading.
        force_n: contact force [N], shape (samples,); NaN where there is no reading.
    """
    displacement = usable("displacement", "mm", time_s, displacement_mm)
    force = usable("force", "N", time_s, force_n)
    if min(len(displacement.values), len(force.values)) < _LEAST_SLOW:
        return []
    with np.errstate(all="ignore"):
        pairs = together(np.asarray(time_s), np.asarray(displacement_mm), np.asarray(force_n))[1:]
        related = _correlation(*pairs)
        found = (
            _still(displacement, force, related),
            _frozen(displacement, force),
            _too_slow(displacement, related),
        )
    return [suspicion for suspicion in found if suspicion is not None]


def _correlation(depth: FloatArray, newtons: FloatArray) -> float:
    sound = np.isfinite(depth) & np.isfinite(newtons)
    if np.count_nonzero(sound) < _LEAST_SLOW:
        return 0.0
    related = float(np.corrcoef(depth[sound], newtons[sound])[0, 1])
    return related if np.isfinite(related) else 0.0


def _still(displacement: Readings, force: Readings, related: float) -> Suspicion | None:
    """Neither channel changes, or by noise alone, but for a tool in the air: that is no contact."""
    if min(len(displacement.values), len(force.values)) < LEAST_SAMPLES or abs(related) > _RELATED:
        return None
    if not robust_range(displacement.values)[1] > 0.0:
        return None
    said = []
    for name, unit, _time_s, values in (displacement, force):
        low, high = robust_range(values)
        if high == low and values.min() == values.max():
            said.append(f"the {name} reads {low:.4g} {unit} all the time")
        elif high - low < NOISE_ALONE * noise(values):
            said.append(f"the {name} is noise alone ({noise(values):.2g} {unit})")
        else:
            return None
    sentence = f"nothing moves: {' and '.join(said)}; is the driver alive? If so: press, and move"
    return Suspicion(Check.STUCK, "both", sentence)


def _frozen(displacement: Readings, force: Readings) -> Suspicion | None:
    """Both channels repeat themselves for a while, and nowhere else."""
    if not (_is_noisy(displacement.values) and _is_noisy(force.values)):
        return None
    longest, begin, end = 0.0, 0.0, 0.0
    of_force = _stretches(force)
    for since, until in _stretches(displacement):
        for start, stop in of_force:
            first, last = max(since, start), min(until, stop)
            if last - first > longest:
                longest, begin, end = last - first, first, last
    if not longest > 0.0:
        return None
    after = begin - float(displacement.time_s[0])
    sentence = (
        f"both channels stand still for {longest:.3g} s, {after:.3g} s after the beginning, and "
        "elsewhere hardly two readings in a row are equal: the driver froze; record again, or keep "
        "what is before or after it"
    )
    return Suspicion(Check.PAUSE, "both", sentence, since_s=begin, until_s=end)


def _is_noisy(values: FloatArray) -> bool:
    """Whether readings have noise: what repeats itself in them is no rest."""
    starts, lengths = runs(values)
    short = lengths < LEAST_SAMPLES
    inside = values[np.repeat(short, lengths)]
    if len(inside) < LEAST_SAMPLES or len(starts) < 2:
        return False
    steps = np.diff(inside)
    bends = np.diff(steps)
    back = np.mean(bends[1:] * bends[:-1] < 0.0)
    return bool(np.mean(steps == 0.0) < _ALIVE and back > _NOISY)


def _stretches(readings: Readings) -> list[tuple[float, float]]:
    """Return from when to when a channel repeats one reading many times."""
    starts, lengths = runs(readings.values)
    many = lengths >= LEAST_SAMPLES
    first, last = starts[many], starts[many] + lengths[many] - 1
    time_s = readings.time_s
    return list(zip(time_s[first].tolist(), time_s[last].tolist(), strict=True))


def _too_slow(displacement: Readings, related: float) -> Suspicion | None:
    """A tool that goes far from reading to reading."""
    low, high = robust_range(displacement.values)
    if abs(related) < _RELATED or not high > low:
        return None
    step = float(np.median(np.abs(np.diff(displacement.values))))
    share = step / (high - low)
    rate = rate_of(displacement.time_s)
    if not (share > _COARSE_STEP and np.isfinite(rate)):
        return None
    enough = rate * share / _FINE_STEP
    sentence = (
        f"the tool moves by {step:.2g} of its {high - low:.2g} mm from reading to reading: "
        f"{rate:.3g} Hz is too low a rate for this motion; record at {enough:.2g} Hz or more, or "
        "move slower"
    )
    return Suspicion(Check.RATE, "displacement", sentence)
