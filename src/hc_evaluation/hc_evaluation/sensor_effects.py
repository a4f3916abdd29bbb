"""What a sensor, or its driver, made of a channel: a low-pass, a moving mean, a memory.

All of them look like a delay, and put right as one they leave another tissue. So each is put behind
the contact law (of a force), or taken off the motion before it (of a displacement), its size is
fitted with K, B, n, p, the force's zero and the contact position, and whichever leaves far less of
the force than a delay, play and a frame that gives way do has the word. A memory is that of a
spring with hysteresis: what is read follows the force behind a gap (Prandtl's play operator),
however slowly it changes.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize_scalar
from scipy.signal import savgol_filter

from hc_estimator.contact.arrays import force_gradient, hunt_crossley_force
from hc_evaluation.behind_sensor import DELAY, LOW_PASS, MEAN, MEMORY, behind
from hc_evaluation.channels import (
    CLEARLY_BETTER,
    EXPONENT_PRIOR,
    FIFTH_DIFFERENCES,
    SMOOTHING_S,
    WIDE_ORDER,
    parameters_of,
    white_noise_std,
)
from hc_evaluation.play import behind_play

Array = NDArray[np.float64]
Motion = tuple[Array, Array]

FORCE: Final = "force"
DISPLACEMENT: Final = "displacement"
BOTH: Final = "displacement and force"
_PLAY, _COMPLIANCE = "play", "compliance"
_TIMES_S: Final = np.geomspace(0.003, 0.15, 8)
"""Of low-passes: 1 / (2 pi corner)."""
_LENGTHS_S: Final = np.geomspace(0.01, 0.5, 9)
_SHARES: Final = np.geomspace(0.003, 0.15, 7)
"""Of the force's range, or of the stroke: gaps."""
_YIELDS: Final = np.geomspace(0.01, 0.6, 6)
"""Of the stroke: what a compliance takes of it at the largest force."""
_DELAYS_S: Final = np.array([-0.06, -0.03, -0.01, 0.0, 0.01, 0.02, 0.03, 0.05, 0.08])
MOST_HZ: Final = 250.0
MOST_ROWS: Final = 4000
FEWEST_ROWS: Final = 200
LEAST_GAIN: Final = 4.0
"""Times by which it leaves less than a delay or play, beyond noise and by mean square, where it
leaves noise alone."""
LARGE_GAIN: Final = 5.0
"""The same where it leaves more than noise."""
LEAST_RATIO: Final = 1.1
"""Of mean squares: that left with a delay or play to that left with it, in any case."""
SMOOTH_RATIO: Final = 2.0
"""The same of what smooths, unless what is left is the noise as it is behind that."""
_COLOURED: Final = (3.0, 0.6)
"""Times the white noise that is behind it; of that, what is left at least."""
BOTH_RATIO: Final = 8.0
"""The same of both channels alike."""
MOST_NOISES: Final = 1.5
_MARGIN: Final = 1.15  # of the noise, which is known no better
NOISIEST: Final = 0.05
"""Of the force's range: what is behind a low-pass may have been white noise of so much."""
EXPONENTS: Final = (0.85, 4.0)
"""n of tissue: with another one something else is wrong."""
LEAST_EFFECT: Final = 0.003
"""Of the force's range: what is taken off, by root mean square."""
_TOGETHER_S: Final = 0.1  # rows that say as much as one
_LIKELIEST: Final = 3
_NEAR: Final = np.array([0.85, 1.0, 1.15])
"""Times a size, where it is looked for again with the motion smoothed less."""
_STEPS, _LAST_STEPS, _TRIES = 12, 30, 10
_ROUNDING: Final = 3e-4
"""Of the force's range: errors of the law itself, so that readings free of noise are no quarry."""


