"""What a filter does when it is lost: it starts anew instead of staying lost.

Plain filters (without limits on their parameters) can be driven where the contact law means
nothing: ln K beyond any tissue, an exponent of 9. From there no data brings them back, and sooner
or later the covariance has no factor any more. Each filter calls `recover` after each sample.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.memory import Field
from hc_estimator.contact.registry import end_of_parameters
from hc_estimator.screening import ACCEPTED, NUMERICAL
from hc_estimator.state_space import registry as state_space

FAILURES = 10  # numerical failures in a row after which the filter starts anew

FIELDS = (Field("failures", np.int64, (), 0),)


@compiled
def forget_parameters(settings: Any, memory: Any) -> None:
    """Set mean and covariance of the parameters to the first guess; the motion stays."""
    state_space.prior(settings, memory.updated_state, memory.updated_covariance)
    last = end_of_parameters(settings.contact_model)
    for i in range(3, last):
        memory.state[i] = memory.updated_state[i]
        for j in range(7):
            memory.covariance[i, j] = 0.0
            memory.covariance[j, i] = 0.0
        memory.covariance[i, i] = memory.updated_covariance[i, i]


@compiled
def recover(settings: Any, memory: Any, decision: int) -> None:
    """Start anew where a filter is lost.

    After an accepted sample whose parameters left every physical range, the parameters start from
    the first guess; the report then says that a change was detected, because the estimate no
    longer builds on what came before. After `FAILURES` numerical failures in a row the whole
    filter starts anew with the next sample.

    Args:
        settings: settings record.
        memory: memory record.
        decision: code of the decision on the sample.
    """
    if decision == NUMERICAL:
        memory.failures += 1
        if memory.failures >= FAILURES:
            memory.failures = 0
            memory.started = 0
            memory.tempering_count = 0
            state_space.prior(settings, memory.state, memory.covariance)
    elif decision == ACCEPTED:
        memory.failures = 0
        if state_space.is_lost(settings, memory.state):
            forget_parameters(settings, memory)
            memory.tempering_count = 0
            memory.change_detected = 1
