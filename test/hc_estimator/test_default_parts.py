"""The parts of the default filter one by one: parabolas, remembered points, fit, judge, guards.

Each is held against an independent reimplementation or its own definition; what they make of
tissue together is in the other test_default files.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

import hc_estimator as hc
from hc_estimator.multiple_model import batch_fit, grid, history, judge, maneuver, plausible
from hc_estimator.multiple_model.hypotheses import DEPTH, FITTED, FRESH, LOG_STIFFNESS, VELOCITY
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import reset

TISSUE = np.array([0.3, 0.015, 1.7, 1.05])
CLOCK = 10.0  # contact clock at which rows are judged [s]


def records(estimator):
    """Its settings and its bank, whose fields are attributes as they are in compiled code."""
    return estimator._settings.view(np.recarray)[0], estimator._memory.view(np.recarray)[0]


@pytest.fixture
def parts():
    """Settings and bank of a fresh default filter."""
    return records(hc.create_estimator("self_tuning_ukf"))


def law(depth, velocity, values):
    """The unilateral law at ln K, ln B, n, p, written out anew."""
    k, b, n, p = np.exp(values[0]), np.exp(values[1]), values[2], values[3]
    force = depth**n * (k + b * np.sign(velocity) * np.abs(velocity) ** p)
    return np.maximum(force, 0.0)


def in_logarithms(parameters):
    return np.array([np.log(parameters[0]), np.log(parameters[1]), *parameters[2:]])


def fill_grid(bank, displacement, force, rate=1000.0, origin=0.0):
    """Feed both channels and make every point of the grid; the number of them."""
    grid.restart(bank.delay)
    made = 0
    for k in range(displacement.size):
        for channel, value in ((0, displacement[k]), (1, force[k])):
            grid.take(bank.delay, channel, origin + k / rate, value)
        before = bank.delay.grid_count
        grid.advance(bank.delay)
        made += bank.delay.grid_count > before
    return made


# Parabolas


@given(st.integers(0, 2**32 - 1), st.sampled_from([200.0, 500.0, 1000.0, 4000.0]))
@settings(max_examples=25)
def test_a_point_of_the_grid_is_the_least_squares_parabola(seed, rate):
    """The latest point against numpy's polynomial fit through the same readings."""
    _, bank = records(hc.create_estimator("self_tuning_ukf"))
    rng = np.random.default_rng(seed)
    time = np.arange(round(0.25 * rate)) / rate
    values = 3.0 + np.sin(20.0 * time) + 0.1 * rng.standard_normal(time.size)
    force = 100.0 + 5.0 * np.cos(15.0 * time) + 0.1 * rng.standard_normal(time.size)
    assert fill_grid(bank, values, force, rate) > 5
    finder = bank.delay
    centre, half = finder.grid_next - finder.grid_step, 0.5 * finder.grid_width
    point = finder.grid[(finder.grid_count - 1) % finder.grid.shape[0]]
    inside = np.abs(time - centre) <= grid.EDGE * half
    c, b, a = np.polyfit(time[inside] - centre, values[inside], 2)
    np.testing.assert_allclose(point[:3], [a, b, 2.0 * c], rtol=1e-6, atol=1e-6)
    left = np.sum((np.polyval([c, b, a], time[inside] - centre) - values[inside]) ** 2)
    assert point[4] == pytest.approx(left / (inside.sum() - 3), rel=1e-6)
    force_left = np.polyfit(time[inside] - centre, force[inside], 2)
    assert point[3] == pytest.approx(force_left[2], rel=1e-9)


@pytest.mark.parametrize("rate", [200.0, 250.0, 500.0, 1000.0])
def test_the_points_do_not_depend_on_the_origin_of_time(rate):
    """Regression: the rounding of the stamps decided whether a reading on the edge counted."""
    rng = np.random.default_rng(4)
    count = round(0.3 * rate)
    displacement = 3.0 + 0.1 * rng.standard_normal(count)
    force = 5.0 + 0.1 * rng.standard_normal(count)
    points = []
    for origin in (0.0, 0.1234567, 1e3, 1e6):
        _, bank = records(hc.create_estimator("self_tuning_ukf"))
        made = fill_grid(bank, displacement, force, rate, origin)
        points.append(np.array(bank.delay.grid[:made]))
    for other in points[1:]:
        np.testing.assert_allclose(other[:, [0, 3]], points[0][:, [0, 3]], atol=1e-6)


