"""The ring of raw readings: what is told from the others, replaced, and taken out."""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import raw_readings
from hc_estimator.multiple_model.delay_records import RAW

NOISE = 0.003


@pytest.fixture
def filled(records_of):
    """Fill the ring of the displacement with readings at 1 kHz; the finder and its last number."""

    def fill(values, rate=1000.0):
        _, bank = records_of(hc.create_estimator("self_tuning_ukf"))
        finder = bank.delay
        for k, value in enumerate(values):
            raw_readings.take(finder, 0, k / rate, value)
        return finder, int(finder.raw_count[0]) - 1

    return fill


def moving(count=200, seed=1):
    time = np.arange(count) / 1000.0
    noise = NOISE * np.random.default_rng(seed).standard_normal(count)
    return 2.0 + 0.5 * np.sin(12.0 * time) + noise


def held(finder):
    """Times and values of the ring, oldest first."""
    count = int(finder.raw_count[0])
    numbers = np.arange(raw_readings.oldest(finder, 0), count) % RAW
    return np.array(finder.raw_time[0, numbers]), np.array(finder.raw_value[0, numbers])


@pytest.mark.parametrize("count", [100, RAW + 50])
@pytest.mark.parametrize("time", [-1.0, 0.0, 0.0405, 0.061, 9.0])
def test_latest_up_to_is_what_searching_the_times_gives(filled, count, time):
    finder, last = filled(moving(count))
    times = np.arange(count) / 1000.0
    expected = np.searchsorted(times, time, side="right") - 1
    number = raw_readings.latest_up_to(finder, 0, time)
    assert number == np.clip(expected, max(count - RAW, 0), last)


@pytest.mark.parametrize("seed", range(20))
def test_a_jump_is_told_from_a_tool_that_sets_off(filled, seed):
    values = moving(seed=seed)
    jumped, set_off = values.copy(), values.copy()
    jumped[196:] += 0.2
    set_off[196:] += 0.1 * np.arange(1.0, 5.0)  # 100 mm/s at once
    for series, expected in ((values, False), (jumped, True), (set_off, False)):
        finder, last = filled(series)
        assert raw_readings.has_jumped(finder, 0, last - 3, last) == expected


@pytest.mark.parametrize("number", [3, 4, 8])
def test_a_noisy_sensor_that_repeats_itself_stands_still(filled, number):
    values = moving()
    values[-number:] = values[-number]
    finder, last = filled(values)
    # Three steps that are none are needed where one in 64 is none by chance.
    assert raw_readings.stands_still(finder, 0, last, NOISE**2) == (number > 3)


def test_a_sensor_that_is_coarser_than_its_noise_repeats_itself_at_rest(filled):
    values = 0.01 * np.round(moving() / 0.01)
    values[-30:] = values[-30]
    finder, last = filled(values)
    assert not raw_readings.stands_still(finder, 0, last, NOISE**2)


def test_where_many_repeat_themselves_more_are_needed(filled):
    values = np.repeat(moving(100), 2)
    finder, last = filled(np.r_[values, np.full(5, values[-1])])
    assert not raw_readings.stands_still(finder, 0, last, NOISE**2)
    finder, last = filled(np.r_[values, np.full(30, values[-1])])
    assert raw_readings.stands_still(finder, 0, last, NOISE**2)


@pytest.mark.parametrize("wrong", [1, 2])
def test_a_few_refused_readings_lie_on_the_line_between_those_beside_them(filled, wrong):
    values = moving()
    sound = values.copy()
    values[150 : 150 + wrong] += 3.0
    finder, _ = filled(values)
    raw_readings.replace_refused(finder, 0, 0.1495, 0.1495 + 0.001 * wrong, False)
    times, replaced = held(finder)
    inside = np.arange(150, 150 + wrong)
    sound[inside] = np.interp(inside, [149, 150 + wrong], values[[149, 150 + wrong]])
    np.testing.assert_allclose(replaced, sound, rtol=1e-12)
    assert times.size == values.size


@pytest.mark.parametrize("count", [200, RAW + 100])
@pytest.mark.parametrize("wrong", [3, 40])
def test_more_are_taken_out(filled, count, wrong):
    values = moving(count)
    begin = count - wrong - 10
    finder, _ = filled(values)
    after = (begin - 0.5) / 1000.0
    raw_readings.replace_refused(finder, 0, after, after + 0.001 * wrong, False)
    times, left = held(finder)
    kept = np.delete(np.arange(count), np.s_[begin : begin + wrong])
    kept = kept[max(count - RAW, 0) :]
    np.testing.assert_array_equal(times, kept / 1000.0)
    np.testing.assert_array_equal(left, values[kept])


def test_so_many_that_they_fill_the_ring_are_taken_out(filled):
    count = RAW + 200
    values = moving(count)
    finder, _ = filled(values)
    begin = count - RAW - 20  # it is no longer remembered
    raw_readings.replace_refused(finder, 0, (begin - 0.5) / 1000.0, (count - 3.5) / 1000.0, False)
    times, left = held(finder)
    np.testing.assert_array_equal(times, np.arange(count - 3, count) / 1000.0)
    np.testing.assert_array_equal(left, values[-3:])


def test_of_forces_only_spikes_are_replaced(filled):
    ramp = np.arange(200.0)  # a force that rises by a newton with each reading, as at a landing
    finder, _ = filled(ramp)
    raw_readings.replace_refused(finder, 0, 0.1495, 0.1505, True)
    np.testing.assert_array_equal(held(finder)[1], ramp)
    ramp[150] += 10.0
    finder, _ = filled(ramp)
    raw_readings.replace_refused(finder, 0, 0.1495, 0.1505, True)
    assert held(finder)[1][150] == pytest.approx(150.0)
