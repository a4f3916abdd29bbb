"""What a recording says, in sentences: what was felt, how sure it is, what stands in the way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_bringup import force_error
from hc_bringup.explanation import explain
from hc_bringup.place_delay import APART_MM
from hc_bringup.report.contacts import Contact
from hc_bringup.report.palpation_map import StiffnessMap
from hc_bringup.run_data import RunData
from hc_bringup.summary import why_unusable
from hc_bringup.terminal.numbers import engineering, with_spread
from hc_bringup.zero_effect import effect_in
from hc_bringup.zero_words import Zeros
from hc_estimator.stream.both_channels import check_both
from hc_estimator.stream.readings import Check, Suspicion
from hc_estimator.stream.sanity import LOOKS_LATE
from hc_evaluation.metrics import chi_square_band
from hc_logger.info import LONGEST_COUNTED_GAP, counts

Array = NDArray[np.float64]

MISMATCH_SHARE: Final = 0.05
UNKNOWN: Final = 0.5
"""Identifiability below which a parameter cannot be seen, and relative deviation above which."""
LITTLE_NIS: Final = 2.5
"""Mean NIS up to which nobody need be told, however many samples say that it is not 2."""
ROUGHLY: Final = 0.5
"""Spread of the force, relative, from which on it is known only roughly."""
DEPTH_MM: Final = 2.0
NOISE_ALONE: Final = 1.5
"""Of the force's noise: what one law for all readings leaves where it describes them."""
APART: Final = 0.1
DEVIATIONS: Final = 5.0
"""Of the force: from where on filter and one fit do not say the same."""
LEAST_NIS: Final = 50
_ALLOWED_FOR: Final = (
    *(Check.FORCE_ZERO, Check.POSITION_ZERO, Check.ZERO_STEP),
    *(Check.PAUSE, Check.RATE, Check.QUANTISATION),
)
"""What is doubted, and estimated beside the parameters or weighed by the filter."""
TOO_GOOD_NIS: Final = 0.5
"""Mean NIS of readings that hardly change, or of noises that were told far too large."""


class Level(str, Enum):
    """How good the news is."""

    GOOD = "good"
    NOTE = "note"
    BAD = "bad"


class Sentence(NamedTuple):
    """One sentence of the verdict."""

    level: Level
    text: str


def verdict(
    data: RunData,
    contacts: Sequence[Contact],
    channels: Any | None,
    found: StiffnessMap | None,
    given: Sequence[Suspicion] = (),
) -> list[Sentence]:
    """Return the verdict on a run, the most important first.

    Args:
        data: the run.
        contacts: its contacts.
        channels: hc_evaluation.channels.ChannelDiagnosis, or None where it cannot be made.
        found: the palpation map, or None where there is none.
        given: what of the readings cannot be right, by whoever looked at all of them.
    """
    unusable = why_unusable((doubt.check.value for doubt in given), math.nan)
    if unusable:  # and whatever else would be said is of other readings than the tissue's
        wrong = [doubt for doubt in given if why_unusable([doubt.check.value], math.nan)]
        return [*map(_doubted, wrong), Sentence(Level.BAD, f"{_capitalised(unusable)}.")]
    if not data.contact.any():
        return [Sentence(Level.BAD, "The tool never touched anything: nothing can be said.")]
    if not (data.contact & data.used).any():
        text = "No sample in contact could be used: nothing can be said."
        return [Sentence(Level.BAD, text), *_losses(data)]
    suspicions = check_both(data.time_s, data.displacement_mm, data.force_n)
    doubts = [_doubted(s) for s in suspicions]
    if any(s.check is Check.STUCK for s in suspicions):
        return doubts
    known = {(s.check, s.channel) for s in suspicions}
    doubts += [_doubted(s) for s in given if (s.check, s.channel) not in known]
    doubt = _of_one_fit(data, channels)
    first = stiffness_found(data, found)
    if doubt:  # nothing to be glad of
        first = [
            one._replace(level=Level.NOTE) if one.level is Level.GOOD else one for one in first
        ]
    sentences = [
        *first,
        *doubt,
        *doubts,
        *_fit(data, contacts, given, doubted=bool(doubts) or _is_dishonest(data)),
        *([] if _more_than_late(given) else _channels(data, channels)),
        *_unseen(data, channels),
        *_zeros(data),
        *_changes(data),
        *_honesty(data),
        *_losses(data),
    ]
    if len(contacts) > 1:
        sentences.append(_spread(contacts))
    return sentences


