"""What is wrong with a recording or a set-up, what it costs in K, B, n and p, and what to do.

Used by `hc doctor` and `hc setup`. Every fault that a number would put right is put right, and the
recording is estimated again: the difference is what the fault costs.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np

from hc_bringup.channel_findings import at_all_places, between_channels
from hc_bringup.finding import (
    DISTURBED_SHARE,
    SYMBOLS,
    UNKNOWN,
    Finding,
    cost_of,
    fits_worse,
)
from hc_bringup.force_error import dishonest_line
from hc_bringup.held_tool import relaxing_line
from hc_bringup.robot_mechanics import MOVES_WITH
from hc_bringup.sensor_effect import means_taken_off
from hc_bringup.sticking import sticking_line
from hc_bringup.treated_samples import FORCE_LIMIT, Estimated, FloatArray, Samples
from hc_bringup.two_clocks import clocks_put_together
from hc_bringup.vibration import vibration_taken_off
from hc_bringup.wandering_zero import wandering_zero
from hc_estimator import PARAMETER_NAMES, Rejection
from hc_estimator.stream.readings import (
    LEAST_SAMPLES,
    Check,
    moves,
    noise,
    robust_range,
)
from hc_estimator.stream.sanity import check_samples
from hc_evaluation.forecast import Forecast, forecast

MOST_REMEDIES = 5
NOISE_ALONE = 6.5
"""The range (99 %) of white noise is 5.2 times its deviation."""
SPOILT = (
    Check.TIMES,
    Check.SATURATION,
    Check.STUCK,
    Check.PAUSE,
    Check.QUANTISATION,
    Check.SMOOTHED,
    Check.RATE,
)
"""What the law would be bent to fit, so that it invents delays and zeros, if no number mends it."""
UNSURE_SHARE = 0.05
"""Of K: what the place of the surface may leave open without a word."""
_MOST_CHANGES = 5
"""Of the tissue, that are named."""
OUT_OF_RANGE = Rejection.OUT_OF_RANGE.name.lower()
CONTACT_STD = "contact_position_std"
"""The estimator's setting that says how well the surface is known."""


@dataclass(frozen=True)
class Diagnosis:
    """All that was found.

    Attributes:
        findings: what is wrong, the most fundamental first.
        estimated: the estimate with all that could be put right put right; None without contact.
        forecasts: motions for what the recording does not show.
        depth_mm: how deep the tool pressed.
        surface_std_mm: standard deviation of the position that displacements count from, with what
            was put right put right [mm].
    """

    findings: tuple[Finding, ...]
    estimated: Estimated | None
    forecasts: tuple[Forecast, ...]
    depth_mm: float
    surface_std_mm: float = 0.0


def diagnose(
    time_s: FloatArray,
    displacement_mm: FloatArray,
    force_n: FloatArray,
    surface_std_mm: float = 0.0,
    force_limit_n: float = math.inf,
    channel_delay: float | str = "auto",
    counted_once: Collection[str] = (),
) -> Diagnosis:
    """Judge readings of both channels.

    Args:
        time_s: stamps [s], shape (n,).
        displacement_mm: penetration [mm], shape (n,); NaN where there is no reading.
        force_n: contact force [N], shape (n,); NaN where there is no reading.
        surface_std_mm: standard deviation of the position that displacements count from [mm].
        force_limit_n: the estimator's: forces beyond it are left out here as well [N].
        channel_delay: the estimator's: by how much the force is late [s], if it was told that.
        counted_once: channels whose repeated readings were left out.
    """
    samples = Samples(
        np.asarray(time_s, np.float64),
        np.asarray(displacement_mm, np.float64),
        np.asarray(force_n, np.float64),
        surface_std_mm,
        channel_delay=channel_delay,
    )
    if (np.abs(samples.force_n) > force_limit_n).any():
        samples.force_end_n = force_limit_n
    untouched = _too_few(samples) or _touches_nothing(samples)
    if untouched is not None:
        return Diagnosis((untouched,), None, (), 0.0)
    aligned = dataclasses.replace(samples)
    found, unaligned = _judged(samples, force_limit_n, counted_once)
    offset = next((f for f in found.findings if _offset_s(f)), None)
    if offset is None:
        return found
    # Mass, drag and friction are those of the motion at a force's own time.
    aligned.shift_force(_offset_s(offset))
    if not _moves_with(found.findings) and aligned.tool_motion() is None:
        return found
    again, _ = _judged(aligned, force_limit_n, counted_once)
    if fits_worse(unaligned, again.estimated):  # what was no tissue looked late
        others = tuple(finding for finding in found.findings if finding is not offset)
        return dataclasses.replace(found, findings=others, estimated=unaligned)
    return dataclasses.replace(again, findings=(offset, *again.findings))


def _moves_with(findings: Iterable[Finding]) -> bool:
    """Whether anything was taken off by the motion."""
    return any(name in finding.settings for finding in findings for name in MOVES_WITH)


