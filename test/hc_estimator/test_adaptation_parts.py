"""The parts of the self-tuning policy, each against a plain computation of its own."""

import math

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.optimize import least_squares
from scipy.stats import chi2

import hc_estimator as hc
from hc_estimator.adaptation import (
    contest,
    difference_noise,
    hindsight,
    history,
    history_fit,
    linearisation,
    model_error,
    motion_density,
)


@pytest.fixture
def records():
    """Settings and memory record of a fresh self_tuning_ukf."""
    estimator = hc.create_estimator("self_tuning_ukf")
    return estimator._settings[0], estimator._memory[0]


def feed(memory, settings, displacements, forces, step=1e-3):
    for d, f in zip(displacements, forces, strict=True):
        memory["elapsed"] = step
        memory["measurement"] = d, f
        difference_noise.learn(settings, memory)


def test_difference_noise_is_the_mean_of_squared_eighth_differences(records):
    settings, memory = records
    rng = np.random.default_rng(1)
    d, f = 3e-3 * rng.standard_normal(400), 0.02 * rng.standard_normal(400)
    feed(memory, settings, d, f)
    variance = math.comb(16, 8)
    for channel, signal in enumerate((d, f)):
        squares = np.diff(signal, 8) ** 2 / variance
        assert memory["difference_mean"][channel] == pytest.approx(np.mean(squares), rel=0.1)
    latest = np.mean(np.diff(f, 8)[-difference_noise.LATEST :] ** 2) / variance
    assert difference_noise.latest(memory, 1) == pytest.approx(latest, rel=1e-9)


def test_smooth_motion_does_not_enter_the_noise(records):
    settings, memory = records
    rng = np.random.default_rng(2)
    time = np.arange(2000) / 200.0
    motion = 2.0 * np.sin(2 * np.pi * 5.0 * time)
    noise = 2e-3 * rng.standard_normal(time.size)
    feed(memory, settings, motion + noise, motion + noise, 5e-3)
    assert math.sqrt(memory["noise"][0]) == pytest.approx(2e-3, rel=0.15)


def test_noise_jump_is_followed_within_60_samples_and_a_step_is_not_mistaken_for_long(records):
    settings, memory = records
    rng = np.random.default_rng(3)
    feed(memory, settings, rng.standard_normal(1000), rng.standard_normal(1000))
    feed(memory, settings, rng.standard_normal(60), 4.0 * rng.standard_normal(60))
    assert 7.0 < memory["noise"][1] < 32.0
    assert memory["noise"][0] == pytest.approx(1.0, rel=0.3)
    feed(memory, settings, rng.standard_normal(1000), 4.0 * rng.standard_normal(1000))
    feed(memory, settings, rng.standard_normal(100), 500.0 + 4.0 * rng.standard_normal(100))
    assert memory["noise"][1] == pytest.approx(16.0, rel=0.7)


def test_uneven_spacing_breaks_the_differences(records):
    settings, memory = records
    feed(memory, settings, np.zeros(9), np.zeros(9))
    count = memory["difference_count"][0]
    memory["elapsed"] = 2e-3
    memory["measurement"] = 5.0, 5.0
    difference_noise.learn(settings, memory)
    feed(memory, settings, np.full(8, 5.0), np.full(8, 5.0))
    assert memory["difference_count"][0] == count + 1
    assert memory["difference_mean"][0] == pytest.approx(1e-10)  # the floor: no jump got in


@pytest.mark.parametrize("index", [0, 12, 20, 34])
def test_bank_gains_solve_the_riccati_equation(index):
    ratio = motion_density.INDICES[index]
    transition = np.array([[1, 1, 0.5], [0, 1, 1], [0, 0, 1]])
    noise = ratio * np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1]])
    row = np.array([[1.0], [0.0], [0.0]])
    predicted = solve_discrete_are(transition.T, row, noise, np.eye(1))
    variance = predicted[0, 0] + 1.0
    updated = predicted - np.outer(predicted[:, 0], predicted[0]) / variance
    bank = motion_density.BANK[index]
    assert bank[0] == pytest.approx(variance, rel=1e-6)
    np.testing.assert_allclose(bank[1:4], predicted[:, 0] / variance, rtol=1e-5)
    np.testing.assert_allclose(bank[4:].reshape(3, 3), updated, rtol=1e-4, atol=1e-12)


