"""A tactile array over a lump: what its taxels read while the rig presses the flat pad.

The rig moves one tip; here it carries a pad of taxels. Every taxel is as deep as the tip, and the
tissue under each has parameters of its own: a lump makes it stiffer, as a bell over both
directions.
"""

# ruff: noqa: RUF009 - the field functions of schema.py are made for defaults

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hc_estimator.contact.arrays import hunt_crossley_force
from hc_sim_rig.records import Truth
from hc_sim_rig.schema import Section, number, section

Array = NDArray[np.float64]
_STREAM = 7
"""Keeps the pad's noise apart from that of the rig, which has the same seed."""


@dataclass(frozen=True, kw_only=True)
class Lump(Section):
    """Something stiff under the pad."""

    row: float = number(None, minimum=-1e3, maximum=1e3, about="of its centre, in taxels")
    column: float = number(None, minimum=-1e3, maximum=1e3, about="of its centre, in taxels")
    width_mm: float = number(None, above=0.0, about="standard deviation of the bell", unit="mm")
    stiffness_factor: float = number(None, minimum=0.0, maximum=1e3, about="at the centre")
    damping_factor: float = number(1.0, minimum=0.0, maximum=1e3, about="at the centre")


@dataclass(frozen=True, kw_only=True)
class Taxels(Section):
    """Rows and columns of equal taxels, and the lump under them."""

    lump: Lump = section()
    rows: int = number(8, minimum=1, maximum=256)
    columns: int = number(8, minimum=1, maximum=256)
    pitch_mm: float = number(2.0, above=0.0, maximum=1e3, unit="mm")

    def factors(self) -> tuple[Array, Array]:
        """Return the factors on K and on B under each taxel, shape (rows * columns,)."""
        row, column = np.divmod(np.arange(self.rows * self.columns), self.columns)
        lump = self.lump
        squared = ((row - lump.row) ** 2 + (column - lump.column) ** 2) * self.pitch_mm**2
        bell = np.exp(-0.5 * squared / lump.width_mm**2)
        return (
            1.0 + (lump.stiffness_factor - 1.0) * bell,
            1.0 + (lump.damping_factor - 1.0) * bell,
        )


class TaxelPad:
    """Makes the readings of all taxels from the truth about the tip."""

    def __init__(
        self, taxels: Taxels, displacement_noise_std_mm: float, force_noise_std_n: float, seed: int
    ) -> None:
        self.taxels = taxels
        self._stiffness, self._damping = taxels.factors()
        self._noise = displacement_noise_std_mm, force_noise_std_n
        self._random = np.random.default_rng([seed, _STREAM])

    def set_noise(self, displacement_noise_std_mm: float, force_noise_std_n: float) -> None:
        """Let the readings be as noisy as that from now on."""
        self._noise = displacement_noise_std_mm, force_noise_std_n

    def parameters(self, truth: Truth) -> Array:
        """Return the true K, B, n, p under each taxel, shape (taxels, 4)."""
        values = np.tile(np.asarray(truth.parameters, np.float64), (len(self._stiffness), 1))
        values[:, 0] *= self._stiffness
        values[:, 1] *= self._damping
        return values

    def readings(self, truth: Truth) -> tuple[Array, Array]:
        """Return displacements [mm] and forces [N] of all taxels, shape (taxels,) each.

        F = max(0, K d^n + B d^n sign(v)|v|^p), as the rig's own tissue.
        """
        depth = float(truth.displacement_mm)
        motion = np.array([[depth], [float(truth.velocity_mm_s)]])
        forces = hunt_crossley_force(motion[0], motion[1], self.parameters(truth))
        noise = self._random.standard_normal((2, len(forces)))
        return depth + self._noise[0] * noise[0], forces + self._noise[1] * noise[1]
