"""What a slave tells of the truth is the truth at the tool's place, lump included."""

import math

import numpy as np
import pytest

from hc_estimator.contact import hunt_crossley_force
from hc_sim_rig.bilateral import Bilateral
from hc_sim_rig.bilateral.layout import Y_SIZE, Y_SLAVE, Y_SLAVE_VELOCITY
from hc_sim_rig.bilateral.live_kernel import tissue_force
from hc_sim_rig.bilateral.sides import SlaveSample
from hc_sim_rig.slave_node import SlaveNode


@pytest.mark.parametrize("lateral_mm", [-40.0, 0.0, 9.0, 12.0, 13.5])
def test_the_true_parameters_give_the_true_force(lateral_mm: float) -> None:
    """Regression: on the lump the truth had K and B of the tissue around it, less than half."""
    settings = Bilateral()
    y = np.zeros(Y_SIZE)
    y[Y_SLAVE], y[Y_SLAVE_VELOCITY] = 2.5, 11.0
    force_n = tissue_force(y, lateral_mm, settings.constants())
    sample = SlaveSample(
        2.5, 11.0, force_n, 0.0, 2.5, lateral_mm, 10.0, y[Y_SLAVE], y[Y_SLAVE_VELOCITY], force_n
    )
    slave = SlaveNode.__new__(SlaveNode)
    slave._tissue, slave._rate_hz = settings.tissue, settings.rate_hz
    truth = slave._as_rig_sample(3, sample).truth
    assert truth.contact
    law = hunt_crossley_force(truth.displacement_mm, truth.velocity_mm_s, *truth.parameters)
    assert math.isclose(law, truth.force_n, rel_tol=1e-12)
