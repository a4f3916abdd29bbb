"""Where a bag lacks estimates that were published: a full disk, a recorder that did not follow.

What the estimator saw meanwhile is not in the bag either, so nothing behind it can be recomputed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hc_logger.bag import Bag
from hc_logger.estimate_arrays import estimates_of_bag
from hc_logger.foreign import open_bag
from hc_logger.recorded import Recording, only_topic
from hc_logger.session import LONGEST_COUNTED_GAP
from hc_logger.type_names import ESTIMATE_TYPE, ESTIMATES_TYPE
from hc_msgs_py.topics import ESTIMATE, ESTIMATES


def rows_behind_missing(recording: Recording) -> NDArray[np.int64]:
    """Return the rows of a bag's estimates before which some are missing, ascending.

    The publisher's counter tells, where it was recorded. Of estimates on two topics it tells of
    neither, for a stream may go over from one to the other.

    Args:
        recording: a bag.

    Raises:
        BagError: if it cannot be read.
    """
    with open_bag(recording.path, recording.namespace) as bag:
        single = only_topic(bag, ESTIMATE_TYPE, ESTIMATE)
        arrays = only_topic(bag, ESTIMATES_TYPE, ESTIMATES)
        counted = {topic: _counters(bag, topic) for topic in (single, arrays) if topic}
        used = [topic for topic, (counters, _) in counted.items() if len(counters)]
        if len(used) != 1:
            return np.empty(0, np.int64)
        counters, times = counted[used[0]]
        steps = np.diff(counters)
        behind = 1 + np.flatnonzero((steps > 1) & (steps < LONGEST_COUNTED_GAP))
        if used[0] == single or not len(behind):
            return behind
        return np.searchsorted(estimates_of_bag(bag, used[0])[1], times[behind])


def _counters(bag: Bag, topic: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the publisher's counters of a topic, and their log times [ns], in order of these."""
    counters, times = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for messages, names in bag.chunks():
        own = np.isin(messages.channel, [i for i, name in names.items() if name == topic])
        counters.append(messages.sequence[own].astype(np.int64))
        times.append(messages.log_time[own])
    counter, time = np.concatenate(counters), np.concatenate(times)
    order = np.argsort(time, kind="stable")
    return counter[order], time[order]
