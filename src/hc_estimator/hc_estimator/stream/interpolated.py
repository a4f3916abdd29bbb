"""A channel that was interpolated linearly between readings of a lower rate: which are readings.

np.interp, pandas and many an export bring a slow channel to the rate of a fast one so. What lies
between two readings has no noise of its own: taken for readings, they make the estimator believe in
a sensor that is finer and smoother than it is, and K and its deviation are wrong. The readings, or
what is next to them, are found by rate and phase: with the right ones the channel lies on straight
lines to rounding, with others it does not. A ramp or a triangle lies on straight lines as well, but
on few; a channel that rests on one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.linear_comb import FloatArray, misfits

LEAST_SAMPLES = 200
LEAST_RATIO, LARGEST_RATIO = 1.35, 86.0
"""Below, hardly a reading is missed; above, a window would be seconds long."""
_SPAN, _SURE_SPAN = 20, 80
"""Readings in a window of a search, and in one that what was found is tried on."""
_FOLLOW_SPAN = 40
_OCTAVES = (43.0, 21.5, 10.8, 5.4, 2.7, LEAST_RATIO)
_CLOSE = 5.0
"""Ratio beyond which most second differences are zero."""
_DIP = 0.5
"""Of the misfit with any phase: what is left of it with the right one, at most."""
_EXACT = 0.02
"""Of the second differences: a misfit that is none."""
_ROUNDING = 0.4
"""Of the last digit: a misfit that is none; rounding is 0.29 of it."""
_FEWEST_SLOPES = 5
"""A tool that is driven to and fro at constant velocity has three."""
_FREE_OF_NOISE = 0.01
_BENDING = 0.15
"""Share of readings at which the lines bend, if all bends were alike; with noise a third."""
_PIECES = 30
_GOOD_SHARE, _FEWEST_PIECES = 0.7, 3


class Interpolation(NamedTuple):
    """How a channel was interpolated.

    Attributes:
        rate_hz: of its readings.
        keep: which samples are readings, or next to one that lies between two samples, shape (n,).
    """

    rate_hz: float
    keep: NDArray[np.bool_]


def find_interpolation(time_s: FloatArray, values: FloatArray) -> Interpolation | None:
    """Find out whether a channel was interpolated linearly between slower readings.

    Args:
        time_s: stamps [s], shape (n,).
        values: readings, shape (n,), all finite.

    Returns:
        None for a channel that was not, that rests, that is repeated, or of which too little is
        there to say so.
    """
    if len(values) < LEAST_SAMPLES:
        return None
    steps = np.diff(time_s)
    step_s = float(np.median(steps))
    if not step_s > 0.0 or steps.min() < 0.0:
        return None
    second = values[1:-1] - 0.5 * (values[:-2] + values[2:])
    scale = float(np.sqrt(np.mean(second**2)))
    if not scale > 0.0 or np.mean(values[1:] == values[:-1]) > 0.5:
        return None
    channel = _Channel(_places(steps, step_s), values, second, _last_digit(values))
    for start in channel.liveliest():
        found = channel.search(start)
        if found is not None and (track := channel.follow(start, *found)) is not None:
            keep = _nearest(channel.places, *track)
            if _distinct_slopes(channel.places[keep], values[keep]) < _FEWEST_SLOPES:
                return None
            ratio = float(np.median(np.diff(track[0]) / np.diff(track[1])))
            mean_s = float((time_s[-1] - time_s[0]) / channel.places[-1])
            return Interpolation(1.0 / (ratio * mean_s), keep)
    return None


def _places(steps: FloatArray, step_s: float) -> FloatArray:
    """Return where samples lie, in samples: whole where their stamps are rounded only."""
    along = steps / step_s
    whole = np.rint(along)
    if np.quantile(np.abs(along - whole), 0.99) < 0.2 and whole.min() >= 1.0:
        along = whole
    return np.concatenate(([0.0], np.cumsum(along)))


def _last_digit(values: FloatArray) -> float:
    """Return the unit of the last decimal that values are written with; 0 if they are in full."""
    some = values[:: max(1, len(values) // 1000)]
    for digits in range(-2, 10):
        scaled = some * 10.0**digits
        if np.max(np.abs(scaled - np.rint(scaled))) < 1e-4:
            return float(10.0**-digits)
    return 0.0


def _distinct_slopes(places: FloatArray, values: FloatArray) -> int:
    """Return how many velocities there are, to a hundredth of the largest."""
    apart = np.diff(places)
    slopes = np.diff(values)[apart > 0.0] / apart[apart > 0.0]
    largest = float(np.quantile(np.abs(slopes), 0.99)) if len(slopes) else 0.0
    if not largest > 0.0:
        return 0
    _which, counts = np.unique(np.rint(100.0 * slopes / largest), return_counts=True)
    return int(np.count_nonzero(counts >= 2))


def _is_predictable(second: FloatArray) -> bool:
    """Whether each second difference follows from those before: free of noise, as a pure hum is.

    Such a channel is near straight lines of many rates, and as good without its samples as with.
    """
    lags = np.stack([second[3 - k : len(second) - k] for k in (1, 2, 3)], axis=1)
    if not len(lags):
        return True
    now = second[3:]
    weights = np.linalg.lstsq(lags, now, rcond=None)[0]
    left = now - lags @ weights
    return bool(np.sum(left**2) < _FREE_OF_NOISE * np.sum(now**2))


def _nearest(places: FloatArray, at: FloatArray, knots: FloatArray) -> NDArray[np.bool_]:
    """Return the samples that are nearest to each reading.

    Args:
        places: of the samples.
        at: places between which the readings are evenly spaced.
        knots: numbers of the readings there.
    """
    inner = np.diff(knots) / np.diff(at)
    along = np.interp(places, at, knots)
    before, after = places < at[0], places > at[-1]
    along[before] = knots[0] + (places[before] - at[0]) * inner[0]
    along[after] = knots[-1] + (places[after] - at[-1]) * inner[-1]
    number = np.rint(along).astype(np.int64)
    order = np.lexsort((np.abs(along - number), number))
    first = np.concatenate(([True], np.diff(number[order]) != 0))
    keep = np.zeros(len(places), np.bool_)
    keep[order[first]] = True
    return keep


class _Channel(NamedTuple):
    """A channel that is looked at: places [samples], values, second differences, last digit."""

    places: FloatArray
    values: FloatArray
    second: FloatArray
    digit: float

    def liveliest(self) -> list[int]:
        """Return some samples about which the channel bends much."""
        size = 64
        count = len(self.second) // size
        energy = np.mean(self.second[: count * size].reshape(count, size) ** 2, axis=1)
        order = np.argsort(energy)
        picked = dict.fromkeys(int(order[int(q * (count - 1))]) for q in (0.8, 0.5))
        return [i * size + size // 2 for i in picked]

    def window(self, centre: int, readings: float, ratio: float) -> slice:
        """Return the samples about one that hold so many readings."""
        half = math.ceil(0.5 * readings * ratio)
        start = max(0, min(centre - half, len(self.values) - 2 * half))
        return slice(start, min(len(self.values), start + 2 * half))

    def is_exact(self, window: slice, misfit: float) -> bool:
        """Whether a misfit is rounding."""
        inside = self.second[window.start : max(window.start + 1, window.stop - 2)]
        scale = float(np.sqrt(np.mean(inside**2)))
        return misfit <= max(_EXACT * scale, _ROUNDING * self.digit)

    def search(self, centre: int) -> tuple[float, float] | None:
        """Return ratio and phase of the readings about a sample; None if there are none such."""
        if _is_predictable(self.second[self.window(centre, _SURE_SPAN, _CLOSE)]):
            return None
        small = max(_EXACT * float(np.sqrt(np.mean(self.second**2))), 1.5 * self.digit)
        many = np.mean(np.abs(self.second) <= small) > 0.5 * (1.0 - 2.0 / _CLOSE)
        for low in _OCTAVES:
            if low > _CLOSE and not many:
                continue
            if len(self.values) < 2 * _SPAN * low:
                continue
            window = self.window(centre, _SPAN, 2.0 * low)
            some = slice(window.start, window.stop, max(1, int(low / _CLOSE)))
            ratios = low * np.exp(np.arange(0.0, math.log(2.0), 0.014))
            parts = np.arange(12) / 12.0
            grid = (ratios[:, None] + 0.0 * parts).ravel(), np.outer(ratios, parts).ravel()
            origin = self.places[(window.start + window.stop) // 2]
            found = misfits(
                self.places[some], self.values[some], grid[0], origin + grid[1]
            ).reshape(len(ratios), -1)
            middle = np.maximum(np.median(found, axis=1, keepdims=True), 1e-300)
            dips = (found / middle).ravel()
            fits = []
            for i in np.argsort(dips)[:4]:
                ratio, phase, misfit = self._refine(window, grid[0][i], origin + grid[1][i])
                if misfit > _DIP * self._usual(window, ratio):
                    continue
                sure = self.window(centre, _SURE_SPAN, ratio)
                ratio, phase, misfit = self._refine(sure, ratio, phase)
                exact = self.is_exact(sure, misfit) and misfit < _DIP * self._usual(sure, ratio)
                if exact and self._bends_often(sure, ratio, phase):
                    fits.append((ratio, phase))
            if fits:
                return max(fits)
        return None

    def _usual(self, window: slice, ratio: float) -> float:
        """Return the misfit of readings at a rate with any phase."""
        phases = self.places[window.start] + ratio * np.arange(12) / 12.0
        found = misfits(self.places[window], self.values[window], np.full(12, ratio), phases)
        return float(np.median(found))

    def _bends_often(self, window: slice, ratio: float, phase: float) -> bool:
        """Whether the lines bend at more readings than a corner or two of a commanded motion."""
        places, values = self.places[window], self.values[window]
        ends = np.array([phase, phase + ratio])
        keep = _nearest(places, ends, np.array([0.0, 1.0]))
        bends = np.diff(np.diff(values[keep]) / np.diff(places[keep])) ** 2
        return bool(np.sum(bends) ** 2 > _BENDING * len(bends) * np.sum(bends**2))

    def _refine(self, window: slice, ratio: float, phase: float) -> tuple[float, float, float]:
        """Return the ratio and phase near those given with the least misfit, and that."""
        origin = self.places[(window.start + window.stop) // 2]
        phase += ratio * round((origin - phase) / ratio)
        span = 0.5 * float(self.places[window.stop - 1] - self.places[window.start]) / ratio
        by_ratio, by_phase = 0.05 * ratio / span, 0.05 * ratio
        steps = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
        misfit = math.inf
        for _ in range(11):
            ratios = np.repeat(ratio + by_ratio * steps, 5)
            phases = np.tile(phase + by_phase * steps, 5)
            found = misfits(self.places[window], self.values[window], ratios, phases)
            best = int(np.argmin(found))
            ratio, phase, misfit = float(ratios[best]), float(phases[best]), float(found[best])
            by_ratio, by_phase = 0.5 * by_ratio, 0.5 * by_phase
        return ratio, phase, misfit

    def follow(
        self, start: int, ratio: float, phase: float
    ) -> tuple[FloatArray, FloatArray] | None:
        """Follow the readings to both ends of the channel.

        Returns:
            Places, and which reading is there (a number with a fraction); None if straight lines
            describe only a part of the channel.
        """
        ends: list[list[tuple[float, float]]] = []
        good = judged = 0
        size = len(self.values)
        reach = math.ceil(_FOLLOW_SPAN * ratio)
        for direction in (1, -1):
            anchors: list[tuple[float, float]] = []
            here_ratio, here_phase, number = ratio, phase, 0.0
            distance = 0
            while True:
                distance += max(reach, min(distance, size // _PIECES))
                centre = start + direction * distance
                if not reach // 2 <= centre < size - reach // 2:
                    break
                window = self.window(centre, _FOLLOW_SPAN, here_ratio)
                verdict = self._phase_near(window, here_ratio, here_phase)
                if verdict is None:
                    continue
                judged += 1
                there, exact = verdict
                if not exact:
                    continue
                good += 1
                between = round((there - here_phase) / here_ratio)
                if between:
                    number += between
                    here_ratio = (there - phase) / number
                    here_phase = there
                    anchors.append((there, number))
            ends.append(anchors)
        if good < max(_GOOD_SHARE * judged, min(_FEWEST_PIECES, size // (2 * reach) - 1)):
            return None
        track = [*reversed(ends[1]), (phase, 0.0), *ends[0]]
        if len(track) < 2:
            track.append((phase + ratio, 1.0))
        return np.array([p for p, _ in track]), np.array([n for _, n in track])

    def _phase_near(self, window: slice, ratio: float, phase: float) -> tuple[float, bool] | None:
        """Return where a reading lies in a window, and whether all lie on lines; None if it rests.

        The ratio is known well enough to say which of the readings it is.
        """
        origin = self.places[(window.start + window.stop) // 2]
        phase += ratio * round((origin - phase) / ratio)
        if _is_predictable(self.second[window]):
            return None
        places, values = self.places[window], self.values[window]
        offsets = ratio * np.arange(-6.0, 6.0) / 12.0
        found = misfits(places, values, np.full(12, ratio), phase + offsets)
        middle = float(np.median(found))
        if not middle > max(0.5 * self.digit, 1e-12 * float(np.max(np.abs(values)))):
            return None
        near = offsets[int(np.argmin(found))]
        if abs(near) > 0.3 * ratio:
            return phase, False
        _ratio, there, misfit = self._refine(window, ratio, phase + near)
        return there, self.is_exact(window, misfit) and misfit < _DIP * middle
