"""Faults between the two channels: time shift, zero of the force, contact position.

A force that lags the displacement looks like damping, a wrong zero or contact position like other
exponents; none of the three shows in the residual of a single slow sine. Where the motion is rich
enough they can be told from K, B, n and p: this module fits all seven to a whole recording by
least squares, F(t) = F_hc(d(t - delay) - contact, v(t - delay)) + zero with the unilateral law, and
says how sure it is.
The four faults' priors (delay 50 ms, zero 5 % of the largest force, contact 10 % of the stroke,
p 1 +- 0.1) only matter where the recording does not tell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import OptimizeResult, least_squares

from hc_estimator.contact.arrays import force_gradient, hunt_crossley_force
from hc_estimator.stream.correlation import samples_for_one
from hc_estimator.stream.together import together
from hc_evaluation.gaps import GAP_STEPS
from hc_evaluation.hold_forward import smooth_motion

FloatArray = NDArray[np.float64]

DELAY_PRIOR_S = 0.05
ZERO_PRIOR_SHARE = 0.05
CONTACT_PRIOR_SHARE = 0.1
EXPONENT_PRIOR = 0.1
DELAY_STARTS_S = (0.0, 0.01, -0.01, 0.03, -0.03, 0.06, -0.06)
SCREENED_SAMPLES = 1000
SCREENING_STEPS = 30
MOST_STEPS = 60
"""Of the fit itself: where the law does not hold it would go on for minutes."""
LARGEST_DELAY_S = 2.0 * DELAY_PRIOR_S
"""A fit that ends there has found something else."""
EXPLAINED = 0.6
"""What the faults explain of the squared residual over what nothing explains: with less, tissue
that varies or relaxes was bent to a fault of the channels (up to 0.33 in the scenarios of the rig
without one, from 1.0 on with one, and in the recordings)."""
LARGEST_EXPONENT = 5.0
SHORTEST_STEP_S = 1e-7
MOST_BETWEEN = 20.0
"""Rows made for each row there is: recordings of two days in one file are filled up by no more."""
LEAST_STRETCH_S = 2.0
"""In a shorter time without a gap no delay can be told."""
SMOOTHING_S = (0.06, 0.12, 0.24, 0.48)
"""Windows of the motion: a wider one is taken as long as the law fits better for it. Noise that is
taken for velocity, of a slow motion or a slow sensor, hides the damping, and a displacement that
comes late stands in for it."""
WIDE_ORDER = 5
"""Of the polynomials in the wider windows: they follow a quick motion all the same."""
CLEARLY_BETTER = 0.98
"""What a wider window has to leave of the residual."""
LARGEST_WINDOW_SHARE = 0.05
"""Of the recording: so long a window may be."""
FIFTH_DIFFERENCES = 252.0  # variance of those of white noise of variance 1
CLEAR = 3.0  # a fault beyond so many standard deviations is called one


@dataclass(frozen=True)
class ChannelDiagnosis:
    """What was found between the channels.

    Attributes:
        parameters: K, B, n, p with the faults taken out, shape (4,).
        delay_s: Time by which the force lags the displacement.
        zero_n: Zero of the force.
        contact_mm: Displacement reading at contact.
        delay_std_s: Standard deviation of the delay.
        zero_std_n: Standard deviation of the zero.
        contact_std_mm: Standard deviation of the contact position.
        residual_rms_n: Force residual with the faults taken out.
        residual_rms_without_n: Force residual of the contact law alone.
        noise_n: White noise of the force; what the residual has beyond it, nothing explains.
    """

    parameters: FloatArray
    delay_s: float
    zero_n: float
    contact_mm: float
    delay_std_s: float
    zero_std_n: float
    contact_std_mm: float
    residual_rms_n: float
    residual_rms_without_n: float
    noise_n: float

    @property
    def explain(self) -> bool:
        """Whether the faults explain a fair part of what the law alone leaves."""
        explained = self.residual_rms_without_n**2 - self.residual_rms_n**2
        left = max(0.0, self.residual_rms_n**2 - self.noise_n**2)
        inside = self.parameters[2] < 0.98 * LARGEST_EXPONENT  # or it has found something else
        return bool(inside and explained > EXPLAINED * left)

    @property
    def clear_faults(self) -> tuple[str, ...]:
        """Names of the faults that stand out of their uncertainty, where they explain enough."""
        found: list[str] = []
        if not self.explain:
            return ()
        inside = abs(self.delay_s) < 0.95 * LARGEST_DELAY_S
        if inside and abs(self.delay_s) > CLEAR * self.delay_std_s:
            found.append("delay")
        if abs(self.zero_n) > CLEAR * self.zero_std_n:
            found.append("zero")
        if abs(self.contact_mm) > CLEAR * self.contact_std_mm:
            found.append("contact")
        return tuple(found)


def diagnose_channels(
    time_s: FloatArray, displacement_mm: FloatArray, force_n: FloatArray
) -> ChannelDiagnosis:
    """Look for a time shift, a force zero and a contact position in a recording.

    Args:
        time_s: Evenly spaced instants, shape (N,).
        displacement_mm: Displacement readings, shape (N,).
        force_n: Force readings, shape (N,).

    Returns:
        The faults with standard deviations that allow for the colour of the residual.

    Raises:
        ValueError: fewer than 50 samples, or no force to fit.
    """
    if time_s.size < 50 or float(np.ptp(force_n)) <= 0.0:
        raise ValueError(
            f"{time_s.size} samples with a force span of {float(np.ptp(force_n)):g} N: the "
            "channels can be compared from 50 samples with a changing force on"
        )
    fit, before = _Fit(time_s, displacement_mm, force_n, SMOOTHING_S[0]), None
    valley = fit.valley()
    for window_s in SMOOTHING_S[1:]:
        if window_s > LARGEST_WINDOW_SHARE * float(np.ptp(time_s)):
            break
        wider = _Fit(time_s, displacement_mm, force_n, window_s)
        found = wider.valley()
        if not wider.rms(found) < CLEARLY_BETTER * fit.rms(valley):
            break
        before = (fit, valley)
        fit, valley = wider, found
    best = fit.best(valley)
    deviations = fit.deviations(best)
    if before is not None:  # what depends on the smoothing is not known better than that
        half_way = 0.5 * np.abs(best.x - before[0].best(before[1]).x)
        deviations = np.hypot(deviations, half_way)
    return ChannelDiagnosis(
        parameters=parameters_of(best.x),
        delay_s=float(best.x[4]),
        zero_n=float(best.x[5]),
        contact_mm=float(best.x[6]),
        delay_std_s=float(deviations[4]),
        zero_std_n=float(deviations[5]),
        contact_std_mm=float(deviations[6]),
        residual_rms_n=fit.rms(best.x),
        residual_rms_without_n=fit.rms_without(best.x[:4]),
        noise_n=fit.noise_n,
    )


def white_noise_std(values: FloatArray) -> float:
    """Return the standard deviation of the white noise in smooth values, by fifth differences."""
    return float(np.sqrt(np.mean(np.diff(values, 5) ** 2) / FIFTH_DIFFERENCES))


def parameters_of(x: FloatArray) -> FloatArray:
    """Return K, B, n, p of what is fitted: ln K, ln B, n, p, delay, zero, contact."""
    return np.array([np.exp(x[0]), np.exp(x[1]), x[2], x[3]])


class _Fit:
    """The law and the three faults over a recording, for one smoothing of its velocity."""

    def __init__(
        self,
        time_s: FloatArray,
        displacement_mm: FloatArray,
        force_n: FloatArray,
        window_s: float,
    ) -> None:
        step = float(np.median(np.diff(time_s)))
        order = 3 if window_s == SMOOTHING_S[0] else WIDE_ORDER
        displacement, rate = smooth_motion(displacement_mm, 1.0 / step, window_s, order)
        self._motion = CubicSpline(time_s, displacement)
        # Not the spline's derivative: its noise is larger at the samples than between them, so that
        # a delay of half a sample more or less would always seem to fit better.
        self._velocity = CubicSpline(time_s, rate)
        self._rates = self._motion.derivative(), self._velocity.derivative()
        self._prior_std = np.array(
            [
                EXPONENT_PRIOR,
                DELAY_PRIOR_S,
                ZERO_PRIOR_SHARE * float(np.max(np.abs(force_n))),
                CONTACT_PRIOR_SHARE * float(np.ptp(displacement)),
            ]
        )
        margin = max(2, round(3.0 * DELAY_PRIOR_S / step))
        inside = slice(margin, time_s.size - margin) if time_s.size > 4 * margin else slice(None)
        self._times, self._measured = time_s[inside], force_n[inside]
        self.noise_n = white_noise_std(force_n) + 1e-9
        self._first = np.log(
            max(float(np.max(force_n)), 1e-9) / max(float(np.max(displacement)), 0.1) ** 1.5
        )
        self._scale = np.concatenate(([1.0, 1.0, 0.3], self._prior_std))
        self._lower = np.array([-20.0, -20.0, 0.5, 0.4, -LARGEST_DELAY_S, -np.inf, -np.inf])
        self._upper = np.array([12.0, 10.0, LARGEST_EXPONENT, 2.0, LARGEST_DELAY_S, np.inf, np.inf])

    def valley(self) -> FloatArray:
        """Return where a few steps from several delays on a part of the samples lead."""
        candidates = []
        thin = max(1, self._times.size // SCREENED_SAMPLES)
        for delay in DELAY_STARTS_S:
            start = np.array([self._first, self._first - 3.0, 1.5, 1.0, delay, 0.0, 0.0])
            candidates.append(self._solve(start, thin, SCREENING_STEPS))
        chosen: FloatArray = min(candidates, key=lambda solution: float(solution.cost)).x
        return chosen

    def best(self, valley: FloatArray) -> OptimizeResult:
        """Fit all samples, from where `valley` leads."""
        return self._solve(valley, 1, MOST_STEPS)

    def _solve(self, start: FloatArray, thin: int, most_steps: int) -> OptimizeResult:
        return least_squares(
            self._residual,
            np.clip(start, self._lower + 1e-6, self._upper - 1e-6),
            self._jacobian,
            args=(thin,),
            bounds=(self._lower, self._upper),
            x_scale=self._scale,
            max_nfev=most_steps,
        )

    def _misfit(self, x: FloatArray, thin: int = 1) -> FloatArray:
        at = self._times[::thin] - x[4]
        model = hunt_crossley_force(self._motion(at) - x[6], self._velocity(at), parameters_of(x))
        result: FloatArray = model + x[5] - self._measured[::thin]
        return result

    def _residual(self, x: FloatArray, thin: int) -> FloatArray:
        deviation = (x[3:] - np.array([1.0, 0.0, 0.0, 0.0])) / self._prior_std
        result: FloatArray = np.concatenate((self._misfit(x, thin) / self.noise_n, deviation))
        return result

    def _slopes(self, x: FloatArray, thin: int = 1) -> FloatArray:
        """Derivatives of `_misfit` with respect to x, shape (N, 7)."""
        at = self._times[::thin] - x[4]
        by = force_gradient(self._motion(at) - x[6], self._velocity(at), parameters_of(x))
        depth_rate, acceleration = (rate(at) for rate in self._rates)
        by_delay = -by[:, 0] * depth_rate - by[:, 1] * acceleration
        return np.column_stack([by[:, 2:], by_delay, np.ones(at.size), -by[:, 0]])

    def _jacobian(self, x: FloatArray, thin: int) -> FloatArray:
        slopes = self._slopes(x, thin) / self.noise_n
        priors = np.zeros((4, 7))
        priors[:, 3:] = np.diag(1.0 / self._prior_std)
        return np.concatenate((slopes, priors))

    def rms(self, x: FloatArray) -> float:
        """Return what is left of the force [N]."""
        return float(np.sqrt(np.mean(self._misfit(x) ** 2)))

    def deviations(self, best: OptimizeResult) -> FloatArray:
        """Return the standard deviations, which allow for the colour of the residual."""
        fitted = self._misfit(best.x)
        jacobian: FloatArray = np.asarray(best.jac)
        spread = max(1.0, float(np.mean((fitted / self.noise_n) ** 2))) * samples_for_one(fitted)
        weights = np.ones(jacobian.shape[0])
        weights[: fitted.size] = 1.0 / spread
        information = (jacobian * weights[:, None]).T @ jacobian
        variances = np.diag(np.linalg.pinv(information))
        # Of readings next to free of noise nothing but rounding is left of some: no knowledge.
        result: FloatArray = np.sqrt(np.where(variances >= 0.0, variances, np.inf))
        return result

    def rms_without(self, start: FloatArray) -> float:
        """Return what the law alone leaves of the force [N]."""

        def whole(x: FloatArray) -> FloatArray:
            return np.concatenate((x, [0.0, 0.0, 0.0]))

        def residual(x: FloatArray) -> FloatArray:
            return self._misfit(whole(x)) / self.noise_n

        def jacobian(x: FloatArray) -> FloatArray:
            return self._slopes(whole(x))[:, :4] / self.noise_n

        alone = least_squares(
            residual,
            start,
            jacobian,
            bounds=(self._lower[:4], self._upper[:4]),
            x_scale=self._scale[:4],
        )
        return float(np.sqrt(2.0 * alone.cost / self._times.size)) * self.noise_n


def unbroken(
    time_s: FloatArray, displacement_mm: FloatArray, force_n: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the longest part of a recording in which neither channel has a gap.

    Args:
        time_s: stamps [s], shape (n,).
        displacement_mm: penetration [mm], shape (n,); NaN where there is no reading.
        force_n: contact force [N], shape (n,); NaN where there is no reading.

    Returns:
        The three, unchanged where there is no gap.

    Raises:
        ValueError: if no part is long enough to tell a delay.
    """
    begins, ends = [], []
    for channel in (displacement_mm, force_n):
        known = np.sort(time_s[np.isfinite(channel) & np.isfinite(time_s)])
        steps = np.diff(known)
        if not (steps > 0.0).any():
            continue
        gaps = np.flatnonzero(steps > GAP_STEPS * float(np.median(steps[steps > 0.0])))
        begins.append(known[gaps])
        ends.append(known[gaps + 1])
    if not any(map(len, begins)):
        return time_s, displacement_mm, force_n
    gap_begins, gap_ends = np.sort(np.concatenate(begins)), np.sort(np.concatenate(ends))
    starts = np.concatenate([[np.nanmin(time_s)], gap_ends])
    stops = np.concatenate([gap_begins, [np.nanmax(time_s)]])
    # Between the end of one gap and the begin of the next; gaps that overlap leave nothing.
    longest = int(np.argmax(stops - starts))
    if stops[longest] - starts[longest] < LEAST_STRETCH_S:
        raise ValueError(
            f"gaps everywhere, {stops[longest] - starts[longest]:.2g} s between two of them at "
            f"most, and a delay takes {LEAST_STRETCH_S:g} s"
        )
    inside = (time_s >= starts[longest]) & (time_s <= stops[longest])
    return time_s[inside], displacement_mm[inside], force_n[inside]


