"""When do the innovations say how the tool moves (`density_correction`)?

While the contact law fits, both channels have a reading and their noises hold: else it is the law,
or a noise about to be known better, that they speak of.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.adaptation import density_correction, noise_color
from hc_estimator.adaptation.policy import DIFFERENCES
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.kalman import depth_of

STEADY_TIME = 0.5  # of contact before the jerk density is corrected [s]
UNTEMPERED = 1.2  # force noise over the sensor's up to which that is done


@compiled
def correct(settings: Any, bank: Any, chosen: Any) -> None:
    """Let the jerk density follow the joint innovations of the row in charge.

    Args:
        settings: settings record.
        bank: its record `motion` is changed.
        chosen: row in charge, updated with the sample.
    """
    present = bank.clock.present
    if settings.motion_adaptation == 0 or bank.motion.density <= 0.0:
        return
    if present[0] == 0 or present[1] == 0:
        return
    if chosen.model_error > 0.0 or chosen.contact_time < STEADY_TIME or depth_of(chosen) <= 0.0:
        return
    if chosen.force_noise > UNTEMPERED * bank.sensor_noise[1]:
        return
    if settings.noise_adaptation == DIFFERENCES:
        for i in range(2):  # a noise about to be called lower would pass for a calmer tool
            if 2.0 * bank.noise[i].short_mean < bank.noise[i].mean:
                return
    innovation = chosen.innovation[1] / math.sqrt(chosen.innovation_variance[1])
    if noise_color.factor(bank.color[1], bank.noise[1]) > 1.0:
        innovation = 0.0  # the noise's own go together
    elapsed = bank.clock.force_elapsed
    density_correction.correct(bank.motion, chosen.untempered_nis, innovation, elapsed)
