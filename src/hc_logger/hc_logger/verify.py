"""Recomputes the recorded estimates of a bag and compares them bit by bit.

The samples and the configurations of a bag are enough to recompute its estimates: the estimator
is deterministic, a parameter change holds from a known sample on, its time counts from a recorded
origin, and a state that was loaded is recorded with its configuration. What cannot be recomputed
(the bag begins in the middle of a run, samples are missing) is counted apart and never passed off
as compared.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator import (
    PARAMETER_NAMES,
    Estimator,
    __version__,
    create_estimator,
    parameter_specifications,
)
from hc_estimator.stream.handover import hand_over
from hc_estimator.stream.in_pieces import run_in_pieces
from hc_estimator.stream.taken_off import TakenOff
from hc_estimator.stream.vocabulary import LOADED_STATE, Cause
from hc_logger.errors import BagError
from hc_logger.layout import stamps
from hc_logger.missing_estimates import rows_behind_missing
from hc_logger.mixed_estimates import mixture_in
from hc_logger.recorded import RecordedConfiguration, Recording
from hc_msgs_py.estimate_fields import estimate_fields

FRESH = (Cause.STARTED, Cause.RESET, Cause.TIME_JUMP)
DIFFERENCES_KEPT = 10
SMALLEST = float(np.finfo(np.float64).tiny)
ROUNDING = 1e-9
"""Of a parameter: what two orders of sums come to over minutes; another filter does more."""


class Difference(NamedTuple):
    """One field of one estimate that came out differently."""

    sequence: int
    field: str
    recorded: float
    recomputed: float


@dataclass
class VerificationReport:
    """Result of a comparison.

    Attributes:
        compared: estimates that were recomputed.
        different: how many of them differ in at least one field.
        not_comparable: estimates that could not be recomputed.
        largest: difference of K, B, n or p, over the value.
        notes: why, one line each, and other versions of the software.
        differences: the first few differing fields.
    """

    compared: int = 0
    different: int = 0
    not_comparable: int = 0
    largest: float = 0.0
    notes: list[str] = field(default_factory=list)
    differences: list[Difference] = field(default_factory=list)

    @property
    def equal(self) -> bool:
        """True if something was compared and nothing differs."""
        return self.compared > 0 and self.different == 0

    def lines(self) -> list[str]:
        """Return what to tell the user, one line each."""
        lines = [f"{self.compared} estimates recomputed, {self.different} different"]
        if self.different:
            line = f"K, B, n and p differ by up to {self.largest:.0e} of their value"
            if self.largest < ROUNDING:
                line += ": rounding, of another processor or version of a library"
            lines.append(line)
        if self.not_comparable:
            lines.append(f"{self.not_comparable} estimates could not be recomputed")
        lines += self.notes
        lines += [
            f"sample {d.sequence}: {d.field} recorded {d.recorded!r}, recomputed {d.recomputed!r}"
            for d in self.differences
        ]
        return lines


class _Segment(NamedTuple):
    """Consecutive estimates under one revision, of one life of the node."""

    life: int
    revision: int
    start: int
    end: int


def verify(recording: Recording) -> VerificationReport:
    """Recompute the estimates of a bag and compare every field with the recorded one.

    Args:
        recording: a bag with samples, estimates and configurations.

    Raises:
        BagError: if the recording has no estimates or no configurations, or those of several
            estimators, mixed.
    """
    estimates, configurations = recording.estimates, recording.configurations
    if not len(estimates):
        raise BagError(f"{recording.path} has no recorded estimates to verify")
    if not configurations:
        raise BagError(f"{recording.path} has no recorded configurations: nothing says how")
    if mixture := mixture_in(recording):
        raise BagError(f"{recording.path} cannot be verified: {mixture}")
    report = VerificationReport()
    versions = sorted({c.software_version for c in configurations} - {__version__})
    if versions:
        report.notes.append(
            f"recorded with version {', '.join(versions)} of hc_estimator, recomputed with "
            f"{__version__}"
        )
    rows = _sample_rows(recording, estimates)
    behind_missing = rows_behind_missing(recording)
    lives = _lives(configurations)
    estimator: Estimator | None = None
    taken_off = TakenOff()
    life, revision = -1, 0
    for segment in _segments(estimates):
        if segment.life != life:
            life, revision, estimator, taken_off = segment.life, 0, None, TakenOff()
        known = lives[life] if life < len(lives) else {}
        reason = ""
        while revision < segment.revision:
            revision += 1
            configuration = known.get(revision)
            if configuration is None:
                estimator, reason = None, f"configuration revision {revision} was not recorded"
                continue
            estimator, reason = _configured(estimator, configuration, known.get(revision - 1))
        own = rows[segment.start : segment.end]
        chosen = known.get(segment.revision)
        is_fresh = chosen is not None and chosen.cause in FRESH
        if chosen is not None and is_fresh and estimator is not None:
            first = int(estimates["sequence"][segment.start])
            if first != chosen.valid_from_sequence:
                reason = (
                    f"revision {segment.revision} began at sample {chosen.valid_from_sequence}, "
                    f"the first recorded estimate is of sample {first}: what the filter knew by "
                    "then is not in the bag; verify the one that begins with the run"
                )
                estimator = None
        taken_off.configure({} if chosen is None else chosen.parameters)
        places, forces = taken_off.of_many(
            recording.stamps[own], recording.displacement_mm[own], recording.force_n[own]
        )
        missing = np.flatnonzero(own < 0)
        gaps = behind_missing[
            (behind_missing >= segment.start + is_fresh) & (behind_missing < segment.end)
        ]
        known_until = min([len(own), *missing[:1].tolist(), *(gaps[:1] - segment.start).tolist()])
        if estimator is None or chosen is None:
            known_until = 0
        elif known_until:
            some = slice(known_until)
            recorded = estimates[segment.start : segment.end][some]
            readings = (places[some], forces[some])
            _compare(estimator, chosen, recording, own[some], readings, recorded, report)
        if known_until < len(own) and estimator is not None:
            were = "was" if len(missing) == 1 else "were"
            reason = f"{len(missing)} of their samples {were} not recorded"
            if not len(missing):
                reason = "estimates and samples before them were not recorded"
            estimator = None
        if count := len(own) - known_until:
            report.not_comparable += count
            report.notes.append(f"{count} estimates: {reason or 'what came before is not known'}")
    return report


def _sample_rows(recording: Recording, estimates: NDArray[Any]) -> NDArray[np.int64]:
    """Return for each estimate the row of its sample in the recording, -1 without one."""
    keys = zip(recording.stamps.tolist(), recording.sequence.tolist(), strict=True)
    places = {key: row for row, key in enumerate(keys)}
    wanted = zip(stamps(estimates).tolist(), estimates["sequence"].tolist(), strict=True)
    return np.array([places.get(key, -1) for key in wanted], np.int64)


def _lives(
    configurations: list[RecordedConfiguration],
) -> list[dict[int, RecordedConfiguration]]:
    """Return the configurations by revision, for each life of the node.

    A revision is told again with its time origin once the first sample is there; the later one
    counts. A node that was started again counts from 1 again.
    """
    lives: list[dict[int, RecordedConfiguration]] = []
    newest = 0
    for configuration in configurations:
        if not lives or configuration.revision < newest:
            lives.append({})
        newest = configuration.revision
        lives[-1][newest] = configuration
    return lives


def _segments(estimates: NDArray[Any]) -> Iterator[_Segment]:
    revision = estimates["configuration_revision"].astype(np.int64)
    starts = np.flatnonzero(np.diff(revision, prepend=revision[0] - 1))
    ends = np.append(starts[1:], len(revision))
    life = newest = 0
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        number = int(revision[start])
        life += number < newest
        newest = number
        yield _Segment(life, number, start, end)


def _configured(
    estimator: Estimator | None,
    configuration: RecordedConfiguration,
    before: RecordedConfiguration | None,
) -> tuple[Estimator | None, str]:
    """Return the estimator as it is once a revision is in force, or None and why not."""
    parameters = _parameters(configuration)
    try:
        unknown = _unknown(configuration, parameters)
        if unknown:
            return None, (
                f"revision {configuration.revision} is of another version of the suite, whose "
                f"{configuration.filter} had {', '.join(unknown)}: only that one can repeat it"
            )
        if configuration.cause == Cause.STATE_LOADED:
            return _restored(configuration, parameters)
        if configuration.cause in FRESH:
            return _created(configuration, parameters), ""
        if estimator is None or before is None:
            return None, ""
        if _kind(configuration) != _kind(before):
            return hand_over(estimator, _created(configuration, parameters)), ""
        old = _parameters(before)
        changed = {n: v for n, v in parameters.items() if n not in old or old[n] != v}
        if changed:
            estimator.reconfigure(**changed)
    except ValueError as error:
        return None, f"revision {configuration.revision} cannot be repeated: {error}"
    return estimator, ""


def _restored(
    configuration: RecordedConfiguration, parameters: dict[str, Any]
) -> tuple[Estimator | None, str]:
    """Return the estimator as it goes on from the state that a revision loaded."""
    text = configuration.parameters.get(LOADED_STATE)
    if not isinstance(text, str):
        return None, f"revision {configuration.revision} loaded a state that was not recorded"
    estimator = _created(configuration, parameters)
    estimator.restore(json.loads(text))
    return estimator, ""


def _kind(configuration: RecordedConfiguration) -> tuple[str, str, str]:
    return configuration.filter, configuration.state_space, configuration.contact_model


def _parameters(configuration: RecordedConfiguration) -> dict[str, Any]:
    """Return the estimator's own parameters, without the input's and a loaded state."""
    return {
        name: value
        for name, value in configuration.parameters.items()
        if not (name.startswith("input.") or name == LOADED_STATE)
    }


def _unknown(configuration: RecordedConfiguration, parameters: dict[str, Any]) -> list[str]:
    """Return the recorded parameters that no filter of this kind has any more."""
    kind = _kind(configuration)
    known = {s.name for s in parameter_specifications(*kind, internal=parameters)}
    return sorted(set(parameters) - known)


def _created(configuration: RecordedConfiguration, parameters: dict[str, Any]) -> Estimator:
    return create_estimator(
        configuration.filter,
        state_space=configuration.state_space,
        contact_model=configuration.contact_model,
        **parameters,
    )


def _compare(
    estimator: Estimator,
    configuration: RecordedConfiguration,
    recording: Recording,
    rows: NDArray[np.int64],
    readings: tuple[NDArray[np.float64], NDArray[np.float64]],
    recorded: NDArray[Any],
    report: VerificationReport,
) -> None:
    """Run the estimator over displacements [mm] and forces [N] of a segment and compare."""
    displacement_mm, force = readings
    series = run_in_pieces(
        estimator,
        (recording.stamps[rows] - configuration.time_origin_ns) * 1e-9,
        displacement_mm,
        force,
    )
    differs = np.zeros(len(rows), bool)
    for name, recomputed in estimate_fields(series, force):
        if name not in (recorded.dtype.names or ()):
            continue  # recorded before the message had this field
        kept = recorded[name]
        if kept.shape != recomputed.shape:
            raise BagError(f"{recording.path}: {name} of the recorded estimates has another size")
        wrong = ~((kept == recomputed) | (np.isnan(kept) & np.isnan(recomputed)))
        wrong_rows = wrong.any(axis=1) if wrong.ndim > 1 else wrong
        differs |= wrong_rows
        if name in PARAMETER_NAMES and wrong_rows.any():
            larger = np.maximum(np.maximum(np.abs(kept), np.abs(recomputed)), SMALLEST)
            apart = np.abs(kept - recomputed) / larger
            report.largest = max(report.largest, float(np.nanmax(apart, initial=0.0)))
        for row in np.flatnonzero(wrong_rows)[: DIFFERENCES_KEPT - len(report.differences)]:
            place = (row, int(np.argmax(wrong[row]))) if wrong.ndim > 1 else row
            report.differences.append(
                Difference(
                    int(recorded["sequence"][row]),
                    name,
                    float(kept[place]),
                    float(recomputed[place]),
                )
            )
    report.compared += len(rows)
    report.different += int(np.count_nonzero(differs))
