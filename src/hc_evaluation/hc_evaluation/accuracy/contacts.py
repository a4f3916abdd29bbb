"""Contacts of all the other experiments in one list: readings without a fault between channels.

For questions that concern every contact: is a delay invented, does a prediction stay possible.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hc_evaluation.accuracy import catalogue, corners, scan, separation
from hc_evaluation.accuracy.scenarios import Scenario, simulate

FloatArray = NDArray[np.float64]
Readings = tuple[FloatArray, FloatArray, FloatArray]
"""Time [s], displacement [mm], force [N], each of shape (N,)."""


def _of(scenario: Scenario, seed: int) -> Readings:
    contact = simulate(scenario, seed)
    return contact.time_s, contact.displacement_mm, contact.force_n


def _corner(index: int, seed: int) -> Readings:
    kinds = [(speed, corner) for speed in corners.DEPTHS_MM for corner in corners.CORNERS]
    return corners.cornered_contact(*kinds[index], seed)[:3]


def _scan(index: int, seed: int) -> Readings:
    contact = scan.scanned([*scan.KINDS, None][index], seed)[1]
    return contact.time_s, contact.displacement_mm, contact.force_n


CONTACTS: dict[str, tuple[int, Callable[[int, int], Readings]]] = {
    "tissues": (len(catalogue.TISSUES), lambda i, seed: _of(catalogue.TISSUES[i], seed)),
    "changes": (len(catalogue.CHANGES), lambda i, seed: _of(catalogue.CHANGES[i], seed)),
    "noise": (len(catalogue.NOISE_JUMPS), lambda i, seed: _of(catalogue.NOISE_JUMPS[i], seed)),
    "excitation": (
        len(catalogue.WEAK_MOTIONS),
        lambda i, seed: _of(catalogue.WEAK_MOTIONS[i], seed),
    ),
    "random": (10, lambda i, seed: _of(catalogue.random_scenario(10 * seed + i), seed)),
    "corners": (len(corners.DEPTHS_MM) * len(corners.CORNERS), _corner),
    "separation": (
        len(separation.SEPARATIONS),
        lambda i, seed: _of(separation.SEPARATIONS[i], seed),
    ),
    "scan": (len(scan.KINDS) + 1, _scan),
}
"""By experiment: how many contacts it has, and one of them by its index and a seed."""