def test_a_kink_leaves_a_parabola_far_more_than_the_noise_and_is_not_remembered(parts):
    _, bank = parts
    noise = np.array([0.002**2, 0.01**2])
    rng = np.random.default_rng(3)
    time = np.arange(200) / 1000.0
    displacement = 3.0 + 0.002 * rng.standard_normal(time.size)
    smooth = 5.0 + 0.01 * rng.standard_normal(time.size)
    corner = smooth + 60.0 * np.maximum(time - 0.1, 0.0)
    for force, kept in ((smooth, True), (corner, False)):
        fill_grid(bank, displacement[:116], force[:116])  # the newest point is at the corner
        history.reset(bank.history)
        assert history.learn(bank.history, bank.delay, noise) == kept
        assert bank.history.count == int(kept)


# What is remembered


def newest_point(bank, displacement, velocity, force):
    finder = bank.delay
    finder.grid_step, finder.delay, finder.grid_count = 0.01, 0.0, finder.grid_count + 1
    slot = (finder.grid_count - 1) % finder.grid.shape[0]
    finder.grid[slot] = (displacement, velocity, 0.0, force, 0.0, 0.0, 0.0)
    return history.learn(bank.history, finder, np.array([1e-6, 1e-4]))


def test_what_is_no_contact_is_not_remembered(parts):
    _, bank = parts
    history.reset(bank.history)
    assert not newest_point(bank, -1.0, 0.0, 0.0)
    assert not newest_point(bank, 2.0, -5.0, 0.02)  # separated: the force is noise
    assert newest_point(bank, 2.0, 1.0, 3.0)
    np.testing.assert_array_equal(bank.history.points[0, :3], [2.0, 1.0, 3.0])


def test_the_memory_is_thinned_out_once_and_then_keeps_the_latest(parts):
    _, bank = parts
    history.reset(bank.history)
    remembered = [k for k in range(3000) if newest_point(bank, 1.0 + k, 1.0, 5.0)]
    kept = bank.history
    held = np.sort(kept.points[:, 0]) - 1.0
    assert kept.every == 2
    assert kept.count > POINTS
    np.testing.assert_array_equal(np.diff(held), 2.0)  # evenly spaced, nothing twice
    assert held[-1] == remembered[-1]
    assert held.size * 0.02 == pytest.approx(10.24)


# The fit


def remember(bank, depth, velocity, force):
    kept = bank.history
    history.reset(kept)
    kept.count = depth.size
    kept.points[: depth.size, 0] = depth
    kept.points[: depth.size, 1] = velocity
    kept.points[: depth.size, 2] = force


def press(rng, count=300):
    """Depth and velocity that show all four parameters."""
    time = np.arange(count) * 0.01
    depth = 3.0 + 1.6 * np.sin(4.4 * time) + 0.8 * np.sin(14.4 * time + 0.5)
    velocity = 1.6 * 4.4 * np.cos(4.4 * time) + 0.8 * 14.4 * np.cos(14.4 * time + 0.5)
    return depth, velocity


@pytest.mark.parametrize("seed", range(3))
def test_the_fit_is_that_of_scipy_with_the_same_prior(seed, parts):
    options, bank = parts
    rng = np.random.default_rng(seed)
    depth, velocity = press(rng)
    deviation = 0.01
    force = law(depth, velocity, in_logarithms(TISSUE)) + deviation * rng.standard_normal(300)
    remember(bank, depth, velocity, force)
    mean = np.array(
        [
            np.log(options.initial_stiffness),
            np.log(options.initial_damping / options.initial_stiffness),
            options.initial_displacement_exponent,
            options.initial_velocity_exponent,
        ]
    )
    spread = np.array(
        [
            options.initial_stiffness_log_std,
            options.initial_damping_log_std,
            options.initial_displacement_exponent_std,
            options.initial_velocity_exponent_std,
        ]
    )
    bank.history.fit[:] = in_logarithms([1.0, 0.05, 1.5, 1.0])
    left = batch_fit._fit(options, bank.history, deviation**2, 0.0, 0.0, 300.0)

    def residuals(values):
        off = np.array([values[0], values[1] - values[0], values[2], values[3]]) - mean
        return np.concatenate([(law(depth, velocity, values) - force) / deviation, off / spread])

    oracle = least_squares(residuals, in_logarithms([1.0, 0.05, 1.5, 1.0]), xtol=1e-14, ftol=1e-14)
    expected = np.linalg.inv(oracle.jac.T @ oracle.jac)
    deviations = np.sqrt(np.diag(expected))
    assert np.all(np.abs(bank.history.fit - oracle.x) < 0.1 * deviations)
    assert 0.0 <= left < 0.5 * deviation**2
    found = bank.history.covariance
    assert np.linalg.eigvalsh(found - 0.999 * expected).min() > -1e-9 * expected.max()
    np.testing.assert_allclose(np.sqrt(np.diag(found)), deviations, rtol=0.2)


