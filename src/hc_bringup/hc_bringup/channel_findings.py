"""A delay between the channels, and zeros that no check of the readings sees: by the law itself."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from hc_bringup.finding import (
    DISTURBED_SHARE,
    UNKNOWN,
    Finding,
    cost_of,
    cures,
    fits_worse,
)
from hc_bringup.other_damping import damping_at_every_depth
from hc_bringup.place_delay import MOST_NOISES, Delay, delay_between_places
from hc_bringup.play import find_play
from hc_bringup.sensor_effect import named_effect
from hc_bringup.terminal.numbers import rounded
from hc_bringup.treated_samples import Estimated, Samples
from hc_bringup.two_clocks import delay_that_grows
from hc_bringup.yielding import find_yielding, yielding_taken_off
from hc_estimator.stream.readings import moves, robust_range
from hc_estimator.stream.vocabulary import CHANNEL_DELAY
from hc_evaluation.channels import CLEAR, diagnose_channels, evenly_spaced, unbroken

CLEAR_DELAY_S = 0.002
"""A delay below this changes B by less than anybody tells."""
_LONGEST = 20_000
"""Samples that the slow comparison of the channels gets."""


def between_channels(
    samples: Samples, before: Estimated | None, *, fits_no_worse: bool
) -> list[Finding]:
    """Look for a delay, and for zeros that the checks cannot see.

    Args:
        samples: readings as far as they were put right; they are put right.
        before: what they give.
        fits_no_worse: whether nothing is a delay with which the law fits less of the contact:
            something else looked late.
    """
    try:
        even = evenly_spaced(*unbroken(samples.time_s, samples.displacement_mm, samples.force_n))
        if not (moves(even[1]) and moves(even[2])):
            return []
        time_s, displacement_mm, force_n = (c[-_LONGEST:] for c in even)
        found = diagnose_channels(time_s, displacement_mm, force_n)
    except ValueError:  # too little to compare, or gaps on purpose: the filter sees a delay, too
        return _by_the_filter(samples, before) if samples.left_out else []
    findings = []
    faults = found.clear_faults if _within_reach(found.contact_mm, displacement_mm) else ()
    if faults or found.residual_rms_without_n > MOST_NOISES * found.noise_n:
        instead = damping_at_every_depth((time_s, displacement_mm, force_n), found)
        if instead.far_better:
            return [Finding(instead.words)]
        findings += [Finding(instead.words)] if instead.words else []
        if not instead.words and (
            effect := named_effect(samples, before, (time_s, displacement_mm, force_n))
        ):
            return [effect]
    if play_mm := find_play((time_s, displacement_mm, force_n), found):
        return [_with_play(samples, before, play_mm)]
    if mm_per_n := find_yielding((time_s, displacement_mm, force_n), found):
        stiff, before = yielding_taken_off(samples, before, mm_per_n)
        if stiff:
            return stiff
    left_s = found.delay_s - samples.known_delay_s
    if "delay" in faults and abs(left_s) > max(CLEAR_DELAY_S, CLEAR * found.delay_std_s):
        drifts = delay_that_grows(even, _LONGEST, found.delay_s, found.delay_std_s)
        if drifts:
            return [Finding(drifts)]
        delayed, before = _delayed(samples, before, left_s, found.delay_std_s, fits_no_worse)
        findings += delayed
        if any(not finding.settings for finding in delayed):
            return findings  # whatever is wrong bends the zeros as well
    for name, key, value, deviation, unit in (
        ("zero", "force.zero", found.zero_n, found.zero_std_n, "N"),
        ("contact", "position.zero", found.contact_mm, found.contact_std_mm, "mm"),
    ):
        if name not in faults:
            continue
        moved = dataclasses.replace(samples)
        if name == "zero":
            what = f"the force's zero seems to be off by {value:.3g} ± {deviation:.2g} {unit}"
            moved.force_n = samples.force_n - value
        else:
            what = f"contact seems to begin at {value:.3g} ± {deviation:.2g} {unit}, not at 0"
            moved.displacement_mm = samples.displacement_mm - value
            moved.surface_std_mm = deviation
        after = moved.estimate()
        if fits_worse(before, after) or not _helps(before, after):
            continue  # one law was bent over tissue that varies: no zero is off
        samples.take_over(moved)
        findings.append(Finding(what, {key: rounded(value, 4)}, cost_of(before, after, True)))
        before = after
    fits = found.residual_rms_n < MOST_NOISES * found.noise_n
    at_zero = abs(found.contact_mm) < 3.0 * found.contact_std_mm
    if samples.surface_std_mm > 0.0 and fits and at_zero:
        known_mm = float(np.hypot(found.contact_mm, found.contact_std_mm))
        samples.surface_std_mm = min(samples.surface_std_mm, known_mm)
    return findings


def _within_reach(contact_mm: float, displacement_mm: NDArray[np.float64]) -> bool:
    """Whether a recording can tell that contact begins there.

    Where it seems to lie further from the readings than all their stroke, the law was bent to
    something else (tissue that relaxes, a needle's grip), and the zeros and the delay with it.
    """
    low_mm, high_mm = robust_range(displacement_mm)
    return bool(low_mm - (high_mm - low_mm) <= contact_mm <= high_mm)


def _with_play(samples: Samples, before: Estimated | None, play_mm: float) -> Finding:
    """Let the position be that behind the play [mm]; return what was found."""
    samples.take_play(play_mm)
    what = (
        f"the position has a play of {play_mm:.2g} mm: after each turn it moves so far before the "
        "force follows (backlash of a gear, a cable, a tendon), which looks like a delay and is "
        "none: read the position behind it; no setting takes it off"
    )
    return Finding(what, {}, cost_of(before, samples.estimate(), True))


def _delayed(
    samples: Samples,
    before: Estimated | None,
    left_s: float,
    deviation_s: float,
    fits_no_worse: bool,
) -> tuple[list[Finding], Estimated | None]:
    """Let the force be so much earlier [s]; return what was found, and the estimate then."""
    late = "force" if left_s > 0.0 else "position"
    settings = {f"{late}.time_offset": -round(abs(left_s), 4)}
    aligned = dataclasses.replace(samples)
    aligned.shift_force(-left_s)
    after = aligned.estimate()
    if fits_no_worse and fits_worse(before, after):
        return [], before
    late_by = Delay(left_s, deviation_s, 1).late
    if fits_no_worse and before and after and not _helps(before, after):
        what = (
            f"{late_by}, or so it seems: with that put right the law does not fit in "
            f"{100 * after.mismatch:.0f} % of the contact, and in {100 * before.mismatch:.0f} % as "
            "it is, so something else is wrong, and no setting is proposed"
        )
        return [Finding(what, {}, UNKNOWN)], before
    samples.take_over(aligned)
    cost = cost_of(before, after, True)
    return [Finding(late_by, settings, cost)], after


def _helps(before: Estimated | None, after: Estimated | None) -> bool:
    """Whether a change cures what did not fit, if anything did not."""
    return before is None or before.mismatch <= DISTURBED_SHARE or cures(before, after)


def _by_the_filter(samples: Samples, before: Estimated | None) -> list[Finding]:
    """Say what delay the filter found, if it is one."""
    if before is None:
        return []
    left_s = before.delay_s - samples.known_delay_s
    if abs(left_s) <= max(CLEAR_DELAY_S, CLEAR * before.delay_std_s):
        return []
    return _delayed(samples, before, left_s, before.delay_std_s, fits_no_worse=False)[0]


def at_all_places(
    samples: Samples, before: Estimated | None, findings: list[Finding]
) -> list[Finding]:
    """Look for a delay where the law does not fit, for several places may have been pressed."""
    known = any("time_offset" in str(f.settings) or "two clocks" in f.what for f in findings)
    if before is None or before.mismatch <= DISTURBED_SHARE or known:
        return []
    delay = delay_between_places(samples.time_s, samples.displacement_mm, samples.force_n)
    if delay is None:
        return []
    off_s = abs(delay.seconds - samples.known_delay_s)
    if off_s <= max(CLEAR_DELAY_S, CLEAR * delay.deviation_s):
        return []
    aligned = dataclasses.replace(samples, channel_delay=round(delay.seconds, 4) + 0.0)
    after = aligned.estimate()
    if fits_worse(before, after):
        return []
    samples.take_over(aligned)
    what = f"{delay.late}, at {delay.places} places that were pressed one after another"
    settings = {CHANNEL_DELAY: aligned.channel_delay}
    return [Finding(what, settings, cost_of(before, after, True))]
