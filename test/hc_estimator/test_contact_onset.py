"""Zeros that are off: the first touch says so, and nothing is moved where they are right."""

import numpy as np
import pytest

import hc_estimator as hc

TISSUE = (0.4, 0.02, 1.5, 1.0)  # K [N/mm^n], B, n, p
MOVED = 0.02  # mm or N by which a zero must be off to be called moved


def approach(rate=500.0, seconds=6.0, start=-2.0, speed=3.0, depth=4.0):
    """Displacement [mm] of a tool that comes down in the air, then palpates; its stamps."""
    time = np.arange(round(rate * seconds)) / rate
    down = (depth / 2 - start) / speed
    d = np.minimum(start + speed * time, depth / 2)
    late = np.maximum(time - down, 0.0)
    d += 0.35 * depth * np.sin(2 * np.pi * 0.9 * late) * (1 - np.exp(-3.0 * late))
    return time, d


def felt(plant, time, d, seed, position=0.0, force_zero=0.0, tissue=TISSUE, noise=0.01):
    """Readings of a tool whose zeros are off."""
    force = plant.force(d, np.gradient(d, time), *tissue)
    generator = np.random.default_rng(seed)
    d_read = d + position + 0.003 * generator.standard_normal(d.size)
    return d_read, force + force_zero + noise * generator.standard_normal(d.size)


@pytest.mark.parametrize("position", [-3.0, 0.0, 2.0, 6.0])
@pytest.mark.parametrize("force_zero", [-2.0, 0.0, 0.4])
def test_wrong_zeros_are_found_at_the_first_touch(position, force_zero, plant):
    """Contact position and force zero, each with either; K within three of its deviations."""
    time, d = approach()
    d_read, force = felt(plant, time, d, 3, position, force_zero)
    series = hc.create_estimator("self_tuning_ukf").run(time, d_read, force)
    assert series.force_zero[-1] == pytest.approx(force_zero, abs=MOVED)
    assert series.contact_position[-1] == pytest.approx(position, abs=0.3)
    error = np.log(series.parameters[-1, 0] / TISSUE[0])
    deviation = series.parameters_std[-1, 0] / series.parameters[-1, 0]
    assert abs(error) < max(3.0 * deviation, 0.01)
    assert deviation < 0.2
    assert series.model_mismatch[-200:].mean() < 0.1