@pytest.mark.parametrize("held", [(1, 3), (3,)], ids=["one_velocity", "there_and_back"])
def test_noise_of_the_velocity_is_no_knowledge(held, parts):
    """One velocity shows neither B nor p, two of opposite sign show B; its noise shows neither."""
    options, bank = parts
    for seed in range(20):
        rng = np.random.default_rng(seed)
        depth, _ = press(rng)
        velocity = np.full(300, 5.0)
        if held == (3,):
            velocity[::2] = -5.0
        noise = 0.6
        force = law(depth, velocity, in_logarithms(TISSUE)) + 0.01 * rng.standard_normal(300)
        remember(bank, depth, velocity + noise * rng.standard_normal(300), force)
        bank.history.fit[:] = in_logarithms([1.0, 0.05, 1.5, 1.0])
        left = batch_fit._fit(options, bank.history, 0.01**2, noise**2, noise**2, 300.0)
        assert left >= 0.0
        off = bank.history.fit - in_logarithms(TISSUE)
        deviation = np.sqrt(np.diag(bank.history.covariance))
        assert deviation[3] > 0.9 * options.initial_velocity_exponent_std
        if 1 in held:
            assert deviation[1] > 0.4 * options.initial_damping_log_std
        else:
            assert deviation[1] < 0.2 * options.initial_damping_log_std
        assert np.all(np.abs(off) < 3.5 * deviation)


def test_at_rest_the_noise_of_the_velocity_is_not_taken_for_damping(parts):
    """Regression: B was 900 times too large for certain, with p at its limit."""
    options, bank = parts
    for seed in range(20):
        rng = np.random.default_rng(seed)
        depth = 3.0 + 0.001 * rng.standard_normal(100)
        force = law(depth, 0.0 * depth, in_logarithms(TISSUE)) + 0.004 * rng.standard_normal(100)
        remember(bank, depth, 0.06 * rng.standard_normal(100), force)
        bank.history.fit[:] = in_logarithms([1.0, 0.05, 1.5, 1.0])
        left = batch_fit._fit(options, bank.history, 0.004**2, 0.06**2, 0.06**2, 100.0)
        assert left >= 0.0
        ratio = bank.history.fit[1] - bank.history.fit[0]
        first = np.log(options.initial_damping / options.initial_stiffness)
        assert ratio == pytest.approx(first, abs=0.1)
        assert bank.history.fit[3] == pytest.approx(1.0, abs=0.05)


def test_a_fit_to_nonsense_stays_where_the_law_means_something(parts):
    """Regression: ln K ran to 3e8 on depths of 400 mm, and K was infinite."""
    options, bank = parts
    rng = np.random.default_rng(0)
    remember(bank, 400.0 + rng.uniform(-9.0, 9.0, 60), rng.normal(size=60), rng.normal(size=60))
    bank.history.fit[:] = (-10.8, -13.8, 4.0, 1.0)
    batch_fit._fit(options, bank.history, 1e-4, 0.0, 0.0, 60.0)
    assert np.all(np.abs(bank.history.fit) <= 16.0)