@pytest.mark.parametrize("density", [1e2, 1e4, 1e6])
def test_bank_finds_the_jerk_density_of_white_jerk(density):
    rng = np.random.default_rng(4)
    dt, count, noise = 1e-3, 6000, 2e-3
    covariance = density * np.array(
        [
            [dt**5 / 20, dt**4 / 8, dt**3 / 6],
            [dt**4 / 8, dt**3 / 3, dt**2 / 2],
            [dt**3 / 6, dt**2 / 2, dt],
        ]
    )
    factor = np.linalg.cholesky(covariance)
    state = np.zeros(3)
    transition = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
    d = np.empty(count)
    for k in range(count):
        state = transition @ state + factor @ rng.standard_normal(3)
        d[k] = state[0]
    estimator = hc.create_estimator("self_tuning_ukf", displacement_limit=1e6)
    # out of contact, so that the displacement alone speaks
    readings = d - np.max(d) - 1.0 + noise * rng.standard_normal(count)
    series = estimator.run(np.arange(count) * dt, readings, 0.01 * rng.standard_normal(count))
    found = np.median(series.process_noise_scale[1000:]) * estimator.configuration["jerk_density"]
    assert abs(math.log10(found / density)) < 0.8


def test_coherence_time_is_long_in_slow_motion_and_short_in_fast(records):
    settings, memory = records
    for frequency in (0.5, 2.0, 8.0):
        memory["mean_square_velocity"] = 0.5
        memory["mean_square_acceleration"] = 0.5 * (2 * math.pi * frequency) ** 2
        expected = 0.35 / math.hypot(2 * math.pi * frequency, 0.35 / 0.28)
        time = linearisation.coherence_time(settings, memory)
        assert time == pytest.approx(max(expected, 0.025), rel=1e-9)
    memory["mean_square_acceleration"] = -1.0  # no more than its own noise
    assert linearisation.coherence_time(settings, memory) == pytest.approx(0.28)


def test_enlargement_is_the_curvature_once_per_coherence_time(records):
    settings, memory = records
    memory["mean_square_velocity"], memory["mean_square_acceleration"] = 1.0, 100.0
    memory["curvature"] = [[0.0, 0.0], [0.0, 0.3]]
    memory["elapsed"] = 0.002
    samples = linearisation.coherence_time(settings, memory) / 0.002
    assert linearisation.enlargement(settings, memory) == pytest.approx(0.3 * samples)
    memory["elapsed"] = 0.0
    assert linearisation.enlargement(settings, memory) == 0.0


def test_model_error_scales_the_parameters_with_the_noise_up_to_the_prior(records):
    settings, memory = records
    rng = np.random.default_rng(5)
    factor = 0.02 * rng.standard_normal((7, 7)) + 0.05 * np.eye(7)
    covariance = factor @ factor.T
    memory["covariance"] = covariance
    memory["prior_variance"] = [4.0, 2.0, 0.25, 0.01]
    memory["sensor_noise"] = [1e-6, 1e-4]
    model_error.set_model_error(settings, memory, 3e-4)  # noise times four
    scaled = memory["covariance"]
    np.testing.assert_allclose(scaled[:3, :3], covariance[:3, :3])
    np.testing.assert_allclose(scaled[3:6, 3:6], 4.0 * covariance[3:6, 3:6], rtol=1e-9)
    assert scaled[6, 6] == pytest.approx(min(0.01, 4.0 * covariance[6, 6]))
    assert np.linalg.eigvalsh(scaled)[0] > 0.0
    before = scaled.copy()
    model_error.set_model_error(settings, memory, 0.0)  # less noise: what was learnt stays
    np.testing.assert_array_equal(memory["covariance"], before)


