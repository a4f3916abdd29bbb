"""Force filters that see a tool's motion and its motor's effort only, and which one is chosen.

Beside the disturbance observer (effort.py): an extended and an unscented Kalman filter in which the
contact force and its rate are states, and paper C's particle filter with equation 26 as printed,
which knows the tissue. All know the slave: m x'' = u - b x' - k x - f(x') - F, f dry friction.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.contact.arrays import hunt_crossley_force
from hc_estimator.stream.effort import DisturbanceObserver
from hc_estimator.stream.force_filter import LONGEST_GAP_S, ForceFilter

FloatArray = NDArray[np.float64]

METHODS = ("observer", "extended", "unscented", "sir_pf")
TONNE_PER_KG = 1e-3
"""A mass in N s^2/mm."""
OBSERVED_ERROR_N = 0.02
UNKNOWN_SHARE = 0.1
"""Of the dry friction: nobody knows it better, and a filter sees its turns late."""
FIRST_SPEED_MM_S = 30.0
FIRST_FORCE_N = 1.0
FIRST_RATE_N_S = 10.0
"""Standard deviations of what a filter does not know at its first reading."""
KNOWN_AGAIN = 1.5
"""After a gap the force is known again when its deviation is this much of that before."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class EffortSettings:
    """What is known of slave, readings and, for `sir_pf`, tissue. Units mm, mm/s, N, s, kg.

    Attributes:
        method: one of METHODS.
        mass_kg: what the motor moves.
        damping: viscous friction [N s/mm].
        spring: of the slave about position zero [N/mm] (k_s of paper C).
        dry_friction_n: f(v) = dry_friction tanh(v / friction_velocity).
        friction_velocity_mm_s: see there.
        bandwidth_hz: of the observer's low-pass.
        position_noise_mm: standard deviation of a position reading.
        effort_noise_n: standard deviation of an effort reading, and of what is not modelled.
        force_jerk: density of the white noise that drives the force's rate [N^2/s^3].
        tissue: K, B, n of paper C's law, p = 1, surface at displacement zero.
        surface_mm: position at which penetration begins.
        particles: how many.
        sigma: paper C's sigma_1 to sigma_3, per step [mm, mm/s, N].
        seed: of the particles.
    """

    method: str = "observer"
    mass_kg: float = 0.5
    damping: float = 0.0
    spring: float = 0.0
    dry_friction_n: float = 0.0
    friction_velocity_mm_s: float = 0.5
    bandwidth_hz: float = 15.0
    position_noise_mm: float = 0.002
    effort_noise_n: float = 0.01
    force_jerk: float = 1e3
    tissue: tuple[float, float, float] = (0.25, 0.006, 1.6)
    surface_mm: float = 0.0
    particles: int = 50
    sigma: tuple[float, float, float] = (2e-4, 0.2, 0.01)
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ValueError: a value is not finite, negative, or zero where it must not be.
        """
        if self.method not in METHODS:
            raise ValueError(f"method = {self.method!r} is not one of {', '.join(METHODS)}")
        for name in ("tissue", "sigma"):
            numbers = getattr(self, name)
            if len(numbers) != 3 or not all(math.isfinite(v) and v >= 0.0 for v in numbers):
                raise ValueError(
                    f"{name} = {list(numbers)!r} is not three finite numbers, none negative"
                )
        if not math.isfinite(self.surface_mm):
            raise ValueError(f"surface_mm = {self.surface_mm!r} is not a finite number")
        positive = (
            "mass_kg",
            "friction_velocity_mm_s",
            "bandwidth_hz",
            "position_noise_mm",
            "effort_noise_n",
            "force_jerk",
        )
        for name in (*positive, "damping", "spring", "dry_friction_n"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0) or (value == 0.0 and name in positive):
                above = "above 0" if name in positive else "not negative"
                raise ValueError(f"{name} = {value!r} is not a finite number, {above}")
        if self.particles < 2:
            raise ValueError(f"particles = {self.particles!r} is not at least 2")


def make_force_filter(settings: EffortSettings) -> ForceFilter:
    """Make the filter that the settings name."""
    if settings.method == "observer":
        return DisturbanceObserver(
            mass_kg=settings.mass_kg,
            damping=settings.damping,
            spring=settings.spring,
            dry_friction_n=settings.dry_friction_n,
            friction_velocity_mm_s=settings.friction_velocity_mm_s,
            bandwidth_hz=settings.bandwidth_hz,
        )
    if settings.method == "sir_pf":
        return ParticleForceFilter(settings)
    return ContactForceFilter(settings)


class ContactForceFilter(ForceFilter):
    """Kalman filter with states position, velocity, contact force and its rate.

    The force's rate is driven by white noise of density `force_jerk`: nothing is known of the
    tissue, nor whether there is contact. Dry friction makes the model nonlinear: `extended` takes
    its derivative, `unscented` sigma points (alpha 1, beta 2, kappa 0, redrawn at every step).
    """

    def __init__(self, settings: EffortSettings) -> None:
        """Tell it slave and noise."""
        super().__init__()
        self._settings = settings
        self._mass = TONNE_PER_KG * settings.mass_kg
        self._unscented = settings.method == "unscented"
        self._state = np.zeros(4)
        self._covariance = np.zeros((4, 4))
        self._enough_n = 0.0

    @property
    def force_std_n(self) -> float:
        """Standard deviation of the force, by the filter's own covariance [N]."""
        return math.sqrt(max(float(self._covariance[2, 2]), 0.0))

    def _begin(self, position_mm: float) -> tuple[float, float]:
        self._state = np.array([position_mm, 0.0, 0.0, 0.0])
        self._enough_n = 0.0
        deviations = (
            self._settings.position_noise_mm,
            FIRST_SPEED_MM_S,
            FIRST_FORCE_N,
            FIRST_RATE_N_S,
        )
        self._covariance = np.diag(np.square(deviations))
        return position_mm, 0.0

    def _resume(self, elapsed: float, position_mm: float, velocity_mm_s: float) -> None:
        noise = self._settings.position_noise_mm
        if self._enough_n == 0.0:  # no gap within a gap: that one knew less
            self._enough_n = KNOWN_AGAIN * self.force_std_n
        force_variance = self._covariance[2, 2] + (FIRST_RATE_N_S * LONGEST_GAP_S) ** 2
        self._state = np.array([position_mm, velocity_mm_s, self._state[2], 0.0])
        self._covariance = np.diag([noise**2, 0.0, force_variance, FIRST_RATE_N_S**2])
        slope = noise**2 / elapsed
        self._covariance[0, 1] = self._covariance[1, 0] = slope
        self._covariance[1, 1] = 2.0 * slope / elapsed

    def _is_known(self, since_s: float) -> bool:
        known = self.force_std_n <= self._enough_n
        if known:
            self._enough_n = 0.0
        return known

    def _follow(self, elapsed: float, position_mm: float, effort_n: float) -> tuple[float, float]:
        if self._unscented:
            self._predict_unscented(elapsed, effort_n)
        else:
            self._predict_extended(elapsed, effort_n)
        settings = self._settings
        # Effort that is wrong over the step: noise of velocity and, half a step on, of position.
        push = elapsed / self._mass * settings.effort_noise_n
        covariance = self._covariance
        covariance[0, 0] += 0.25 * (elapsed * push) ** 2
        covariance[0, 1] += 0.5 * elapsed * push**2
        covariance[1, 0] += 0.5 * elapsed * push**2
        covariance[1, 1] += push**2
        covariance[3, 3] += settings.force_jerk * elapsed
        total = covariance[0, 0] + settings.position_noise_mm**2
        gain = covariance[:, 0] / total
        self._state = self._state + gain * (position_mm - self._state[0])
        kept = np.eye(4)
        kept[:, 0] -= gain
        noise = settings.position_noise_mm**2 * np.outer(gain, gain)
        self._covariance = kept @ covariance @ kept.T + noise
        return float(self._state[0]), float(self._state[2])

    def _moved(self, states: FloatArray, elapsed: float, effort_n: float) -> FloatArray:
        """Each state one step on; shape (4,) or (4, points)."""
        settings = self._settings
        position, velocity, force, rate = states
        friction = settings.dry_friction_n * np.tanh(velocity / settings.friction_velocity_mm_s)
        acceleration = (
            effort_n - settings.damping * velocity - settings.spring * position - friction - force
        ) / self._mass
        return np.array(
            [
                position + elapsed * velocity + 0.5 * elapsed**2 * acceleration,
                velocity + elapsed * acceleration,
                force + elapsed * rate,
                rate,
            ]
        )

    def _predict_extended(self, elapsed: float, effort_n: float) -> None:
        settings = self._settings
        turn = math.tanh(self._state[1] / settings.friction_velocity_mm_s)
        drag = settings.damping + settings.dry_friction_n * (1.0 - turn * turn) / (
            settings.friction_velocity_mm_s
        )
        slopes = np.array([-settings.spring, -drag, -1.0, 0.0]) / self._mass
        jacobian = np.eye(4)
        jacobian[0, 1] = elapsed
        jacobian[2, 3] = elapsed
        jacobian[0] += 0.5 * elapsed**2 * slopes
        jacobian[1] += elapsed * slopes
        self._state = self._moved(self._state, elapsed, effort_n)
        self._covariance = jacobian @ self._covariance @ jacobian.T

    def _predict_unscented(self, elapsed: float, effort_n: float) -> None:
        # Scaled by the deviations, or the root would lose the small ones.
        deviations = np.sqrt(np.maximum(np.diag(self._covariance), 1e-18))
        correlation = self._covariance / np.outer(deviations, deviations)
        root = deviations[:, None] * np.linalg.cholesky(correlation + 1e-12 * np.eye(4))
        spread = 2.0 * root  # sqrt(n + kappa) with n = 4
        points = np.concatenate([self._state[:, None] + spread, self._state[:, None] - spread], 1)
        moved = self._moved(points, elapsed, effort_n)
        centre = self._moved(self._state, elapsed, effort_n)
        # kappa 0, alpha 1: the centre has no weight in the mean, and beta 2 in the covariance.
        self._state = moved.mean(axis=1)
        away, aside = moved - self._state[:, None], centre - self._state
        self._covariance = away @ away.T / 8.0 + 2.0 * np.outer(aside, aside)


