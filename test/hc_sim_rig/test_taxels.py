"""The tactile array of the rig."""

import dataclasses

import numpy as np
import pytest
from rclpy.parameter import Parameter

from hc_estimator.contact.arrays import hunt_crossley_force
from hc_sim_rig import Rig, ScenarioError, load_scenario
from hc_sim_rig.node import IndenterNode
from hc_sim_rig.ros.outputs import Outputs
from hc_sim_rig.taxels import TaxelPad


@pytest.fixture(scope="module")
def scenario():
    return load_scenario("taxels")


def test_every_taxel_feels_the_law_with_its_own_parameters(scenario):
    rig, pad = Rig(scenario), TaxelPad(scenario.taxels, 0.0, 0.0, 1)
    for _ in range(300):
        truth = rig.step().truth
        depths, forces = pad.readings(truth)
        velocities = np.full(64, truth.velocity_mm_s)
        expected = hunt_crossley_force(depths, velocities, pad.parameters(truth))
        np.testing.assert_allclose(forces, expected, rtol=1e-12)
    assert (depths == truth.displacement_mm).all()


def test_the_lump_is_where_the_scenario_says(scenario):
    stiffness, damping = scenario.taxels.factors()
    table = stiffness.reshape(8, 8)
    assert np.unravel_index(table.argmax(), table.shape) in [(3, 4), (3, 5)]
    assert table[3, 4] == table[3, 5] > 3.5
    assert table[7, 0] < 1.1
    assert damping.max() < 2.0


def test_noise_is_that_of_the_scenario_and_the_same_for_the_same_seed(scenario):
    truth = Rig(scenario).step().truth
    pads = [TaxelPad(scenario.taxels, 0.002, 0.01, seed) for seed in (1, 1, 2)]
    many = [np.array([pad.readings(truth) for _ in range(200)]) for pad in pads]
    np.testing.assert_array_equal(many[0], many[1])
    assert not np.array_equal(many[0], many[2])
    assert many[0][:, 0].std(axis=0).mean() == pytest.approx(0.002, rel=0.05)
    assert many[0][:, 1].std(axis=0).mean() == pytest.approx(0.01, rel=0.05)


def test_noise_that_is_set_while_the_rig_runs_is_theirs_too(scenario):
    """Regression: `hc param set indenter force_noise_std_n` changed the rig's own sensor alone."""
    node, outputs = IndenterNode.__new__(IndenterNode), Outputs.__new__(Outputs)
    node._rig, node._outputs = Rig(scenario), outputs
    outputs._pad = pad = TaxelPad(scenario.taxels, 0.002, 0.01, 1)
    truth = node._rig.step().truth
    before = node._rig.settings()["displacement_noise_std_mm"]
    node._apply_settings([Parameter("force_noise_std_n", value=0.05)])
    many = np.array([pad.readings(truth) for _ in range(200)])
    assert many[:, 0].std(axis=0).mean() == pytest.approx(before, rel=0.05)
    assert many[:, 1].std(axis=0).mean() == pytest.approx(0.05, rel=0.05)
    outputs._pad = None  # a scenario without them
    node._apply_settings([Parameter("force_noise_std_n", value=0.01)])


def test_taxels_need_a_tissue_with_such_parameters(scenario):
    free = load_scenario("relaxation").tissue
    with pytest.raises(ScenarioError, match="hunt_crossley"):
        dataclasses.replace(scenario, tissue=free)
