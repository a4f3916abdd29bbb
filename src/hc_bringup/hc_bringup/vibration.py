"""A vibration of one frequency in one channel and not in the other: a pump, a motor, mains hum.

Tissue answers to a tool that vibrates, so that a vibration that is felt stands in both channels.
One that stands in a single channel is made by its sensor, or between it and the tip. It is a line
of the spectrum that stands alone: of a tool that taps there are many, each little less than the
one before.
"""

from __future__ import annotations

import dataclasses
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_bringup.finding import DISTURBED_SHARE, Finding, cost_of, cures
from hc_bringup.treated_samples import Estimated, Samples
from hc_estimator.stream.readings import noise
from hc_evaluation.channels import evenly_spaced
from hc_evaluation.sensor_effects import DISPLACEMENT, FORCE

Array = NDArray[np.float64]

LOWEST_HZ: Final = 4.0
"""What is slower may be a hand, or breath, and moves the tip."""
FEWEST_PERIODS: Final = 40
BAND: Final = 0.12
"""Of the frequency, to either side: what belongs to the line, of an amplitude that varies too."""
AROUND: Final = 0.4
"""Of the frequency, to either side: where no other line may stand."""
STANDS_OUT: Final = 5.0
"""Times the largest of those around."""
LEAST_NOISES: Final = 0.7
"""Of the amplitude: what is less disturbs no filter."""
LEAST_SHARE: Final = 0.004
"""Of the channel's standard deviation."""
IN_THE_OTHER: Final = 3.0
"""Times the largest of those around: a line is in the other channel too, and the tip moves."""
AS_MUCH: Final = 0.3
"""Of what stands here, as shares of how both move on the whole: the same."""
_TRIED: Final = 3
"""Lines, the largest first."""


class Vibration(NamedTuple):
    """A line in one channel.

    Attributes:
        channel: FORCE or DISPLACEMENT.
        frequency_hz: where it is.
        amplitude: half of what it goes up and down, the root of its mean square times the root
            of two, in N or mm.
    """

    channel: str
    frequency_hz: float
    amplitude: float

    @property
    def words(self) -> str:
        """A sentence: what is seen, and what to do."""
        here, other, unit = "position", "force", "mm"
        if self.channel == FORCE:
            here, other, unit = "force", "position", "N"
        return (
            f"a vibration of {self.frequency_hz:.1f} Hz and ± {self.amplitude:.2g} {unit} in the "
            f"{here}, and none in the {other}: a pump, a motor, a fan, the mains or a loose mount, "
            "which the law does not fit: switch it off or keep it away from the sensor; no setting "
            "takes it off"
        )


def find_vibration(even: tuple[Array, Array, Array]) -> Vibration | None:
    """Return the clearest vibration that stands in one channel alone; None where there is none.

    Args:
        even: evenly spaced stamps [s], penetration [mm] and force [N], each of shape (n,).
    """
    time_s, depth, force = even
    if len(time_s) < 2 * FEWEST_PERIODS:
        return None
    step_s = float(time_s[1] - time_s[0])
    spreads = np.array([np.std(depth), np.std(force)])
    if not (np.isfinite(spreads).all() and (spreads > 0.0).all()):
        return None
    window = np.hanning(len(time_s))
    spectra = np.array(
        [
            np.abs(np.fft.rfft(window * (column - column.mean()) / spread))
            for column, spread in zip((depth, force), spreads, strict=True)
        ]
    )
    frequencies = np.asarray(np.fft.rfftfreq(len(time_s), step_s), np.float64)
    found = []
    for index, (name, column) in enumerate(((DISPLACEMENT, depth), (FORCE, force))):
        at = _line(frequencies, spectra[index])
        if not at:
            continue
        near = _between(frequencies, at * (1.0 - BAND), at * (1.0 + BAND))
        here, there = (np.linalg.norm(spectra[i][near]) for i in (index, 1 - index))
        shows = _stands_out(frequencies, spectra[1 - index], at) > IN_THE_OTHER
        if shows or there > AS_MUCH * here or _is_overtone(frequencies, spectra, at):
            continue
        amplitude = float(np.sqrt(2.0) * np.std(_band(column, step_s, at)))
        if amplitude > max(LEAST_NOISES * noise(column), LEAST_SHARE * spreads[index]):
            found.append((amplitude / spreads[index], Vibration(name, at, amplitude)))
    return max(found)[1] if found else None