class Effect(NamedTuple):
    """What a sensor made of a channel.

    Attributes:
        kind: MEAN, MEMORY, or one of LOW_PASS.
        channel: FORCE, DISPLACEMENT, or BOTH alike.
        size: length of the mean [s], width of the gap [N], 1 / (2 pi corner) of a low-pass [s].
        left_n: RMS of the force that the law leaves with it [N].
        left_otherwise_n: RMS that it leaves with a delay, play or compliance, the least [N].
        parameters: K, B, n, p, force zero [N] and contact position [mm] with it, shape (6,).
    """

    kind: str
    channel: str
    size: float
    left_n: float
    left_otherwise_n: float
    parameters: Array


def find_effect(time_s: Array, displacement_mm: Array, force_n: Array) -> Effect | None:
    """Return the effect that explains what nothing else does; None where there is none.

    Args:
        time_s: evenly spaced instants, shape (n,).
        displacement_mm: readings, shape (n,).
        force_n: readings, shape (n,).
    """
    law = _law_of_slow_motion(time_s, displacement_mm, force_n)
    if law is None:
        return None
    otherwise_n = law.left_otherwise()
    of_one = [*law.smoothed(FORCE), *law.smoothed(DISPLACEMENT)]
    of_one.append(law.scan(MEMORY, FORCE, _SHARES * law.range_n))
    likeliest = sorted(of_one, key=_left)[:_LIKELIEST]
    found = _explained(law, min(map(law.with_less_smoothing, likeliest), key=_left), otherwise_n)
    if found is not None:
        return found
    # That smooths the noise of the position as well, for which alone it leaves less.
    of_both = min(law.smoothed(BOTH), key=_left)
    return _explained(law, of_both, otherwise_n, anyway=BOTH_RATIO)


def mean_of(
    channels: Collection[str], length_s: float, readings: tuple[Array, Array, Array]
) -> Effect | None:
    """Return a moving mean of a length that is known, of these channels at least.

    Args:
        channels: FORCE, DISPLACEMENT, or both of them: known to be means.
        length_s: of the mean [s].
        readings: evenly spaced instants [s], displacement [mm] and force [N], shape (n,) each.

    Returns:
        That of BOTH where this explains more; None where something else explains as much.
    """
    law = _law_of_slow_motion(*readings)
    if law is None:
        return None
    candidates = (*channels, BOTH) if len(channels) == 1 else (BOTH,)
    tried = [law.with_effect(MEAN, one, length_s, None, _LAST_STEPS) for one in candidates]
    best = min(map(law.with_less_smoothing, tried), key=_left)
    anyway = BOTH_RATIO if best.channel == BOTH else LEAST_RATIO
    return _explained(law, best, law.left_otherwise(), anyway)


def _left(effect: Effect) -> float:
    return effect.left_n


def _explained(
    law: _Law, best: Effect, otherwise: float, anyway: float = LEAST_RATIO
) -> Effect | None:
    """Return an effect if it explains far more than a delay, play and compliance do.

    Args:
        law: over the readings.
        best: the effect.
        otherwise: what the law leaves with the others [N].
        anyway: times by which it leaves less by mean square, whatever is noise.
    """
    noise_n = max(law.noise_n, _ROUNDING * law.range_n)
    allowed_n = max(noise_n, law.noise_behind(best))
    here = max(best.left_n**2 - (_MARGIN * allowed_n) ** 2, 0.0)
    floor_n = max(min(allowed_n, best.left_n), noise_n)
    there = max(otherwise**2 - floor_n**2, 0.0)
    fits = best.left_n < MOST_NOISES * allowed_n
    gain = LEAST_GAIN if fits else LARGE_GAIN
    clear = LEAST_GAIN * here < there if fits else LARGE_GAIN * best.left_n**2 < otherwise**2
    as_behind = _COLOURED[0] * law.noise_n < allowed_n and best.left_n > _COLOURED[1] * allowed_n
    if best.kind != MEMORY and not as_behind:
        anyway = max(anyway, SMOOTH_RATIO)
    clear &= otherwise**2 > anyway * best.left_n**2
    enough = gain * noise_n**2 * _TOGETHER_S * law.rate_hz < there * law.rows
    plausible = EXPONENTS[0] < best.parameters[2] < EXPONENTS[1]
    if not (plausible and clear and enough and law.taken_off(best) > LEAST_EFFECT * law.range_n):
        return None
    return best._replace(left_otherwise_n=otherwise)


