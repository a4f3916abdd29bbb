"""How well straight lines between readings at regular times describe a piece of a channel.

A channel that was interpolated lies on the straight lines between its readings to rounding, once
rate and phase of the readings are right; with any other phase it does not. Least squares for the
readings: each sample depends on two neighbours, so the normal equations are tridiagonal.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dptsv

FloatArray = NDArray[np.float64]
_RIDGE = 1e-11
"""Of a sample's weight: readings that no sample depends on stay near zero."""


def misfits(
    places: FloatArray, values: FloatArray, ratios: FloatArray, phases: FloatArray
) -> FloatArray:
    """Return the deviation from the lines, for several rates and phases.

    Args:
        places: of the samples, shape (n,), in samples.
        values: shape (n,).
        ratios: samples from reading to reading, shape (m,).
        phases: place of one of the readings, shape (m,), in samples.

    Returns:
        Root mean square by degree of freedom, shape (m,); 0 where nothing is left to judge by.
    """
    count = len(ratios)
    along = (places - phases[:, None]) / ratios[:, None]
    knots = np.floor(along).astype(np.int64)
    share = along - knots
    knots -= knots.min(axis=1, keepdims=True)
    size = int(knots.max()) + 2
    rows = knots + size * np.arange(count)[:, None]
    centred = values - values.mean()

    def summed(at: NDArray[np.int64], weights: FloatArray) -> FloatArray:
        flat = np.bincount(at.ravel(), weights.ravel(), minlength=count * size)
        return flat.astype(np.float64).reshape(count, size)

    diagonal = summed(rows, (1.0 - share) ** 2) + summed(rows + 1, share**2) + _RIDGE
    beside = summed(rows, share * (1.0 - share))
    right = summed(rows, (1.0 - share) * centred) + summed(rows + 1, share * centred)
    readings = _solve(diagonal, beside, right)
    picked = np.take_along_axis(readings, knots, axis=1)
    following = np.take_along_axis(readings, knots + 1, axis=1)
    left = centred - (1.0 - share) * picked - share * following
    free = len(places) - (knots.max(axis=1) + 2)
    return np.where(free > 0, np.sqrt(np.sum(left**2, axis=1) / np.maximum(free, 1)), 0.0)


def _solve(diagonal: FloatArray, beside: FloatArray, right: FloatArray) -> FloatArray:
    """Solve symmetric tridiagonal equations, shape (m, size) each.

    Nothing lies beside a last element: all m are one system of m size unknowns (LAPACK's dptsv).
    """
    solution, info = dptsv(diagonal.ravel(), beside.ravel()[:-1], right.ravel())[2:]
    if info == 0:
        return np.asarray(solution, np.float64).reshape(right.shape)
    return _eliminate(diagonal, beside, right)  # not positive, by rounding


def _eliminate(diagonal: FloatArray, beside: FloatArray, right: FloatArray) -> FloatArray:
    """The same by elimination, with pivots that are positive in any case."""
    size = diagonal.shape[1]
    pivots = np.ascontiguousarray(diagonal.T)
    upper = np.ascontiguousarray(beside.T)
    result = np.ascontiguousarray(right.T)
    for i in range(1, size):
        factor = upper[i - 1] / pivots[i - 1]
        pivots[i] -= factor * upper[i - 1]
        np.maximum(pivots[i], _RIDGE, out=pivots[i])
        result[i] -= factor * result[i - 1]
    result[-1] /= pivots[-1]
    for i in range(size - 2, -1, -1):
        result[i] = (result[i] - upper[i] * result[i + 1]) / pivots[i]
    return np.ascontiguousarray(result.T)
