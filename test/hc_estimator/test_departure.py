"""A tool that departs from rest: the first forces show it, and are no misfit.

Where the tool rests, the motion model learns that it does; a press with a limited acceleration was
then foretold up to two hundred noises wrong, and a law that was right was called wrong in up to
half of the time.
"""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import change as changes
from hc_estimator.multiple_model import departure
from hc_estimator.multiple_model.hypotheses import ACCELERATION, DEPTH, VELOCITY
from hc_evaluation.accuracy.presses import MOVES, Presses

TISSUE = (0.3, 0.01, 1.5, 0.95)
FORCE_NOISE = 0.002


def presses(kind):
    """Quick presses with rests, out of the air and back."""
    moves = []
    for k in range(6):
        start = 1.0 + 3.0 * k
        moves += [(start, 0.5, 3.5), (start + 1.2, 0.5, -1.5), (start + 2.0, 0.5, -2.0)]
    return Presses(-0.5, kind, tuple(moves))


@pytest.mark.parametrize("kind", sorted(MOVES))
@pytest.mark.parametrize("rate", [500.0, 1000.0])
def test_presses_from_rest_are_foretold(plant, kind, rate):
    time = np.arange(round(20.0 * rate)) / rate
    d, v, _ = presses(kind).evaluate(time)
    force = plant.force(d, v, *TISSUE)
    readings = plant.noisy(d, force, 5, 0.006, FORCE_NOISE)
    found = hc.create_estimator("self_tuning_ukf").run(time, *readings)
    felt = (time > 6.0) & (force > 5.0 * FORCE_NOISE)
    missed = (found.force_predicted[felt] - force[felt]) / FORCE_NOISE
    assert np.sqrt(np.mean(missed**2)) < 2.5
    assert np.mean(found.model_mismatch[time > 6.0]) < 0.02
    assert not found.change_detected.any()
    assert found.parameters[-1, 0] == pytest.approx(TISSUE[0], rel=0.01)
    score = (found.parameters[-1] - TISSUE) / found.parameters_std[-1]
    assert np.all(np.abs(score) < 4.0)


def test_moves_begin_and_end_at_rest():
    time = np.linspace(0.0, 20.0, 200_001)
    for kind in MOVES:
        d, v, a = presses(kind).evaluate(time)
        assert np.allclose(np.gradient(d, time), v, atol=0.01)
        steady = np.abs(np.gradient(v, time) - a) < 0.5
        assert np.mean(steady) > 0.999  # but where the acceleration jumps
        assert np.max(np.abs(v)) == pytest.approx(presses(kind).fastest_mm_s, rel=1e-3)


def resting(bank):
    """A bank whose chosen row rests, and whose force is ten deviations off."""
    row = bank.rows[0]
    bank.maneuver.square_acceleration = 100.0**2
    bank.maneuver.square_speed = 10.0**2
    row.model_error = 0.0
    row.state[VELOCITY] = 0.0
    row.covariance[VELOCITY, VELOCITY] = 0.01**2
    row.innovation[1] = 10.0
    row.innovation_variance[1] = 1.0
    return row


def test_an_unlikely_force_lets_the_motion_go(parts):
    bank = parts[1]
    row = resting(bank)
    before = row.covariance.copy()
    assert departure.let_go(bank.maneuver, bank.rows, row, 0.002)
    time = departure.UNSEEN * 0.002
    gained = row.covariance - before
    assert gained[ACCELERATION, ACCELERATION] == pytest.approx(100.0**2)
    assert gained[VELOCITY, VELOCITY] == pytest.approx((100.0 * time) ** 2)
    assert gained[DEPTH, ACCELERATION] == pytest.approx(0.5 * (100.0 * time) ** 2)
    row.state[VELOCITY] = 5.0  # now it moves, but it departed just now
    assert departure.let_go(bank.maneuver, bank.rows, row, 0.002)


@pytest.mark.parametrize("spoil", ["likely", "moving", "misfit", "never moved"])
def test_nothing_else_does(parts, spoil):
    bank = parts[1]
    row = resting(bank)
    if spoil == "likely":
        row.innovation[1] = 2.9
    elif spoil == "moving":
        row.state[VELOCITY] = 1.0
    elif spoil == "misfit":
        row.model_error = 0.1
    else:
        bank.maneuver.square_acceleration = 0.0
    before = row.covariance.copy()
    assert not departure.let_go(bank.maneuver, bank.rows, row, 0.002)
    assert np.array_equal(row.covariance, before)


def test_a_test_ends_once_its_reference_explains_all_again(parts):
    settings, bank = parts
    change, rows = bank.change, bank.rows
    bank.tool.contact_clock = 10.0
    bank.clock.force_elapsed = 0.01
    assert changes.begin_test(settings, bank, 0.0)
    rows[0].model_error = 0.0
    for _ in range(49):
        changes.judge_test(settings, bank)
    assert change.testing == 1
    rows[0].alarm_sum = 40.0  # close to an alarm of its own: it does not
    changes.judge_test(settings, bank)
    rows[0].alarm_sum = 0.0
    for _ in range(48):
        changes.judge_test(settings, bank)
    assert change.testing == 1
    for _ in range(4):
        changes.judge_test(settings, bank)
    assert change.testing == 0
    assert change.detected == 0
