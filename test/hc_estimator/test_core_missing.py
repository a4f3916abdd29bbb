"""Readings that are missing, or come alone at their own stamps, for filters that adapt.

That the update itself is exact stands in test_core_linear; here is what surrounds it.
"""

import numpy as np
import pytest
from scipy.stats import chi2

import hc_estimator as hc
from hc_estimator import Rejection

TRUTH = (0.2, 0.009, 1.8, 1.05)  # that of `recording`
MISSING = {"missing_readings": True}
KNOWN = {"displacement_noise_std": 0.002, "force_noise_std": 0.01}
NEAR = {"initial_damping": 0.006}
# Every way in which a filter learns from a sample, besides its update.
ADAPTIVE = [
    ("ukf", {"noise_adaptation": "fixed"}),
    ("ukf", {"noise_adaptation": "differences"}),
    ("ukf", {"noise_adaptation": "variational_bayes"}),
    ("ekf", {"change_detection": "cusum"}),
    ("rwstukf", {}),
    ("aukf", {"adapted_noise": "measurement"}),
    ("aukf", {"adapted_noise": "both", "matching_trace": "literal"}),
    ("raukf", {"adapted_noise": "both"}),
    ("rls", {}),
    ("sir_pf", {}),
    ("rbpf", {}),
]


def alternating(time, d, force):
    """Each sample as two: the displacement at its stamp, the force a fifth of a step later.

    For tests of what depends on the order alone; the force is not moved along with its stamp.
    """
    step = time[1] - time[0]
    stamps = np.column_stack([time, time + 0.2 * step]).ravel()
    nothing = np.full(time.size, np.nan)
    return (
        stamps,
        np.column_stack([d, nothing]).ravel(),
        np.column_stack([nothing, force]).ravel(),
    )


@pytest.fixture(scope="module")
def two_rates():
    """Displacement at 250 Hz and force at 1 kHz, each at stamps of its own; the last is 3 s."""

    def make(seed, seconds=3.0):
        rng = np.random.default_rng(seed)
        slow, fast = 2 * np.pi * 0.7, 2 * np.pi * 2.3

        def motion(t):
            d = 3 + 1.6 * np.sin(slow * t) + 0.8 * np.sin(fast * t + 0.5)
            v = 1.6 * slow * np.cos(slow * t) + 0.8 * fast * np.cos(fast * t + 0.5)
            return d, v

        pose = np.arange(round(seconds * 250)) / 250
        wrench = np.arange(round(seconds * 1000)) / 1000 + 0.37e-3
        K, B, n, p = TRUTH
        depth, v = motion(wrench)
        force = depth**n * (K + B * np.sign(v) * np.abs(v) ** p)
        force += 0.01 * rng.standard_normal(wrench.size)
        depth = motion(pose)[0] + 0.002 * rng.standard_normal(pose.size)
        time = np.concatenate([pose, wrench])
        order = np.argsort(time, kind="stable")
        nothing = np.full(pose.size, np.nan), np.full(wrench.size, np.nan)
        d = np.concatenate([depth, nothing[1]])[order]
        return time[order], d, np.concatenate([nothing[0], force])[order]

    return make


@pytest.mark.parametrize(("filter_name", "options"), ADAPTIVE)
@pytest.mark.parametrize("gone", [0, 1], ids=["displacement", "force"])
def test_nothing_is_learnt_from_a_reading_that_is_not_there(filter_name, options, gone, recording):
    """A tenth of a second with one reading alone leaves all that is known of the other.

    Without the force nothing is learnt of the tissue either.
    """
    time, d, force = recording(1.0)
    estimator = hc.create_estimator(filter_name, **MISSING, **options)
    before = estimator.run(time[:800], d[:800], force[:800])[-1]
    known = estimator.state()["memory"]
    readings = [d.copy(), force.copy()]
    readings[gone][:] = np.nan
    after = estimator.run(time[800:900], readings[0][800:900], readings[1][800:900])
    assert np.all(after.rejected == 0)
    assert np.isnan(after.innovation[:, gone]).all()
    assert np.isfinite(after.innovation[:, 1 - gone]).all()
    noise = [after.displacement_noise_std, after.force_noise_std][gone]
    assert np.all(noise == [before.displacement_noise_std, before.force_noise_std][gone])
    unknown = estimator.state()["memory"]
    for name in ("bayes_shape", "bayes_scale", "matching_position", "matching_count"):
        at = 1 + gone if name.startswith("matching") else gone
        assert unknown[name][at] == known[name][at], name
    assert unknown["noise_channels"][gone] == known["noise_channels"][gone]
    if gone == 1:
        assert unknown["tempering_count"] == known["tempering_count"]
        assert unknown["change_quiet"] == known["change_quiet"]
        assert unknown["change_values"] == known["change_values"]
        known = before.parameters_std > 0.0  # `rls` knows of no p
        moved = (after.parameters - before.parameters)[:, known] / before.parameters_std[known]
        if filter_name != "sir_pf":  # whose particles are roughened
            assert np.abs(moved).max() < 0.5
        if filter_name == "rls":  # which keeps motion and tissue apart
            assert np.abs(moved).max() == 0.0