def without(
    effect: Effect, time_s: Array, displacement_mm: Array, force_n: Array
) -> tuple[Array, Array]:
    """Return what is to be added to displacement [mm] and force [N] for the effect to be gone.

    Args:
        effect: as found.
        time_s: evenly spaced instants, shape (n,).
        displacement_mm: readings, shape (n,).
        force_n: readings, shape (n,).
    """
    law = _Law(time_s, displacement_mm, force_n, SMOOTHING_S[0], 3)
    added_mm, motion = np.zeros(len(time_s)), law.motion
    if effect.channel != FORCE:
        motion = law.motion_before(effect.kind, effect.size)
        added_mm = motion[0] - law.motion[0]
    if effect.channel == DISPLACEMENT:
        return added_mm, np.zeros(len(time_s))
    columns = law.law_of(_logarithms(effect.parameters), motion)[0][:, None]
    read = behind(effect.kind, columns, effect.size, law.rate_hz)
    return added_mm, (columns - read)[:, 0]


def _logarithms(parameters: Array) -> Array:
    return np.concatenate((np.log(parameters[:2]), parameters[2:]))


def _law_of_slow_motion(time_s: Array, displacement_mm: Array, force_n: Array) -> _Law | None:
    """Return the law over the last readings, thinned, with the smoothing that suits a delay."""
    step = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    every = max(1, int(1.0 / step / MOST_HZ))
    stamps, places, forces = (c[::every][-MOST_ROWS:] for c in (time_s, displacement_mm, force_n))
    if len(stamps) < FEWEST_ROWS or not (np.ptp(forces) > 0.0 and np.ptp(places) > 0.0):
        return None
    best, left = _Law(stamps, places, forces, SMOOTHING_S[0], 3), np.inf
    tried: list[_Law] = []
    for window_s in SMOOTHING_S:
        law = _Law(stamps, places, forces, window_s, 3 if not tried else WIDE_ORDER)
        now = law.scan(DELAY, FORCE, _DELAYS_S).left_n
        if not now < CLEARLY_BETTER * left:
            break
        best, left = law, now
        tried.append(law)
    best.less_smoothed = [law for law in tried if law is not best]
    # The noise is that of all readings.
    best.noise_n = white_noise_std(force_n)
    best.noise_rate_hz = 1.0 / step
    return best