def evenly_spaced(
    time_s: FloatArray, displacement_mm: FloatArray, force_n: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a recording with jitter or bad rows on the even instants that the diagnosis needs.

    Args:
        time_s: Instants, shape (N,); rows out of order or not finite are left out.
        displacement_mm: Displacement readings, shape (N,).
        force_n: Force readings, shape (N,). Where samples hold one reading alone, the recording is
            that at the stamps of the forces.

    Returns:
        The three at the median step, by linear interpolation where they are not there already.

    Raises:
        ValueError: fewer than two usable rows, stamps next to equal, or mostly gaps.
    """
    rows = np.column_stack(together(time_s, displacement_mm, force_n))
    rows = rows[np.isfinite(rows).all(axis=1)]
    if len(rows):
        newest = np.maximum.accumulate(rows[:, 0])
        rows = rows[np.concatenate(([True], rows[1:, 0] > newest[:-1]))]
    if len(rows) < 2:
        raise ValueError(f"{len(rows)} usable rows are no recording")
    times = rows[:, 0]
    steps = np.diff(times)
    step = float(np.median(steps))
    if step < SHORTEST_STEP_S:
        raise ValueError(f"most rows are {step:g} s apart: these are no times of measurement")
    if float(np.max(np.abs(steps - step))) <= 1e-3 * step:
        return times, rows[:, 1], rows[:, 2]
    span = float(times[-1] - times[0])
    if not span < MOST_BETWEEN * step * len(times):
        raise ValueError(
            f"{len(times)} rows mostly {step:g} s apart lie within {span:g} s: mostly gaps"
        )
    even = times[0] + step * np.arange(int(span / step) + 1)
    return even, np.interp(even, times, rows[:, 1]), np.interp(even, times, rows[:, 2])