def _offset_s(finding: Finding) -> float:
    """Return what a finding adds to the stamps of the force against those of the position [s]."""
    of_force, of_position = (
        float(finding.settings.get(f"{channel}.time_offset", 0.0))
        for channel in ("force", "position")
    )
    return of_force - of_position


def _judged(
    samples: Samples, force_limit_n: float, counted_once: Collection[str]
) -> tuple[Diagnosis, Estimated | None]:
    """Judge readings, put right as far as that can be; and what they give without a delay."""
    surface_std_mm = samples.surface_std_mm
    findings: list[Finding] = []
    treated: set[tuple[Check, str, float, float]] = set()
    spoilt = False
    before = samples.estimate()
    while len(treated) < MOST_REMEDIES:
        doubts = [
            s
            for s in check_samples(
                *(samples.time_s, samples.displacement_mm, samples.force_n),
                *(force_limit_n, (*counted_once, *samples.left_out)),
            )
            if (s.check, s.channel, s.since_s, s.until_s) not in treated
        ]
        if not doubts:
            break
        doubt = doubts[0]
        nothing_moves = doubt.check is Check.STUCK and doubt.channel == "both"
        # Every other word would be of the other channel, or of nothing.
        if doubt.check is Check.EXCHANGED or nothing_moves:
            return Diagnosis((*findings, Finding(doubt.sentence)), None, (), 0.0), None
        if doubt.check is Check.SMOOTHED:  # both channels at once, if both are
            means = [s for s in doubts if s.check is Check.SMOOTHED]
            treated |= {(s.check, s.channel, s.since_s, s.until_s) for s in means}
            said, before, cured = means_taken_off(samples, before, means)
            findings += said
            spoilt = spoilt or not cured
            continue
        treated.add((doubt.check, doubt.channel, doubt.since_s, doubt.until_s))
        settings = samples.put_right(doubt)
        mended = bool(settings) or doubt.check is Check.ZERO_STEP
        after = samples.estimate() if mended else before
        spoilt = spoilt or (doubt.check in SPOILT and not mended)
        cost = cost_of(before, after, mended)
        findings.append(Finding(doubt.sentence, settings, cost or (UNKNOWN if spoilt else "")))
        before = after
    if not spoilt:
        unlike, before = clocks_put_together(samples, before)
        findings += unlike
        wandering, before = _wandering(samples, before)
        findings += wandering
        vibrating, before = vibration_taken_off(samples, before)
        findings += vibrating
    after = before
    if not (spoilt or samples.limits):  # a force that goes no further looks late
        findings += between_channels(samples, before, fits_no_worse=not _moves_with(findings))
        after = samples.estimate()
        late = at_all_places(samples, after, findings)
        if late:
            findings += late
            after = samples.estimate()
    if after is None or not samples.play_mm:  # in which a position that stands still is refused
        but = OUT_OF_RANGE if samples.limits else ""
        findings += _refusals(after, len(samples.time_s), but=but)
    if not spoilt and (
        line := relaxing_line(samples.time_s, samples.displacement_mm, samples.force_n)
    ):
        findings.append(Finding(line))
    if after is not None and after.mismatch > DISTURBED_SHARE:
        readings = (samples.time_s, samples.displacement_mm, samples.force_n)
        if not spoilt and (line := sticking_line(*readings)):
            findings.append(Finding(line))
        findings.append(
            Finding(
                f"the contact law does not fit in {100 * after.mismatch:.0f} % of the contact: "
                "relaxing or layered tissue, a tool that slides, friction on its way (a cannula), "
                "several places one after another (hc contacts --sites), or a fault above"
            )
        )
    if after is not None and (line := dishonest_line(after.nis)):
        findings.append(Finding(line))
    depth = float(robust_range(samples.displacement_mm[np.isfinite(samples.displacement_mm)])[1])
    plans: list[Forecast] = []
    if after is not None and not spoilt:
        steps = np.diff(samples.time_s[~np.isnan(samples.force_n)])
        forward = steps[steps > 0.0]
        # What the surface leaves open, no stroke can mend.
        sure = after
        if samples.surface_std_mm:
            sure = dataclasses.replace(samples, surface_std_mm=0.0).estimate() or after
        findings += _surface(after, sure, samples.surface_std_mm)
        plans = forecast(
            sure.parameters,
            sure.covariance,
            force_noise_std=after.force_noise_std,
            depth_mm=depth,
            rate_hz=1.0 / float(np.median(forward)) if len(forward) else 0.0,
        )
    for finding in findings:
        if FORCE_LIMIT in finding.settings:
            finding.settings.update(samples.limits)  # as the forces count in the end
    if samples.surface_std_mm != surface_std_mm:
        _say_deviation(findings, samples.surface_std_mm)
    diagnosis = Diagnosis(tuple(findings), after, tuple(plans), depth, samples.surface_std_mm)
    return diagnosis, before