def stiffness_found(data: RunData, found: StiffnessMap | None) -> list[Sentence]:
    """Return the hard spot, if there is one, and how stiff the tissue is.

    Args:
        data: a run with samples in contact that were used.
        found: the palpation map, or None where there is none.
    """
    scanned = found is not None and found.lump is not None
    return [*_lump(found), *_parameters_found(data, scanned=scanned)]


def settled(data: RunData) -> NDArray[np.bool_]:
    """Mark the samples in contact that were used, without the first second of contact."""
    return force_error.settled(data.time_s, data.contact & data.used)


def _force_at_rest(data: RunData) -> tuple[float, float]:
    """Return the force at DEPTH_MM [N] of the law as it stood last, and its relative variance."""
    last = int(np.flatnonzero(data.contact & data.used)[-1])
    stiffness, _, exponent, _ = data.parameters[last]
    relative = np.array([1.0 / stiffness, float(np.log(DEPTH_MM))])
    variance = relative @ data.covariance[last][np.ix_([0, 2], [0, 2])] @ relative
    return float(stiffness * DEPTH_MM**exponent), float(variance)


def _parameters_found(data: RunData, *, scanned: bool) -> list[Sentence]:
    force, variance = _force_at_rest(data)
    if not variance < UNKNOWN**2:
        return [Sentence(Level.BAD, "The tissue was touched, but its stiffness is not known.")]
    spread = 2.0 * force * float(np.sqrt(variance))
    error = (data.force_n - data.force_predicted_n)[settled(data)]
    rms = float(np.sqrt(np.nanmean(error**2))) if np.isfinite(error).any() else np.nan
    where = ", after it changed last," if data.change_detected.any() else ""
    where = ", where it was felt last," if scanned else where
    takes = f"takes {with_spread(force, spread)} N for {DEPTH_MM:g} mm of depth"
    text = f"At rest the tissue{where} {takes}"
    if np.isfinite(rms):
        text += f"; one step ahead its force is foretold within {engineering(rms, 'N')} (RMS)"
    # Half of the force as its spread is no knowledge to be glad of.
    return [Sentence(Level.GOOD if spread < ROUGHLY * force else Level.NOTE, text + ".")]


def _of_one_fit(data: RunData, channels: Any | None) -> list[Sentence]:
    """Say so where one fit to all readings, which leaves noise alone, says another force.

    A filter that follows what no tissue does ends elsewhere, and is as sure as ever.
    """
    if channels is None or channels.clear_faults:  # what is said of these says why
        return []
    if not channels.residual_rms_n < NOISE_ALONE * channels.noise_n:
        return []
    touched = data.contact & data.used
    last = int(np.flatnonzero(touched)[-1])
    depth = float(np.nanquantile(data.displacement_mm[touched], 0.9))
    if not depth > 0.0:
        return []
    stiffness, _, exponent, _ = data.parameters[last]
    relative = np.array([1.0 / stiffness, float(np.log(depth))])
    variance = relative @ data.covariance[last][np.ix_([0, 2], [0, 2])] @ relative
    force = float(stiffness * depth**exponent)
    of_fit = float(channels.parameters[0] * depth ** channels.parameters[2])
    apart = abs(of_fit - force)
    if not apart > max(APART * force, DEVIATIONS * force * float(np.sqrt(variance))):
        return []
    text = (
        f"One fit to the whole recording leaves noise alone and says {of_fit:.3g} N at rest at "
        f"{depth:.2g} mm, the filter {force:.3g} N: trust neither before hc doctor says why."
    )
    return [Sentence(Level.BAD, text)]


def _lump(found: StiffnessMap | None) -> list[Sentence]:
    if found is None or found.lump is None:
        return []
    return [Sentence(Level.NOTE, f"{found.lump.sentence(found.is_line)}.")]


def _capitalised(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}"


def _doubted(doubt: Suspicion) -> Sentence:
    """Return a doubt of the readings as a sentence; one that the filter allows for is a note."""
    level = Level.NOTE if doubt.check in _ALLOWED_FOR else Level.BAD
    return Sentence(level, f"{_capitalised(doubt.sentence)}.")


def _more_than_late(given: Sequence[Suspicion]) -> bool:
    """Whether something is known that looks like a delay and is more than that."""
    return any(doubt.check in LOOKS_LATE for doubt in given)


