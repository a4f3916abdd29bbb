"""What the operator does: approach, two presses, palpate, scan over the lump, hold.

The path is where the arm pulls the hand to; positions are mm, positive into the tissue, with the
surface at zero. The hand itself follows with its own mass and is pushed back by what it feels.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.schema import ScenarioError

Array = NDArray[np.float64]

ABOVE_MM = -1.5
"""Between two presses the hand wants to be here: in the air."""
PRESS_MM = 4.5
PRESS_S = 1.5
PLACES_MM = (0.0, 6.0, 12.0, 18.0, 24.0)
LUMP_PLACE = 2
PRESSES_AT_A_PLACE = 2
PALPATION_HZ = 1.0
PALPATION_CYCLES = 6
HOLD_MM = 4.0
HOLD_S = 12.0
LONGEST_MOTION_S = 3600.0
SETTLING_S = 2.0
"""After a hold or a palpation begins; what is judged comes after it."""


class Span(NamedTuple):
    """A part of the task, in the time of the hand [s]."""

    begin: float
    end: float

    def mask(self, time_s: Array) -> NDArray[np.bool_]:
        """Which samples lie in it."""
        return (time_s >= self.begin) & (time_s < self.end)


@dataclass(frozen=True)
class Task:
    """A path with its parts; `path` and `lateral` have one sample more than the task."""

    path: Array
    lateral: Array
    first_contact: Span
    palpation: Span
    hold: Span
    presses: tuple[Span, ...]
    """The last press at each of PLACES_MM."""
    first_presses: tuple[Span, ...]
    """The first press there."""

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.path) - 1


def palpation_task(rate_hz: float, surface_mm: float = 0.0) -> Task:
    """The task of the measurements.

    Args:
        rate_hz: samples per second.
        surface_mm: where the tissue begins.

    Returns:
        About 43 s: approach from 5 mm above, two presses with free motion between, six seconds of
        palpation in contact, two presses at each of five places with the lump at the third, and a
        hold of twelve seconds at the first.
    """
    paths: list[Array] = []
    sideways: list[Array] = []
    now = -5.0
    place = PLACES_MM[0]
    clock = 0.0

    def add(path: Array, lateral: Array | None = None) -> Span:
        nonlocal now, clock, place
        paths.append(path)
        sideways.append(np.full(len(path), place) if lateral is None else lateral)
        now, place = float(path[-1]), float(sideways[-1][-1])
        begin, clock = clock, clock + len(path) / rate_hz
        return Span(begin, clock)

    def ease(target: float, seconds: float) -> Span:
        return add(now + (target - now) * _minimum_jerk(seconds, rate_hz))

    def press(to_place: float) -> Span:
        share = np.arange(1, round(PRESS_S * rate_hz) + 1) / round(PRESS_S * rate_hz)
        depth = ABOVE_MM + (PRESS_MM - ABOVE_MM) * 0.5 * (1.0 - np.cos(2.0 * np.pi * share))
        moved = place + (to_place - place) * np.clip(share / 0.15, 0.0, 1.0)
        return add(depth, moved)

    ease(now, 0.5)
    first = ease(ABOVE_MM, 1.0)
    for _ in range(2):
        first = Span(first.begin, press(place).end)
    middle, swing = 0.5 * (PRESS_MM + 1.0), 0.5 * (PRESS_MM - 1.0)
    ease(middle, 1.0)
    seconds = PALPATION_CYCLES / PALPATION_HZ
    time = np.arange(1, round(seconds * rate_hz) + 1) / rate_hz
    palpation = add(middle + swing * np.sin(2.0 * np.pi * PALPATION_HZ * time))
    ease(ABOVE_MM, 1.0)
    first_presses, presses = [], []
    for target in PLACES_MM:
        there = [press(target) for _ in range(PRESSES_AT_A_PLACE)]
        first_presses.append(there[0])
        presses.append(there[-1])
    add(np.full(round(rate_hz), now), np.linspace(place, PLACES_MM[0], round(rate_hz)))
    ease(HOLD_MM, 1.0)
    hold = ease(HOLD_MM, HOLD_S)
    ease(ABOVE_MM, 1.0)
    path = np.concatenate([paths[0][:1], *paths]) + surface_mm
    lateral = np.concatenate([sideways[0][:1], *sideways])
    return Task(
        path,
        lateral,
        first,
        Span(palpation.begin + SETTLING_S, palpation.end),
        Span(hold.begin + SETTLING_S, hold.end),
        tuple(presses),
        tuple(first_presses),
    )


def recorded_task(path: Path, rate_hz: float, surface_mm: float = 0.0) -> Task:
    """A recorded hand motion as the task: where the arm pulls the hand to.

    Args:
        path: CSV with a heading and the columns time_s and displacement_mm, and lateral_mm if the
            hand moved sideways too.
        rate_hz: samples per second, to which the recording is interpolated.
        surface_mm: displacement 0 of the recording.

    Returns:
        The task. Its parts are those that scores need: `hold` is the last fifth, `palpation` the
        middle, `first_contact` the first fifth; there are no presses.

    Raises:
        ScenarioError: the file cannot be read, has other columns, or times that do not rise.
    """
    try:
        with path.open(encoding="utf-8-sig") as file:
            names = [name.strip() for name in file.readline().split(",")]
            table = np.loadtxt(file, delimiter=",", ndmin=2)
    except (OSError, ValueError) as error:
        raise ScenarioError(f"cannot read the motion {path}: {error}") from error
    missing = [name for name in ("time_s", "displacement_mm") if name not in names]
    if missing or table.shape[0] < 2 or table.shape[1] != len(names):
        wrong = f"has no column {missing[0]}" if missing else "is no table of two rows or more"
        raise ScenarioError(f"the motion {path} {wrong}")
    time = table[:, names.index("time_s")]
    if not (np.isfinite(table).all() and (np.diff(time) > 0.0).all()):
        raise ScenarioError(f"the motion {path} has times that do not rise, or no numbers")
    seconds = float(time[-1] - time[0])
    if not 2.0 / rate_hz <= seconds <= LONGEST_MOTION_S:
        raise ScenarioError(f"the motion {path} lasts {seconds:g} s, at most {LONGEST_MOTION_S:g}")
    even = time[0] + np.arange(round(seconds * rate_hz) + 1) / rate_hz
    displacement = np.interp(even, time, table[:, names.index("displacement_mm")]) + surface_mm
    lateral = np.zeros(len(even))
    if "lateral_mm" in names:
        lateral = np.interp(even, time, table[:, names.index("lateral_mm")])
    ends = [Span(share * seconds, (share + 0.2) * seconds) for share in (0.0, 0.4, 0.8)]
    return Task(displacement, lateral, ends[0], ends[1], ends[2], (), ())


def _minimum_jerk(seconds: float, rate_hz: float) -> Array:
    """From 0 to 1 with the least jerk."""
    share = np.arange(1, round(seconds * rate_hz) + 1) / round(seconds * rate_hz)
    eased: Array = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    return eased


def tremor(
    samples: int, rate_hz: float, std: float, low_hz: float, high_hz: float, seed: int
) -> Array:
    """Force of a tremor [N]: sines of random phase, evenly spaced between two frequencies.

    Args:
        samples: how many.
        rate_hz: samples per second.
        std: standard deviation [N].
        low_hz: lowest frequency.
        high_hz: highest frequency.
        seed: of the phases.

    Returns:
        (samples,) forces.
    """
    frequencies = np.linspace(low_hz, high_hz, 33)
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(frequencies))
    time = np.arange(samples) / rate_hz
    total = np.zeros(samples)
    for frequency, phase in zip(frequencies, phases, strict=True):
        total += np.sin(2.0 * np.pi * frequency * time + phase)
    scaled: Array = std * np.sqrt(2.0 / len(frequencies)) * total
    return scaled
