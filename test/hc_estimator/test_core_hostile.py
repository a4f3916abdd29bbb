"""After whatever came in, ten seconds of good data give the tissue; and nothing is ever unsound.

`hostile` is everything that sensors, clocks and wires can do wrong, in phases; hypothesis puts the
phases together.
"""

import functools
import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import hc_estimator as hc
from hc_estimator import Rejection

COMBINATIONS = [(f, s) for f in hc.available_filters() for s in hc.available_state_spaces(f)]
RATE = 500.0
TISSUE = (0.2, 0.009, 1.8, 1.05)
# `rls` is biased where the damping force is not small, by its linearisation.
HARDLY_DAMPED = (0.5, 0.001, 1.6, 1.0)


def palpation(plant, seconds, parameters=TISSUE, seed=77, rate=RATE, force_noise=0.01):
    time = np.arange(round(seconds * rate)) / rate
    d, v = plant.motion(time)
    force = plant.force(d, v, *parameters)
    return (time, *plant.noisy(d, force, seed, force_noise=force_noise))


def gaps(rng, time, d, force):
    return time * rng.choice([30.0, 30_000.0]), d, force


def stamps(rng, time, d, force):
    time = time + rng.choice([0.0, 1e5, -1e3])
    where = rng.random(time.size) < 0.1
    where[-1] = False
    return (
        np.where(where, rng.choice([np.nan, np.inf, -1e9, 1e-300, 1e12], time.size), time),
        d,
        force,
    )


def disorder(rng, time, d, force):
    return time + rng.choice([1e-9, 1e-3, 0.1]) * rng.standard_normal(time.size), d, force


def nothing(rng, time, d, force):
    share = rng.choice([0.05, 0.5, 1.0])
    bad = [np.nan, np.inf, -np.inf, 1e9, -1e308, 5e-324]
    for values in (d, force):
        where = rng.random(time.size) < share
        values[where] = rng.choice(bad, where.sum())
    return time, d, force


def nonsense(rng, time, d, force):
    which = rng.integers(1, 4)
    if which & 1:
        d = rng.uniform(-900, 900, time.size)
    if which & 2:
        force = rng.uniform(-900, 900, time.size)
    return time, d, force


def spikes(rng, time, d, force):
    for values in (d, force):
        where = rng.random(time.size) < 0.2
        values[where] = rng.uniform(-900, 900, where.sum())
    return time, d, force


def stuck(rng, time, d, force):
    return time, np.full_like(d, d[0]), np.full_like(force, rng.choice([0.0, 1.0, -1.0]))


def another_law(rng, time, d, force):
    return time, d, rng.choice([-1.0, 1e-3, 300.0]) * force


def no_force_in_depth(rng, time, d, force):
    return time, d, 0.0 * force


