"""Whether two estimators of one name told their estimates on one topic: a bag holds them mixed.

Nothing in a message says who sent it, so that they cannot be told apart again. Their samples can
be estimated anew.
"""

from __future__ import annotations

import shlex
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_logger.layout import stamps
from hc_logger.recorded import Recording

_NEAR: Final = 1000
"""Rows; two estimators tell of one sample within these, a player that loops later."""
_LEAST_SHARE: Final = 0.01
"""Of the estimates that are of a sample which another one is of, too."""


def are_mixed(estimates: NDArray[Any]) -> bool:
    """Whether estimates of several estimators stand among one another.

    Args:
        estimates: records of hc_msgs/HuntCrossleyEstimate with stamps, as they were recorded.
    """
    if not len(estimates):
        return False
    stamp, sequence = stamps(estimates), estimates["sequence"]
    order = np.lexsort((sequence, stamp))
    same = (np.diff(stamp[order]) == 0) & (np.diff(sequence[order].astype(np.int64)) == 0)
    twice = np.count_nonzero(same & (np.abs(np.diff(order)) <= _NEAR))
    return bool(twice > _LEAST_SHARE * len(estimates))


def mixture_in(recording: Recording) -> str:
    """Say that the recorded estimates are those of several estimators; empty if they are not.

    Args:
        recording: a bag.

    Raises:
        BagError: if the recording is not a bag, or has several topics of estimates.
    """
    if not are_mixed(recording.estimates):
        return ""
    return (
        "its estimates are those of two or more estimators of one name, mixed, and nothing says "
        f"which is whose (hc estimate {shlex.quote(str(recording.path))} takes its samples); give "
        "each a namespace next time (-r __ns:=/left)"
    )
