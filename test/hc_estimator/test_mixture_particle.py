"""The force of a particle of `rbpf` is that of the contact law to the bit, with its slopes."""

from __future__ import annotations

import numpy as np

import hc_estimator as hc
from hc_estimator.contact.hunt_crossley import SMALLEST_SPEED
from hc_estimator.contact.registry import contact_force, contact_gradient
from hc_estimator.filters.mixture_particle import COLUMNS, SIZE, STATE, linearise

SPEEDS = (0.0, 1e-12, 0.5 * SMALLEST_SPEED, SMALLEST_SPEED, 3.0 * SMALLEST_SPEED, 1.0, 20.0)


def test_the_force_of_a_particle_is_that_of_the_law() -> None:
    """At rest, below the smallest speed of a slope, in separation and outside of the tissue too."""
    estimator = hc.create_estimator("rbpf")
    settings, memory = estimator._settings[0], estimator._memory[0]
    model, gradient = settings["contact_model"], np.empty(6)
    rng = np.random.default_rng(17)
    forces = []
    for _ in range(2000):
        row = np.zeros(COLUMNS)
        state = row[STATE : STATE + SIZE]
        state[0] = rng.choice([-1.0, 0.0, 1e-12, 1.0, 1.0, 1.0]) * rng.uniform(0.0, 4.0)
        state[1] = rng.choice([-1.0, 1.0]) * rng.choice(SPEEDS)
        state[3:5] = rng.uniform(-0.1, 1.0, 2)
        state[5], state[6] = rng.uniform(0.2, 4.5), rng.uniform(0.0, 3.5)  # beyond their ranges
        arguments = (model, state[0], state[1], *state[3:])
        force = linearise(settings, memory, row)
        assert force == contact_force(*arguments)
        contact_gradient(*arguments, gradient)
        expected = [gradient[0], gradient[1], 0.0, *gradient[2:]]
        assert memory["conditional_slope"].tolist() == expected
        forces.append(force)
    assert 100 < np.count_nonzero(forces) < 1900