@pytest.mark.parametrize(
    ("filter_name", "options"),
    [
        ("ukf", KNOWN | {"noise_adaptation": "fixed", "change_detection": "none"}),
        ("ukf", {"noise_adaptation": "variational_bayes", "change_detection": "none"}),
        ("ukf", {}),
        ("ekf", {}),
        ("rwstukf", {}),
        ("aukf", {}),
        ("raukf", {}),
        ("rbpf", {}),
    ],
)
def test_readings_at_their_own_rates_find_the_tissue(filter_name, options, two_rates):
    """A pose at 250 Hz and a wrench at 1 kHz, nothing paired: parameters, noise and NIS."""
    estimator = hc.create_estimator(filter_name, **MISSING, **NEAR, **options)
    time, d, force = two_rates(1)
    series = estimator.run(time, d, force)
    assert np.mean(series.rejected == 0) > 0.99
    np.testing.assert_allclose(series.parameters[-1], TRUTH, rtol=0.06)
    assert series.parameters[-1, 0] == pytest.approx(TRUTH[0], rel=0.02)
    assert not series.change_detected.any()
    late = time > 1.5
    # One reading each. `rbpf` tempers longer, and the R of `aukf` scatters with its window.
    assert np.mean(series.nis[late]) == pytest.approx(
        1.0, rel=0.3 if filter_name == "rbpf" else 0.2
    )
    rel = 0.4 if filter_name == "aukf" else 0.25
    assert series.force_noise_std[-1] == pytest.approx(0.01, rel=rel)
    assert series.displacement_noise_std[-1] == pytest.approx(0.002, rel=rel)


def test_nees_and_nis_with_single_readings_lie_in_their_bands(two_rates):
    truth = np.array([*np.log(TRUTH[:2]), *TRUTH[2:]])
    nees, nis = [], []
    options = KNOWN | {"noise_adaptation": "fixed", "change_detection": "none"}
    for seed in range(12):
        estimator = hc.create_estimator("ukf", **MISSING, **NEAR, **options)
        series = estimator.run(*two_rates(seed))
        memory = estimator._memory[0]
        error = memory["state"][3:] - truth
        nees.append(error @ np.linalg.solve(memory["covariance"][3:, 3:], error))
        nis.append(series.nis[2000:])
    assert 1.5 < np.mean(nees) < chi2.ppf(1 - 1e-4, 4 * 12) / 12
    assert np.mean(nis) == pytest.approx(1.0, rel=0.05)


def test_a_nan_is_refused_unless_it_is_said_to_be_a_missing_reading():
    plain = hc.create_estimator("ukf")
    assert plain.step(0.0, np.nan, 1.0).rejected is Rejection.NOT_FINITE
    estimator = hc.create_estimator("ukf", **MISSING)
    assert estimator.step(0.0, 2.0, np.nan).rejected is Rejection.ACCEPTED
    assert estimator.step(0.001, np.nan, 1.0).rejected is Rejection.ACCEPTED
    assert estimator.step(0.002, np.nan, np.nan).rejected is Rejection.NOT_FINITE
    assert estimator.step(0.002, np.inf, np.nan).rejected is Rejection.NOT_FINITE
    assert estimator.step(np.nan, 2.0, np.nan).rejected is Rejection.NOT_FINITE


