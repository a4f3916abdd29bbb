"""Refused forces: those of a noisier sensor scatter, those of a tool that sets off do not."""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.adaptation import difference_noise

NOISE = 0.003
GATE = 0.04  # [N]


def known_channel():
    """A channel whose noise is known from 300 readings."""
    settings = hc.create_estimator("self_tuning_ukf")._settings.view(np.recarray)[0]
    channel = np.zeros(1, difference_noise.NOISE).view(np.recarray)[0]
    generator = np.random.default_rng(5)
    for k in range(300):
        reading = 20.0 + NOISE * generator.standard_normal()
        difference_noise.learn(settings, channel, k / 200.0, reading, k == 0, 1e-9)
    return channel


def opened(innovations):
    """Whether any of the refused innovations opens the gate, and the noise then in use."""
    channel = known_channel()
    found = [difference_noise.learn_refused(channel, value, GATE) for value in innovations]
    return any(found), float(np.sqrt(channel["mean"]))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("power", [1, 2, 3, 5])
def test_a_tool_that_sets_off_is_no_noise(power, sign):
    """Before, the fifth power made a noise of 1.1 N of 3 mN, and damping was 10 times too small."""
    away = sign * 0.05 * np.arange(1.0, 9.0) ** power
    found, noise = opened(away)
    assert not found
    assert noise == pytest.approx(NOISE, rel=0.2)


def test_a_sensor_that_turns_noisier_opens_the_gate():
    waited = []
    for seed in range(200):
        generator = np.random.default_rng(seed)
        innovations = 0.3 * generator.standard_normal(40)
        refused = innovations[np.abs(innovations) > GATE]
        count = next(k for k in range(3, refused.size) if opened(refused[:k])[0])
        waited.append(count)
        assert 0.05 < opened(refused[:count])[1] < 1.5
    assert np.mean(waited) < 5.0
