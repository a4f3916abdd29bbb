"""The rendered law against the contact law, and how steep it may be."""

from __future__ import annotations

import numpy as np
import pytest

from hc_sim_rig.bilateral import (
    Bilateral,
    Feedback,
)
from hc_sim_rig.bilateral.rendering_kernel import elastic_energy, rendered_force

STEP = 0.001


def test_the_rendered_law_is_the_contact_law_within_its_bound() -> None:
    model = np.array([0.3, 0.01, 1.6, 0.8, 0.5])
    loose = Bilateral(feedback=Feedback(largest_damping=1.0)).constants()
    assert rendered_force(0.4, 10.0, model, loose) == 0.0
    expected = 0.3 * 2.0**1.6 + 0.01 * 2.0**1.6 * 10.0**0.8
    assert rendered_force(2.5, 10.0, model, loose) == pytest.approx(expected)
    assert rendered_force(2.5, -1e4, model, loose) == 0.0  # it never pulls
    tight = Bilateral(feedback=Feedback(largest_damping=0.02)).constants()
    assert rendered_force(2.5, 1e-6, model, tight) <= 0.3 * 2.0**1.6 + 0.02 * 1e-6 + 1e-15


@pytest.mark.parametrize("exponent", [0.5, 0.98, 1.0, 1.0 + 1e-9, 1.6, 4.0])
@pytest.mark.parametrize("stiffness", [1e-4, 0.25, 9.0, 20.0])
def test_the_rendered_spring_is_nowhere_steeper_than_its_bound(
    stiffness: float, exponent: float
) -> None:
    """The hardest model that a link takes had 2160 N/mm at 3 mm: no hand at 1 kHz is safe there."""
    constants = Bilateral().constants()
    model = np.array([stiffness, 0.0, exponent, 1.0, 0.0])
    depth = np.linspace(0.0, 8.0, 4001)
    force = np.array([rendered_force(x, 0.0, model, constants) for x in depth])
    slope = np.diff(force) / np.diff(depth)
    assert slope.max() <= 10.0 * (1.0 + 1e-9)
    assert slope.min() >= 0.0
    law = stiffness * depth**exponent
    assert np.all(force <= law * (1.0 + 1e-9) + 1e-12)
    straight = np.maximum.accumulate(stiffness * exponent * depth[1:] ** (exponent - 1.0)) > 10.0
    if exponent >= 1.0:  # as the tissue as far as that is no steeper
        assert force[1:][~straight] == pytest.approx(law[1:][~straight])
    energy = [elastic_energy(x, model, constants) for x in depth]
    work = np.r_[0.0, np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(depth))]
    assert energy == pytest.approx(work, rel=1e-3, abs=1e-5)
