"""On linear models every Kalman-type filter is the Kalman filter, to 1e-10.

With the Kelvin-Voigt law and K and B held fixed both state spaces are linear: `kinematic` measures
y = [d, K d + B v] of a constant-acceleration motion, `paper` has F' = K d + B v as a state.
"""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.estimate import Hypothesis
from hc_estimator.multiple_model.hypotheses import without

STIFFNESS, DAMPING = 0.7, 0.03
NOISE = np.diag([0.01, 0.05]) ** 2
SAMPLES = 200
OFF = {"outlier_gate": 1e9}
# What switches each filter's adaptation off.
PLAIN = {
    "self_tuning_ukf": {  # leaves the row of the constant tissue
        "noise_adaptation": "fixed",
        "motion_adaptation": False,
        "coherence_share": 0.0,
        "without_hypotheses": without(*tuple(Hypothesis)[1:]),
        "find_maneuvers": False,
        "channel_delay": 0.0,
    },
    "ukf": {"noise_adaptation": "fixed", "change_detection": "none", "tempering_amplitude": 0.0},
    "ekf": {"noise_adaptation": "fixed", "change_detection": "none", "tempering_amplitude": 0.0},
    "rwstukf": {
        "noise_adaptation": "fixed",
        "change_detection": "none",
        "tempering_amplitude": 0.0,
        "mahalanobis_threshold": 1e6,
    },
    "aukf": {"matching_window": 256, "tempering_amplitude": 0.0},  # never full in 200 samples
    "raukf": {
        "matching_window": 256,
        "tempering_amplitude": 0.0,
        "change_detection": "none",
    },
}


def readings(rng):
    """Irregular stamps (no gaps) and readings of a tool that stays in contact."""
    time = 0.3 + np.cumsum(rng.uniform(0.5e-3, 2e-3, SAMPLES))
    d = 8.0 + np.sin(9.0 * time)
    force = STIFFNESS * d + DAMPING * 9.0 * np.cos(9.0 * time)
    return (
        time,
        d + 0.01 * rng.standard_normal(SAMPLES),
        force + 0.05 * rng.standard_normal(SAMPLES),
    )


def kinematic_model(dt, values):
    transition = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
    noise = values["jerk_density"] * np.array(
        [
            [dt**5 / 20, dt**4 / 8, dt**3 / 6],
            [dt**4 / 8, dt**3 / 3, dt**2 / 2],
            [dt**3 / 6, dt**2 / 2, dt],
        ]
    )
    return transition, noise, np.array([[1.0, 0, 0], [STIFFNESS, DAMPING, 0]])


def paper_model(dt, values):
    transition = np.array([[1, dt, 0], [0, 1, 0], [STIFFNESS, DAMPING, 0]])
    names = ("process_noise_displacement", "process_noise_velocity", "process_noise_force")
    noise = np.diag([values[name] * dt for name in names])
    return transition, noise, np.array([[1.0, 0, 0], [0, 0, 1]])


def with_missing(rng, d, force):
    """The readings with three tenths of each channel missing at random, never both at once."""
    which = rng.choice(3, d.size, p=[0.4, 0.3, 0.3])
    which[0] = 0
    return np.where(which == 1, np.nan, d), np.where(which == 2, np.nan, force)


def kalman_filter(time, readings, model, values, mean, deviations):
    """The closed-form Kalman filter in its textbook (short) form, step by step.

    NaN is a reading that is missing: the measurement then has one row.
    """
    covariance = np.diag(deviations) ** 2
    out = []
    for k, y in enumerate(readings):
        if k:
            transition, noise, measure = model(time[k] - time[k - 1], values)
            mean = transition @ mean
            covariance = transition @ covariance @ transition.T + noise
        else:
            _, _, measure = model(1.0, values)
        predicted = (measure @ mean)[1]
        innovation = y - measure @ mean
        there = ~np.isnan(y)
        rows, known = measure[there], innovation[there]
        spread = rows @ covariance @ rows.T + NOISE[np.ix_(there, there)]
        gain = covariance @ rows.T @ np.linalg.inv(spread)
        mean = mean + gain @ known
        covariance = covariance - gain @ spread @ gain.T
        nis = known @ np.linalg.solve(spread, known)
        out.append([mean[0], mean[1], predicted, *innovation, nis])
    return np.array(out)


