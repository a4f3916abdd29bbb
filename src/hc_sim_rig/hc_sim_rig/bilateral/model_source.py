"""What the slave's estimator knows, as the model that the slave sends."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.bilateral import layout
from hc_sim_rig.bilateral.mediator import PROVISIONAL_FORCE, PROVISIONAL_STIFFNESS, ModelGate

Array = NDArray[np.float64]

OLDEST_S = 0.5
"""An estimate that is older makes nobody sure."""
NO_MODEL = (math.nan,) * layout.MODEL_SIZE


class SlaveModel(NamedTuple):
    """What the slave's estimator knows, ready to be sent."""

    model: tuple[float, ...] = NO_MODEL
    deviations: tuple[float, ...] = (math.nan,) * 4
    relative_std: float = math.inf
    sure: bool = False


class ModelSource:
    """Makes the model to send of estimates; holds the last one that counted."""

    def __init__(self) -> None:
        """Begin without a model: a soft spring stands in where force is first felt."""
        self._gate = ModelGate()
        self._of_s = -math.inf
        self.current = SlaveModel()

    def at(self, now_s: float) -> SlaveModel:
        """What is known at a time: of an estimate that grew old nobody is sure.

        Args:
            now_s: by the clock of `take`.
        """
        current = self.current
        if current.sure and self.age_s(now_s) > OLDEST_S:
            return current._replace(sure=False)
        return current

    def age_s(self, now_s: float) -> float:
        """Of the newest estimate; infinite before one has come."""
        return now_s - self._of_s

    def feel(self, position_mm: float, force_n: float) -> None:
        """Hear of a force before the surface is known."""
        if math.isnan(self.current.model[0]) and force_n > PROVISIONAL_FORCE:
            spring = (PROVISIONAL_STIFFNESS, 0.0, 1.0, 1.0, position_mm)
            self.current = SlaveModel(model=spring)

    def take(
        self,
        parameters: Array,
        covariance: Array,
        surface_mm: float,
        depth_mm: float,
        seconds: float,
        of_s: float,
    ) -> None:
        """Take in an estimate.

        Args:
            parameters: K, B, n, p, shape (4,).
            covariance: of them, shape (4, 4).
            surface_mm: where contact begins, in the slave's own position.
            depth_mm: penetration now.
            seconds: since the estimate before.
            of_s: when its sample was read, by a clock that nobody sets.
        """
        self._of_s = of_s
        self._gate.went(depth_mm, seconds)
        if self._gate.trusts(parameters, covariance, surface_mm):
            deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
            self.current = SlaveModel(
                (*parameters.tolist(), surface_mm),
                tuple(deviations.tolist()),
                self._gate.relative_std,
                True,
            )
        else:
            self.current = self.current._replace(sure=False)