def test_two_channels_may_share_a_stamp_and_two_readings_of_one_may_not():
    estimator = hc.create_estimator("ukf", **MISSING)
    assert estimator.step(0.0, 2.0, np.nan).rejected is Rejection.ACCEPTED
    assert estimator.step(0.0, np.nan, 1.0).rejected is Rejection.ACCEPTED
    assert estimator.step(0.0, np.nan, 1.0).rejected is Rejection.TIME_REPEATED
    assert estimator.step(0.0, 2.0, 1.0).rejected is Rejection.TIME_REPEATED


@pytest.mark.parametrize("filter_name", hc.available_filters())
def test_a_force_alone_does_not_start_a_filter(filter_name, recording):
    """Before the first displacement nobody knows where the tool is; once it was taken for 0 mm."""
    time, d, force = recording(0.5)
    estimator = hc.create_estimator(filter_name, **MISSING)
    early = estimator.run(time[:20], np.full(20, np.nan), force[:20])
    assert np.all(early.rejected == Rejection.NOT_FINITE)
    started = hc.create_estimator(filter_name, **MISSING)
    first = estimator.run(time[20:], d[20:], force[20:])
    second = started.run(time[20:], d[20:], force[20:])
    np.testing.assert_array_equal(first.parameters, second.parameters)


@pytest.mark.parametrize("filter_name", ["ukf", "rls", "sir_pf", "rbpf", "self_tuning_ukf"])
def test_a_displacement_that_is_gone_for_long_takes_the_force_with_it(filter_name, recording):
    """After the longest gap a force says nothing any more; the motion then starts anew."""
    time, d, force = recording(4.0)
    lost = (time > 2.0) & (time < 3.2)
    d[lost] = np.nan
    estimator = hc.create_estimator(filter_name, **MISSING)
    series = estimator.run(time, d, force)
    assert np.all(series.rejected[(time > 2.0) & (time < 2.499)] == 0)
    late = (time > 2.502) & (time < 3.2)
    assert np.all(series.rejected[late] == Rejection.NOT_FINITE)
    again = np.searchsorted(time, 3.2)
    assert np.mean(series.rejected[again:] == 0) >= 0.98
    np.testing.assert_allclose(series.displacement[again], d[again], atol=0.02)
    if filter_name in ("ukf", "self_tuning_ukf"):  # `rbpf` needs some seconds, two are biased
        assert series.parameters[-1, 0] == pytest.approx(TRUTH[0], rel=0.02)


@pytest.mark.parametrize("filter_name", ["ukf", "self_tuning_ukf"])
def test_a_force_that_jumped_is_believed_though_the_displacement_comes_in_between(
    filter_name, recording
):
    """Regression: each displacement alone, inside the gate, once set the count of outliers to 0."""
    time, d, force = alternating(*recording(3.0))
    jump = 4000
    force[jump:] *= 4.0
    estimator = hc.create_estimator(filter_name, **MISSING)
    series = estimator.run(time, d, force)
    refused = np.count_nonzero(series.rejected[jump:] == Rejection.OUTLIER)
    assert refused < 40
    there = np.flatnonzero(np.isfinite(force))[-400:]
    error = series.force_predicted[there] - force[there]
    assert np.sqrt(np.mean(error**2)) < 0.05 * np.mean(np.abs(force[there]))


@pytest.mark.parametrize("state_space", ["kinematic", "paper"])
def test_particles_drawn_anew_at_a_force_alone_are_where_the_tool_is(state_space, recording):
    """They were drawn at depth 0, which is what stands where the displacement is missing."""
    time, d, force = recording(2.0)
    d = np.where(np.arange(time.size) % 4 == 0, d, np.nan)
    force[1500:] *= 8.0
    gate = {"outlier_gate": 12.0, "outlier_limit": 3}
    estimator = hc.create_estimator("sir_pf", state_space=state_space, **gate, **MISSING)
    series = estimator.run(time, d, force)
    assert series.change_detected[1502]  # the tissue is forgotten, and the next sample is a force
    assert np.isnan(d[1503])
    np.testing.assert_allclose(series.displacement[1503:1510], d[1504], atol=0.3)
