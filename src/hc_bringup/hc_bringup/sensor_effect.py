"""What a sensor or its driver made of a channel, in words, and taken off a recording."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.finding import DISTURBED_SHARE, UNKNOWN, Finding, cost_of, cures
from hc_bringup.reading_changes import read_alike
from hc_bringup.treated_samples import Estimated, Samples
from hc_bringup.two_clocks import doubted_clocks
from hc_bringup.vibration import find_vibration
from hc_estimator.stream.readings import Check, Suspicion
from hc_evaluation.behind_sensor import LOW_PASS, MEAN, MEMORY
from hc_evaluation.channels import CLEAR, evenly_spaced, unbroken
from hc_evaluation.sensor_effects import (
    BOTH,
    DISPLACEMENT,
    FORCE,
    Effect,
    find_effect,
    mean_of,
    without,
)

Array = NDArray[np.float64]

OF_A_MEAN: Final = 0.5
"""Of its length: means so far apart have half of their noise in common."""
OF_A_LOW_PASS: Final = 2.5
"""Of its time constant: the same, an eighth."""
LOOKS_LATE_S: Final = 0.002
"""A delay that an estimator found, from which on it may be more than that."""
MOST_ROWS: Final = 20_000
"""Of the end of a recording, which are looked at."""
_OF_THE_ZEROS: Final = (Check.FORCE_ZERO, Check.POSITION_ZERO)
ALIKE: Final = 0.05
"""Share by which lengths of means that are the same differ."""
_SENSOR: Final = {FORCE: "force", DISPLACEMENT: "position", BOTH: "position and force"}


def named_effect(
    samples: Samples, before: Estimated | None, even: tuple[Array, Array, Array]
) -> Finding | None:
    """Say what a sensor made of a channel, and take it off; None where nothing stands out.

    Args:
        samples: readings as far as they were put right; they are put right.
        before: what they give.
        even: evenly spaced stamps [s], penetration [mm] and force [N], each of shape (n,).
    """
    effect = find_effect(*even)
    if effect is None:
        return None
    tried = dataclasses.replace(samples)
    take_off(tried, effect)
    after = tried.estimate()
    words = effect_words(effect)
    if not cures(before, after):
        return Finding(words, {}, UNKNOWN)
    samples.take_over(tried)
    return Finding(words, {}, cost_of(before, after, True))


def doubted_effect(
    readings: tuple[Array, Array, Array],
    doubts: Sequence[Suspicion],
    mismatch_share: float,
    delay_s: float,
    delay_std_s: float,
) -> Suspicion | None:
    """Look for two clocks, for what a sensor made of a channel, and for a vibration.

    Only where the law did not fit, or a delay was found.

    Args:
        readings: stamps [s], penetration [mm] and force [N], shape (n,) each; NaN for no reading.
        doubts: what cannot be right of them; with any but zeros there is nothing to look for.
        mismatch_share: of the samples in which the law did not fit.
        delay_s: by how much the force is late, as an estimator found it [s]; NaN where it did not.
        delay_std_s: its standard deviation [s].
    """
    looks_late = abs(delay_s) > max(LOOKS_LATE_S, CLEAR * delay_std_s)
    if not (looks_late or mismatch_share > DISTURBED_SHARE):
        return None
    if any(doubt.check not in _OF_THE_ZEROS for doubt in doubts):
        return None
    try:
        even = evenly_spaced(*unbroken(*readings))
    except ValueError:  # too little, or mostly gaps
        return None
    if clocks := doubted_clocks(even):
        return clocks
    effect = find_effect(*(column[-MOST_ROWS:] for column in even))
    if effect is None:
        vibration = find_vibration(even) if mismatch_share > DISTURBED_SHARE else None
        return vibration and Suspicion(Check.VIBRATION, vibration.channel, vibration.words)
    check = Check.HYSTERESIS if effect.kind == MEMORY else Check.SMOOTHED
    stiffness = f"{effect_words(effect)}; with it in the law K = {effect.parameters[0]:.3g}"
    return Suspicion(check, effect.channel, f"{stiffness} (hc doctor says the others)")


def doubted_effects(
    recording: Any, doubts: Sequence[Suspicion], estimated: Mapping[str, Any]
) -> list[Suspicion]:
    """Return what `doubted_effect` finds in a recording, none or one.

    Args:
        recording: hc_logger.recorded.Recording.
        doubts: what cannot be right of it.
        estimated: what an estimator made of it: model_mismatch_share, channel_delay [s] and
            channel_delay_std [s].
    """
    keys = ("model_mismatch_share", "channel_delay", "channel_delay_std")
    effect = doubted_effect(read_alike(recording), doubts, *(float(estimated[key]) for key in keys))
    return [] if effect is None else [effect]


def effect_words(effect: Effect) -> str:
    """Say what a sensor made of a channel, and what to do."""
    sensor = _SENSOR[effect.channel]
    if effect.kind == MEMORY:
        return (
            f"the force sensor seems to remember: after each turn the force changes by "
            f"{effect.size:.2g} N before its reading follows, however slowly, so that it reads "
            "more on the way out than on the way in, and no tissue gives energy back (hysteresis "
            "of the sensor, a mount or screw that sticks, a cable): fix it and calibrate it up and "
            "down; no setting takes it off"
        )
    verb = "seem" if effect.channel == BOTH else "seems"
    what = f"a moving mean over {effect.size:.2g} s"
    if effect.kind in LOW_PASS:
        corner_hz = 1.0 / (2.0 * np.pi * effect.size)
        what = f"behind a {effect.kind} with a corner at {corner_hz:.2g} Hz"
    return (
        f"the {effect.channel} {verb} to be {what}, which is no mere delay: what is quicker is "
        "flattened, and the law takes that for other tissue: switch off the filter of the "
        f"{sensor} sensor or of its driver (or let it end at ten times that); no setting takes it "
        "off"
    )


def take_off(samples: Samples, effect: Effect) -> None:
    """Add what an effect took from the readings.

    Raises:
        ValueError: fewer than two usable rows, stamps next to equal, or mostly gaps.
    """
    even = evenly_spaced(samples.time_s, samples.displacement_mm, samples.force_n)
    of_depth, of_force = without(effect, *even)
    samples.displacement_mm = samples.displacement_mm + np.interp(samples.time_s, even[0], of_depth)
    samples.force_n = samples.force_n + np.interp(samples.time_s, even[0], of_force)
    if effect.channel != DISPLACEMENT and effect.kind != MEMORY:
        _leave_out_repeated_noise(samples, effect)


def _leave_out_repeated_noise(samples: Samples, effect: Effect) -> None:
    """Leave out forces whose noise is that of the one before, for a filter had it in both."""
    apart_s = effect.size * (OF_A_MEAN if effect.kind == MEAN else OF_A_LOW_PASS)
    there = np.flatnonzero(np.isfinite(samples.force_n) & np.isfinite(samples.time_s))
    turn = np.floor((samples.time_s[there] - samples.time_s[there[0]]) / apart_s + 1e-6)
    repeated = there[1:][turn[1:] == turn[:-1]]
    if len(repeated):
        samples.force_n = samples.force_n.copy()
        samples.force_n[repeated] = np.nan
        samples.left_out = (*samples.left_out, FORCE)


def means_taken_off(
    samples: Samples, before: Estimated | None, doubts: Sequence[Suspicion]
) -> tuple[list[Finding], Estimated | None, bool]:
    """Take moving means off, whose lengths are known, and say what that changes.

    Args:
        samples: they are put right, if the law fits then.
        before: what they give.
        doubts: of the check SMOOTHED; one of a median has no length.

    Returns:
        What was found, what the samples give then, and whether they are put right.
    """
    found = _mean_of(samples, doubts)
    tried, after = dataclasses.replace(samples), None
    if found is not None:
        take_off(tried, found)
        after = tried.estimate()
    cured = cures(before, after)
    findings = [Finding(doubt.sentence) for doubt in doubts]
    if found is not None and found.channel == BOTH and len(doubts) == 1:
        other = DISPLACEMENT if doubts[0].channel == FORCE else FORCE
        findings.append(Finding(effect_words(found._replace(channel=other))))
    cost = cost_of(before, after, True) if cured else UNKNOWN
    findings[-1] = dataclasses.replace(findings[-1], cost=cost)
    if cured:
        samples.take_over(tried)
    return findings, after if cured else before, cured


def _mean_of(samples: Samples, doubts: Sequence[Suspicion]) -> Effect | None:
    """Return the mean that doubts are of, if it is one, and explains what the law does not."""
    lengths = [doubt.remedy for doubt in doubts]
    if not np.ptp(lengths) <= ALIKE * min(lengths):  # one of them a median, or of its own length
        return None
    try:
        even = evenly_spaced(samples.time_s, samples.displacement_mm, samples.force_n)
        return mean_of([doubt.channel for doubt in doubts], lengths[0], even)
    except ValueError:  # mostly gaps, or too few rows to fit anything
        return None
