"""Where the samples of estimates and of the truth stand in a recording."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def places_of(
    wanted_ns: NDArray[Any], wanted: NDArray[Any], stamps_ns: NDArray[Any], numbers: NDArray[Any]
) -> NDArray[np.intp]:
    """Return where the samples of these stamps and numbers are, -1 where there is none.

    The number alone names no sample: a source that is started again counts anew.

    Args:
        wanted_ns: stamps that are looked for, shape (n,).
        wanted: their sequence numbers, shape (n,).
        stamps_ns: those among which they are looked for, shape (m,).
        numbers: their sequence numbers, shape (m,).
    """
    pairs = (stamps_ns, wanted_ns), [one.astype(np.uint64) for one in (numbers, wanted)]
    times, counts = (np.unique(np.concatenate(pair), return_inverse=True)[1] for pair in pairs)
    keys = times.astype(np.int64) * (int(counts.max(initial=0)) + 1) + counts
    there, looked_for = keys[: len(numbers)], keys[len(numbers) :]
    if not len(there):
        return np.full(len(wanted), -1, np.intp)
    order = np.argsort(there, kind="stable")
    place = np.maximum(np.searchsorted(there[order], looked_for, side="right") - 1, 0)
    return np.where(there[order][place] == looked_for, order[place], -1)
