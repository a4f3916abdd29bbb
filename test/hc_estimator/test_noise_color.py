"""Noise whose neighbours go together: how much of it counts for a tool's motion, and for K."""

import numba
import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import butter, lfilter, sosfilt

import hc_estimator as hc
from hc_estimator.adaptation import difference_noise, noise_color
from hc_estimator.adaptation.difference_noise import ORDER, WEIGHTS

RATE = 1000.0


def records():
    """What is known of one channel, and its colour, before any reading."""
    channel = np.zeros(1, difference_noise.NOISE).view(np.recarray)[0]
    color = np.zeros(1, noise_color.COLOR).view(np.recarray)[0]
    return channel, color


def taken(readings, touches=None, rate=RATE, short_times=False):
    """Both records after readings, the noise as `difference_noise` learns it."""
    settings = hc.create_estimator("self_tuning_ukf")._settings.view(np.recarray)[0]
    channel, color = records()
    noise_color.restart(color)
    if short_times:
        noise_color.limit_to_short_times(color)
    inside = np.ones(len(readings), np.bool_) if touches is None else np.asarray(touches)
    take(settings, channel, color, np.asarray(readings), rate, inside)
    return channel, color


@numba.njit
def take(settings, channel, color, readings, rate, inside):
    """Take all readings in; called for each of a million from Python it took a minute."""
    for k in range(len(readings)):
        difference_noise.learn(settings, channel, k / rate, readings[k], k == 0, 1e-9)
        noise_color.learn(color, channel, readings[k], inside[k])


def filtered(generator, count, time_constant, rate=RATE):
    """Noise of variance 1 behind a low-pass."""
    share = np.exp(-1.0 / (rate * time_constant))
    noise = generator.standard_normal(count)
    for k in range(1, count):
        noise[k] = share * noise[k - 1] + np.sqrt(1.0 - share * share) * noise[k]
    return noise


def expected(autocovariance, octave):
    """Variance that an octave says, by the quadratic form of all its readings' covariances."""
    size = 2**octave
    weights = np.repeat(WEIGHTS, size) / size
    covariance = toeplitz(autocovariance[: weights.size])
    return size * (weights @ covariance @ weights) / (WEIGHTS @ WEIGHTS)


@pytest.mark.parametrize("rate", [100.0, 250.0, 500.0, 1000.0, 4000.0])
def test_white_noise_counts_once(rate):
    for seed in range(12):
        readings = 3.0 + 0.01 * np.random.default_rng(seed).standard_normal(4000)
        channel, color = taken(readings, rate=rate)
        assert noise_color.factor(color, channel) == 1.0


@pytest.mark.parametrize("time_constant", [0.0022, 0.005])
def test_every_octave_says_what_the_covariances_of_its_readings_make(time_constant):
    generator = np.random.default_rng(7)
    lags = np.arange(9 * 2**noise_color.OCTAVES)
    autocovariance = np.exp(-lags / (RATE * time_constant))
    said, factors, own = np.zeros(noise_color.OCTAVES), [], []
    for _ in range(8):
        readings = filtered(generator, 12000, time_constant)
        channel, color = taken(readings, short_times=True)
        said += np.array(color.variance) / 8.0
        factors.append(noise_color.factor(color, channel))
        own.append(channel["mean"])
    assert np.mean(own) == pytest.approx(expected(autocovariance, 0), rel=0.1)
    for octave in (1, 2, 3):  # the lower median of eight is a tenth too small
        assert said[octave - 1] == pytest.approx(0.9 * expected(autocovariance, octave), rel=0.12)
    # What is wider than 8 ms is learnt, and not taken for noise.
    ratio = expected(autocovariance, 3) / expected(autocovariance, 0)
    assert np.mean(factors) == pytest.approx(0.9 * ratio, rel=0.12)


