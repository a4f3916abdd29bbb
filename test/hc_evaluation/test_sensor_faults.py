"""Faults of sensors change the readings as they say, nothing else, and are scored as they say."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from hc_evaluation.accuracy.bench import Bench
from hc_evaluation.accuracy.columns import COLUMNS
from hc_evaluation.accuracy.faulty_sensors import (
    ACQUISITION,
    LEARNING_S,
    LOST,
    NOTHING,
    SHAKES,
    UNEVEN,
    ZEROS,
    FaultyReadings,
    faulty_readings,
    first_touch_s,
)
from hc_evaluation.accuracy.measure import Setup
from hc_evaluation.accuracy.sensor_faults import counted_of, scores, sensor_faults

SEEDS = (1000, 1002, 1009)


def plain(seed):
    return faulty_readings(NOTHING, seed).contact


def zero_of(name, seed):
    """What a fault adds to the force, beside the contact and when it moved without a sign."""
    readings = faulty_readings(name, seed)
    return readings.contact.force_n - plain(seed).force_n, readings.contact, readings.moved_s


def resting(contact):
    """Samples of visits to the air and the one after each, shape (visits, N)."""
    begins, ends = contact.visits_s.T[:, :, None]
    return (contact.time_s >= begins) & (contact.time_s <= ends + contact.time_s[1])


@pytest.mark.parametrize("seed", range(1000, 1012))
def test_the_tool_begins_in_the_air_comes_back_to_it_and_nothing_pulls(seed):
    contact = plain(seed)
    assert 5 <= len(contact.visits_s) <= 12
    at_rest = resting(contact)
    assert not np.any(contact.acting_n[np.any(at_rest, axis=0)])
    assert at_rest[0, 0]
    assert contact.visits_s[0, 1] < first_touch_s(contact) < 8.0
    assert np.min(contact.acting_n) == 0.0
    for visit in at_rest:  # noise is all that moves there
        assert np.std(contact.displacement_mm[visit]) < 0.03
    for left, back in zip(contact.visits_s[:-1, 1], contact.visits_s[1:, 0], strict=True):
        between = (contact.time_s > left) & (contact.time_s < back)
        assert np.any(contact.acting_n[between] > 0.0)
    rate_hz = 1.0 / np.median(np.diff(contact.time_s))
    assert min(abs(rate_hz / rate - 1.0) for rate in ACQUISITION.rates_hz) < 1e-6
    assert contact.force_noise_n >= 0.001
    assert np.std(contact.force_n - contact.acting_n) == pytest.approx(
        contact.force_noise_n, rel=0.05
    )


@pytest.mark.parametrize("name", [*LOST, *UNEVEN, *ZEROS])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_fault_is_reproducible_and_leaves_the_tissue(name, seed):
    contact, again = (faulty_readings(name, seed).contact for _ in range(2))
    for key in ("time_s", "displacement_mm", "force_n", "parameters"):
        np.testing.assert_array_equal(getattr(contact, key), getattr(again, key))
    np.testing.assert_array_equal(contact.parameters, plain(seed).parameters[: contact.time_s.size])
    assert contact.parameters.shape == (contact.time_s.size, 4)
    assert np.min(contact.acting_n) >= 0.0
    assert np.all(np.diff(contact.time_s) > 0.0)


@pytest.mark.parametrize(
    ("name", "share"),
    [("10 % lost", 0.1), ("25 % lost", 0.25), ("50 % lost", 0.5), ("every fourth lost", 0.25)],
)
def test_either_channel_loses_its_share_and_what_comes_is_as_it_was(name, share):
    for seed in SEEDS:
        contact, whole = faulty_readings(name, seed).contact, plain(seed)
        came = np.searchsorted(whole.time_s, contact.time_s)
        np.testing.assert_array_equal(whole.time_s[came], contact.time_s)
        count = whole.time_s.size
        for key in ("displacement_mm", "force_n"):
            read = getattr(contact, key)
            there = np.isfinite(read)
            np.testing.assert_array_equal(read[there], getattr(whole, key)[came][there])
            assert 1.0 - np.count_nonzero(there) / count == pytest.approx(share, abs=0.02)
        assert np.all(np.isfinite(contact.displacement_mm) | np.isfinite(contact.force_n))
        lost = np.isnan(contact.displacement_mm) | np.isnan(contact.force_n)
        either = 1.0 - (1.0 - share) ** 2 if name != "every fourth lost" else 2.0 * share
        rows = (np.count_nonzero(lost) + count - contact.time_s.size) / count
        assert rows == pytest.approx(either, abs=0.02)


def test_bursts_take_both_channels_for_tenths_of_a_second_and_a_tenth_in_the_mean():
    shares = []
    for seed in range(1000, 1012):
        contact, whole = faulty_readings("bursts lost", seed).contact, plain(seed)
        assert np.all(np.isfinite(contact.force_n + contact.displacement_mm))
        period = whole.time_s[1]
        gaps = np.diff(contact.time_s) - period
        gaps = gaps[gaps > 0.5 * period]
        assert gaps.size > 10
        assert np.min(gaps) >= 0.05 - period
        # Two bursts may meet.
        assert np.median(gaps) <= 0.3 + period
        shares.append(1.0 - contact.time_s.size / whole.time_s.size)
    assert np.mean(shares) == pytest.approx(0.1, abs=0.015)


@pytest.mark.parametrize("seed", SEEDS)
def test_stamps_that_shake_are_when_the_readings_were_taken(seed):
    contact, whole = faulty_readings(SHAKES, seed).contact, plain(seed)
    early = (contact.time_s - whole.time_s) / whole.time_s[1]
    assert np.max(np.abs(early)) <= 0.3
    assert np.std(early) == pytest.approx(0.3 / np.sqrt(3.0), rel=0.05)
    np.testing.assert_array_equal(contact.visits_s, whole.visits_s)
    # The same noise beside the same way, read earlier or later.
    moved = contact.displacement_mm - whole.displacement_mm
    speed = np.gradient(whole.displacement_mm, whole.time_s)
    assert np.corrcoef(moved, early * speed)[0, 1] > 0.8
    expected = CubicSpline(whole.time_s, whole.acting_n)(contact.time_s)
    off = np.abs(contact.acting_n - expected)
    assert np.quantile(off, 0.95) < 1e-3 * np.max(whole.acting_n)
    assert np.any(contact.acting_n != whole.acting_n)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_driver_that_tares_in_the_air_does_so_while_the_tool_rests_there(seed):
    zero, contact, moved_s = zero_of("tared in the air, once", seed)
    assert moved_s is None
    (step,) = np.flatnonzero(np.abs(np.diff(zero)) > 1e-9) + 1
    assert np.any(resting(contact)[1:, step])
    assert contact.time_s[step] >= first_touch_s(contact) + LEARNING_S
    assert 0.05 <= abs(zero[-1]) <= 0.5
    assert abs(zero[0]) < 1e-9
    zero, contact, _ = zero_of("tared in the air, at every visit", seed)
    steps = np.flatnonzero(np.abs(np.diff(zero)) > 1e-9) + 1
    visits = resting(contact)[1:]
    assert len(visits) - 1 <= steps.size <= len(visits)  # the last may be cut off
    assert np.all(np.any(visits[:, steps], axis=0))
    assert np.all(np.abs(zero[steps]) >= 0.03 - 1e-9)
    assert np.all(np.abs(zero[steps]) <= 0.3 + 1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_driver_that_tares_in_the_tissue_takes_off_what_presses_there(seed):
    zero, contact, moved_s = zero_of("tared in the tissue", seed)
    moment = int(np.searchsorted(contact.time_s, moved_s))
    assert contact.acting_n[moment] > 0.0
    np.testing.assert_allclose(zero[:moment], 0.0, atol=1e-9)
    np.testing.assert_allclose(zero[moment:], -contact.acting_n[moment], atol=1e-9)
    assert abs(contact.force_n[moment]) < 5.0 * contact.force_noise_n


@pytest.mark.parametrize("seed", SEEDS)
def test_an_encoder_that_is_zeroed_moves_the_position_alone(seed):
    readings, whole = faulty_readings("encoder zeroed", seed), plain(seed)
    np.testing.assert_array_equal(readings.contact.force_n, whole.force_n)
    off = readings.contact.displacement_mm - whole.displacement_mm
    moment = np.searchsorted(whole.time_s, readings.moved_s)
    np.testing.assert_array_equal(off[:moment], 0.0)
    assert np.ptp(off[moment:]) < 1e-9
    assert 0.1 <= abs(off[-1]) <= 1.0


@pytest.mark.parametrize("seed", SEEDS)
def test_zeros_that_move_by_themselves_or_were_never_set(seed):
    zero, contact, _ = zero_of("warms up", seed)
    assert abs(zero[0]) < 1e-9
    assert 0.2 * 0.01 <= abs(zero[-1]) <= 0.1
    ratio = (zero[-1] - zero[zero.size // 2]) / zero[zero.size // 2]
    assert np.exp(-30.0 / 30.0) - 1e-3 <= ratio <= np.exp(-30.0 / 120.0) + 1e-3
    zero, contact, _ = zero_of("drifts", seed)
    speed = zero[1:] / contact.time_s[1:]
    assert 2e-4 - 1e-9 <= abs(speed[-1]) <= 5e-3
    np.testing.assert_allclose(speed, speed[-1], rtol=1e-9, atol=1e-9)
    zero, contact, _ = zero_of("untared, 2 to 10 deviations", seed)
    assert np.ptp(zero) < 1e-9
    assert 2.0 <= abs(zero[0]) / contact.force_noise_n <= 10.0
    zero, contact, _ = zero_of("untared, 0.05 to 0.5 N", seed)
    assert np.ptp(zero) < 1e-9
    assert 0.05 <= abs(zero[0]) <= 0.5


def test_no_such_fault_is_refused():
    with pytest.raises(KeyError, match="broken"):
        faulty_readings("broken", 1000)


class _Says:
    """An estimator that gives out what it is made with, whatever it reads."""

    def __init__(self, parameters, relative_std, mismatch=None, changes=()):
        count = len(parameters)
        self.parameters = parameters
        variance = (relative_std * parameters) ** 2
        self.covariance = variance[:, :, None] * np.eye(4)
        self.parameters_std = np.sqrt(variance)
        self.model_mismatch = np.zeros(count, bool) if mismatch is None else mismatch
        self.change_detected = np.isin(np.arange(count), changes)

    def create(self):
        return SimpleNamespace(run=lambda *_readings: self)


def test_what_is_true_and_what_is_not_is_scored_as_such():
    readings = faulty_readings("encoder zeroed", 1002)
    contact = readings.contact
    counted = counted_of(readings)
    time = contact.time_s
    assert not np.any(counted[time < first_touch_s(contact) + 8.0])
    grace = (time > readings.moved_s) & (time < readings.moved_s + 2.0)
    assert not np.any(counted[grace])
    assert np.count_nonzero(counted) > 0.5 * time.size
    truth = scores(_Says(contact.parameters, 0.01), readings)
    assert truth["within"] == 1.0
    for key in ("K", "K_90", "nees", "wrong", "mismatch", "changes"):
        assert truth[key] == 0.0
    off = contact.parameters * [1.1, 1.0, 1.0, 1.0]
    wrong = scores(_Says(off, 0.01, changes=(0, len(off) - 1)), readings)
    assert wrong["K"] == pytest.approx(np.log(1.1))
    assert (wrong["within"], wrong["wrong"]) == (0.0, 1.0)
    assert wrong["nees"] == pytest.approx((np.log(1.1) / 0.01) ** 2, rel=1e-6)
    assert wrong["changes"] == 1.0  # one before the contact counts for none
    # What stands under a flag was not said to be right; nor what is within its deviations.
    assert scores(_Says(off, 0.01, np.ones(len(off), bool)), readings)["wrong"] == 0.0
    assert scores(_Says(off, 0.05), readings)["wrong"] == 0.0
    # In the two seconds after a zero was moved anything may be said.
    shaken = np.where(grace[:, None], off, contact.parameters)
    assert scores(_Says(shaken, 0.01), readings) == truth
    unmoved = FaultyReadings(contact)
    assert scores(_Says(shaken, 0.01), unmoved)["wrong"] > 0.0


def test_the_table_has_a_row_for_each_fault_and_the_first_has_none():
    result = sensor_faults(Bench(Setup(), 1, first_seed=1002, workers=1))
    rows = result["rows"]
    assert [row["fault"] for row in rows] == [NOTHING, *LOST, *UNEVEN, *ZEROS]
    assert rows[0]["over"] == 1.0
    for row in rows:
        for _heading, text in COLUMNS["sensor_faults"]:
            assert text(row)
    # One contact, known well: nothing wrong is said of it whatever a tenth of the readings does.
    by_name = {row["fault"]: row for row in rows}
    for name in (NOTHING, "10 % lost"):
        assert by_name[name]["K"] < 0.01
        assert by_name[name]["wrong"] < 0.01
    names = [entry["name"] for entry in result["targets"]]
    assert len(names) == len(set(names))
    for name in ZEROS:
        assert {f"{name}: share told wrong", f"{name}: misfit told"} <= set(names)
    for name in (*LOST, *UNEVEN):
        assert f"{name}: error over that without" in names
