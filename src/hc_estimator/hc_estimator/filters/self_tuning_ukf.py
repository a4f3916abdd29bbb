"""`self_tuning_ukf`: the default, a bank of hypotheses on the tissue under one judge.

Nothing is to be tuned: noise, motion, drift, changes and misfit are found. What happens to a
sample, and in which order, stands in `multiple_model.sample`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.adaptation import difference_noise, motion_density
from hc_estimator.adaptation.policy import NOISE_ADAPTATION, NOISE_SPECIFICATIONS
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import (
    alignment,
    another_place,
    beginning,
    contact_onset,
    delay_evidence,
    hypotheses,
    lift_off,
    maneuver,
    moving_fit,
    plausible,
    spread,
    tempering,
    zero_doubt,
    zero_fit,
)
from hc_estimator.multiple_model.records import BANK
from hc_estimator.multiple_model.report import write_row
from hc_estimator.report import say_range
from hc_estimator.screening import ACCEPTED, screen

SPECIFICATIONS = (
    *NOISE_SPECIFICATIONS,
    NOISE_ADAPTATION,
    *difference_noise.SPECIFICATIONS,
    *motion_density.SPECIFICATIONS,
    *tempering.SPECIFICATIONS,
    *hypotheses.SPECIFICATIONS,
    *spread.SPECIFICATIONS,
    *maneuver.SPECIFICATIONS,
    *plausible.SPECIFICATIONS,
    *lift_off.SPECIFICATIONS,
    *alignment.SPECIFICATIONS,
    *delay_evidence.SPECIFICATIONS,
    *zero_fit.SPECIFICATIONS,
    *moving_fit.SPECIFICATIONS,
    *another_place.SPECIFICATIONS,
    *zero_doubt.SPECIFICATIONS,
)
# For experiments: nobody tunes these, and the accuracy pages say what each is worth.
INTERNAL = (
    *(s.name for s in difference_noise.SPECIFICATIONS),
    *(s.name for s in motion_density.SPECIFICATIONS),
    *(s.name for s in tempering.SPECIFICATIONS),
    *(s.name for s in hypotheses.SPECIFICATIONS),
    *(s.name for s in spread.SPECIFICATIONS),
    *(s.name for s in maneuver.SPECIFICATIONS),
    *(s.name for s in plausible.SPECIFICATIONS),
    *(s.name for s in lift_off.SPECIFICATIONS),
    *(s.name for s in moving_fit.SPECIFICATIONS),
    *(s.name for s in another_place.SPECIFICATIONS),
    *(s.name for s in delay_evidence.SPECIFICATIONS),
    "initial_displacement_std",
    "initial_velocity_std",
    "initial_acceleration_std",
)
FIELDS = BANK


@compiled
def initialise(settings_array: Any, memory_array: Any) -> None:
    """State of the bank before any sample."""
    settings, bank = settings_array[0], memory_array[0]
    contact_onset.reset(bank)
    bank.contact_readings = 0
    beginning.start(settings, bank)
    alignment.reset(settings, bank)


@compiled
def set_noise(settings_array: Any, memory_array: Any) -> None:
    """Take the noise levels of the settings."""
    beginning.take_noise(settings_array[0], memory_array[0])


@compiled
def take_settings(settings_array: Any, memory_array: Any) -> None:
    """Take what else of changed settings the memory holds."""
    alignment.take_setting(settings_array[0], memory_array[0])
    zero_fit.take_setting(settings_array[0], memory_array[0].zeros)


@compiled
def run(
    settings_array: Any,
    memory_array: Any,
    particles: NDArray[np.float64],
    samples: NDArray[np.float64],
    rows: NDArray[np.float64],
) -> None:
    """Run the filter over samples; arguments as in `filters.ukf.run`."""
    settings, bank = settings_array[0], memory_array[0]
    for k in range(samples.shape[0]):
        time = samples[k, 0]
        decision = screen(settings, bank.clock, time, samples[k, 1], samples[k, 2])
        if decision == ACCEPTED:
            decision = alignment.use(settings, bank, time)
        else:
            bank.change.detected = 0
        write_row(settings, bank, decision, rows[k])
        say_range(settings, samples[k, 2], rows[k])
