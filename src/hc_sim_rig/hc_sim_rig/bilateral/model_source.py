"""What the slave's estimator knows, as the model that the slave sends."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.bilateral import layout
from hc_sim_rig.bilateral.mediator import PROVISIONAL_FORCE, PROVISIONAL_STIFFNESS, ModelGate

Array = NDArray[np.float64]

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
        self.current = SlaveModel()

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
    ) -> None:
        """Take in an estimate.

        Args:
            parameters: K, B, n, p, shape (4,).
            covariance: of them, shape (4, 4).
            surface_mm: where contact begins, in the slave's own position.
            depth_mm: penetration now.
            seconds: since the estimate before.
        """
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
