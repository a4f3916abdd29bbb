"""Force zero and contact position from the samples: what ~/tare and ~/find_surface set going."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rclpy.parameter import Parameter

from hc_estimator.input.surface import SurfaceFinder
from hc_estimator.input.tare import Tare, TareResult

ZEROS = ("input.force.zero", "input.position.zero")


class Zeroing:
    """Collects samples while a tare or a search for the surface is under way."""

    def __init__(self) -> None:
        self._collector: Tare | SurfaceFinder | None = None

    @property
    def active(self) -> bool:
        """Whether samples are wanted."""
        return self._collector is not None

    def tare(self, samples: int) -> str:
        """Take the means of the next samples; returns what to tell the user."""
        self._collector = Tare(samples)
        return f"takes the mean of the next {samples} samples; hc/events says when it is done"

    def find_surface(self) -> str:
        """Find the surface in the next approach; returns what to tell the user."""
        self._collector = SurfaceFinder()
        return "press from free motion into the tissue; hc/events says where the surface was"

    def cancel(self) -> None:
        """Want no more samples."""
        self._collector = None

    def add(self, displacement_mm: float, force_n: float) -> TareResult | None:
        """Take in a sample; return the result with the last one that was wanted."""
        assert self._collector is not None
        found = self._collector.add(displacement_mm, force_n)
        if found is not None:
            self._collector = None
        return found

    @staticmethod
    def parameters(found: TareResult, values: Mapping[str, Any]) -> list[Parameter]:
        """Return the node's parameters with the new zeros.

        Args:
            found: in readings that came with the present zeros taken off.
            values: the present parameters.
        """
        means = (found.force_n, found.displacement_mm)
        return [
            Parameter(name, value=values[name] + mean)
            for name, mean in zip(ZEROS, means, strict=True)
        ]

    @staticmethod
    def describe(found: TareResult, zeros: list[Parameter]) -> str:
        """Return a line for the event."""
        return (
            f"force zero {zeros[0].value:.6g} N (deviation {found.force_std_n:.2g} N), contact at "
            f"{zeros[1].value:.6g} mm (deviation {found.displacement_std_mm:.2g} mm)"
        )