def _wandering(
    samples: Samples, before: Estimated | None
) -> tuple[list[Finding], Estimated | None]:
    """Say so where the law does not fit and the force's zero wanders; return the estimate then."""
    if before is None or before.mismatch <= DISTURBED_SHARE:
        return [], before
    found = wandering_zero(samples.time_s, samples.displacement_mm, samples.force_n)
    if found is None:
        return [], before
    steady = dataclasses.replace(samples, force_n=samples.force_n - found.zero_n)
    after = steady.estimate()
    if fits_worse(before, after):
        return [], before
    samples.take_over(steady)
    return [Finding(found.words, {}, cost_of(before, after, True))], after


def _say_deviation(findings: list[Finding], surface_std_mm: float) -> None:
    """Let the last of the findings that move the surface say how well it is known then."""
    moves_it = [i for i, finding in enumerate(findings) if "position.zero" in finding.settings]
    if moves_it:
        last = findings[moves_it[-1]]
        last.settings[CONTACT_STD] = float(f"{surface_std_mm:.2g}")


def _too_few(samples: Samples) -> Finding | None:
    """Say so if there is too little of a channel for any of the checks."""
    for name, values in (("displacement", samples.displacement_mm), ("force", samples.force_n)):
        count = int(np.count_nonzero(np.isfinite(values)))
        if count < LEAST_SAMPLES:
            return Finding(
                f"{count} readings of the {name} are too few to judge, {LEAST_SAMPLES} are needed: "
                "record several presses"
            )
    return None


def _touches_nothing(samples: Samples) -> Finding | None:
    """Say so if the force is noise alone while the tool moves: what fits it is no tissue."""
    places = samples.displacement_mm[np.isfinite(samples.displacement_mm)]
    forces = samples.force_n[np.isfinite(samples.force_n)]
    if min(len(places), len(forces)) < LEAST_SAMPLES or not moves(places):
        return None
    low, high = robust_range(forces)
    least, most = robust_range(places)
    noise_n = noise(forces)
    if not 0.0 < high - low < NOISE_ALONE * noise_n:
        return None
    return Finding(
        f"the force is noise alone ({noise_n:.2g} N) while the tool moves by {most - least:.3g} "
        "mm: it touched nothing, or this is another axis, topic or column than that which presses"
    )


def _surface(estimated: Estimated, sure: Estimated, surface_std_mm: float) -> list[Finding]:
    """Say so where K is uncertain for nothing but the place of the surface."""
    share = estimated.deviations[0] / abs(estimated.parameters[0])
    if not (share > UNSURE_SHARE and sure.deviations[0] < 0.5 * estimated.deviations[0]):
        return []
    return [
        Finding(
            f"the surface is known to ± {surface_std_mm:.2g} mm only, and that alone makes K "
            f"uncertain by {100.0 * share:.0f} %: hc find-surface with a slow press, and again"
        )
    ]


def _refusals(estimated: Estimated | None, count: int, but: str) -> list[Finding]:
    if estimated is None:
        return [Finding("the tool was never in contact: nothing is known of the tissue")]
    most = DISTURBED_SHARE * count
    refused = {k: n for k, n in estimated.rejected.items() if k != but and n > most}
    return [
        Finding(f"{n} of {count} samples are refused ({reason.replace('_', ' ')})")
        for reason, n in refused.items()
    ]


def changes_line(diagnosis: Diagnosis) -> str:
    """Return when the tissue changed, for the parameters are of what came after; else nothing."""
    estimated = diagnosis.estimated
    if estimated is None or not estimated.changed_s:
        return ""
    shown = ", ".join(f"{time_s:.2f}" for time_s in estimated.changed_s[:_MOST_CHANGES])
    more = ", ..." if len(estimated.changed_s) > _MOST_CHANGES else ""
    what = "a change" if len(estimated.changed_s) == 1 else f"{len(estimated.changed_s)} changes"
    return (
        f"{what} of the tissue detected, at {shown}{more} s: K, B, n and p are of what came after "
        "the last one"
    )


def estimate_lines(diagnosis: Diagnosis) -> list[str]:
    """Return the estimate and the forecasts as lines for a person."""
    estimated = diagnosis.estimated
    if estimated is None:
        return []
    lines = []
    for symbol, name, value, deviation, known in zip(
        SYMBOLS,
        PARAMETER_NAMES,
        estimated.parameters,
        estimated.deviations,
        estimated.identifiability,
        strict=True,
    ):
        lines.append(
            f"  {symbol} = {value:.4g} ± {deviation:.2g}  {100 * known:.0f} % known from the data"
            f"  ({name.replace('_', ' ')})"
        )
    return lines + [f"to know more: {plan.sentence}" for plan in diagnosis.forecasts]
