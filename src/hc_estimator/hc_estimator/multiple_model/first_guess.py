"""The first guess of K and B: from the first clear contact, and from what was felt before.

Ours: an order of magnitude, not a fit; the prior around it stays as wide as it was.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import plausible
from hc_estimator.multiple_model.hypotheses import DEPTH, EXPONENT, LOG_DAMPING, LOG_STIFFNESS
from hc_estimator.multiple_model.rows import is_held

# From which a force says the order of magnitude of K [mm], and in deviations of the depth.
SMALLEST_DEPTH = 0.05
CERTAIN = 3.0
FREE_DEPTH = 1.0  # from which on no force says something of K [mm]
CONTACT_READINGS = 3  # readings in a row that say there is a force
SURE = 5.0  # a force beyond so many standard deviations is one


@compiled
def centre_prior(settings: Any, bank: Any) -> None:
    """Centre the prior of K and B on the first clear contact; its width stays.

    K spans decades between tissues. From a first guess a hundred times too stiff the linearised
    update needs long to come down, and the first force reading says the order of magnitude. As long
    as nothing was felt yet, it says what K is at most.
    """
    clock = bank.clock
    chosen = bank.rows[bank.judge.chosen]
    depth = chosen.state[DEPTH]
    sure = SURE * math.sqrt(bank.sensor_noise[1])
    if clock.present[1] == 0 or depth < SMALLEST_DEPTH:
        return
    if depth < CERTAIN * math.sqrt(chosen.covariance[DEPTH, DEPTH]):
        return
    pressed = clock.measurement[1] >= sure
    if bank.contact_readings < CONTACT_READINGS:
        bank.contact_readings = bank.contact_readings + 1 if pressed else 0
    if not pressed and (depth < FREE_DEPTH or bank.contact_readings == CONTACT_READINGS):
        return
    if pressed:  # until calibrated each sample says it anew, for no force is used
        bank.guessed = bank.calibrated
    if is_held(settings, 0):
        return
    log_force = math.log(max(clock.measurement[1], sure))
    for m in range(bank.rows.shape[0]):
        state = bank.rows[m].state
        shift = log_force - state[EXPONENT] * math.log(depth) - state[LOG_STIFFNESS]
        if not pressed and shift > 0.0:
            continue
        if bank.tool.deepest > depth:  # felt before the zeros moved, in the same tissue
            most = math.log(plausible.LARGEST_FACTOR * max(bank.tool.largest_force, sure))
            most -= state[EXPONENT] * math.log(bank.tool.deepest)
            shift = min(shift, most - state[LOG_STIFFNESS])
        state[LOG_STIFFNESS] += shift
        if not is_held(settings, 1):
            state[LOG_DAMPING] += shift