def test_white_innovations_raise_no_alarm_and_doubled_ones_soon(records):
    settings, memory = records
    memory["sensor_noise"] = [1e-6, 1e-4]
    memory["measurement_noise"] = [1e-6, 1e-4]
    memory["predicted_state"][0] = 1.0
    memory["elapsed"] = 1e-3
    memory["difference_count"] = 0
    rng = np.random.default_rng(6)
    covariance = np.array([[2e-6, 3e-6], [3e-6, 3e-4]])
    memory["innovation_covariance"] = covariance
    factor = np.linalg.cholesky(covariance)
    alarms = 0
    for _ in range(50_000):
        memory["innovation"] = factor @ rng.standard_normal(2)
        alarms += model_error.learn(settings, memory)
    assert alarms == 0
    seen = 0
    for _ in range(200):
        memory["innovation"] = 3.0 * factor @ rng.standard_normal(2)
        seen += 1
        if model_error.learn(settings, memory):
            break
    assert seen < 30


def test_evidence_is_the_gaussian_log_likelihood(records):
    settings, memory = records
    memory["sensor_noise"] = [1e-2, 1e-1]
    memory["measurement_noise"] = [1e-2, 1e-1]
    covariance = np.array([[0.05, 0.02], [0.02, 0.4]])
    memory["innovation_covariance"] = covariance
    memory["innovation"] = [0.1, -0.5]
    model_error.learn(settings, memory)
    z = np.array([0.1, -0.5])
    expected = -0.5 * (np.log(np.linalg.det(covariance)) + z @ np.linalg.inv(covariance) @ z)
    assert memory["evidence"][0] == pytest.approx(expected, rel=1e-9)


def test_exchanging_twice_changes_nothing(records):
    settings, memory = records
    rng = np.random.default_rng(7)
    memory["state"] = rng.standard_normal(7)
    memory["covariance"] = np.eye(7)
    memory["sensor_noise"] = [1e-6, 1e-4]
    contest.begin(settings, memory)
    before = {name: np.copy(memory[name]) for name in memory.dtype.names}
    assert np.all(memory["rival_covariance"][3:, :3] == 0.0)
    assert memory["rival_covariance"][3, 3] == pytest.approx(1.0)
    contest.exchange(memory)
    assert not np.array_equal(memory["covariance"], before["covariance"])
    contest.exchange(memory)
    for name, value in before.items():
        np.testing.assert_array_equal(memory[name], value)


def test_newcomer_that_is_no_better_in_the_end_leaves_nothing_behind(records):
    settings, memory = records
    memory["state"][3:] = [0.1, -2.0, 1.5, 1.0]
    memory["covariance"] = 1e-4 * np.eye(7)
    memory["predicted_state"][0] = 1.0
    memory["elapsed"] = 1e-3
    memory["sensor_noise"] = [1e-6, 1e-4]
    veteran = memory["state"].copy()
    contest.begin(settings, memory)
    memory["rival_state"][3] = 0.7
    for k in range(2100):
        ahead = 1 if memory["newcomer_leads"] == 0 else 0
        memory["evidence"] = 0.0
        memory["evidence"][ahead] = 0.5 if k < 300 else 0.0  # better for a while only
        contest.judge(settings, memory)
        if k == 100:
            assert memory["newcomer_leads"] == 1
            assert memory["state"][3] == 0.7
    assert memory["contest"] == 0
    np.testing.assert_array_equal(memory["state"], veteran)


def law(d, v, parameters):
    stiffness, damping, n, p = parameters
    return d**n * (stiffness + damping * np.sign(v) * np.abs(v) ** p)


def remember(memory, settings, time, d, v, force):
    """Let the history take samples at its own interval, the last of them the latest."""
    memory["elapsed"] = settings["history_interval"]
    memory["restart"] = 0
    for k in range(time.size):
        memory["state"][0], memory["state"][1] = d[k], v[k]
        memory["measurement"][1] = force[k]
        assert history.learn(settings, memory)


@pytest.fixture
def felt(records):
    """A history of the law with a slow error on top that it cannot explain."""
    settings, memory = records
    time = np.arange(120) * 0.02
    d, v = 3.0 + 2.0 * np.sin(3.0 * time), 6.0 * np.cos(3.0 * time)
    force = law(d, v, (0.5, 0.02, 1.6, 1.0)) + 0.15 * np.sin(1.3 * time)
    remember(memory, settings, time, d, v, force)
    memory["sensor_noise"] = [1e-6, 1e-4]
    memory["model_error"][0] = 4e-4
    return settings, memory, d, v, force