@pytest.mark.parametrize(("frequency", "noise"), [(2.9, 1e-5), (2.9, 0.003), (0.05, 0.003)])
def test_a_parabola_hides_no_velocity(frequency, noise, parts):
    """Regression: (omega h)^2 / 10 of every velocity was missing; it is 1 % at 3 Hz."""
    _, bank = parts
    finder, kept = bank.delay, bank.history
    grid.restart(finder)
    rng = np.random.default_rng(4)
    time = np.arange(5000) / 1000.0
    omega = 2.0 * np.pi * frequency
    d = 3.0 + np.sin(omega * time) + noise * rng.standard_normal(time.size)
    history.reset(kept)
    true = []
    for k in range(time.size):
        grid.take(finder, 0, time[k], d[k])
        grid.take(finder, 1, time[k], 5.0)
        before = finder.grid_count
        grid.advance(finder)
        if finder.grid_count == before:
            continue
        centre = finder.grid_next - finder.grid_step
        if history.learn(kept, finder, np.array([1e-4, 1e-4])):
            true.append(omega * np.cos(omega * centre))
    found = np.array([kept.points[k] for k in range(kept.count)])
    variance = 3.0 * noise**2 / 0.015**2 / 30.0
    batch_fit._share_cubic(kept, variance, kept.count / 3.0)
    share = kept.cubic_share
    off = found[:, 1] + share * found[:, 4] - true
    slope = np.sum(off * true) / np.sum(np.square(true))
    if frequency > 1.0:
        assert share > 0.9
        assert abs(slope) < 1e-3
        assert np.sum((found[:, 1] - true) * true) / np.sum(np.square(true)) < -6e-3
    else:  # nothing to gain, noise to lose
        assert share < 0.5


def test_what_no_law_explains_is_forgotten_from_its_older_end(parts):
    """Regression: after nonsense there was no fit, and no recovery, for ten good seconds."""
    _, bank = parts
    kept = bank.history
    remember(bank, *press(None), np.ones(300))
    history.forget_older_half(kept)
    assert history.oldest(kept) == 150
    history.forget_older_half(kept)
    assert history.oldest(kept) == 225
    kept.count = POINTS + 300  # the ring has gone round since
    assert history.oldest(kept) == 300
    history.reset(kept)
    assert history.oldest(kept) == 0


def test_a_fit_with_misfit_tells_it_and_one_that_explains_nothing_is_none(parts):
    options, bank = parts
    rng = np.random.default_rng(1)
    depth, velocity = press(rng)
    exact = law(depth, velocity, in_logarithms(TISSUE))
    start = in_logarithms([1.0, 0.05, 1.5, 1.0])
    wrong = 0.05 * np.sqrt(np.mean(exact**2))
    remember(bank, depth, velocity, exact + wrong * rng.standard_normal(300))
    bank.history.fit[:] = start
    assert batch_fit._fit(options, bank.history, 1e-4, 0.0, 0.0, 300.0) == pytest.approx(
        wrong**2, rel=0.3
    )
    remember(bank, depth, velocity, np.abs(20.0 * rng.standard_normal(300)))
    bank.history.fit[:] = start
    assert batch_fit._fit(options, bank.history, 1e-4, 0.0, 0.0, 300.0) == -1.0


def test_parameters_that_are_held_fixed_stay_and_have_no_variance():
    options, bank = records(
        hc.create_estimator("self_tuning_ukf", initial_velocity_exponent_std=0.0)
    )
    depth, velocity = press(None)
    remember(bank, depth, velocity, law(depth, velocity, in_logarithms([0.3, 0.015, 1.7, 1.0])))
    bank.history.fit[:] = in_logarithms([1.0, 0.05, 1.5, 1.0])
    assert batch_fit._fit(options, bank.history, 1e-4, 0.0, 0.0, 300.0) >= 0.0
    assert bank.history.fit[3] == 1.0
    assert not bank.history.covariance[3].any()
    np.testing.assert_allclose(np.exp(bank.history.fit[:2]), [0.3, 0.015], rtol=0.01)


def test_the_fit_earns_its_place_where_the_law_does_not_fit(plant):
    """A relaxing tissue, pressed and held: forces half a second ahead, with the fit and without."""
    time = np.arange(8000) / 1000.0
    depth = 2.0 + 1.5 * (2.0 / np.pi) * np.arcsin(np.sin(2.0 * np.pi * 0.4 * time))
    velocity = np.gradient(depth, time)
    force = plant.force(depth, velocity, 0.4, 0.02, 1.6, 1.0)
    force *= 1.0 - 0.15 * np.sin(2.0 * np.pi * 0.4 * time + 1.0)  # what no law of ours does
    d, f = plant.noisy(depth, force, 5)
    errors = {}
    for fit in (True, False):
        series = hc.create_estimator("self_tuning_ukf", fit_batches=fit).run(time, d, f)
        values = series.parameters[2000:-500]
        ahead = plant.force(depth[2500:], velocity[2500:], *values.T)
        errors[fit] = np.sqrt(np.mean((ahead - force[2500:]) ** 2))
    assert errors[True] < errors[False]


