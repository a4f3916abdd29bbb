"""The slave's side of model mediation: from readings to the contact model that is sent.

The first approach gives surface and force zero (hc_estimator's SurfaceFinder); from then on an
estimator of hc_estimator follows. Until it is sure, and while it is unsure, something else stands
in: first a soft spring at the place where force was felt, later the last model that was trusted.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator import create_estimator
from hc_estimator.stream.surface import CLEAR, SurfaceFinder
from hc_sim_rig.bilateral.layout import HIGHEST, LOWEST, MODEL_SIZE

Array = NDArray[np.float64]

PROVISIONAL_STIFFNESS = 0.1
"""[N/mm] A soft spring says that there is something, and harms nobody."""
PROVISIONAL_FORCE = 0.1
"""[N] Force that counts as contact before the surface is found."""
LARGEST_RELATIVE_STD = 0.3
"""An estimate is trusted while the force that it gives at working depth is known so well."""
KEPT_S = 3.0
"""Readings from before the surface was found that the estimator is given afterwards."""
WORKING_SPEED = 10.0
"""[mm/s] at which the force's uncertainty is looked at."""
DEPTH_MEMORY_S = 2.0


class Mediator:
    """Takes blocks of readings, gives the model to send."""

    def __init__(self, filter: str, rate_hz: float, least_noise_n: float = 0.0) -> None:
        """Start out in the air.

        Args:
            filter: of hc_estimator.
            rate_hz: of the readings.
            least_noise_n: error in motion of a force that is calculated, not measured [N].

        Raises:
            ValueError: there is no such filter.
        """
        self._estimator = create_estimator(filter)
        self._finder: SurfaceFinder | None = SurfaceFinder(least_noise_n)
        self._kept: list[Array] = []
        self._rate = rate_hz
        self._least_contact = max(PROVISIONAL_FORCE, CLEAR * least_noise_n)
        self._surface = 0.0
        self._zero = 0.0
        self._gate = ModelGate()
        self._first_force: list[float] = []
        self.model = np.zeros(1 + MODEL_SIZE)
        """1 if there is a model; K, B, n, p, surface."""
        self.trusted = 0
        self.distrusted = 0

    def take(self, time_s: Array, position_mm: Array, force_n: Array) -> None:
        """Use a block of readings and bring `model` up to date.

        Args:
            time_s: stamps, shape (samples,).
            position_mm: of the tool, the same shape.
            force_n: of the sensor, the same shape.
        """
        if self._finder is None:
            self._estimate(time_s, position_mm, force_n)
            return
        self._kept.append(np.stack([time_s, position_mm, force_n]))
        while len(self._kept) * len(time_s) > KEPT_S * self._rate:
            del self._kept[0]
        for position, force in zip(position_mm.tolist(), force_n.tolist(), strict=True):
            found = self._finder.add(position, force)
            if found is not None:
                self._finder = None
                self._surface, self._zero = found.displacement_mm, found.force_n
                kept = np.concatenate(self._kept, axis=1)
                self._kept.clear()
                self._estimate(kept[0], kept[1], kept[2])
                return
        self._provisional(position_mm, force_n)

    @property
    def trusted_share(self) -> float:
        """Share of the renewals since the surface was found whose estimate was trusted."""
        return self.trusted / max(self.trusted + self.distrusted, 1)

    def _provisional(self, position_mm: Array, force_n: Array) -> None:
        """A soft spring where force was first felt, until the surface is known."""
        if len(self._first_force) < 10:
            self._first_force.append(float(np.mean(force_n)))
            self._zero = float(np.mean(self._first_force))
        if self.model[0] == 0.0 and float(np.median(force_n)) - self._zero > self._least_contact:
            self.model[:] = (1.0, PROVISIONAL_STIFFNESS, 0.0, 1.0, 1.0, float(position_mm[0]))

    def _estimate(self, time_s: Array, position_mm: Array, force_n: Array) -> None:
        series = self._estimator.run(time_s, position_mm - self._surface, force_n - self._zero)
        self._gate.went(float(np.max(position_mm)) - self._surface, len(time_s) / self._rate)
        parameters = np.array(series.parameters[-1])
        surface = self._surface + float(series.contact_position[-1])
        if self._gate.trusts(parameters, np.array(series.covariance[-1]), surface):
            self.model[0] = 1.0
            self.model[1:5] = parameters
            self.model[5] = surface
            self.trusted += 1
        else:
            self.distrusted += 1

    @property
    def sure(self) -> float:
        """1 while the newest estimate counts."""
        return float(self._gate.sure)


class ModelGate:
    """Says whether an estimate is good enough to act on."""

    def __init__(self) -> None:
        self._depth = 0.0
        self.relative_std = math.inf
        """Of the model's force at working depth, by the estimate's covariance."""
        self.sure = False

    def went(self, depth_mm: float, seconds: float) -> None:
        """Hear how deep the tool was; the depth of the last seconds is the working depth."""
        fading = math.exp(-seconds / DEPTH_MEMORY_S)
        self._depth = max(self._depth * fading, depth_mm)

    def trusts(self, parameters: Array, covariance: Array, surface_mm: float) -> bool:
        """Whether the estimate counts.

        Args:
            parameters: K, B, n, p, shape (4,).
            covariance: of them, shape (4, 4).
            surface_mm: contact position.
        """
        self.relative_std = self._relative_std(parameters, covariance)
        sane = bool(np.all(np.isfinite(parameters)) and math.isfinite(surface_mm)) and bool(
            np.all(parameters >= LOWEST) and np.all(parameters <= HIGHEST)
        )
        self.sure = sane and self.relative_std <= LARGEST_RELATIVE_STD
        return self.sure

    def _relative_std(self, parameters: Array, covariance: Array) -> float:
        """Standard deviation of the model's force at working depth and speed, over the force."""
        if self._depth <= 0.0 or not np.all(np.isfinite(covariance)):
            return math.inf
        stiffness, damping, exponent, velocity_exponent = parameters
        power = self._depth**exponent
        drag = power * WORKING_SPEED**velocity_exponent
        force = stiffness * power + damping * drag
        if not force > 0.0:
            return math.inf
        gradient = np.array(
            [
                power,
                drag,
                force * math.log(self._depth),
                damping * drag * math.log(WORKING_SPEED),
            ]
        )
        variance = float(gradient @ covariance @ gradient)
        return math.sqrt(max(variance, 0.0)) / float(force)
