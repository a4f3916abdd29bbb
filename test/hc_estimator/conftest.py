"""What the tests of hc_estimator share."""

import numpy as np
import pytest


@pytest.fixture(scope="session")
def recording():
    """Simulates a multi-sine indentation: time [s], displacement [mm], force [N]."""

    def make(
        seconds=1.0,
        rate=1000.0,
        seed=1,
        parameters=(0.2, 0.009, 1.8, 1.05),
        displacement_noise=0.002,
        force_noise=0.01,
        adhesive=False,
    ):
        stiffness, damping, n, p = parameters
        rng = np.random.default_rng(seed)
        time = np.arange(round(seconds * rate)) / rate
        slow, fast = 2 * np.pi * 0.7, 2 * np.pi * 2.3
        d = 3 + 1.6 * np.sin(slow * time) + 0.8 * np.sin(fast * time + 0.5)
        v = 1.6 * slow * np.cos(slow * time) + 0.8 * fast * np.cos(fast * time + 0.5)
        force = d**n * (stiffness + damping * np.sign(v) * np.abs(v) ** p)
        if not adhesive:  # with a damping of 0.045 of the stiffness nothing separates
            force = np.maximum(force, 0.0)
        noise = rng.standard_normal((2, time.size))
        return time, d + displacement_noise * noise[0], force + force_noise * noise[1]

    return make