# The judge


def rows_of(options, bank, scores, misfits=(), learns=()):
    """Rows that all count, with the given scores; some misfit, some still learn."""
    for m, score in enumerate(scores):
        row = bank.rows[m]
        reset(options, row, 2.0)
        row.index, row.active, row.score, row.claimed = m, 1, score, 0.0
        row.covariance[7, 7] = 0.01  # a surface that is known
        row.model_error = 1.0 if m in misfits else 0.0
        if m in learns:
            row.recent_nis, row.claimed = 1.0, 1e3
    bank.judge.chosen = 0
    return bank.rows


@pytest.mark.parametrize(
    ("scores", "misfits", "learns", "chosen"),
    [
        ((1.0, 1.0, 1.0, 1.0, 1.0), (), (), 0),  # the calmest of equals
        ((1.1, 9.0, 1.0, 1.0, 1.0), (), (), 0),  # not clearly worse
        ((1.5, 9.0, 1.0, 1.0, 1.0), (), (), 2),  # clearly worse
        ((2.0, 1.0, 9.0, 9.0, 9.0), (1,), (), 0),  # one that claims to fit goes before a misfit
        ((4.0, 1.0, 9.0, 9.0, 9.0), (1,), (), 1),  # unless it predicts far worse
        ((4.0, 2.0, 9.0, 1.0, 9.0), (0, 1, 2, 3, 4), (), 3),  # among misfits, the best
        ((4.0, 2.0, 9.0, 9.0, 1.0), (0, 1, 2, 3, 4), (), 1),  # a surface that explains nothing
        ((9.0, 9.0, 3.5, 9.0, 1.0), (0, 1), (), 4),  # and one that does
        ((2.0, 6.5, 9.0, 3.2, 3.2), (0,), (), 0),  # what may drift has no advance over a misfit
        ((3.0, 9.0, 1.0, 1.0, 1.0), (), (0,), 0),  # still learning: freer rows prove nothing
        ((3.0, 1.0, 0.4, 0.4, 0.4), (), (0,), 1),  # but the fit, as calm, does
        ((5.0, 9.0, 1.0, 1.0, 1.0), (), (0,), 2),  # far better is far better
    ],
)
def test_the_judge_chooses(scores, misfits, learns, chosen, parts):
    options, bank = parts
    rows_of(options, bank, scores, misfits, learns)
    judge._choose(bank.judge, bank.rows, CLOCK)
    assert bank.judge.chosen == chosen


def test_an_old_error_is_forgiven(parts):
    """A bad start once counted for ten seconds: its square decayed through eight decades."""
    options, bank = parts
    rows_of(options, bank, (1e8, 9.0, 1.0, 1.0, 1.0))
    judge._choose(bank.judge, bank.rows, CLOCK)
    assert bank.rows[0].score == pytest.approx(judge.FORGIVEN)


def test_a_maneuver_takes_back_scores_and_choice(parts):
    """Regression: after a corner the row that had followed the wrong motion stayed in charge."""
    options, bank = parts
    rows_of(options, bank, (1.0, 2.0, 3.0, 4.0, 5.0))
    bank.tool.contact_clock = 1.0
    for _ in range(maneuver.PERIOD):
        maneuver.keep(
            bank.maneuver, bank.rows, bank.rows[0], bank.tool, bank.motion, 1.0, 0.001, False
        )
    assert bank.maneuver.count == 1
    bank.judge.count = 4
    bank.judge.said_at[:4] = (0.9, 0.99, 1.01, 1.02)
    bank.judge.said[:4] = 7.0
    rows_of(options, bank, (50.0, 50.0, 50.0, 0.1, 50.0))
    bank.rows[3].log_likelihood = 99.0
    bank.judge.chosen = 3
    grid.take(bank.delay, 0, 1.0, 2.0)
    maneuver._go_back(bank, 0, 1.0)
    assert bank.judge.chosen == 0
    assert [bank.rows[m].score for m in range(FRESH)] == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert bank.rows[3].log_likelihood == 0.0
    assert np.all(bank.judge.said[:2] == 7.0)  # what was said before it stands
    assert not np.any(bank.judge.said[2:4, :FRESH, 0] == 7.0)  # the rest is said anew