def jumps(rng, time, d, force):
    return time, d, force * np.repeat(10.0 ** rng.uniform(-3, 3, time.size // 50), 50)


def wandering(rng, time, d, force):
    return time, np.cumsum(rng.standard_cauchy(time.size)), force


PHASES = [gaps, stamps, disorder, nothing, nonsense, spikes, stuck, another_law]
PHASES += [wandering, no_force_in_depth, jumps]
ORDERS = st.lists(
    st.tuples(st.sampled_from(range(len(PHASES))), st.integers(0, 2**32 - 1)),
    min_size=1,
    max_size=3,
)


def hostile(plant, estimator, order, samples=500):
    """Feed the phases one after another; a stamp after which the good data may begin.

    Whatever they leave can be saved and restored.
    """
    start = 0.0
    for index, seed in order:
        readings = palpation(plant, samples / RATE, seed=seed % 1000)
        time, d, force = PHASES[index](np.random.default_rng(seed), *readings)
        series = estimator.run(start + time, d, force)
        assert_sound(series)
        usual = time[np.isfinite(time) & (np.abs(time) < 1e8)]
        start += max(usual.max(initial=0.0), 0.0) + 0.01
        estimator.restore(json.loads(json.dumps(estimator.state())))
    return start


def assert_sound(series):
    """Finite, in range, and a covariance that is one, after every sample."""
    for name in ("parameters", "covariance", "force_reconstructed", "displacement", "velocity"):
        assert np.isfinite(getattr(series, name)).all(), name
    assert (series.parameters[:, 0] >= 0.0).all()
    np.testing.assert_array_equal(series.covariance, series.covariance.transpose(0, 2, 1))
    scale = np.sqrt(np.einsum("kii->ki", series.covariance)) + 1e-300
    correlation = series.covariance / scale[:, :, None] / scale[:, None, :]
    assert np.linalg.eigvalsh(correlation).min(initial=0.0) > -1e-9
    assert (series.force_noise_std > 0).all()
    assert (series.displacement_noise_std > 0).all()
    used = series.rejected == Rejection.ACCEPTED
    assert np.isfinite(series.nis[used]).all()
    assert (series.nis[used] >= 0).all()


def good_data(plant, filter_name):
    """Ten seconds in the tissue that the filter is able to find."""
    parameters = HARDLY_DAMPED if filter_name == "rls" else TISSUE
    noise = 0.002 if filter_name == "rls" else 0.01
    return palpation(plant, 10.0, parameters, force_noise=noise)


@functools.cache
def without_phases(plant, filter_name, state_space):
    """The estimates on good data alone: the same ones beside every order of phases."""
    estimator = hc.create_estimator(filter_name, state_space=state_space)
    return estimator.run(*good_data(plant, filter_name))


def after(plant, filter_name, state_space, order):
    """The estimates on ten seconds of good data after the phases, and without them."""
    time, d, force = good_data(plant, filter_name)
    estimator = hc.create_estimator(filter_name, state_space=state_space)
    start = hostile(plant, estimator, order)
    series = estimator.run(start + time, d, force)
    assert_sound(series)
    assert np.mean(series.rejected[-1000:] == Rejection.ACCEPTED) > 0.95
    return series, without_phases(plant, filter_name, state_space), force


EXACT = [c for c in COMBINATIONS if c[0] not in ("self_tuning_ukf", "sir_pf", "rbpf")]


@pytest.mark.parametrize(("filter_name", "state_space"), EXACT)
@given(order=ORDERS)
@settings(
    max_examples=6,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_ten_seconds_of_good_data_give_the_stiffness(filter_name, state_space, order, plant):
    """Within 1 % of what the filter says without the phases.

    On `paper`, which is 1 to 4 % off itself on these data, within 3 %. There `raukf` after
    `disorder` is beyond 1 % in 5 of 154 orders: stamps a tenth of a second off make the innovations
    of the displacement large, R takes them in, and its average over all samples (weight 1 / J,
    paper B, Eq. 26) forgets them no faster. Followed: 12 times the noise after 1 s, 7 times after
    10 s, K 2.6 % off then and 0.1 % at 20 s. Paper B begins J anew at an abrupt change of the noise
    only; the detector looks at the force, which has none here. It is the letter, so it stays.
    """
    series, clean, _ = after(plant, filter_name, state_space, order)
    rel = 0.01 if state_space == "kinematic" else 0.03
    assert series.parameters[-1, 0] == pytest.approx(clean.parameters[-1, 0], rel=rel)


LOST = {  # phases after which `raukf` kept a misfit for noise
    "kinematic": [(gaps, 2862501244), (gaps, 2721655647), (gaps, 2488190006)],
    "paper": [(another_law, 5841)],
}


@pytest.mark.parametrize("state_space", LOST)
def test_a_noise_learnt_while_lost_is_doubted_and_given_up(state_space, plant):
    """Regression: R, averaged with 1 / J, kept the misfit; K was 81 and 291 % off."""
    order = [(PHASES.index(phase), seed) for phase, seed in LOST[state_space]]
    series, clean, _ = after(plant, "raukf", state_space, order)
    assert series.parameters[-1, 0] == pytest.approx(clean.parameters[-1, 0], rel=0.01)
    assert series.force_noise_std[-1] < 0.1
    told = np.flatnonzero(series.change_detected) / RATE
    assert told.size > 0
    assert told[-1] < 5.0


def test_a_law_that_does_not_fit_is_doubted_ever_more_seldom(plant):
    """A misfit of 30 % for 60 s: `raukf` does not begin anew each time it looks."""
    time, d, force = palpation(plant, 60.0)
    wrong = force * (1.0 + 0.3 * np.sin(2.0 * np.pi * 1.9 * time))
    options = {"state_space": "paper", "change_detection": "none"}
    series = hc.create_estimator("raukf", **options).run(time, d, wrong)
    told = np.flatnonzero(series.change_detected) / RATE
    assert 2 <= told.size <= 5
    assert np.all(np.diff(told)[1:] > 1.3 * np.diff(told)[:-1])


@pytest.mark.parametrize("state_space", ["kinematic", "paper"])
def test_a_filter_that_is_not_lost_is_left_alone(state_space, real):
    """A real scan, whose misfit the law of `raukf` carries for a while, is none of its doubts."""
    samples = real("palpation_scan.csv")
    estimator = hc.create_estimator("raukf", state_space=state_space)
    estimator.run(*samples)
    assert estimator.state()["memory"]["doubt_patience"] == 0


@pytest.mark.slow
@given(order=ORDERS)
@settings(
    max_examples=3,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_ten_seconds_of_good_data_give_the_stiffness_to_the_gaussian_mixture(order, plant):
    series, clean, _ = after(plant, "rbpf", "kinematic", order)
    assert series.parameters[-1, 0] == pytest.approx(clean.parameters[-1, 0], rel=0.01)


@pytest.mark.parametrize("phase", [gaps, nonsense, jumps], ids=lambda phase: phase.__name__)
def test_the_particle_filter_follows_the_force_again(phase, plant):
    """Its K is 10 to 50 % off on the best of data with its 50 particles; its forces are less so."""
    series, _, force = after(plant, "sir_pf", "kinematic", [(PHASES.index(phase), 1)])
    error = (series.force_predicted - force)[-1000:]
    assert np.sqrt(np.nanmean(error**2)) < 0.3 * np.sqrt(np.mean(force[-1000:] ** 2))


@pytest.mark.parametrize("seeds", [1, pytest.param(10, marks=pytest.mark.slow)])
@pytest.mark.parametrize("phase", PHASES, ids=lambda phase: phase.__name__)
def test_ten_seconds_of_good_data_give_the_stiffness_to_the_default(phase, seeds, plant):
    for seed in range(seeds):
        order = [(PHASES.index(phase), seed)]
        series, clean, _ = after(plant, "self_tuning_ukf", "kinematic", order)
        assert clean.parameters[-1, 0] == pytest.approx(TISSUE[0], rel=0.005)
        assert series.parameters[-1, 0] == pytest.approx(TISSUE[0], rel=0.01), f"seed {seed}"


LEARNT = [(spikes, 7), (another_law, 1), (wandering, 3), (wandering, 8)]


@pytest.mark.parametrize(("phase", "seed"), LEARNT)
def test_depths_and_speeds_of_rubbish_bound_the_stiffness_for_seconds_only(phase, seed, plant):
    """Regression: the K that was given out stayed 59 to 100 % too low; the forces were right."""
    order = [(PHASES.index(phase), seed)]
    series, _, _ = after(plant, "self_tuning_ukf", "kinematic", order)
    assert series.parameters[-1, 0] == pytest.approx(TISSUE[0], rel=0.01)


@pytest.mark.parametrize("examples", [8, pytest.param(100, marks=pytest.mark.slow)])
@pytest.mark.parametrize("missing", [False, True], ids=["pairs", "missing"])
def test_the_default_is_sound_after_every_sample(missing, examples, plant):
    @given(order=ORDERS)
    @settings(max_examples=examples)
    def sound(order):
        hostile(plant, hc.create_estimator("self_tuning_ukf", missing_readings=missing), order)

    sound()


@pytest.mark.parametrize("filter_name", ["self_tuning_ukf", "ukf", "ekf", "raukf", "rls"])
def test_gaps_of_minutes_are_bridged(filter_name, real):
    """Regression: 3,112 of these 25,000 samples were used once, and K was 1 +- 2."""
    samples = real("hostile/gaps_600s.csv")
    series = hc.create_estimator(filter_name).run(*samples)
    assert np.mean(series.rejected == Rejection.ACCEPTED) > 0.9
    if filter_name != "rls":  # biased anyway
        assert series.parameters[-1, 0] == pytest.approx(0.5, rel=0.02)


# `raukf` and `rls` take the first such force after half a second for a sensor gone noisy.
WATCHED = ["self_tuning_ukf", "ukf", "ekf", "rwstukf", "rbpf"]


@pytest.mark.parametrize("filter_name", WATCHED)
@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_who_refuses_everything_for_a_second_starts_anew_and_says_so(filter_name, rate, plant):
    """A force that no tissue gives, and a gate that never opens by itself."""
    time, d, force = palpation(plant, 4.0, rate=rate)
    estimator = hc.create_estimator(filter_name, outlier_limit=1_000_000)
    before = estimator.run(time, d, force)[-1]
    bad = estimator.run(4.0 + time, d, force + 500.0)
    told = np.flatnonzero(bad.change_detected)
    assert told.size
    refused = bad.rejected[: told[0]] == Rejection.OUTLIER
    assert np.mean(refused) > 0.8
    if refused.all():  # a motion begun anew after half a second may have let one through
        assert 1.0 < time[told[0]] < 1.1
    assert time[told[0]] < 2.1
    assert bad.parameters_std[told[0], 0] > 3.0 * before.parameters_std[0]