def test_history_remembers_all_at_first_and_thins_out_to_its_interval(records):
    settings, memory = records
    memory["elapsed"] = 0.25 * settings["history_interval"]
    memory["state"][0] = -1.0
    assert not any(history.learn(settings, memory) for _ in range(20))
    memory["state"][0] = 1.0
    kept = []
    for k in range(8 * history.POINTS):
        memory["measurement"][1] = k
        count = int(memory["history_count"])
        if history.learn(settings, memory):
            kept.append(k)
            if memory["history_count"] <= count:  # every second one was forgotten
                kept = kept[1::2]
        # What is remembered is spread evenly over the contact, the none skipped.
        latest = np.sort(memory["history"][: min(len(kept), history.POINTS), 2])
        np.testing.assert_array_equal(latest, kept[-history.POINTS :])
        if len(kept) > 2 and k % 50 == 0:
            assert len(set(np.diff(kept)[-history.POINTS :])) == 1
    assert memory["history_spacing"] == settings["history_interval"]
    assert np.all(np.diff(kept)[-history.POINTS :] == 4)


def test_history_takes_a_velocity_within_its_noise_for_rest(records):
    settings, memory = records
    memory["elapsed"] = 1e-3
    memory["state"][0] = 1.0
    memory["covariance"][1, 1] = 0.04
    for velocity, expected in ((0.5, 0.0), (-0.5, 0.0), (0.7, 0.7), (-0.7, -0.7)):
        memory["state"][1] = velocity
        assert history.learn(settings, memory)
        assert memory["history"][memory["history_count"] - 1, 1] == expected


def test_estimate_that_forgot_is_replaced_by_the_least_squares_fit(felt):
    settings, memory, d, v, force = felt
    memory["state"][3:] = np.log(0.4), np.log(0.08), 1.7, 0.6
    memory["covariance"] = 1e-6 * np.eye(7)
    hindsight.hold(settings, memory)
    guess = math.log(settings["initial_damping"] / settings["initial_stiffness"])
    prior = memory["prior_variance"]

    def residuals(x, noise):
        values = (np.exp(x[0]), np.exp(x[1]), x[2], x[3])
        distance = (
            (x[0] - math.log(settings["initial_stiffness"])) / math.sqrt(prior[0]),
            (x[1] - x[0] - guess) / math.sqrt(prior[1]),
            (x[2] - settings["initial_displacement_exponent"]) / math.sqrt(prior[2]),
            (x[3] - settings["initial_velocity_exponent"]) / math.sqrt(prior[3]),
        )
        return np.append((law(d, v, values) - force) / math.sqrt(noise), distance)

    expected = least_squares(residuals, (-0.7, -4.0, 1.6, 1.0), args=(5e-4,), x_scale="jac")
    np.testing.assert_allclose(memory["state"][3:], expected.x, atol=2e-3)
    left = residuals(memory["state"][3:], 1.0)[:-4]
    noise = memory["sensor_noise"][1] + memory["model_error"][0]
    assert noise == pytest.approx(np.mean(left**2), rel=1e-6)
    # One remembered sample stands for one used sample here, so that the share is 1.
    jacobian = least_squares(residuals, memory["state"][3:], args=(noise,), max_nfev=1).jac
    np.testing.assert_allclose(
        memory["covariance"][3:, 3:], np.linalg.inv(jacobian.T @ jacobian), rtol=0.02
    )


def test_estimate_that_explains_the_history_stays(felt):
    settings, memory, *_ = felt
    memory["state"][3:] = np.log(0.4), np.log(0.08), 1.7, 0.6
    hindsight.hold(settings, memory)  # now it is the fit
    memory["state"][3] += 0.005
    before = memory["state"].copy()
    memory["history_held"] = 1.0
    hindsight.hold(settings, memory)
    np.testing.assert_array_equal(memory["state"], before)
    memory["state"][3] = 0.5
    memory["model_error"][0] = 0.0  # where the law fits nothing is ever replaced
    memory["history_held"] = 1.0
    hindsight.hold(settings, memory)
    assert memory["state"][3] == 0.5