def test_a_fitted_row_that_did_not_exist_before_a_maneuver_goes(parts):
    options, bank = parts
    rows_of(options, bank, (1.0, 1.0, 1.0, 1.0, 1.0))
    bank.rows[FITTED].active = 0
    for _ in range(maneuver.PERIOD):
        maneuver.keep(
            bank.maneuver, bank.rows, bank.rows[0], bank.tool, bank.motion, 1.0, 0.001, False
        )
    bank.rows[FITTED].active = 1
    grid.take(bank.delay, 0, 1.0, 2.0)
    maneuver._go_back(bank, 0, 1.0)
    assert bank.rows[FITTED].active == 0


# What is possible


def felt(options, bank, log_stiffness):
    """Rows at 2 mm and 1 mm/s with the given ln K; 10 N, 3 mm and 5 mm/s were felt."""
    rows = rows_of(options, bank, (1.0,) * FRESH)
    plausible.reset(bank.tool)
    bank.tool.contact_clock = 1.0
    bank.tool.deepest, bank.tool.fastest, bank.tool.largest_force = 3.0, 5.0, 10.0
    for m, value in enumerate(log_stiffness):
        rows[m].state[DEPTH], rows[m].state[VELOCITY] = 2.0, 1.0
        rows[m].state[LOG_STIFFNESS] = value
    return rows


def test_a_row_that_expects_the_impossible_begins_anew_from_one_that_does_not(parts):
    options, bank = parts
    rows = felt(options, bank, [0.0, 0.0, 12.0, 0.0, -1.0])
    plausible.check(options, rows, bank.tool, 4, 1e-4)
    assert rows[2].state[LOG_STIFFNESS] == -1.0  # the row in charge is the model
    assert rows[2].predicted_force == pytest.approx(rows[4].predicted_force)
    assert rows[0].state[LOG_STIFFNESS] == 0.0  # the others stay


def test_where_no_row_is_possible_all_are_brought_down(parts):
    options, bank = parts
    rows = felt(options, bank, [12.0] * FRESH)
    plausible.check(options, rows, bank.tool, 0, 1e-4)
    largest = plausible.LARGEST_FACTOR * 10.0 + plausible.NOISE * 0.01
    for m in range(FRESH):
        assert rows[m].predicted_force <= largest * (1.0 + 1e-9)
        assert rows[m].covariance[LOG_STIFFNESS, LOG_STIFFNESS] == 1.0  # and let go


@pytest.mark.parametrize("new", ["depth", "speed", "contact"])
def test_what_was_not_felt_yet_may_be_as_strong_as_it_likes(new, parts):
    options, bank = parts
    rows = felt(options, bank, [12.0] * FRESH)
    if new == "depth":
        bank.tool.deepest = 1.9
    elif new == "speed":
        bank.tool.fastest = 0.9
    else:
        bank.tool.contact_clock = 0.05
    plausible.check(options, rows, bank.tool, 0, 1e-4)
    assert all(rows[m].state[LOG_STIFFNESS] == 12.0 for m in range(FRESH))


def test_a_model_error_beyond_the_forces_themselves_explains_nothing(parts):
    options, bank = parts
    rows = felt(options, bank, [0.0] * FRESH)
    for model_error, worthless in ((1.0, 0.0), (1e6, 0.1), (1.0, 0.0)):
        rows[0].model_error = model_error
        for _ in range(100):
            plausible.learn(bank.tool, rows[0], 5.0, 0.001)
        assert bank.tool.worthless_time == pytest.approx(worthless, abs=2e-3)


def test_a_law_that_explains_nothing_begins_anew_and_says_so(plant):
    """Regression: its model error outlived ten seconds of good data, K off by any factor."""
    rng = np.random.default_rng(2)
    time = np.arange(14000) / 1000.0
    depth, velocity = plant.motion(time)
    force = plant.force(depth, velocity, *TISSUE)
    d, f = plant.noisy(depth, force, 6)
    nonsense = (time > 2.0) & (time < 4.0)
    f[nonsense] = 200.0 * rng.random(nonsense.sum()) * (rng.random(nonsense.sum()) < 0.3)
    series = hc.create_estimator("self_tuning_ukf").run(time, d, f)
    assert series.parameters[-1, 0] == pytest.approx(TISSUE[0], rel=0.01)
    assert np.isfinite(series.parameters).all()
    assert not series.model_mismatch[-1000:].any()
