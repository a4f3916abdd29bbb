"""Finds the surface while the tool presses: force zero and contact position from one approach.

A tool that cannot be brought to rest at the surface (the contact position is not known, that is
why one palpates) moves freely at first, and the force of that time is its zero. When the force
stands out of its noise the tool is in contact, but the surface lies before that point: the
readings that follow are fitted with F = c (d - surface)^n, whose zero is the surface. At a constant
speed of the approach the damping only changes c; where the speed changes, c grows with it by the
damping's share g of the force at the mean speed: c (1 + g (v / mean - 1)), g from 0 to 1.

How well the surface is known counts two things that the fit's own covariance does not: errors that
last longer than a sample (displacements interpolated between the poses of a slower tracker; a law
that is not quite that of the tissue), and how the speed was told from the displacements.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.correlation import samples_for_one
from hc_estimator.stream.tare import TareResult

PRESSES = "presses with "
"""How `feels` begins while the tool is in contact."""
FREE_SAMPLES = 100
"""Samples free of contact that say force zero and noise; fewer are not enough."""
FORGETTING = 1.0 / 10_000.0
"""Of the force zero: a sensor drifts, but a slow approach must not pass for drift."""
CLEAR = 5.0
"""A force beyond so many times its noise is contact, if it stays there."""
LARGEST_TERM = 3.0
"""A reading further off than so many times the noise counts as that."""
LARGEST_GROWTH = 3.0
"""Noise that becomes so many times what it was is a tool that moves in contact, not free motion."""
CONFIRMATIONS = 5
FEWEST_OF_WEAK = 20
"""Samples of a touch that is too weak by itself."""
ENOUGH = 100.0
"""Force in units of its noise up to which the approach is fitted: shallow, so that one n fits."""
LESS = (50.0, 25.0)
"""The same of a recording in which no press is so strong. With 50 and 25 the surface was off by
0.07 and 0.13 mm in the median of 150 drawn presses (0.04 with 100), and the stated deviations held:
0.9 of them in the mean square."""
CALCULATED_ENOUGH = 8.0
"""The same in units of the least noise: an error in motion, not a noise that averages out."""
CALCULATED_SPAN = 1.8
"""A calculated force is fitted once it is so many times the first of its approach. Where readings
of the contact are lost, the first is one at depth: a few of one depth do not say where it began.
Ours; measured in docs/teleoperation.md."""
MOST_SAMPLES = 20_000
SPEED_DEGREE = 3
"""Of the polynomial in time that is the speed of an approach; of 2 to 5 it is the one whose stated
deviations hold. What a degree more or less would have found is part of the stated deviation."""
FEWEST_FOR_SPEED = 20
LEAST_SWING = 0.1
"""An approach whose speed changes by less of its mean is one of constant speed."""
SMALLEST_EXPONENT = 0.8
LARGEST_EXPONENT = 3.0

FloatArray = NDArray[np.float64]


class SurfaceFinder:
    """Takes samples of an approach from free motion into the tissue; used like a Tare."""

    def __init__(
        self, least_noise_n: float = 0.0, *, enough: float = ENOUGH, twice: bool = True
    ) -> None:
        """Wait for free motion.

        Args:
            least_noise_n: where the force is not a sensor's but calculated, its error in motion,
                which the noise at rest does not show [N]. Contact is a force clear of it.
            enough: how far a force has to stand out of its noise for the approach to be fitted.
            twice: whether two weaker touches that agree are enough as well; never where the force
                is calculated.
        """
        # Half a second that a node need not spend at its start, and not at the end of an approach.
        from scipy.optimize import least_squares

        self._least_squares = least_squares
        self._least_noise = least_noise_n
        self._noises = enough
        self._twice = twice and least_noise_n == 0.0
        self.strongest = 0.0  # how far the force stood out of its noise
        self.was_free = False  # whether free motion was ever sure
        self._weak: TareResult | None = None  # what the last weak touch showed
        self._approach: list[tuple[float, float]] = []
        self._force_n = math.nan
        self._start_over()

    def _start_over(self) -> None:
        self._free = 0
        self._zero = 0.0
        self._variance = self._first_variance = 0.0
        self._above = 0
        self._below = 0
        self._approach.clear()
        self._first: list[float] = []  # readings until the free ones are sure

    def add(self, displacement_mm: float, force_n: float) -> TareResult | None:
        """Take in a sample; return force zero and surface once the tool has pressed enough.

        Readings that are not finite are passed over. A touch that ends before it says enough is
        forgotten, and the next one counts.
        """
        if not (math.isfinite(displacement_mm) and math.isfinite(force_n)):
            return None
        self._force_n = force_n
        if self._free < FREE_SAMPLES:
            self._begin(force_n)
            return None
        deviation = self._deviation
        excess = force_n - self._zero
        self._below = self._below + 1 if excess < -CLEAR * deviation else 0
        if self._below >= CONFIRMATIONS:
            # What was taken for free motion was a press: the tool has left the tissue now.
            self._start_over()
            return None
        if excess <= CLEAR * deviation:
            ended = self._ended(deviation)
            self._take_free(force_n)
            return ended
        self._above += 1
        self.strongest = max(self.strongest, excess / max(deviation, 1e-12))
        self._approach.append((displacement_mm, excess))
        enough = excess > self._enough or len(self._approach) >= MOST_SAMPLES
        if self._above < CONFIRMATIONS or not enough:
            return None
        return self._fit(deviation)

    def _ended(self, deviation: float) -> TareResult | None:
        """Return what a touch that is over shows, if it agrees with a weak one before it.

        One that was too weak may have been a bump; two at the same place are a surface.
        """
        weak = self._twice and self._above >= FEWEST_OF_WEAK
        pushed = np.array([force for _, force in self._approach])
        if not weak or float(np.max(pushed)) < LESS[-1] * deviation:
            return None
        before = self._weak
        self._approach = self._approach[: int(np.argmax(pushed)) + 1]
        if len(self._approach) < FEWEST_OF_WEAK:
            return None
        self._weak = found = self._fit(deviation)
        if before is None:
            return None
        off = found.displacement_mm - before.displacement_mm
        spread = math.hypot(found.displacement_std_mm, before.displacement_std_mm)
        return found if abs(off) < 3.0 * spread else None

    @property
    def _deviation(self) -> float:
        """Of the force free of contact [N]."""
        return max(math.sqrt(self._variance), self._least_noise)

    @property
    def _enough(self) -> float:
        """Force up to which an approach is fitted, without its zero [N]."""
        if self._least_noise == 0.0:
            return self._noises * self._deviation
        first = self._approach[0][1] if self._approach else 0.0
        return max(CALCULATED_ENOUGH * self._least_noise, CALCULATED_SPAN * first)

    @property
    def feels(self) -> str:
        """What it feels, and what it waits for, in words."""
        if math.isnan(self._force_n):
            return "no sample has come yet"
        if self._free < FREE_SAMPLES:
            return f"the force is {self._force_n:.3g} N; leave the tissue, and rest for a moment"
        excess = self._force_n - self._zero
        if self._approach:
            return f"{PRESSES}{excess:.3g} N; {self._enough:.2g} N are enough"
        twice = f", or twice with {LESS[-1] * self._deviation:.2g} N" if self._twice else ""
        return (
            f"free of contact: {excess:+.2g} N from its zero, noise {self._deviation:.2g} N; press "
            f"with {self._enough:.2g} N at least{twice}"
        )

    def _begin(self, force_n: float) -> None:
        """Collect the first readings; while the force falls or rises the tool is in contact."""
        self._first.append(force_n)
        if len(self._first) < FREE_SAMPLES:
            return
        force = np.array(self._first)
        half = FREE_SAMPLES // 2
        noise = float(np.std(np.diff(force))) / math.sqrt(2.0)
        change = float(np.mean(force[:half]) - np.mean(force[half:]))
        if abs(change) > CLEAR * noise * math.sqrt(2.0 / half):
            del self._first[:half]
            return
        self._free = FREE_SAMPLES
        self.was_free = True
        self._zero = float(np.mean(force))
        self._variance = self._first_variance = float(np.var(force))

    def _take_free(self, force_n: float) -> None:
        if self._above:
            self._above = 0
            self._approach.clear()
        self._free += 1
        weight = max(1.0 / self._free, FORGETTING)
        # The beginning of a contact must not drag zero and noise along.
        limit = LARGEST_TERM * math.sqrt(self._variance)
        before = min(max(force_n - self._zero, -limit), limit)
        force_n = self._zero + before
        self._zero += weight * before
        self._variance += weight * (before * (force_n - self._zero) - self._variance)
        if self._variance > LARGEST_GROWTH**2 * self._first_variance:
            self._start_over()

    def _fit(self, deviation: float) -> TareResult:
        displacement, force = np.array(self._approach).T
        few = len(force) < FEWEST_FOR_SPEED
        speed = None if few else self._speed(displacement, SPEED_DEGREE)
        surface, variance = self._fit_law(displacement, force, speed)
        if few:
            # Too few for a speed that is known well: what one would have changed is left open.
            degrees: tuple[int, ...] = (min(SPEED_DEGREE, len(force) - 3),)
        else:
            degrees = (SPEED_DEGREE - 1, SPEED_DEGREE + 1) if speed is not None else ()
        if degrees:
            others = [
                self._fit_law(displacement, force, self._speed(displacement, degree))[0]
                for degree in degrees
            ]
            variance += float(np.mean(np.square(np.array(others) - surface)))
        return TareResult(surface, math.sqrt(variance), self._zero, deviation, len(force))

    def _fit_law(
        self, displacement: FloatArray, force: FloatArray, speed: FloatArray | None
    ) -> tuple[float, float]:
        """Return the surface [mm] and its variance [mm^2] by a fit of the law.

        Args:
            displacement: of the approach [mm], shape (samples,).
            force: without its zero [N], shape (samples,).
            speed: what the speed exceeds its mean by, in units of the mean, shape (samples,); None
                for one that is constant.
        """
        first = float(displacement[0])
        # More than the place's last digits.
        stroke = max(float(np.max(displacement)) - first, 1e-6, 1e-9 * abs(first))
        strongest = float(np.max(np.abs(force)))
        # In units of the stroke and of the strongest force: the search ends at a gradient that is
        # small as a number, and that of millinewtons is so before the first step.
        place, pushed = (displacement - first) / stroke, force / strongest
        lower = np.array([-2.0, 0.0, SMALLEST_EXPONENT])
        # The surface is not deeper than where contact was sure.
        upper = np.array([0.0, np.inf, LARGEST_EXPONENT])
        if speed is not None:
            lower, upper = np.append(lower, 0.0), np.append(upper, 1.0)

        def misfit(x: FloatArray) -> FloatArray:
            depth = np.maximum(place - x[0], 1e-9)
            error: FloatArray = x[1] * depth ** x[2] - pushed
            if speed is not None:
                error += x[1] * depth ** x[2] * x[3] * speed
            return error

        start = np.array([-0.1, max(pushed[-1], 1e-3), 1.5, 0.2])[: len(lower)]
        scale = np.array([1.0, start[1], 1.0, 1.0])[: len(lower)]
        fit = self._least_squares(misfit, start, bounds=(lower, upper), x_scale=scale)
        freedom = max(len(force) - len(lower), 1)
        jacobian: FloatArray = np.asarray(fit.jac)
        # A few residuals are small by chance, and no smaller than the noise of which they are.
        noise = self._variance / strongest**2
        residual = max(2.0 * float(fit.cost) / freedom, noise) * (1.0 + 2.0 / freedom)
        covariance = residual * np.linalg.pinv(jacobian.T @ jacobian)
        variance = max(float(covariance[0, 0]), 0.0) * samples_for_one(np.asarray(fit.fun))
        return first + stroke * float(fit.x[0]), stroke**2 * variance

    def _speed(self, displacement: FloatArray, degree: int) -> FloatArray | None:
        """Return the speed of an approach as what it exceeds its mean by, in units of the mean.

        The speed is a polynomial of that degree in time.

        None where that is not known or does not differ: few samples, or a calculated force,
        which has the damping of its own robot in it.
        """
        if self._least_noise > 0.0 or len(displacement) < degree + 3:
            return None
        # A polynomial over the whole approach: less noise than slopes of short pieces.
        place = np.linspace(-1.0, 1.0, len(displacement))
        motion = np.polynomial.Chebyshev.fit(place, displacement, degree + 1)
        straight = np.polynomial.Chebyshev.fit(place, displacement, 1)
        left = float(np.sum((displacement - motion(place)) ** 2)) / len(displacement)
        more = float(np.sum((motion(place) - straight(place)) ** 2)) / degree
        speed: FloatArray = motion.deriv()(place)
        mean = float(np.mean(speed))
        swings = more > CLEAR**2 * left and float(np.ptp(speed)) > LEAST_SWING * mean
        if mean <= 0.0 or not swings:
            return None
        return speed / mean - 1.0


def find_surface(displacement_mm: FloatArray, force_n: FloatArray) -> TareResult | None:
    """Find the surface in a recording from its first approach that is strong enough.

    Args:
        displacement_mm: displacement readings, shape (samples,).
        force_n: force readings, shape (samples,).

    Returns:
        Force zero and surface; None if the recording does not go from free motion into contact.
    """
    for enough in (ENOUGH, *LESS):
        result, finder = _next_approach(_readings(displacement_mm, force_n), enough)
        if result is not None and enough == ENOUGH:
            return _from_the_air(result, displacement_mm, force_n)
        if result is not None and _is_lowest(result, force_n):
            return result
        if finder.strongest < LESS[-1]:
            break
    return None


def _from_the_air(
    first: TareResult, displacement_mm: FloatArray, force_n: FloatArray
) -> TareResult:
    """Return a later approach if the first one began at rest in the tissue, else that.

    It began there if a later one begins at less force and finds the surface less deep: a sensor
    that drifts leaves the surface where it is, and tissue that pulls leaves both.
    """
    if _is_lowest(first, force_n):
        return first
    for enough in (ENOUGH, *LESS):
        for other in _approaches(displacement_mm, force_n, enough):
            lower = first.force_n - other.force_n > CLEAR * first.force_std_n
            spread = math.hypot(first.displacement_std_mm, other.displacement_std_mm)
            if lower and first.displacement_mm - other.displacement_mm > CLEAR * spread:
                return other
    return first


def _approaches(
    displacement_mm: FloatArray, force_n: FloatArray, enough: float
) -> Iterator[TareResult]:
    """Yield what each press of so many noises shows."""
    readings = _readings(displacement_mm, force_n)
    while (result := _next_approach(readings, enough)[0]) is not None:
        yield result


def _is_lowest(found: TareResult, force_n: FloatArray) -> bool:
    """Whether the force before an approach is the least of all: else it began in the tissue."""
    least = float(np.nanquantile(force_n, 0.005))
    return found.force_n < least + CLEAR * found.force_std_n


def why_no_surface(displacement_mm: FloatArray, force_n: FloatArray) -> str:
    """Say why a recording, of the same arguments, does not show where the surface is."""
    _result, finder = _next_approach(_readings(displacement_mm, force_n), ENOUGH)
    if not finder.was_free:
        return (
            "does not go from free motion into contact: before a press the tool has to be in the "
            f"air for {FREE_SAMPLES} readings of the force"
        )
    if finder.strongest < 2.0 * CLEAR:  # noise alone does not reach that
        return "does not go from free motion into contact"
    return (
        "has no press from free motion that is strong enough: the force stands out of its noise by "
        f"{finder.strongest:.0f} times, and {LESS[-1]:.0f} are needed"
    )


def _readings(displacement_mm: FloatArray, force_n: FloatArray) -> Iterator[tuple[float, float]]:
    return zip(displacement_mm.tolist(), force_n.tolist(), strict=True)


def _next_approach(
    readings: Iterator[tuple[float, float]], enough: float
) -> tuple[TareResult | None, SurfaceFinder]:
    """Return what the next approach of so many noises shows, and who looked for it."""
    finder = SurfaceFinder(enough=enough, twice=False)
    for displacement, force in readings:
        result = finder.add(displacement, force)
        if result is not None:
            return result, finder
    return None, finder
