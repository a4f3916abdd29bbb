"""What hardly damps, as a spring does, is found as well, and B is known as well as is said.

Regression of 2026-11-29. B could not be less than a two thousandth of K: of a steel spring at fine
sensors (0.5 um, 2 mN) a misfit was told in 37 % of the time, and in all of it for some. And B and p
of tissue that damps by a hundredth of the force were off by four of their deviations, for what the
row of constant tissue learnt with a B that was too high seemed to say more than it did.
"""

import math

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import normal_equations, relinearisation
from hc_estimator.multiple_model.hypotheses import LOG_DAMPING, LOG_STIFFNESS, VELOCITY_EXPONENT
from hc_estimator.multiple_model.records import POINTS

SECONDS = 20.0
SETTLED_S = 6.0


def contact(seed, rate_hz, exponent, damping, noise_mm, noise_n, middle_mm=2.5, swing_mm=1.2):
    """Times, readings and parameters of a smooth random motion; damping in K, p = 1."""
    random = np.random.default_rng(seed)
    time_s = np.arange(round(SECONDS * rate_hz)) / rate_hz
    stiffness = math.exp(random.uniform(math.log(0.1), math.log(2.0)))
    omega = 2.0 * np.pi * 2.0 * random.uniform(0.2, 1.0, 8)
    amplitude, phase = random.standard_normal(8) / math.sqrt(8.0), random.uniform(0.0, 6.28, 8)
    angle = omega[:, None] * time_s + phase[:, None]
    depth = middle_mm + swing_mm * (amplitude @ np.sin(angle))
    velocity = swing_mm * ((amplitude * omega) @ np.cos(angle))
    law = np.maximum(depth, 0.0) ** exponent * stiffness * (1.0 + damping * velocity)
    depth = depth + noise_mm * random.standard_normal(time_s.size)
    force = np.maximum(law, 0.0) + noise_n * random.standard_normal(time_s.size)
    return time_s, depth, force, np.array([stiffness, stiffness * damping, exponent, 1.0])


def run(seed, *of):
    time_s, depth, force, truth = contact(seed, *of)
    series = hc.create_estimator("self_tuning_ukf").run(time_s, depth, force)
    settled = time_s > SETTLED_S
    off = series.parameters[settled] - truth
    deviations = np.sqrt(np.diagonal(series.covariance[settled], axis1=1, axis2=2))
    return off, deviations, series.model_mismatch[settled], truth


SPRINGS = {
    "in contact": (500.0, 1.0, 0.0, 0.003, 0.01),
    "fine sensors": (500.0, 1.0, 0.0, 0.0005, 0.002),
    "1 kHz, tapped": (1000.0, 1.0, 0.0, 0.003, 0.01, 1.0, 1.5),
    "125 Hz": (125.0, 1.0, 0.0, 0.003, 0.01),
    "a rubber ball": (500.0, 1.5, 0.0, 0.003, 0.01),
}


@pytest.mark.parametrize("spring", SPRINGS)
def test_a_spring_is_found_and_no_misfit_is_told(spring):
    for seed in range(4):
        off, deviations, misfit, truth = run(seed, *SPRINGS[spring])
        assert np.mean(misfit) == 0.0
        assert np.quantile(np.abs(off[:, 0]) / truth[0], 0.9) < 0.004
        assert np.mean(np.abs(off[:, [0, 2]]) < 3.5 * deviations[:, [0, 2]]) > 0.95
        assert np.quantile(off[:, 1] / truth[0], 0.9) < 4e-4  # 5e-4 at least it was


@pytest.mark.parametrize("damping", [1e-4, 3e-4, 1e-3])
@pytest.mark.parametrize("rate_hz", [125.0, 500.0])
def test_light_damping_is_known_as_well_as_is_said(damping, rate_hz):
    """Twelve contacts: deviations of B and p at the end, and how often they are within three."""
    scores, within = [], []
    for seed in range(100, 112):
        off, deviations, _misfit, _truth = run(seed, rate_hz, 1.5, damping, 0.003, 0.01)
        score = off[:, [1, 3]] / deviations[:, [1, 3]]
        scores.append(score[-1])
        within.append(np.mean(np.abs(score) < 3.0, axis=0))
    assert np.all(np.sqrt(np.mean(np.square(scores), axis=0)) < 1.6)  # 3.3 to 4.5 it was
    assert np.all(np.mean(within, axis=0) > 0.97)  # 0.54 to 0.83


@pytest.fixture
def fitted(records_of):
    """The settings and the bank of an estimator that has felt six seconds of light damping."""
    time_s, depth, force, _truth = contact(100, 500.0, 1.5, 5e-4, 0.003, 0.01)
    estimator = hc.create_estimator("self_tuning_ukf")
    estimator.run(time_s[:3000], depth[:3000], force[:3000])
    return records_of(estimator)


def test_a_row_is_misled_where_the_fit_knows_better(fitted):
    settings, bank = fitted
    history, row = bank.history, bank.rows[0]
    assert history.count <= POINTS
    assert history.fitted == 1

    def misled():
        return relinearisation.is_misled(settings, history, row)

    def take_fit():
        for i, k in enumerate((LOG_STIFFNESS, LOG_DAMPING, LOG_DAMPING + 1, VELOCITY_EXPONENT)):
            row.state[k] = history.fit[i]
            row.covariance[k, k] = history.covariance[i, i]

    take_fit()
    assert not misled()
    row.state[LOG_DAMPING] += 5.0 * math.sqrt(history.covariance[1, 1])
    assert misled()
    take_fit()
    row.covariance[VELOCITY_EXPONENT, VELOCITY_EXPONENT] *= 0.1
    assert misled()
    history.first = 1  # it has forgotten some
    assert not misled()
    history.first = 0
    history.left = 1e-4  # the law does not fit
    assert not misled()
    history.left = 0.0
    assert misled()
    history.fit[1] = history.fit[0] + math.log(0.02)  # it damps
    row.state[LOG_DAMPING] = history.fit[1] + 1.0
    assert not misled()


def test_a_first_guess_of_damping_has_long_tails(fitted):
    """Its cost goes on as a line beyond two deviations and a half, with a slope that stays."""
    settings, bank = fitted
    history = bank.history
    history.held[:] = 0
    deviation = settings.initial_damping_log_std
    guess = math.log(settings.initial_damping / settings.initial_stiffness)

    def cost(off):
        values = np.array([0.0, guess + off * deviation, 1.5, 1.0])
        values[2] = settings.initial_displacement_exponent
        values[3] = settings.initial_velocity_exponent
        values[0] = math.log(settings.initial_stiffness)
        values[1] += values[0]
        return normal_equations.prior_cost(settings, history, values)

    tail = normal_equations.TAIL
    assert cost(1.0) == pytest.approx(1.0)
    assert cost(-tail) == pytest.approx(tail**2)
    assert cost(-8.0) - cost(-7.0) == pytest.approx(2.0 * tail)
    history.held[1] = 1  # held there, it is held
    assert cost(-8.0) == pytest.approx((8.0 / normal_equations.HELD_SHARE) ** 2)
