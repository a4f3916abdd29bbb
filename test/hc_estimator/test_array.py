"""EstimatorArray: every channel has the numbers of an estimator of its own, bit for bit."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import hc_estimator as hc
from hc_estimator.array_kernels import KERNELS

CHANNELS = 4
QUICK = ("ekf",)
FILTERS = [
    pytest.param(name, marks=() if name in QUICK else pytest.mark.slow)
    for name in hc.available_filters()
]  # the kernels of the others take a minute to compile


def same(one, other):
    """Whether estimates are the same in every bit of every number."""
    np.testing.assert_array_equal(one._rows, other._rows)  # says where they differ
    assert one._rows.tobytes() == other._rows.tobytes()


def presses(channels=CHANNELS, samples=240, seed=1, missing=0.0):
    """Time (samples,), displacements and forces (channels, samples): presses out of step."""
    random = np.random.default_rng(seed)
    time = np.arange(samples) / 500.0
    phase = 2.0 * np.pi * (2.5 * time + np.linspace(0.0, 1.0, channels)[:, None])
    depth = 1.2 - 1.6 * np.cos(phase)
    speed = 1.6 * 2.0 * np.pi * 2.5 * np.sin(phase)
    force = np.maximum(0.0, np.maximum(depth, 0.0) ** 1.6 * (0.3 + 0.01 * speed))
    readings = np.stack([depth, force]) + 2e-3 * random.standard_normal((2, *depth.shape))
    readings[random.random(readings.shape) < missing] = np.nan
    return time, readings[0], readings[1]


def each(filter_name, time, depths, forces, **parameters):
    """The series of an estimator for each channel."""
    times = np.broadcast_to(time, depths.shape)
    return [
        hc.create_estimator(filter_name, **parameters).run(*channel)
        for channel in zip(times, depths, forces, strict=True)
    ]


def test_every_filter_has_a_kernel():
    assert set(KERNELS) == set(hc.available_filters())


@pytest.mark.parametrize("filter_name", FILTERS)
def test_channels_are_estimators_of_their_own(filter_name):
    for missing in (0.0, 0.2):
        data = presses(missing=missing)
        parameters = {"missing_readings": missing > 0.0, "reorder_window": 0.0}
        array = hc.EstimatorArray(filter_name, CHANNELS, **parameters)
        series = array.run(*data)
        for channel, one in enumerate(each(filter_name, *data, **parameters)):
            same(one, series[channel])
        assert series.parameters.shape == (CHANNELS, 240, 4)
        assert series.nis.shape == series.contact.shape == (CHANNELS, 240)
        stepped = hc.EstimatorArray(filter_name, CHANNELS, threads=3, **parameters)
        for k in range(240):
            now = stepped.step(data[0][k], data[1][:, k], data[2][:, k])
            np.testing.assert_array_equal(now._rows, series._rows[:, k])
        assert len(now) == CHANNELS
        assert now[1].rejected == series[1][239].rejected


NUMBERS = st.one_of(
    st.floats(-3.0, 10.0),
    st.just(float("nan")),
    st.floats(allow_nan=True, allow_infinity=True),
)


@pytest.mark.parametrize("filter_name", FILTERS)
@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_whatever_comes_the_numbers_are_the_same(filter_name, data):
    """Hostile numbers and times, in pieces, with threads and without."""
    channels, samples = data.draw(st.integers(1, 5)), data.draw(st.integers(0, 12))
    row = st.lists(NUMBERS, min_size=samples, max_size=samples)
    table = st.lists(row, min_size=channels, max_size=channels)
    depths, forces = (np.array(data.draw(table)).reshape(channels, samples) for _ in range(2))
    steps = np.array(data.draw(row))
    common = data.draw(st.booleans())
    time = np.cumsum(np.abs(steps) * 1e-3) if common else np.array(data.draw(table))
    time = time.reshape(samples if common else (channels, samples))
    parameters = {"missing_readings": data.draw(st.booleans()), "reorder_window": 0.0}
    threads = data.draw(st.integers(1, 3))
    array = hc.EstimatorArray(filter_name, channels, threads=threads, **parameters)
    cut = data.draw(st.integers(0, samples))
    parts = [
        array.run(time[..., part], depths[:, part], forces[:, part])
        for part in (slice(cut), slice(cut, None))
    ]
    for channel, one in enumerate(each(filter_name, time, depths, forces, **parameters)):
        rows = np.concatenate([part[channel]._rows for part in parts])
        np.testing.assert_array_equal(one._rows, rows)
        assert one._rows.tobytes() == rows.tobytes()


@pytest.mark.parametrize("filter_name", FILTERS)
def test_late_readings_go_back_in_their_channel_only(filter_name):
    """With a window every channel may have readings that come late, at stamps of its own."""
    _, depths, forces = presses(missing=0.3, seed=4)
    random = np.random.default_rng(5)
    time = np.tile(np.arange(240) / 500.0, (CHANNELS, 1))
    for row in time[1:]:
        late = random.integers(20, 230, 12)
        row[late] -= 0.012
    parameters = {"missing_readings": True, "reorder_window": 0.03}
    series = hc.EstimatorArray(filter_name, CHANNELS, **parameters).run(time, depths, forces)
    for channel, one in enumerate(each(filter_name, time, depths, forces, **parameters)):
        same(one, series[channel])


@pytest.mark.parametrize("filter_name", FILTERS)
def test_reconfigure_and_reset_are_those_of_each(filter_name):
    time, depths, forces = presses()
    change = {"force_noise_std": 0.05}
    array = hc.EstimatorArray(filter_name, CHANNELS)
    ones = [hc.create_estimator(filter_name) for _ in range(CHANNELS)]
    array.run(time[:80], depths[:, :80], forces[:, :80])
    array.reconfigure(**change)
    array.run(time[80:120], depths[:, 80:120], forces[:, 80:120])
    array.reset(2)
    series = array.run(time[120:], depths[:, 120:], forces[:, 120:])
    for channel, one in enumerate(ones):
        one.run(time[:80], depths[channel, :80], forces[channel, :80])
        one.reconfigure(**change)
        one.run(time[80:120], depths[channel, 80:120], forces[channel, 80:120])
        if channel == 2:
            one.reset()
        same(one.run(time[120:], depths[channel, 120:], forces[channel, 120:]), series[channel])
    assert array.configuration == ones[0].configuration
    array.reset()
    fresh = hc.EstimatorArray(filter_name, CHANNELS, **change)
    same(array.run(time, depths, forces), fresh.run(time, depths, forces))


def test_a_missing_side_is_none():
    array = hc.EstimatorArray("ekf", 2, missing_readings=True, reorder_window=0.0)
    nothing = np.full(2, np.nan)
    twin = hc.EstimatorArray("ekf", 2, missing_readings=True, reorder_window=0.0)
    same(array.step(0.0, [1.0, 2.0], None), twin.step(0.0, [1.0, 2.0], nothing))
    same(array.step([0.1, 0.2], None, [0.1, 0.2]), twin.step([0.1, 0.2], nothing, [0.1, 0.2]))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: hc.EstimatorArray("ekf", 0), "channels = 0"),
        (lambda: hc.EstimatorArray("ekf", 2.0), "channels = 2.0"),
        (lambda: hc.EstimatorArray("ekf", True), "channels = True"),
        (lambda: hc.EstimatorArray("ekf", 2, threads=0), "threads = 0"),
        (lambda: hc.EstimatorArray("magic", 2), "filter = 'magic'"),
        (lambda: hc.EstimatorArray("ekf", 2, force_noise_std=-1.0), "force_noise_std"),
        (lambda: hc.EstimatorArray("ekf", 2).reset(2), "channel = 2"),
        (lambda: hc.EstimatorArray("ekf", 2).reconfigure(magic=1), "magic"),
        (lambda: hc.EstimatorArray("ekf", 2).step(0.0, [1.0], [1.0, 1.0]), "displacements_mm"),
        (lambda: hc.EstimatorArray("ekf", 2).step([0.0] * 3, [1.0] * 2, [1.0] * 2), "time_s"),
        (lambda: hc.EstimatorArray("ekf", 2).run([0.0], [[1.0]] * 2, [[1.0]] * 3), "forces_n"),
        (lambda: hc.EstimatorArray("ekf", 2).run([0.0], 1.0, 1.0), "displacements_mm"),
    ],
)
def test_wrong_use_names_what_is_wrong(make, says):
    with pytest.raises(ValueError, match=says):
        make()


def test_the_estimates_of_many_channels_say_what_they_are_and_make_a_table():
    """To print them was an IndexError, and their table had the numbers of other samples."""
    time, depths, forces = presses(samples=30)
    estimates = hc.EstimatorArray("ekf", CHANNELS).run(time, depths, forces)
    assert repr(estimates) == f"EstimatesOfChannels({CHANNELS} channels, 30 samples)"
    table = estimates.columns()
    assert {column.shape for column in table.values()} == {(CHANNELS, 30)}
    np.testing.assert_array_equal(table["damping_std"], estimates.parameters_std[..., 1])
    one = estimates[2].columns()
    for name, column in table.items():
        np.testing.assert_array_equal(column[2], one[name])


@pytest.mark.parametrize("chosen", [slice(0, 2), [0, 1], np.array([True, True, False])])
def test_several_channels_are_chosen_as_by_numpy(chosen):
    """They came as one series with an axis too many, whose text was a TypeError."""
    time, depths, forces = presses(samples=30)
    estimates = hc.EstimatorArray("ekf", CHANNELS).run(time, depths, forces)
    if isinstance(chosen, np.ndarray):
        chosen = np.resize([True, True, *[False] * CHANNELS], CHANNELS)
    two = estimates[chosen]
    assert repr(two) == "EstimatesOfChannels(2 channels, 30 samples)"
    np.testing.assert_array_equal(two[1].parameters, estimates[1].parameters)
    np.testing.assert_array_equal(two[np.int64(-1)].parameters, estimates[1].parameters)


@pytest.mark.parametrize("wrong", [(1, 2), True, "all", 1.0])
def test_what_chooses_no_channel_is_a_type_error(wrong):
    time, depths, forces = presses(samples=30)
    estimates = hc.EstimatorArray("ekf", CHANNELS).run(time, depths, forces)
    with pytest.raises(TypeError, match="chosen by a whole number"):
        estimates[wrong]


@pytest.mark.parametrize(
    "twin", [copy.deepcopy, lambda array: pickle.loads(pickle.dumps(array))], ids=["copy", "pickle"]
)
@pytest.mark.parametrize("threads", [1, 2])
def test_a_copy_goes_on_alone_however_many_threads(twin, threads):
    """Regression: with threads, TypeError: cannot pickle '_queue.SimpleQueue' object."""
    array = hc.EstimatorArray("ekf", 4, threads=threads)
    array.step(0.0, np.ones(4), np.ones(4))
    other = twin(array)
    found = other.step(0.1, np.full(4, 2.0), np.full(4, 3.0)).parameters
    np.testing.assert_array_equal(array.step(0.1, [2.0] * 4, [3.0] * 4).parameters, found)