class ParticleForceFilter(ForceFilter):
    """Paper C's SIR particle filter with equation 26 as printed; it knows the tissue.

    Each particle has position, velocity and force. The third row of Eq. 26 makes the force from
    the position and velocity before the step plus sigma_3's noise, and this force moves the
    particle in the next step. Misprints are read as elsewhere in this suite: penetration is
    max(0, x - surface), the element (2, 1) is that of a spring, the weight has a minus sign. Dry
    friction is not in Eq. 26; where it is told it is taken from the drive.
    """

    def __init__(self, settings: EffortSettings) -> None:
        """Tell it slave, tissue and noise."""
        super().__init__()
        self._settings = settings
        self._mass = TONNE_PER_KG * settings.mass_kg
        self.reset()

    def reset(self) -> None:
        """Forget all readings, and draw again from the seed."""
        super().reset()
        self._random = np.random.Generator(np.random.PCG64(self._settings.seed))
        self._particles = np.zeros((3, self._settings.particles))

    def _begin(self, position_mm: float) -> tuple[float, float]:
        self._particles[0], self._particles[1:] = position_mm, 0.0
        return position_mm, 0.0

    def _resume(self, elapsed: float, position_mm: float, velocity_mm_s: float) -> None:
        settings = self._settings
        position, velocity = self._random.standard_normal((2, settings.particles))
        position *= settings.position_noise_mm
        velocity = velocity_mm_s + (settings.position_noise_mm * velocity + position) / elapsed
        self._particles[:2] = position_mm + position, velocity
        self._particles[2] = self._law(self._particles[0], velocity)

    def _is_known(self, since_s: float) -> bool:
        return True  # by the tissue that it knows

    def _follow(self, elapsed: float, position_mm: float, effort_n: float) -> tuple[float, float]:
        settings, count = self._settings, self._settings.particles
        draws = self._random.standard_normal((3, count)) * np.array(settings.sigma)[:, None]
        offset = self._random.random()
        position, velocity, force = self._particles
        # Over a long step the velocity decays by exp(-b T/m), and pushes count for its mean.
        rate = settings.damping / self._mass
        decay = math.exp(-rate * elapsed)
        share = elapsed if rate * elapsed < 1e-12 else (1.0 - decay) / rate
        friction = settings.dry_friction_n * np.tanh(velocity / settings.friction_velocity_mm_s)
        pushed = (effort_n - friction - settings.spring * position - force) / self._mass
        tissue_force = self._law(position, velocity)
        moved = draws
        moved[0] += position + elapsed * velocity
        moved[1] += decay * velocity + share * pushed
        moved[2] += tissue_force
        residual = (position_mm - moved[0]) / settings.position_noise_mm
        weights = -0.5 * residual * residual
        weights = np.exp(weights - weights.max())
        weights /= weights.sum()
        mean = moved @ weights
        marks = (np.arange(count) + offset) / count
        chosen = np.minimum(np.searchsorted(np.cumsum(weights), marks), count - 1)
        self._particles = moved[:, chosen]
        return float(mean[0]), float(mean[2])

    def _law(self, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """Force of the tissue that it knows, shape of the arguments."""
        depth = position - self._settings.surface_mm
        return hunt_crossley_force(depth, velocity, np.array([*self._settings.tissue, 1.0]))


def error_in_motion(settings: EffortSettings) -> float:
    """Error of the force while the tool moves that no noise at rest shows [N]."""
    return OBSERVED_ERROR_N + UNKNOWN_SHARE * settings.dry_friction_n