def _line(frequencies: Array, spectrum: Array) -> float:
    """Return the frequency of the largest line that stands alone [Hz]; 0 without one."""
    lowest = max(LOWEST_HZ, FEWEST_PERIODS * frequencies[1])
    weighed = np.where(frequencies < lowest, 0.0, spectrum * frequencies)
    # What a motion leaves falls off faster than the frequency grows.
    for place in np.argsort(weighed)[::-1][:_TRIED]:
        at = float(frequencies[place])
        if not weighed[place]:
            return 0.0
        if _stands_out(frequencies, spectrum, at) > STANDS_OUT:
            return at
    return 0.0


def _stands_out(frequencies: Array, spectrum: Array, at: float) -> float:
    """Return how many times as large the line at a frequency is as the largest around it."""
    near = _between(frequencies, at * (1.0 - BAND), at * (1.0 + BAND))
    around = _between(frequencies, at * (1.0 - AROUND), at * (1.0 + AROUND)) & ~near
    largest = float(np.max(spectrum[around], initial=0.0))
    return float(np.max(spectrum[near])) / largest if largest else 0.0


def _is_overtone(frequencies: Array, spectra: Array, at: float) -> bool:
    """Whether a motion of half or a third of the frequency makes it: no law is linear."""
    near = _between(frequencies, at * (1.0 - BAND), at * (1.0 + BAND))
    for part in (2.0, 3.0):
        low, high = (at / part * (1.0 + side * BAND) for side in (-1.0, 1.0))
        below = _between(frequencies, low, high)
        if below.any() and float(np.max(spectra[:, below])) > float(np.max(spectra[:, near])):
            return True
    return False


def _between(frequencies: Array, low: float, high: float) -> NDArray[np.bool_]:
    return (frequencies >= low) & (frequencies <= high)


def _band(column: Array, step_s: float, at: float) -> Array:
    """Return what of a channel lies around a frequency, shape (n,)."""
    # The ends are led to one another, so that a motion that does not end where it began leaves
    # nothing in the band.
    ramp = np.linspace(column[0], column[-1], len(column))
    spectrum = np.fft.rfft(column - ramp)
    frequencies = np.asarray(np.fft.rfftfreq(len(column), step_s), np.float64)
    spectrum[~_between(frequencies, at * (1.0 - BAND), at * (1.0 + BAND))] = 0.0
    return np.fft.irfft(spectrum, len(column))


def vibration_taken_off(
    samples: Samples, before: Estimated | None
) -> tuple[list[Finding], Estimated | None]:
    """Name a vibration where the law does not fit for it; return what the samples give without.

    Args:
        samples: they are put right, if the law fits then.
        before: what they give.
    """
    if before is None or before.mismatch <= DISTURBED_SHARE:
        return [], before
    try:
        even = evenly_spaced(samples.time_s, samples.displacement_mm, samples.force_n)
    except ValueError:  # mostly gaps, or too few rows
        return [], before
    found = find_vibration(even)
    if found is None:
        return [], before
    tried = dataclasses.replace(samples)
    column = even[2] if found.channel == FORCE else even[1]
    step_s = float(even[0][1] - even[0][0])
    off = np.interp(samples.time_s, even[0], _band(column, step_s, found.frequency_hz))
    if found.channel == FORCE:
        tried.force_n = tried.force_n - off
    else:
        tried.displacement_mm = tried.displacement_mm - off
    after = tried.estimate()
    if not cures(before, after):
        return [], before
    samples.take_over(tried)
    return [Finding(found.words, {}, cost_of(before, after, True))], after