def _fit(
    data: RunData, contacts: Sequence[Contact], given: Sequence[Suspicion], *, doubted: bool
) -> list[Sentence]:
    used = data.contact & data.used
    share = float(np.mean(data.model_mismatch[used]))
    if share <= MISMATCH_SHARE:
        if not _force_at_rest(data)[1] < UNKNOWN**2:
            text = "Nothing contradicts the contact law, but this motion hardly tests it."
            return [Sentence(Level.NOTE, text)]
        if doubted:
            return [Sentence(Level.NOTE, "The filter noticed no misfit of the contact law.")]
        return [Sentence(Level.GOOD, "The contact law describes what the sensors say.")]
    text = f"The contact law does not fit in {100 * share:.0f} % of the contact"
    reason = "" if _more_than_late(given) else _places(contacts) or _reason(data)
    return [Sentence(Level.BAD, f"{text}: {reason}." if reason else f"{text}.")]


def _places(contacts: Sequence[Contact]) -> str:
    """Say that several places were pressed, one after another; nothing of a tool that slid."""
    at = np.array([c.position_mm for c in contacts]).reshape(-1, 2)
    slid = any(c.travel_mm > APART_MM for c in contacts)
    if slid or not np.isfinite(at).all():
        return ""
    count = 1 + int(np.count_nonzero(np.hypot(*np.diff(at, axis=0).T) > APART_MM))
    if count < 2:
        return ""
    return (
        f"the tool went to {count} places one after another, and each may have a surface of its "
        "own; hc contacts --sites takes each by itself"
    )