class _Law:
    """The contact law over a recording, with one effect at a time."""

    def __init__(
        self, time_s: Array, place_mm: Array, force_n: Array, window_s: float, order: int
    ) -> None:
        self.rate_hz = 1.0 / float(np.median(np.diff(time_s)))
        self.noise_rate_hz = self.rate_hz
        self.place_mm, self._measured = place_mm, force_n
        self.noise_n = white_noise_std(force_n)
        self.range_n = float(np.ptp(force_n))
        self.less_smoothed: list[_Law] = []
        self._length = max(7, 2 * round(0.5 * window_s * self.rate_hz) + 1)
        self._order = order
        self.motion = self._smooth(place_mm)
        margin = min(max(2, round(0.3 * self.rate_hz)), len(force_n) // 4)
        self._settled = slice(margin, -margin)
        self.rows = len(force_n) - 2 * margin
        zero_n, contact_mm = 0.05 * float(np.max(np.abs(force_n))), 0.1 * float(np.ptp(place_mm))
        self._prior = np.array([EXPONENT_PRIOR, zero_n, contact_mm])
        deepest = max(float(np.max(place_mm)), 0.1)
        first = np.log(max(float(np.max(force_n)), 1e-9) / deepest**1.5)
        self._start = np.array([first, first - 3.0, 1.5, 1.0, 0.0, 0.0])
        infinite = np.inf
        self._lower = np.array([-20.0, -20.0, 0.5, 0.4, -infinite, -infinite])
        self._upper = np.array([12.0, 10.0, 5.0, 2.0, infinite, infinite])

    def _smooth(self, place_mm: Array) -> Motion:
        return self._derivative(place_mm, 0), self._derivative(place_mm, 1)

    def _derivative(self, values: Array, of: int) -> Array:
        order = max(self._order, of + 1)
        step = 1.0 / self.rate_hz
        result: Array = savgol_filter(values, self._length, order, deriv=of, delta=step)
        return result

    def motion_before(self, kind: str, size: float) -> Motion:
        """Return depth [mm] and velocity [mm/s] before something was done to the displacement."""
        if kind == _PLAY:
            return self._smooth(behind_play(self.place_mm, size))
        if kind == _COMPLIANCE:  # of the frame, or of tissue in layers
            return self._smooth(self.place_mm - size * self._measured)
        place, velocity, bend, jerk = (self._derivative(self.place_mm, of) for of in range(4))
        if kind == LOW_PASS[0]:
            return place + size * velocity, velocity + size * bend
        if kind == LOW_PASS[1]:
            first, second = np.sqrt(2.0) * size, size**2
            ahead = place + first * velocity + second * bend
            return ahead, velocity + first * bend + second * jerk
        share = size**2 / 24.0
        rows = np.arange(len(place), dtype=np.float64)
        later = np.minimum(rows + 0.5 * size * self.rate_hz, rows[-1])
        return (
            np.interp(later, rows, place - share * bend),
            np.interp(later, rows, velocity - share * jerk),
        )

    def law_of(self, x: Array, motion: Motion) -> tuple[Array, Array]:
        """Return the force [N], shape (n,), and its derivatives by x, shape (n, 6)."""
        depth, velocity = motion[0] - x[5], motion[1]
        parameters = parameters_of(x)
        force = hunt_crossley_force(depth, velocity, parameters)
        by = force_gradient(depth, velocity, parameters)
        return force, np.column_stack([by[:, 2:], np.zeros(len(force)), -by[:, 0]])

    def with_effect(
        self, kind: str, channel: str, size: float, start: Array | None, steps: int
    ) -> Effect:
        """Fit the law with an effect of one size."""
        of_force = channel != DISPLACEMENT and kind != _PLAY
        motion = self.motion if channel == FORCE else self.motion_before(kind, size)
        kept: dict[bytes, Array] = {}

        def columns(x: Array) -> Array:
            key = x.tobytes()
            if key not in kept:
                kept.clear()
                force, by = self.law_of(x, motion)
                both = np.column_stack([force, by])
                kept[key] = behind(kind, both, size, self.rate_hz) if of_force else both
                kept[key][:, 0] += x[4]
                kept[key][:, 5] = 1.0
            return kept[key]

        noise_n = max(self.noise_n, _ROUNDING * self.range_n)

        def residual(x: Array) -> Array:
            rest = (columns(x)[:, 0] - self._measured)[self._settled]
            return np.concatenate((rest / noise_n, (x[3:] - _EXPECTED) / self._prior))

        def jacobian(x: Array) -> Array:
            priors = np.zeros((3, 6))
            priors[:, 3:] = np.diag(1.0 / self._prior)
            return np.concatenate((columns(x)[self._settled, 1:] / noise_n, priors))

        begin = np.clip(
            self._start if start is None else start, self._lower + 1e-6, self._upper - 1e-6
        )
        scale = np.concatenate(([1.0, 1.0, 0.3], self._prior))
        bounds = (self._lower, self._upper)
        found = least_squares(
            residual, begin, jacobian, bounds=bounds, x_scale=scale, max_nfev=steps
        )
        x = np.asarray(found.x, np.float64)
        rest = (columns(x)[:, 0] - self._measured)[self._settled]
        left_n = float(np.sqrt(np.mean(rest**2)))
        parameters = np.concatenate((np.exp(x[:2]), x[2:]))
        return Effect(kind, channel, size, left_n, np.inf, parameters)

    def scan(self, kind: str, channel: str, sizes: Array) -> Effect:
        """Fit the law with an effect of the size that leaves least of the force."""
        tried: list[Effect] = []
        start: Array | None = None
        for size in sizes.tolist():
            tried.append(self.with_effect(kind, channel, size, start, _STEPS))
            start = _logarithms(tried[-1].parameters)
        best = int(np.argmin([one.left_n for one in tried]))
        begin = _logarithms(tried[best].parameters)
        near = minimize_scalar(
            lambda size: self.with_effect(kind, channel, size, begin, _STEPS).left_n,
            bounds=(sizes[max(best - 1, 0)], sizes[min(best + 1, len(sizes) - 1)]),
            method="bounded",
            options={"maxiter": _TRIES},
        )
        last = self.with_effect(kind, channel, float(near.x), begin, _LAST_STEPS)
        return min(last, tried[best], key=lambda one: one.left_n)

    def smoothed(self, channel: str) -> list[Effect]:
        """Return the law with each low-pass, and with a mean, of the size that suits best."""
        low_passes = [self.scan(kind, channel, _TIMES_S) for kind in LOW_PASS]
        return [*low_passes, self.scan(MEAN, channel, _LENGTHS_S)]

    def with_less_smoothing(self, effect: Effect) -> Effect:
        """Return an effect with that smoothing of the motion which leaves least, as a delay has."""
        near = np.sort(_NEAR * effect.size)  # a delay may be negative
        others = [law.scan(effect.kind, effect.channel, near) for law in self.less_smoothed]
        return min((effect, *others), key=_left)

    def left_otherwise(self) -> float:
        """Return what it leaves with a delay, play or a frame that gives way, the least [N]."""
        stroke_mm = float(np.ptp(self.place_mm))
        rivals = (
            self.scan(DELAY, FORCE, _DELAYS_S),
            self.scan(_PLAY, DISPLACEMENT, _SHARES * stroke_mm),
            self.scan(_COMPLIANCE, DISPLACEMENT, _YIELDS * stroke_mm / self.range_n),
        )
        return min(_left(self.with_less_smoothing(one)) for one in rivals)

    def noise_behind(self, effect: Effect) -> float:
        """Return the noise of readings that were white before the effect [N]."""
        if effect.channel == DISPLACEMENT or effect.kind == MEMORY:
            return self.noise_n
        impulse = np.zeros((int(3.0 * effect.size * 6.0 * self.noise_rate_hz) + 20, 1))
        impulse[6] = 1.0
        answer = behind(effect.kind, impulse, effect.size, self.noise_rate_hz)[:, 0]
        quick = float(np.sqrt(np.sum(np.diff(answer, 5) ** 2) / FIFTH_DIFFERENCES))
        white_n = min(self.noise_n / max(quick, 1e-12), NOISIEST * self.range_n)
        return white_n * float(np.sqrt(np.sum(answer**2)))

    def taken_off(self, effect: Effect) -> float:
        """Return the RMS of what the effect makes of the force [N]."""
        x = _logarithms(effect.parameters)
        before = motion = self.motion
        if effect.channel != FORCE:
            before = self.motion_before(effect.kind, effect.size)
        force, as_read = self.law_of(x, before)[0], self.law_of(x, motion)[0]
        if effect.channel != DISPLACEMENT:
            after = behind(effect.kind, force[:, None], effect.size, self.rate_hz)[:, 0]
            as_read = after if effect.channel == FORCE else as_read + force - after
        return float(np.sqrt(np.mean((force - as_read)[self._settled] ** 2)))


_EXPECTED: Final = np.array([1.0, 0.0, 0.0])
"""p, force zero and contact position before anything is known."""
