"""What the force sensor says where the law alone does not: force, noise and motion."""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.adaptation import force_estimate
from hc_evaluation.metrics import nees
from hc_sim_rig import Rig

RATE_HZ = 1000.0
NOISE_MM, NOISE_N = 0.002, 0.01


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def test_with_a_linear_law_the_force_is_that_of_the_kalman_filter():
    # F = K d + B v, a filter that counts the force as noisier than it is, and a misfit.
    stiffness, damping, misfit = 0.8, 0.05, 0.02**2
    estimator = hc.create_estimator("self_tuning_ukf", contact_model="kelvin_voigt")
    settings, memory = estimator._settings[0], estimator._memory[0]
    memory["calibrated"] = 1
    memory["known"] = 1
    memory["turn_since"] = 1e9
    memory["elapsed"] = 1.0 / RATE_HZ
    draw = np.random.default_rng(1)
    for _ in range(50):
        root = draw.standard_normal((7, 7)) * [[0.01], [0.3], [5.0], [0.2], [0.3], [0.0], [0.0]]
        covariance = root @ root.T
        state = np.array([2.0, draw.normal(), 0.0, np.log(stiffness), np.log(damping), 1.0, 1.0])
        noise = np.array([NOISE_MM, NOISE_N]) ** 2
        law = stiffness * state[0] + damping * state[1]
        slopes = np.zeros((2, 7))
        slopes[0, 0] = 1.0
        slopes[1] = [stiffness, damping, 0.0, stiffness * state[0], damping * state[1], 0.0, 0.0]
        spread = slopes @ covariance @ slopes.T
        innovation = draw.multivariate_normal(np.zeros(2), spread + np.diag(noise))
        memory["predicted_state"], memory["predicted_covariance"] = state, covariance
        memory["sensor_noise"], memory["model_error"] = noise, [misfit, 0.0]
        memory["measurement_noise"] = noise * [1.0, 40.0]
        memory["innovation_covariance"] = spread + np.diag(memory["measurement_noise"])
        memory["innovation"] = innovation
        memory["measurement"] = innovation + np.array([state[0], law])
        force_estimate.find(settings, memory)
        # The misfit is one more state, that the force contains and the displacement does not.
        larger = np.zeros((8, 8))
        larger[:7, :7] = covariance
        larger[7, 7] = misfit
        by_state = np.column_stack((slopes, [0.0, 1.0]))
        gain = by_state @ larger @ by_state.T
        gain = gain @ np.linalg.inv(gain + np.diag(noise))
        expected = law + (gain @ innovation)[1]
        assert memory["given_force"] == pytest.approx(expected, abs=1e-9)


def test_a_reading_used_as_it_stands_gives_the_law_at_the_updated_state():
    signals = Rig("multisine", 1).run(4.0)
    series = hc.create_estimator("self_tuning_ukf").run(
        signals.time_s, signals.displacement_mm, signals.force_n
    )
    stiffness, damping, n, p = series.parameters.T
    depth = np.maximum(series.displacement, 1e-9)
    dashpot = np.sign(series.velocity) * np.abs(series.velocity) ** p
    law = np.where(series.displacement > 0.0, depth**n * (stiffness + damping * dashpot), 0.0)
    late = slice(-1000, None)
    np.testing.assert_allclose(series.force_reconstructed[late], law[late], atol=1e-9)


@pytest.mark.parametrize(
    ("scenario", "seconds"),
    [("step_hold", 3.6), ("needle_insertion", 12.0)],  # the velocity jumps; no law holds
)
def test_the_force_stays_with_the_sensor_where_the_law_is_lost(scenario, seconds):
    signals = Rig(scenario, seed=3).run(seconds)
    series = hc.create_estimator("self_tuning_ukf").run(
        signals.time_s, signals.displacement_mm, signals.force_n
    )
    used = series.rejected == 0
    truth = np.asarray(signals.truth.force_n)
    assert rms((series.force_predicted - truth)[used]) > 0.1
    assert rms((series.force_reconstructed - truth)[used]) < 0.04


def test_before_a_fit_the_force_is_carried_on_and_better_than_the_reading():
    errors, readings = [], []
    for seed in range(20):
        draw = np.random.default_rng(seed)
        time = np.arange(1, 25) / 100.0
        depth = 0.5 + 0.4 * time
        force = 0.2 * depth**1.8 * (1.0 + 0.1)
        noisy = force + 0.03 * draw.standard_normal(time.size)
        series = hc.create_estimator("self_tuning_ukf").run(time, depth, noisy)
        errors.append(series.force_reconstructed[8:] - force[8:])
        readings.append(noisy[8:] - force[8:])
    assert rms(errors) < 0.75 * rms(readings)