@pytest.mark.parametrize(
    ("rate", "time_constant", "least", "most"),
    [(100.0, 0.025, 0.15, 1.1), (250.0, 0.01, 0.35, 1.1), (500.0, 0.01, 0.35, 1.1)],
)
def test_slow_noise_counts_where_the_tool_is_calm(rate, time_constant, least, most):
    """Wider than any tool's motion was asked for before: at 100 Hz nothing was."""
    generator = np.random.default_rng(11)
    share = np.exp(-1.0 / (rate * time_constant))
    whole = (1.0 + share) / (1.0 - share)  # spectral density at no frequency over the variance
    shares = []
    for _ in range(6):
        time = np.arange(round(30.0 * rate)) / rate
        calm = 2.0 + np.sin(2.0 * np.pi * 0.4 * time)
        channel, color = taken(
            calm + 0.01 * filtered(generator, time.size, time_constant, rate), rate=rate
        )
        shares.append(noise_color.factor(color, channel) * channel["mean"] / 1e-4 / whole)
    assert least < np.mean(shares) < most


@pytest.mark.parametrize("order", [4, 6])
@pytest.mark.parametrize("rate", [100.0, 500.0])
def test_a_hand_that_wanders_is_no_noise(order, rate):
    """Its spectrum falls with the fourth or sixth power of the frequency.

    Of the first a little is in means 8 ms apart, which count as they are.
    """
    sections = butter(order // 2, 1.5, fs=rate, output="sos")
    for seed in range(20):
        generator = np.random.default_rng(seed)
        wanders = sosfilt(sections, generator.standard_normal(round(40.0 * rate)))
        force = 3.0 + wanders / np.std(wanders)
        force += 0.005 * generator.standard_normal(force.size)
        channel, color = taken(force, rate=rate)
        assert noise_color.factor(color, channel) < (4.0 if order == 4 else 1.5)


def test_the_force_of_a_tool_that_shakes_is_no_noise():
    time = np.arange(6000) / RATE
    force = 3.0 + 2.0 * np.sin(19.0 * time) + 0.3 * np.sin(2.0 * np.pi * 12.0 * time)
    force += 1e-3 * np.random.default_rng(3).standard_normal(time.size)
    channel, color = taken(force)
    assert noise_color.factor(color, channel) == 1.0


def test_a_touch_is_no_noise():
    """Where the force begins it has a corner, which no difference takes for smooth."""
    time = np.arange(8000) / RATE
    force = np.maximum(4.0 * np.sin(2.0 * np.pi * 5.0 * time), 0.0)
    touches = force > 0.0
    force = force + 2e-3 * np.random.default_rng(5).standard_normal(time.size)
    channel, color = taken(force, touches)
    assert noise_color.factor(color, channel) == 1.0
    channel, color = taken(force)
    assert noise_color.factor(color, channel) > 5.0  # of all readings together it would be one


def test_a_jump_of_the_noise_begins_anew():
    generator = np.random.default_rng(2)
    quiet = 0.01 * generator.standard_normal(4000)
    channel, color = taken(np.concatenate([10.0 * quiet, quiet[:300]]))
    assert noise_color.factor(color, channel) == 1.0
    assert color.count[0] < 200


def test_a_gap_is_bridged_by_no_difference():
    settings = hc.create_estimator("self_tuning_ukf")._settings.view(np.recarray)[0]
    channel, color = records()
    noise_color.restart(color)
    for k in range(200):
        reading = 0.01 * (-1.0) ** k
        difference_noise.learn(settings, channel, k / RATE, reading, k in (0, 100), 1e-9)
        jumped = reading + (50.0 if k >= 100 else 0.0)
        noise_color.learn(color, channel, jumped, True)
    assert np.max(color.variance[:2]) < 1e-3
    assert np.max(color.following) <= ORDER + 1


@pytest.mark.parametrize(("band", "force"), [((6.0, 10.0), 0.02), ((8.0, 12.0), 0.01)])
@pytest.mark.parametrize("seed", range(4))
def test_what_the_motion_makes_in_longer_times_is_no_noise(band, force, seed):
    """A hand's tremor settles from one octave to the next, as noise behind a filter does."""
    generator = np.random.default_rng(seed)
    count, stiffness = 20000, 0.5
    tremor = sosfilt(
        butter(2, band, "bandpass", fs=RATE, output="sos"), generator.standard_normal(count)
    )
    tremor *= force / tremor.std()
    noise = generator.standard_normal((2, count))
    channel, color = taken(tremor + 0.01 * noise[0])
    place, place_color = taken(tremor / stiffness + 0.005 * noise[1], short_times=True)
    assert noise_color.factor(color, channel) > 10.0  # by the force alone
    for octave in range(noise_color.OCTAVES):
        between = noise_color.interval(channel, octave)
        moved = noise_color.deviation_by_motion(place_color, place, between)
        color.moved[octave] = 2.0 ** (octave + 1) * (stiffness * moved) ** 2
    assert noise_color.factor(color, channel) == 1.0
    assert noise_color.factor(place_color, place) == 1.0


def test_motion_is_unknown_before_enough_means():
    place, place_color = taken(0.005 * np.random.default_rng(2).standard_normal(400))
    assert noise_color.deviation_by_motion(place_color, place, 0.002) == 0.0
    assert noise_color.deviation_by_motion(place_color, place, 0.128) == np.inf


def pressed(draw, time, middle, frequencies):
    """A drawn tissue under three sines: its stiffness, depth [mm] and force [N]."""
    stiffness, exponent = np.exp(draw.uniform(np.log(0.1), np.log(2.0))), draw.uniform(1.0, 2.0)
    damping = stiffness * draw.uniform(0.004, 0.03)
    depth, speed = np.full(time.size, middle), np.zeros(time.size)
    for hertz, phase in zip(frequencies, draw.uniform(0.0, 6.28, 3), strict=True):
        depth += 0.7 * np.sin(2.0 * np.pi * hertz * time + phase)
        speed += 1.4 * np.pi * hertz * np.cos(2.0 * np.pi * hertz * time + phase)
    return stiffness, depth, np.maximum(depth, 0.0) ** exponent * (stiffness + damping * speed)


def found(draw, time, depth, force, stiffness, after):
    """Misfit told, K within three deviations, and error of K, after a while [s]."""
    place = depth + 0.003 * draw.standard_normal(time.size)
    series = hc.create_estimator("self_tuning_ukf").run(time, place, force)
    late = time > after
    error = np.abs(series.parameters[late, 0] - stiffness)
    within = error < 3.0 * series.parameters_std[late, 0]
    return np.mean(series.model_mismatch[late]), np.mean(within), np.median(error) / stiffness


@pytest.mark.parametrize(("time_constant", "mains"), [(0.0022, 0.0), (0.004, 0.0), (0.0, 0.03)])
def test_a_sensor_with_a_filter_or_in_a_mains_field_is_no_misfit(time_constant, mains):
    """Before, a misfit was said in 88 to 100 % of the time."""
    runs = []
    for seed in range(600, 606):
        draw = np.random.default_rng(seed)
        time = np.arange(0.0, 14.0, 1.0 / RATE)
        stiffness, depth, force = pressed(draw, time, 2.6, (0.37, 0.81, 1.3))
        noise = draw.standard_normal(time.size)
        if time_constant > 0.0:
            noise = filtered(draw, time.size, time_constant)
        force += 0.01 * noise + mains * np.sin(2.0 * np.pi * 50.0 * time)
        runs.append(found(draw, time, depth, force, stiffness, 5.0))
    told, within, errors = np.array(runs).T
    assert np.mean(told) < 0.05
    assert np.mean(within) > 0.9
    assert np.median(errors) < 0.01


@pytest.mark.parametrize(("rate", "corner_hz", "order"), [(250.0, 30.0, 2), (500.0, 16.0, 1)])
def test_a_slow_filter_of_the_force_sensor_is_no_misfit(rate, corner_hz, order):
    """Of drawn contacts behind such filters a misfit was said in 72 to 98 % of the time."""
    runs = []
    numerator, denominator = butter(order, corner_hz, fs=rate)
    for seed in range(700, 708):
        draw = np.random.default_rng(seed)
        time = np.arange(0.0, 24.0, 1.0 / rate)
        stiffness, depth, force = pressed(draw, time, 3.0, (0.31, 0.62, 1.1))
        noise = lfilter(numerator, denominator, draw.standard_normal(time.size + 1000))[1000:]
        force += 0.005 * np.max(force) * noise / np.std(noise)
        runs.append(found(draw, time, depth, force, stiffness, 10.0))
    told, within, _ = np.array(runs).T
    assert np.mean(told) < 0.15
    assert np.mean(within) > 0.9