@pytest.mark.parametrize("speed", [6.0, 25.0, 40.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_tool_that_rests_above_the_tissue_and_is_quick(seed, speed, plant):
    """Regression: a force zero of ten deviations, and the first of the rise, passed for a tissue.

    Of one that began 2.2 mm above, for a straight line through a second at rest and three readings
    of contact says so; K was 97 % off to the end.
    """
    time, d = approach(rate=200.0, start=-0.73, speed=speed)
    d = np.r_[np.full(200, d[0]), d[:-200]]
    d_read, force = felt(plant, time, d, seed, force_zero=0.1)
    series = hc.create_estimator("self_tuning_ukf").run(time, d_read, force)
    assert np.max(np.abs(series.contact_position)) < 0.5
    assert series.force_zero[-1] == pytest.approx(0.1, abs=MOVED)


@pytest.mark.parametrize("seed", range(12))
def test_zeros_that_are_right_are_not_moved(seed, plant):
    """Soft and hard tissue, slow and fast tools, with an approach and without."""
    generator = np.random.default_rng(seed)
    stiffness = np.exp(generator.uniform(np.log(0.03), np.log(5.0)))
    ratio, n = np.exp(generator.uniform(np.log(0.01), np.log(0.2))), generator.uniform(1.2, 2.2)
    rate = generator.choice([66.0, 200.0, 1000.0])
    start, speed = generator.uniform(-3.0, 0.5), generator.uniform(0.5, 20.0)
    time, d = approach(rate, 5.0, start, speed, generator.uniform(2.0, 6.0))
    tissue = (stiffness, ratio * stiffness, n, 1.0)
    d_read, force = felt(plant, time, d, seed, tissue=tissue, noise=generator.choice([0.003, 0.03]))
    estimator = hc.create_estimator("self_tuning_ukf")
    series = estimator.run(time, d_read, force)
    np.testing.assert_array_less(np.abs(series.force_zero), MOVED)
    calm = series.hypothesis != hc.Hypothesis.SURFACE_MOVES
    np.testing.assert_array_equal(series.contact_position[calm], 0.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_tissue_that_is_left_behind_is_no_air(seed, plant):
    """Fast retreats in contact: the force is gone deep in the tissue, and the zero is right."""
    time = np.arange(3000) / 200.0
    d, v = plant.motion(time)
    force = plant.force(d, v, 0.3, 0.02, 1.7, 1.0)
    assert np.mean(force == 0.0) > 0.01
    d_read, force = plant.noisy(d, force, seed)
    series = hc.create_estimator("self_tuning_ukf").run(time, d_read, force)
    calm = series.hypothesis != hc.Hypothesis.SURFACE_MOVES
    np.testing.assert_array_equal(series.contact_position[calm], 0.0)
    assert series.parameters[-1, 0] == pytest.approx(0.3, rel=0.02)


def test_a_sensor_that_drifts_in_the_air_touches_nothing(plant):
    """The force creeps by ten deviations while the tool waits above the tissue."""
    time, d = approach(seconds=10.0, start=-20.0)
    d_read, force = felt(plant, time, d, 5)
    force += np.where(d < 0.0, 0.1 * time / time[d < 0.0].max(), 0.1)
    series = hc.create_estimator("self_tuning_ukf").run(time, d_read, force)
    before = d < 0.0
    assert np.abs(series.contact_position[before]).max() == 0.0
    assert series.contact_position[-1] == pytest.approx(0.0, abs=0.3)


def test_a_force_that_was_there_before_the_zero(plant):
    """The recording begins in contact, its zero three millimetres too deep."""
    time = np.arange(3000) / 500.0
    d = 2.5 + 1.2 * np.sin(2 * np.pi * 0.7 * time - 1.5)
    d_read, force = felt(plant, time, d, 7, position=-3.0)
    series = hc.create_estimator("self_tuning_ukf").run(time, d_read, force)
    assert series.contact_position[-1] == pytest.approx(-3.0, abs=1.0)
    error = np.log(series.parameters[-1, 0] / TISSUE[0])
    assert abs(error) < 3.0 * series.parameters_std[-1, 0] / series.parameters[-1, 0] + 0.02


def test_found_zeros_survive_saving(plant):
    """A restored estimator goes on bit for bit, its zeros moved."""
    time, d = approach()
    d_read, force = felt(plant, time, d, 9, position=2.0, force_zero=-1.0)
    half = time.size // 2
    whole = hc.create_estimator("self_tuning_ukf")
    whole.run(time[:half], d_read[:half], force[:half])
    assert whole._memory[0]["onset"]["zero"][0] != 0.0
    other = hc.create_estimator("self_tuning_ukf")
    other.restore(whole.state())
    first = whole.run(time[half:], d_read[half:], force[half:])
    second = other.run(time[half:], d_read[half:], force[half:])
    np.testing.assert_array_equal(first.parameters, second.parameters)
    np.testing.assert_array_equal(first.contact_position, second.contact_position)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("zero", [1.0, 3.0])
def test_a_zero_that_moves_twice_before_the_first_touch_is_read_twice(zero, seed, plant):
    """Regression of 2026-11-26: the highest level of before stayed in the zero of before.

    The force stands at 1 N, falls a little while the tool rests, and rises a little on its way
    down, where its zero is read. What the tool felt at rest was one newton more than that zero, and
    counted as a contact: so the rest of the way down was no air.
    """
    fall, rise = 0.06, 0.04
    time, travel = approach(seconds=6.5, start=-4.0, speed=2.0)
    d = np.concatenate([np.full(750, -4.0), travel])
    time = np.arange(d.size) / 500.0
    level = zero - fall * (time > 1.0) + rise * (time > 2.7)  # at -1.6 mm
    d_read, force = felt(plant, time, d, seed)
    series = hc.create_estimator("self_tuning_ukf").run(time, d_read, force + level)
    inside = int(np.argmax(d > 0.4))
    assert series.force_zero[inside] == pytest.approx(level[-1], abs=0.005)
    assert series.force_zero[-1] == pytest.approx(level[-1], abs=0.005)
    assert series.contact_position[-1] == 0.0


@pytest.mark.parametrize("when", [1.0, 2.5])  # at rest; on the way down, 2 mm above the tissue
@pytest.mark.parametrize("step", [-1.0, -0.2, -0.06, 0.06, 0.2, 1.0])
@pytest.mark.parametrize("zero", [-1.0, 0.0, 1.0])
def test_a_zero_that_steps_before_the_first_touch_is_no_contact(zero, step, when, plant):
    """Regression of 2026-11-27: a step was the first touch, or the rest of the way down was no air.

    K was 0.001 or 0.03 of 0.4 and the contact four millimetres too high, in 26 of 96 such runs.
    """
    time, travel = approach(seconds=6.5, start=-4.0, speed=2.0)
    d = np.concatenate([np.full(750, -4.0), travel])
    time = np.arange(d.size) / 500.0
    level = zero + step * (time > when)
    d_read, force = felt(plant, time, d, 2)
    series = hc.create_estimator("self_tuning_ukf").run(time, d_read, force + level)
    assert series.force_zero[-1] == pytest.approx(level[-1], abs=0.005)
    assert series.contact_position[-1] == 0.0
    error = abs(series.parameters[-1, 0] - TISSUE[0])
    assert error < 4.0 * series.parameters_std[-1, 0] + 0.002
    assert series.parameters_std[-1, 0] < 0.02
    assert series.model_mismatch[-200:].mean() < 0.1


@pytest.mark.parametrize("step", [-0.6, -0.03, 0.012, 0.03, 0.6])
def test_a_zero_that_steps_where_the_tissue_was_said_to_be(step, plant):
    """Regression of 2026-11-27: the search for zeros was given up with nothing found.

    The tool waits, and comes down, below the given position and above the tissue: a law explains
    nothing there, and the zeros that were found, none, were taken back for good.
    """
    time, travel = approach(seconds=6.5, start=-3.0, speed=2.0)
    d = np.concatenate([np.full(750, -3.0), travel])
    time = np.arange(d.size) / 500.0
    level = step * (time > 1.0)
    d_read, force = felt(plant, time, d, 2, position=2.5)
    series = hc.create_estimator("self_tuning_ukf").run(time, d_read, force + level)
    assert series.force_zero[-1] == pytest.approx(level[-1], abs=0.005)
    assert series.contact_position[-1] == pytest.approx(2.5, abs=0.1)
    assert series.parameters[-1, 0] == pytest.approx(TISSUE[0], rel=0.05)


@pytest.mark.parametrize("force_zero", [-2.0, 0.0, 0.4, 2.0])
def test_no_reading_stays_in_a_zero_that_moved(force_zero, plant):
    """Regression of 2026-11-26: the reading with which a zero moved was still in the old one.

    Readings come alone, the displacement late: the forces are held back, and one of them moves a
    zero while the next reading, of either sensor, is at hand. It was 3 mm or 2 N off, and refused.
    """
    delay, position = 0.02, -3.0
    time, d = approach()
    _, force = felt(plant, time, d, 3, position, force_zero)
    d_read, _ = felt(plant, time, np.interp(time - delay, time, d), 3, position)
    d_read[1::2], force[::2] = np.nan, np.nan
    estimator = hc.create_estimator("self_tuning_ukf", missing_readings=True, channel_delay=-delay)
    series = estimator.run(time, d_read, force)
    down = (time > 0.6) & (time < 1.3)  # from the air into the tissue
    assert np.any(np.abs(np.diff(series.contact_position[down])) > 1.0)
    assert series.force_zero[-1] == pytest.approx(force_zero, abs=MOVED)
    assert np.all(series.rejected[down] == 0)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("position", "force_zero", "breathing"),
    [(0.2, 0.02, 0.4), (-0.2, -0.03, 0.4), (0.0, 0.012, 0.7), (0.3, 0.02, 0.0)],
)
def test_a_force_zero_is_found_between_taps(
    position, force_zero, breathing, seed, taps, check_taps
):
    """Regression of 2026-11-28: on an organ that breathes K was off by 4 to 60 %, a misfit told.

    The tissue seemed to begin elsewhere, and by that the tool was never in the air.
    """
    time, displacement, force = taps(
        seed,
        lambda time: position + breathing * np.sin(1.57 * time + 2.0 * seed),
        force_zero,
        phase=seed,
    )
    series = hc.create_estimator("self_tuning_ukf").run(time, displacement, force)
    assert series.force_zero[-1] == pytest.approx(force_zero, abs=0.001)
    check_taps(time, series, 0.01)


def test_a_tool_that_holds_its_force_between_presses_is_in_no_air(plant):
    """A robot that goes back to the same force each time, and creeps there: no zero is off."""
    time = np.arange(0.0, 20.0, 0.002)
    creep = 0.3 * np.sin(0.9 * time)
    phase = time % 2.0
    press = np.where(phase < 1.0, np.sin(np.pi * phase) ** 2, 0.0)
    depth = 1.5 + 2.0 * press
    force = plant.force(depth, np.gradient(depth, time), *TISSUE)
    draw = np.random.default_rng(8)
    displacement = depth + creep + 0.003 * draw.standard_normal(time.size)
    series = hc.create_estimator("self_tuning_ukf").run(
        time, displacement, force + 0.01 * draw.standard_normal(time.size)
    )
    np.testing.assert_array_equal(series.force_zero, 0.0)
