"""How values of a series go together, and how much less errors say for it than their number."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def autocorrelation(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the correlation with values that come later, by how many; empty where nothing varies.

    Args:
        values: shape (n,); their mean is taken off.

    Returns:
        Shape (n,), the first one 1.
    """
    centred = values - np.mean(values)
    size = 1 << int(2 * centred.size - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    found: NDArray[np.float64] = np.fft.irfft(spectrum, size)[: centred.size]
    return found / found[0] if found[0] > 0.0 else np.empty(0)


def samples_for_one(error: NDArray[np.float64]) -> float:
    """Return how many samples count as one: 1 + 2 sum of the autocorrelation up to its first zero.

    Args:
        error: what a fit left, shape (samples,); its mean is taken off.
    """
    correlation = autocorrelation(error)[: error.size // 2]
    if not correlation.size:
        return 1.0
    negative = np.flatnonzero(correlation <= 0.0)
    end = int(negative[0]) if negative.size else correlation.size
    return float(1.0 + 2.0 * np.sum(correlation[1:end]))
