"""Possible predictions only: on real recordings at a surgical arm's rate, the zero wrong."""

import numpy as np
import pytest

import hc_estimator as hc

RECORDINGS = ["press_triangle", "scan", "sine_hard", "sine_soft", "sine_horse_raw"]
ZEROS = [-3.0, -1.0, 0.0, 1.0, 3.0]  # by which the displacement's zero is off [mm]
ARM = 66.0  # samples per second
LEARNING = 0.5  # time after the touch for which nobody knows the tissue [s]
TOUCH = 0.05  # force that is one [N]
CASES = [(name, zero) for name in RECORDINGS for zero in ZEROS]


def thinned(time, d, force, rate):
    """The samples nearest to a lower rate."""
    wanted = np.arange(time[0], time[-1], 1.0 / rate)
    k = np.unique(np.minimum(np.searchsorted(time, wanted), time.size - 1))
    return time[k], d[k], force[k]


def predicted(real, name, zero):
    """Readings and one-step prediction at the arm's rate, from `LEARNING` after the touch on."""
    time, d, force = thinned(*real(f"palpation_{name}.csv"), ARM)
    series = hc.create_estimator("self_tuning_ukf").run(time, d + zero, force)
    touched = time[np.argmax(force > TOUCH)]
    known = np.isfinite(series.force_predicted) & (time > touched + LEARNING)
    return time, d + zero, force, series.force_predicted, known


@pytest.mark.parametrize(("name", "zero"), CASES)
def test_no_force_is_predicted_that_was_never_felt(name, zero, real):
    """At a depth inside of what was reached before, within three times the largest force so far."""
    _, d, force, prediction, known = predicted(real, name, zero)
    felt = np.maximum.accumulate(np.abs(force))[:-1]
    reached = np.maximum.accumulate(d)[:-1]
    asked = known[1:] & (d[1:] <= reached)
    assert asked.sum() > 100
    assert np.all(np.abs(prediction[1:][asked]) <= 3.0 * np.maximum(felt[asked], TOUCH))


@pytest.mark.parametrize(("name", "zero"), CASES)
def test_a_prediction_is_not_much_worse_than_the_last_reading(name, zero, real):
    """RMS error of one step: at most twice that of holding the last reading."""
    _, _, force, prediction, known = predicted(real, name, zero)
    error = np.sqrt(np.mean((prediction - force)[known] ** 2))
    held = np.sqrt(np.mean(np.diff(force)[known[1:]] ** 2))
    assert error <= 2.0 * held


@pytest.mark.parametrize("seed", range(4))
def test_no_row_predicts_what_was_never_felt_on_possible_data(seed, plant):
    """Every hypothesis, sample by sample, while tissue and depth are those that were felt."""
    time = np.arange(3000) / 200.0
    d, v = plant.motion(time)
    force = plant.force(d, v, 0.3, 0.02, 1.7, 1.0)
    d, force = plant.noisy(d, force, seed)
    estimator = hc.create_estimator("self_tuning_ukf")
    estimator.run(time[:200], d[:200], force[:200])
    felt, reached = np.abs(force[:200]).max(), d[:200].max()
    for k in range(200, time.size):
        estimator.step(time[k], d[k], force[k])
        rows = estimator._memory[0]["rows"]
        if d[k] <= reached:
            worst = np.abs(rows["predicted_force"][rows["active"] == 1]).max()
            assert worst <= 3.0 * felt, f"at {time[k]} s"
        felt, reached = max(felt, abs(force[k])), max(reached, d[k])
