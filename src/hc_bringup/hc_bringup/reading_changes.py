"""A recording whose sensors were read otherwise in the middle: said, and judged in one piece.

A bag of `hc run` with a tare in it has readings with two zeros. Each stretch is right by itself;
together they are no recording of one tissue.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.readings import LEAST_SAMPLES, Check, Suspicion, moves
from hc_logger.events import ReadingChange

_LONG_NUMBER = re.compile(r"-?\d+\.\d{5,}(e-?\d+)?")
_NEAR_S = 0.1
"""A step so near to a change is the change."""


class Stretch(NamedTuple):
    """Samples that were read alike.

    Attributes:
        chosen: which samples of the recording, shape (samples,).
        begin_s: time of the first one [s].
        end_s: time of the last one [s].
    """

    chosen: NDArray[np.bool_]
    begin_s: float
    end_s: float


def change_lines(changes: Sequence[ReadingChange], origin_ns: int) -> list[str]:
    """Return a line for each change: when, and how the sensors are read from then on.

    Args:
        changes: in order.
        origin_ns: stamp of the first sample, from which times count.
    """
    return [
        f"the sensors were read otherwise from {(c.stamp_ns - origin_ns) * 1e-9:.2f} s on: "
        + _LONG_NUMBER.sub(lambda number: f"{float(number[0]):.6g}", c.settings)
        for c in changes
    ]


def longest_stretch(
    stamps: NDArray[np.int64], time_s: NDArray[np.float64], changes: Sequence[ReadingChange]
) -> Stretch:
    """Return the stretch between changes that has the most samples.

    Args:
        stamps: of the samples [ns], shape (samples,).
        time_s: their times [s], shape (samples,).
        changes: in order.
    """
    parts = _parts(stamps, changes)
    return _stretch(parts == np.bincount(parts).argmax(), time_s)


def judged_stretch(recording: Any) -> Stretch | None:
    """Return the last stretch in which the tool pressed, for what is told of a recording.

    Its parameters are those of its end. Where it pressed in none, the longest.

    Args:
        recording: hc_logger.recorded.Recording.

    Returns:
        The stretch; None where the sensors were read alike throughout.
    """
    changes = recording.reading_changes
    if not changes:
        return None
    parts = _parts(recording.stamps, changes)
    for part in np.unique(parts)[::-1]:
        chosen = parts == part
        channels = recording.displacement_mm[chosen], recording.force_n[chosen]
        finite = [values[np.isfinite(values)] for values in channels]
        if all(len(values) >= LEAST_SAMPLES and moves(values) for values in finite):
            return _stretch(chosen, recording.time_s)
    return longest_stretch(recording.stamps, recording.time_s, changes)


def read_alike(
    recording: Any,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return times [s], displacements [mm] and forces [N] of what is judged of a recording.

    Args:
        recording: hc_logger.recorded.Recording.
    """
    stretch = judged_stretch(recording)
    chosen = slice(None) if stretch is None else stretch.chosen
    return recording.time_s[chosen], recording.displacement_mm[chosen], recording.force_n[chosen]


def _parts(stamps: NDArray[np.int64], changes: Sequence[ReadingChange]) -> NDArray[np.int64]:
    """Return how many changes came before each sample, shape (samples,)."""
    return np.searchsorted(np.array([c.stamp_ns for c in changes]), stamps, side="left")


def _stretch(chosen: NDArray[np.bool_], time_s: NDArray[np.float64]) -> Stretch:
    """Return samples with the time of the first and the last one."""
    return Stretch(chosen, float(time_s[chosen][0]), float(time_s[chosen][-1]))


def judged_line(stretch: Stretch) -> str:
    """Return what of a recording is judged."""
    return (
        f"judged is the longest part that was read alike, {stretch.begin_s:.2f} to "
        f"{stretch.end_s:.2f} s"
    )


def unexplained(
    suspicions: Iterable[Suspicion], changes: Sequence[ReadingChange], origin_ns: int
) -> list[Suspicion]:
    """Return the suspicions without zeros of which it is known who took them anew."""
    at_s = [(c.stamp_ns - origin_ns) * 1e-9 for c in changes]

    def is_known(doubt: Suspicion) -> bool:
        if doubt.check is not Check.ZERO_STEP:
            return False
        time_s = doubt.since_s if math.isfinite(doubt.since_s) else doubt.until_s
        return any(abs(time_s - t) < _NEAR_S for t in at_s)

    return [doubt for doubt in suspicions if not is_known(doubt)]


def surface_std_at(recording: Any, end_ns: int) -> float:
    """Return how well the surface was known at the end of a stretch [mm]; 0 if nobody said.

    Args:
        recording: hc_logger.recorded.Recording of a bag.
        end_ns: stamp of the stretch's last sample.
    """
    from hc_estimator.stream.vocabulary import CONTACT_POSITION_STD

    known = [c for c in recording.configurations if c.stamp_ns <= end_ns]
    return float(known[-1].parameters.get(CONTACT_POSITION_STD, 0.0)) if known else 0.0
