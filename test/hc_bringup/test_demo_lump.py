"""The first thing that a new user sees: the default filter over the lump of the rig's demo."""

import numpy as np

from hc_estimator import create_estimator
from hc_sim_rig.rig import Rig
from hc_sim_rig.scenario import load_scenario

SECONDS = 60.0


def test_no_misfit_is_told_over_the_lump_and_its_stiffness_is_followed():
    """Regression: at the peak a copy of a row that had to wait was chosen, with a misfit."""
    series = Rig(load_scenario("lump"), 0).run(SECONDS)
    estimates = create_estimator("self_tuning_ukf").run(
        series.time_s, series.displacement_mm, series.force_n
    )
    settled = series.time_s > 2.0
    assert np.mean(estimates.model_mismatch[settled]) < 0.001
    assert not estimates.change_detected[settled].any()
    stiffness = estimates.parameters[settled, 0]
    error = np.abs(stiffness / series.truth.parameters[settled, 0] - 1.0)
    assert np.median(error) < 0.005
    assert np.quantile(error, 0.95) < 0.03