def palpation(time, draw, noise_n, stiffness=0.2):
    """Readings of two slow sines on a soft tissue; `noise_n` a number or one per sample."""
    depth = 1.6 - np.cos(2.0 * np.pi * 0.1 * time) - 0.4 * np.cos(2.0 * np.pi * 0.3 * time)
    velocity = np.gradient(depth, time)
    force = (stiffness + 0.05 * velocity) * depth**1.8
    return (
        depth + 0.001 * draw.standard_normal(time.size),
        force + noise_n * draw.standard_normal(time.size),
    )


def test_a_sensor_far_noisier_is_noticed_though_half_of_its_readings_are_refused():
    late = []
    for seed in range(20):
        time = np.arange(1500) / 100.0
        noise = np.where(time < 12.0, 0.036, 0.576)
        readings = palpation(time, np.random.default_rng(seed), noise)
        series = hc.create_estimator("self_tuning_ukf").run(time, *readings)
        assert not series.change_detected.any()
        noticed = (series.force_noise_std > 0.2) & (time > 12.0)
        late.append(time[np.argmax(noticed)] - 12.0)
    assert np.median(late) <= 0.1  # the differences alone, broken by refusals: 0.3 s


def test_spikes_and_a_stiffer_tissue_are_no_noisier_sensor():
    time = np.arange(12000) / RATE_HZ
    draw = np.random.default_rng(2)
    depth, force = palpation(time, draw, 0.01)
    force[7000::40] += 0.5  # all to one side: refused one by one
    series = hc.create_estimator("self_tuning_ukf").run(time, depth, force)
    assert (series.rejected[7000::40] != 0).all()
    assert series.force_noise_std[7000:].max() < 0.05

    stiffer = np.where(time < 7.0, 0.2, 0.6)
    depth, force = palpation(time, draw, 0.01, stiffer)
    series = hc.create_estimator("self_tuning_ukf").run(time, depth, force)
    changed = np.flatnonzero(series.change_detected)
    assert changed.size == 1
    assert 7.0 <= time[changed[0]] < 7.5
    assert series.force_noise_std[7000:8000].max() < 0.05


def test_motion_that_only_the_force_shows_does_not_make_the_estimate_sure_of_itself():
    # 0.7 mm of noise on the position, a velocity kicked at every sample (paper C, section V).
    found = []
    for seed in range(1, 9):
        signals = Rig("teleoperation", seed).run(8.0)
        estimator = hc.create_estimator("self_tuning_ukf")
        series = estimator.run(signals.time_s, signals.displacement_mm, signals.force_n)
        truth = np.asarray(signals.truth.parameters)[-1:]
        found.append(float(nees(series.parameters[-1:], series.covariance[-1:], truth)[0]))
        assert estimator._memory[0]["hidden_density"] > 0.0
    assert np.median(found) < 15.0  # without it: hundreds
    assert max(found) < 60.0


def test_motion_in_plain_sight_is_left_to_the_displacement():
    for scenario in ("multisine", "indentation"):
        signals = Rig(scenario, 1).run(6.0)
        estimator = hc.create_estimator("self_tuning_ukf")
        estimator.run(signals.time_s, signals.displacement_mm, signals.force_n)
        assert estimator._memory[0]["hidden_density"] == 0.0


@pytest.mark.parametrize(
    ("scenario", "seconds", "after", "before", "then"),
    [
        ("needle_insertion", 12.0, 6.9, 7.6, 0.9),  # a layer breaks: no parameters fit any more
        ("relaxation", 3.0, 0.5, 2.5, 0.0),  # a fit is told, and does not foresee what follows
    ],
)
def test_a_law_that_does_not_fit_is_told_before_the_tissue_is_known(
    scenario, seconds, after, before, then
):
    signals = Rig(scenario, seed=1).run(seconds)
    series = hc.create_estimator("self_tuning_ukf").run(
        signals.time_s, signals.displacement_mm, signals.force_n
    )
    told = signals.time_s[np.argmax(series.model_mismatch)]
    assert series.model_mismatch.any()
    assert after < told < before
    assert series.model_mismatch[signals.time_s > before].mean() >= then


@pytest.mark.parametrize("scenario", ["step_hold", "indentation", "multisine", "tissue_change"])
def test_no_misfit_is_told_of_a_law_that_fits(scenario):
    for seed in range(4):
        signals = Rig(scenario, seed=seed).run(6.0)
        series = hc.create_estimator("self_tuning_ukf").run(
            signals.time_s, signals.displacement_mm, signals.force_n
        )
        assert not series.model_mismatch.any()
