"""What a plain filter does when it is lost: it starts anew instead of staying lost, and says so.

Plain filters can be driven where the contact law means nothing: ln K beyond any tissue. From there
no data brings them back, and sooner or later the covariance has no factor any more. Each filter
calls `recover` after each sample. Start, recovery and restart all go through `reset`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hc_estimator.adaptation import covariance_matching, noise_doubt, policy, strong_tracking
from hc_estimator.compilation import compiled
from hc_estimator.correction import open_gate
from hc_estimator.memory import Field
from hc_estimator.screening import ACCEPTED, NUMERICAL, OUTLIER
from hc_estimator.state_space import registry as state_space

FAILURES = 10  # numerical failures in a row after which the filter starts anew
REFUSED_TIME = 1.0  # a filter that refuses everything for so long starts anew [s]
REFUSED_SAMPLES = 20  # and for so many samples

WATCHED_TIME = 1.0  # over which predictions are held against the readings [s]
WATCHED_READINGS = 20  # and over so many of a channel
WORTHLESS_WINDOWS = 2  # one after another, for the first one may be that of learning
WORSE = 4.0  # mean square over that of the last reading held from which on a prediction is worse
NOT_EXPLAINED = 0.25  # share of the force's mean square

FIELDS = (
    Field("failures", np.int64, (), 0),
    Field("begun", np.int64, (), 0, 1),  # 0 until a filter has drawn or set what it has of its own
    # Of the present window, displacement and force:
    Field("watched_time", np.float64, (), 0.0),  # [s]
    Field("watched", np.int64, (2,), 0),  # readings
    Field("watched_reading", np.float64, (2,)),  # the last one
    Field("watched_errors", np.float64, (2,), 0.0),  # squared innovations
    Field("watched_steps", np.float64, (2,), 0.0),  # squared steps from reading to reading
    Field("watched_force", np.float64, (), 0.0),  # squared forces
    Field("worthless", np.int64, (), 0),  # windows one after another
)


@compiled
def reset(settings: Any, memory: Any) -> None:
    """Forget all samples: state, noise, windows and counts are those before the first one.

    What only the next sample can tell, or what lies outside of the record (particles), a filter
    sets when it finds memory.begun at 0. Random numbers go on where they were.
    """
    state_space.prior(settings, memory.state, memory.covariance)
    for i in range(4):
        memory.prior_variance[i] = memory.covariance[3 + i, 3 + i]
    memory.process_noise_scale = 1.0
    memory.change_detected = 0
    memory.begun = 0
    memory.started = 0
    memory.backward_count = 0
    memory.refused_count = 0
    memory.failures = 0
    for i in range(2):
        memory.outlier_counts[i] = 0
    memory.worthless = 0
    _begin_window(memory)
    policy.reset(settings, memory)
    strong_tracking.restart(memory)
    covariance_matching.restart(memory)
    noise_doubt.restart(memory)


@compiled
def _begin_window(memory: Any) -> None:
    """Forget the predictions of the last window."""
    memory.watched_time = 0.0
    memory.watched_force = 0.0
    for i in range(2):
        memory.watched[i] = 0
        memory.watched_errors[i] = 0.0
        memory.watched_steps[i] = 0.0


@compiled
def _is_worthless(memory: Any) -> bool:
    """Hold the predictions against the accepted readings; True if they are no use.

    A displacement that the last reading foretells better is a motion that was lost, and so is a
    force if the prediction misses most of it as well (a law that does not fit misses some). Whoever
    takes all of that for noise of the sensors never comes back.
    """
    if memory.restart != 0:
        memory.watched[0] = 0
        memory.watched[1] = 0
        return False
    for i in range(2):
        if memory.present[i] == 0:
            continue
        reading, innovation = memory.measurement[i], memory.innovation[i]
        if memory.watched[i] > 0:
            step = reading - memory.watched_reading[i]
            memory.watched_errors[i] += innovation * innovation
            memory.watched_steps[i] += step * step
            if i == 1:
                memory.watched_force += reading * reading
        memory.watched_reading[i] = reading
        memory.watched[i] += 1
    memory.watched_time += memory.elapsed
    fewest = min(memory.watched[0], memory.watched[1])
    if memory.watched_time < WATCHED_TIME or fewest < WATCHED_READINGS:
        return False
    errors, steps = memory.watched_errors, memory.watched_steps
    bad = errors[0] > WORSE * steps[0]
    if errors[1] > WORSE * steps[1] and errors[1] > NOT_EXPLAINED * memory.watched_force:
        bad = True
    memory.worthless = memory.worthless + 1 if bad else 0
    _begin_window(memory)
    return bool(memory.worthless >= WORTHLESS_WINDOWS)


@compiled
def start_anew(settings: Any, memory: Any) -> None:
    """Reset; the report says that what was learnt is gone, and where the tool is."""
    displacement = memory.measurement[0] if memory.present[0] != 0 else memory.state[0]
    reset(settings, memory)
    state, covariance = memory.state, memory.covariance
    state_space.start_motion(settings, displacement, memory.measurement[1], state, covariance)
    memory.change_detected = 1


@compiled
def _is_hopeless(memory: Any, time: float, decision: int) -> bool:
    """Count a refusal by the filter itself; True if it has refused everything for too long."""
    if decision == NUMERICAL:
        memory.failures += 1
    else:
        memory.failures = 0
    if memory.refused_count == 0 or time < memory.refused_since:
        memory.refused_since = time
        memory.refused_count = 0
    memory.refused_count += 1
    waited = time - memory.refused_since
    enough = memory.refused_count >= REFUSED_SAMPLES and waited > REFUSED_TIME
    return bool(enough or memory.failures >= FAILURES)


@compiled
def _answer_outliers(settings: Any, memory: Any) -> None:
    """Forget what the outliers contradict, now that so many came that they are to be believed.

    A displacement that jumps is a motion begun anew. A force that jumps is another tissue; what
    was learnt of its noise from innovations goes with it.
    """
    if memory.outlier_counts[0] == settings.outlier_limit:
        memory.started = 0
        open_gate(settings, memory, 0)
    elif memory.outlier_counts[1] == settings.outlier_limit:
        open_gate(settings, memory, 1)
        _forget_tissue(settings, memory)


@compiled
def _forget_tissue(settings: Any, memory: Any) -> None:
    """Begin anew with another tissue, and with the noise that was learnt from its innovations."""
    policy.forget_tissue(settings, memory)
    covariance_matching.restart(memory)
    for i in range(2):
        if memory.noise_channels[i].count == 0:
            policy.set_noise(settings, memory, i)
    memory.begun = 0
    memory.change_detected = 1


@compiled
def recover(settings: Any, memory: Any, time: float, decision: int) -> None:
    """Start anew where a filter is lost; the report then says that a change was detected.

    It is lost where the parameters have left every physical range, where its predictions are
    worthless, after `FAILURES` numerical failures in a row, and once it has refused everything for
    `REFUSED_TIME`. Readings that the screening refused do not count: they are the sensor's fault.

    Args:
        settings: settings record.
        memory: memory record.
        time: stamp of the sample [s].
        decision: code of the decision on the sample.
    """
    if decision == ACCEPTED:
        memory.failures = 0
        memory.refused_count = 0
        if state_space.is_literal(settings):
            return
        if state_space.is_lost(settings, memory.state) or _is_worthless(memory):
            start_anew(settings, memory)
        return
    memory.change_detected = 0
    if decision not in (OUTLIER, NUMERICAL):
        return
    if _is_hopeless(memory, time, decision):
        start_anew(settings, memory)
    elif decision == OUTLIER and not state_space.is_literal(settings):
        _answer_outliers(settings, memory)
