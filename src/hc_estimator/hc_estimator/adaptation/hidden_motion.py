"""Motion that only the force shows: a tool more restless than the displacement sensor can see.

With a poor displacement sensor (an optical tracker, a long kinematic chain) the velocity may jitter
unseen, and `motion_density` then takes the tool to be calm. While the parameters are hardly known,
the filter counts the force as if it were noisy (`linearisation`), and its innovations say nothing
against that; what is learnt from a force that follows an unknown velocity is wrong, and too
certain.

But whatever the parameters, the force of a contact law changes only as fast as the motion does. A
force that changes many times in the coherence time of the motion is none of a calm tool. Then the
jerk density is raised step by step, if the displacement allows it, until that is no longer so.
What it must allow is a member of the bank that is much quicker than the likeliest and not refuted.
The density may go beyond that member's: a hand or a servo that kicks the velocity does so at high
frequencies, which the force shows, and white jerk as dense as that would wander at low ones, where
the displacement does refute it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.adaptation import linearisation, motion_density
from hc_estimator.compilation import compiled

LAG = 8  # samples between the two forces of a difference
MEMORY_TIME = 0.2  # time constant of the mean squares [s]
FEWEST = 100.0  # samples in a mean square
OFTEN = 5.0  # times that the force changes in the coherence time of the motion
TEMPERED = 2.0  # force noise over the sensor's, from which on the filter hardly uses the force
NO_NOISE = 4.0  # variance of the differences over the sensor's
MOSTLY = 0.5  # share of the samples; a tool that turned once makes a burst
RATE = 0.05  # of the logarithm of the density per sample
TURN_TIME = 0.5  # after a turn, in which the force says nothing [s]
FEWEST_MEMBERS = 4  # between the likeliest and the quickest: a velocity ten times more restless
BEYOND = 1e3  # times the density of the quickest
FORGETTING_TIME = 3.0  # in which the logarithm falls by one when nothing shows [s]

FIELDS = (
    ("late_forces", np.float64, (LAG,)),  # ring [N]
    ("late_count", np.int64, ()),
    ("late_mean", np.float64, ()),  # of the force [N]
    ("late_square", np.float64, ()),  # mean square of the force about that mean [N^2]
    ("late_difference", np.float64, ()),  # half the mean square of its difference over LAG [N^2]
    ("late_share", np.float64, ()),  # share of the samples in which that is more than noise
)


@compiled
def initialise(memory: Any) -> None:
    """No force felt yet."""
    memory.late_count = 0


@compiled
def learn(settings: Any, memory: Any) -> None:
    """Take the accepted force; raise the density if the force changes faster than the motion."""
    if memory.restart == 0:
        memory.hidden_density *= math.exp(-memory.elapsed / FORGETTING_TIME)
    turned = memory.turn_since * memory.elapsed < TURN_TIME
    if memory.restart != 0 or turned or memory.predicted_state[0] <= 0.0 or memory.elapsed <= 0.0:
        memory.late_count = 0
        return
    force, noise = memory.measurement[1], memory.sensor_noise[1]
    place = memory.late_count % LAG
    half = 0.5 * (force - memory.late_forces[place]) ** 2
    memory.late_forces[place] = force
    memory.late_count += 1
    count = memory.late_count - LAG
    if count <= 0:
        memory.late_mean = force
        memory.late_square = 0.0
        memory.late_difference = 0.0
        memory.late_share = 0.0
        return
    share = min(max(memory.elapsed / MEMORY_TIME, 1.0 / count), 1.0)
    off = force - memory.late_mean
    memory.late_mean += share * off
    memory.late_square += share * (off * off - memory.late_square)
    memory.late_difference += share * (half - memory.late_difference)
    more = 1.0 if half > NO_NOISE * noise else 0.0
    memory.late_share += share * (more - memory.late_share)
    if count < FEWEST or count * memory.elapsed < MEMORY_TIME or memory.late_share < MOSTLY:
        return
    if memory.model_error[0] > 0.0 or memory.measurement_noise[1] < TEMPERED * noise:
        return
    changing = LAG * memory.elapsed * math.sqrt(memory.late_square / memory.late_difference)
    if OFTEN * changing < linearisation.coherence_time(settings, memory):
        _raise_density(memory)


@compiled
def _raise_density(memory: Any) -> None:
    """Take a step upward, if the displacement may hide so restless a motion."""
    if memory.bank_quickest - memory.bank_chosen < FEWEST_MEMBERS:
        return
    largest = BEYOND * motion_density.density_of(memory, memory.bank_quickest)
    present = max(memory.hidden_density, memory.bank_density)
    memory.hidden_density = min(present * math.exp(RATE), largest)
