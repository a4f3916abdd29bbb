"""Doubt about a noise level of the force that was learnt from innovations.

What a lost filter does not explain it takes for noise of the sensor, and then trusts the readings
too little to find back; averaged over all samples (`raukf`, weight 1 / J) such a level stays for
minutes. But noise shows in the readings themselves: the third difference of a smooth signal is
nearly zero, that of white noise of variance r has the variance 20 r. A level far beyond what these
differences show, and a good part of the force, is none of the sensor's.

Looked at are samples in contact, in windows of two seconds. A law that does not fit leaves a misfit
that comes back after every new beginning, so each doubt doubles the wait for the next one.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hc_estimator.adaptation import policy
from hc_estimator.compilation import compiled
from hc_estimator.memory import Field

ORDER = 3  # of the differences
DIFFERENCE_VARIANCE = 20.0  # of the third difference of white noise of variance 1
WINDOW_TIME = 2.0  # in contact [s]
WINDOW_READINGS = 200
LONGEST_PATIENCE = 20  # doublings of the wait, which begins with one window
CALM = 4  # waits without doubt after which the wait is halved again
BEYOND_SHOWN = 500.0  # variance in use over that in the readings: real tissue took it to 290
SHARE_OF_FORCE = 0.02  # of the mean squared force; what any law may leave unexplained
BEYOND_GIVEN = 4.0  # variance in use over that of the settings
PRESSED = 50.0  # mean squared force over the variance in the readings: the tool presses

FIELDS = (
    # Of the present window:
    Field("doubt_last", np.float64, (ORDER,)),  # forces, newest first [N]
    Field("doubt_following", np.int64, (), 0, ORDER),  # of them, that follow one another
    Field("doubt_time", np.float64, (), 0.0),  # in contact [s]
    Field("doubt_readings", np.int64, (), 0),
    Field("doubt_differences", np.float64, (), 0.0),  # sum of their squares [N^2]
    Field("doubt_force", np.float64, (), 0.0),  # sum of the squared forces [N^2]
    Field("doubt_noise", np.float64, (), 0.0),  # sum of the variances in use [N^2]
    # Of the windows before it:
    Field("doubt_windows", np.int64, (), 0),  # in a row whose noise is none of the readings'
    Field("doubt_quiet", np.int64, (), 0),  # in a row whose noise may be
    Field("doubt_patience", np.int64, (), 0, LONGEST_PATIENCE),
)


@compiled
def restart(memory: Any) -> None:
    """Forget the windows; what was learnt of patience stays."""
    memory.doubt_windows = 0
    memory.doubt_quiet = 0
    memory.doubt_following = 0
    _begin_window(memory)


@compiled
def _begin_window(memory: Any) -> None:
    memory.doubt_time = 0.0
    memory.doubt_readings = 0
    memory.doubt_differences = 0.0
    memory.doubt_force = 0.0
    memory.doubt_noise = 0.0


@compiled
def doubts(settings: Any, memory: Any) -> bool:
    """Take an accepted sample; True if the noise in use is none of the force sensor's.

    Args:
        settings: settings record.
        memory: memory record.
    """
    if memory.restart != 0 or not policy.is_touching(memory):
        memory.doubt_following = 0
        return False
    last, reading = memory.doubt_last, memory.measurement[1]
    if memory.doubt_following == ORDER:
        difference = reading - 3.0 * (last[0] - last[1]) - last[2]
        memory.doubt_differences += difference * difference
        memory.doubt_force += reading * reading
        memory.doubt_noise += memory.noise[1]
        memory.doubt_readings += 1
        memory.doubt_time += memory.elapsed
    else:
        memory.doubt_following += 1
    last[2], last[1], last[0] = last[1], last[0], reading
    if memory.doubt_time < WINDOW_TIME or memory.doubt_readings < WINDOW_READINGS:
        return False
    return _judge(settings, memory)


@compiled
def _judge(settings: Any, memory: Any) -> bool:
    """End the window; True if it is the last one of a row that is long enough."""
    shown = memory.doubt_differences / DIFFERENCE_VARIANCE
    claimed, force = memory.doubt_noise, memory.doubt_force
    given = settings.force_noise_std * settings.force_noise_std
    beyond = claimed > BEYOND_SHOWN * shown and claimed > SHARE_OF_FORCE * force
    beyond = beyond and claimed > BEYOND_GIVEN * given * memory.doubt_readings
    _begin_window(memory)
    if force < PRESSED * shown:
        return False
    wait = 2**memory.doubt_patience
    if beyond:
        memory.doubt_quiet = 0
        memory.doubt_windows += 1
        if memory.doubt_windows < wait:
            return False
        memory.doubt_windows = 0
        memory.doubt_patience = min(memory.doubt_patience + 1, LONGEST_PATIENCE)
        return True
    memory.doubt_windows = 0
    memory.doubt_quiet += 1
    if memory.doubt_quiet >= CALM * wait:
        memory.doubt_quiet = 0
        memory.doubt_patience = max(memory.doubt_patience - 1, 0)
    return False