def _reason(data: RunData) -> str:
    """Return why it does not fit, by the stretch in which it fits worst."""
    at = np.flatnonzero(data.model_mismatch & data.used)
    middle = data.time_s[at[len(at) // 2]]
    near = data.used & (np.abs(data.time_s - middle) < 5.0)
    rows = np.flatnonzero(near)[_increasing(data.time_s[near])]
    return explain(*data.together(rows))


def _increasing(times: Array) -> NDArray[np.bool_]:
    return np.append(True, times[1:] > np.maximum.accumulate(times)[:-1])


def _channels(data: RunData, channels: Any | None) -> list[Sentence]:
    """Say by how much the two channels are out of step, or off their zeros."""
    estimated = data.estimates["channel_delay"][-1], data.estimates["channel_delay_std"][-1]
    if np.isfinite(estimated).all() and abs(estimated[0]) > 3.0 * estimated[1]:
        return [Sentence(Level.NOTE, f"{_delay(estimated[0])}; the filter allows for it.")]
    if channels is None:
        return []
    gain = channels.residual_rms_n / max(channels.residual_rms_without_n, 1e-12)
    if gain > 0.85:  # putting it right makes little difference: leave it alone
        return []
    clear = channels.clear_faults
    sentences = []
    if "delay" in clear:
        sentences.append(f"{_delay(channels.delay_s)}")
    if "zero" in clear:
        sentences.append(f"The force reads {engineering(channels.zero_n, 'N')} without contact")
    if "contact" in clear:
        sentences.append(f"Contact begins at {channels.contact_mm:.2g} mm, not at 0")
    better = f"what is left of the force falls to {100 * gain:.0f} % when put right"
    return [Sentence(Level.BAD, f"{text}; {better}.") for text in sentences]


def _delay(delay_s: float) -> str:
    order = "behind" if delay_s > 0.0 else "ahead of"
    return f"The force is {1e3 * abs(delay_s):.3g} ms {order} the displacement"


def _unseen(data: RunData, channels: Any | None) -> list[Sentence]:
    """Say what this motion does not show."""
    last = int(np.flatnonzero(data.contact & data.used)[-1])
    values, deviations = data.parameters[last], data.parameters_std[last]
    known = data.identifiability[last]
    sentences = []
    for i, name in enumerate(("stiffness", "damping", "exponent n", "exponent p")):
        relative = deviations[i] / max(abs(values[i]), 1e-12)
        if known[i] < UNKNOWN or relative > UNKNOWN:
            sentences.append(f"{name.capitalize()} cannot be seen from this motion")
    if channels is not None and "delay" in channels.clear_faults:
        damping = float(channels.parameters[1])
        if damping < 0.3 * values[1]:
            sentences.append(
                f"What looks like damping (B = {values[1]:.3g}) is mostly the delay: "
                f"{damping:.2g} without it"
            )
    return [Sentence(Level.NOTE, f"{text}.") for text in sentences]


def _zeros(data: RunData) -> list[Sentence]:
    """Say what zeros were found, or what zeros that are off would do where they are exact."""
    said = effect_in(data.settings, data.estimates).sentence
    if not said and len(data.estimates):
        zeros = Zeros.in_the_end(
            data.estimates["contact"], lambda k: Zeros.from_message(data.estimates[k].__getitem__)
        )
        words = zeros.with_spread(2.0).words  # as all that stands behind ± on the page
        said = f"{words[0].upper()}{words[1:]}." if words else ""
    return [Sentence(Level.NOTE, said)] if said else []


def _changes(data: RunData) -> list[Sentence]:
    times = data.time_s[data.change_detected]
    if not len(times):
        return []
    at = ", ".join(f"{t:.2f}" for t in times[:5]) + (" …" if len(times) > 5 else "")
    what = "once" if len(times) == 1 else f"{len(times)} times"
    return [Sentence(Level.NOTE, f"The tissue changed {what}, at {at} s.")]


def _mean_nis(data: RunData) -> tuple[float, float]:
    """Return the mean NIS and up to where it may be by chance; NaN where there are few."""
    nis = data.nis[settled(data)]
    nis = nis[np.isfinite(nis)]
    if len(nis) < LEAST_NIS:
        return np.nan, np.nan
    _low, high = chi_square_band(2, len(nis) // 10)  # neighbours are not independent
    return float(np.mean(nis)), high


def _is_dishonest(data: RunData) -> bool:
    mean, high = _mean_nis(data)
    return mean > 1.5 * high


def _honesty(data: RunData) -> list[Sentence]:
    """Say whether errors are as large as stated: those of the force, and of K where it is known."""
    chosen = settled(data)
    mean, high = _mean_nis(data)
    if np.isnan(mean):
        return []
    if _is_dishonest(data):
        text = f"Errors are larger than the filter admits: mean NIS {mean:.3g} (ideal 2)."
        return [Sentence(Level.BAD, text)]
    if mean > max(high, LITTLE_NIS):
        text = f"Errors are a little larger than the filter admits: mean NIS {mean:.1f} (ideal 2)."
        return [Sentence(Level.NOTE, text)]
    if mean < TOO_GOOD_NIS:
        text = (
            f"Errors are far smaller than the filter states: mean NIS {mean:.2g} (ideal 2). Its "
            "noises are too large, or the readings hardly change."
        )
        return [Sentence(Level.NOTE, text)]
    if data.truth is not None and np.isfinite(data.truth[chosen, 0]).any():
        # Of some samples the truth was not recorded: the rig does not wait for a reader of it.
        known = chosen & np.isfinite(data.truth[:, 0])
        error = np.abs(data.parameters[:, 0] - data.truth[:, 0])[known]
        inside = float(np.mean(error <= 3.0 * data.parameters_std[known, 0]))
        level = Level.GOOD if inside > 0.9 else Level.BAD
        where = f"within 3 of its stated deviations in {100 * inside:.0f} % of the contact"
        return [Sentence(level, f"The true K lies {where}; mean NIS {mean:.2f} (ideal 2).")]
    if np.mean(data.model_mismatch[chosen]) > MISMATCH_SHARE:
        return []  # consistent only because the misfit counts as noise
    return [Sentence(Level.GOOD, f"The filter is honest: mean NIS {mean:.2f} (ideal 2).")]


def _losses(data: RunData) -> list[Sentence]:
    refused = int(np.count_nonzero(~data.used))
    sentences = []
    if refused:
        share = 100.0 * refused / len(data.time_s)
        were = "sample was" if refused == 1 else "samples were"
        sentences.append(Sentence(Level.NOTE, f"{refused} {were} refused ({share:.2g} %)."))
    steps = np.diff(data.estimates["sequence"].astype(np.int64))
    onward = (steps > 0) & (steps <= LONGEST_COUNTED_GAP + 1)
    missing = int(np.sum(steps[onward] - 1))
    if missing and counts(len(steps) + 1, int(np.count_nonzero(~onward))):
        are = "sample is" if missing == 1 else "samples are"
        sentences.append(Sentence(Level.NOTE, f"{missing} {are} missing."))
    return sentences


def _spread(contacts: Sequence[Contact]) -> Sentence:
    values = np.array([c.parameters[0] for c in contacts])
    return Sentence(
        Level.NOTE,
        f"{len(contacts)} contacts: K from {values.min():.3g} to {values.max():.3g} N/mmⁿ.",
    )