def test_history_tells_a_changed_tissue_from_more_of_the_same_misfit(felt):
    settings, memory, d, v, _ = felt
    memory["state"][3:] = np.log(0.5), np.log(0.02), 1.6, 1.0
    hindsight.hold(settings, memory)  # says how large the misfit is
    later = slice(0, 20)
    time = np.arange(20) * 0.02
    misfit = 0.15 * np.sin(1.3 * time + 2.0)
    for factor, expected in ((1.0, True), (1.4, False)):
        force = factor * law(d, v, (0.5, 0.02, 1.6, 1.0))[later] + misfit
        count = int(memory["history_count"])
        remember(memory, settings, time, d[later], v[later], force)
        assert hindsight.same_tissue(settings, memory) == expected
        memory["history_count"] = count


@pytest.fixture
def first_felt(records):
    """The first half second of contact, at constant velocity: only K + B v^p and n show."""
    settings, memory = records
    generator = np.random.default_rng(5)
    time = np.arange(1, 501) * 1e-3
    d, v = 2.0 * time, np.full(500, 2.0)
    clean = law(d, v, (8.0, 0.3, 2.0, 1.05))
    memory["sensor_noise"] = [1e-6, 1e-4]
    memory["measurement_noise"] = [1e-6, 1.0]  # tempered: the filter does not know the tissue
    memory["elapsed"] = 1e-3
    memory["restart"] = 0
    before = memory["state"][3:].copy()
    for k in range(time.size):
        memory["state"][0], memory["state"][1] = d[k], v[k]
        memory["measurement"][1] = clean[k] + 0.01 * generator.standard_normal()
        if history.learn(settings, memory):
            hindsight.hold(settings, memory)
    np.testing.assert_array_equal(memory["state"][3:], before)
    return settings, memory


def test_fit_is_told_until_the_filter_knows_the_tissue_and_leaves_it_alone(first_felt):
    settings, memory = first_felt
    assert memory["told"] == 1
    told = memory["told_parameters"]
    truth = np.array([math.log(8.0), math.log(0.3), 2.0, 1.05])
    assert np.exp(told[0]) + np.exp(told[1]) * 2.0 ** told[3] == pytest.approx(
        8.0 + 0.3 * 2.0**1.05, rel=0.02
    )
    assert told[2] == pytest.approx(2.0, abs=0.02)
    # K and B are told as unknown as they are: B may be anything, K what B leaves of it.
    covariance = memory["told_covariance"]
    assert math.sqrt(covariance[1, 1]) > 1.0
    assert math.sqrt(covariance[2, 2]) < 0.05
    error = told - truth
    assert error @ np.linalg.solve(covariance, error) < chi2.ppf(0.99, 4)
    memory["history_held"] = 1.0
    memory["contact_time"][0] = 1.1 * settings["probation"]
    memory["measurement_noise"][1] = 1.1 * memory["sensor_noise"][1]
    hindsight.hold(settings, memory)
    assert memory["told"] == 0
    memory["measurement_noise"][1] = 1.0  # known once, it is not told again of the same tissue
    memory["history_held"] = 1.0
    hindsight.hold(settings, memory)
    assert memory["told"] == 0


def test_covariance_told_counts_the_curved_valley(first_felt):
    settings, memory = first_felt
    noise = 1e-4
    assert history_fit.find_covariance(settings, memory, noise)
    plain = memory["fit_covariance"].copy()
    assert history_fit.widen_covariance(settings, memory, noise)
    wide = memory["fit_covariance"].copy()
    # Walk the valley: fix B away from the fit, refit the rest, and see how far that leads.
    fit = memory["fit"].copy()
    count = int(memory["history_count"])
    d, v = memory["history"][:count, :2].T
    force = law(d, v, (*np.exp(fit[:2]), *fit[2:]))
    step = math.sqrt(plain[1, 1])
    away = least_squares(
        lambda x: law(d, v, (math.exp(x[0]), math.exp(fit[1] + step), x[1], fit[3])) - force,
        (fit[0], fit[2]),
    ).x
    off = np.array([away[0] - fit[0], step, away[1] - fit[2], 0.0])
    assert off @ np.linalg.solve(plain, off) > 4.0 * chi2.ppf(0.95, 4)
    assert off @ np.linalg.solve(wide, off) < chi2.ppf(0.95, 4)