@pytest.mark.parametrize("missing", [False, True], ids=["pairs", "missing"])
@pytest.mark.parametrize(
    ("filter_name", "state_space"),
    [(f, s) for f in PLAIN for s in hc.available_state_spaces(f)],
)
def test_equals_the_closed_form_kalman_filter(filter_name, state_space, missing):
    """With both readings, and with readings missing at random: exact for either."""
    time, d, force = readings(np.random.default_rng(5))
    if missing:
        d, force = with_missing(np.random.default_rng(15), d, force)
    fixed = {"initial_stiffness": STIFFNESS, "initial_damping": DAMPING}
    log = "_log" if state_space == "kinematic" else ""
    fixed |= {f"initial_stiffness{log}_std": 0.0, f"initial_damping{log}_std": 0.0}
    walks = ["process_noise_stiffness", "process_noise_damping"]
    if state_space == "kinematic":
        walks = ["stiffness_log_walk", "damping_log_walk"]
    known = {s.name for s in hc.parameter_specifications(filter_name, state_space, "kelvin_voigt")}
    estimator = hc.create_estimator(
        filter_name,
        state_space=state_space,
        contact_model="kelvin_voigt",
        displacement_noise_std=0.01,
        force_noise_std=0.05,
        initial_velocity_std=2.0,  # narrow: no sigma point may leave contact at the start
        initial_displacement_std=0.5,
        missing_readings=missing,
        **{name: 0.0 for name in walks if name in known},
        **({"initial_acceleration_std": 50.0} if state_space == "kinematic" else {}),
        **fixed,
        **OFF,
        **PLAIN[filter_name],
    )
    series = estimator.run(time, d, force)
    values = estimator.configuration
    names = ["initial_displacement_std", "initial_velocity_std"]
    if state_space == "kinematic":
        model, mean = kinematic_model, np.array([d[0], 0.0, 0.0])
        names.append("initial_acceleration_std")
    else:
        model, mean = paper_model, np.array([d[0], 0.0, force[0]])
        names.append("initial_force_std")
    expected = kalman_filter(
        time, np.column_stack([d, force]), model, values, mean, [values[n] for n in names]
    )
    found = np.column_stack(
        [
            series.displacement,
            series.velocity,
            series.force_predicted,
            series.innovation,
            series.nis,
        ]
    )
    assert np.all(series.rejected == 0)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(series.parameters[-1], [STIFFNESS, DAMPING, 1, 1], rtol=1e-14)
    assert np.all(series.covariance[-1] == 0.0)


@pytest.mark.parametrize("missing", [False, True], ids=["pairs", "missing"])
@pytest.mark.parametrize("filter_name", ["rls", "rbpf"])
def test_motion_in_the_air_equals_the_closed_form_kalman_filter(filter_name, missing):
    """The filters that only know Hunt-Crossley are linear out of contact."""
    time, d, _ = readings(np.random.default_rng(6))
    d -= 20.0
    force = 0.05 * np.random.default_rng(7).standard_normal(SAMPLES)
    if missing:
        d, force = with_missing(np.random.default_rng(16), d, force)
    options = {"tempering_amplitude": 0.0} if filter_name == "rbpf" else {}
    estimator = hc.create_estimator(
        filter_name,
        displacement_noise_std=0.01,
        force_noise_std=0.05,
        noise_adaptation="fixed",
        missing_readings=missing,
        **options,
    )
    series = estimator.run(time, d, force)
    values = estimator.configuration

    def in_the_air(dt, values):
        transition, noise, _ = kinematic_model(dt, values)
        return transition, noise, np.array([[1.0, 0, 0], [0, 0, 0]])

    names = ("initial_displacement_std", "initial_velocity_std", "initial_acceleration_std")
    expected = kalman_filter(
        time,
        np.column_stack([d, force]),
        in_the_air,
        values,
        np.array([d[0], 0.0, 0.0]),
        [values[n] for n in names],
    )
    found = np.column_stack(
        [
            series.displacement,
            series.velocity,
            series.force_predicted,
            series.innovation,
            series.nis,
        ]
    )
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    assert not series.contact.any()


@pytest.mark.parametrize("missing", [False, True], ids=["pairs", "missing"])
def test_particle_filter_approaches_the_kalman_filter(missing):
    """With many particles the SIR filter's mean is the Kalman filter's, to Monte Carlo error."""
    time, d, force = readings(np.random.default_rng(8))
    time, d, force = time[:60], d[:60], force[:60]
    if missing:
        d, force = with_missing(np.random.default_rng(18), d, force)
    estimator = hc.create_estimator(
        "sir_pf",
        state_space="paper",
        contact_model="kelvin_voigt",
        particle_count=20000,
        missing_readings=missing,
        likelihood_scale=1.0,
        surviving_share=0.0,
        roughening=0.0,
        noise_adaptation="fixed",
        displacement_noise_std=0.01,
        force_noise_std=0.05,
        initial_stiffness=STIFFNESS,
        initial_damping=DAMPING,
        initial_stiffness_std=0.0,
        initial_damping_std=0.0,
        process_noise_stiffness=0.0,
        process_noise_damping=0.0,
        process_noise_displacement=0.02,  # lively, so that the particles spread again
        process_noise_velocity=500.0,
        process_noise_force=1.0,
        initial_velocity_std=10.0,
        initial_force_std=0.1,
    )
    series = estimator.run(time, d, force)
    values = estimator.configuration
    expected = kalman_filter(
        time,
        np.column_stack([d, force]),
        paper_model,
        values,
        np.array([d[0], 0.0, force[0]]),
        [0.01, values["initial_velocity_std"], values["initial_force_std"]],
    )
    error = np.column_stack([series.displacement, series.velocity]) - expected[:, :2]
    assert np.abs(error[:, 0]).max() < 0.001  # a tenth of the noise
    assert np.abs(error[5:, 1]).max() < 0.4  # of a standard deviation of about 3 mm/s
    np.testing.assert_allclose(series.nis[5:], expected[5:, 5], rtol=0.1, atol=0.1)
