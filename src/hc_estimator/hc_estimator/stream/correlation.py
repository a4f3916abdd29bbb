"""How much less a series of errors says than its number of samples, because they go together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def samples_for_one(error: NDArray[np.float64]) -> float:
    """Return how many samples count as one: 1 + 2 sum of the autocorrelation up to its first zero.

    Args:
        error: what a fit left, shape (samples,); its mean is taken off.
    """
    centred = error - np.mean(error)
    size = 1 << int(2 * centred.size - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    correlation = np.fft.irfft(spectrum, size)[: centred.size // 2]
    if correlation[0] <= 0.0:
        return 1.0
    correlation = correlation / correlation[0]
    negative = np.flatnonzero(correlation <= 0.0)
    end = int(negative[0]) if negative.size else correlation.size
    return float(1.0 + 2.0 * np.sum(correlation[1:end]))
