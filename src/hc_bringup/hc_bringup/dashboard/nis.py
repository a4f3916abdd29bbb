"""Bands of the mean NIS by chi-square, for the pages."""

from __future__ import annotations

from typing import Final

from scipy.special import gammaincinv

DEGREES: Final = 2
COUNTS: Final = 60
"""Bands of the mean of up to so many NIS are told to the page; it goes on from there."""
SHARES: Final = (0.025, 0.975)


def nis_band(count: int) -> list[float]:
    """Return the 95 % band of the mean of so many NIS."""
    shape = 0.5 * DEGREES * count
    return [2.0 * float(gammaincinv(shape, share)) / count for share in SHARES]


def nis_bands() -> list[list[float]]:
    """Return the bands for 1, 2 and so on."""
    return [nis_band(count) for count in range(1, COUNTS + 1)]
