"""Of a channel that repeats its last reading until there is a new one, each reading counts once."""

import math

import numpy as np
import pytest

from hc_estimator.ros.settings_meaning import counted_once
from hc_estimator.stream.channel_checks import held
from hc_estimator.stream.readings import Check, Readings
from hc_estimator.stream.repeats import (
    LONGEST_S,
    Repeats,
    channels_held_by,
    new_readings,
    once_each,
)
from hc_estimator.stream.sanity import check_samples
from hc_estimator.stream.suspicion_watch import SuspicionWatch


def test_a_reading_counts_once_and_again_where_the_channel_rests():
    stamps = np.arange(0, 400_000_000, 2_000_000, dtype=np.int64)
    values = np.repeat(np.arange(50.0), 4)
    assert new_readings(stamps, values).tolist() == [True, False, False, False] * 50
    at_rest = new_readings(stamps, np.zeros(200))
    assert np.diff(stamps[at_rest]).tolist() == [round(LONGEST_S * 1e9)] * 4


def test_a_vector_is_new_where_any_component_is_and_a_clock_set_back_begins_anew():
    repeats = Repeats()
    assert not repeats.is_one(10, (1.0, 2.0))
    assert repeats.is_one(20, (1.0, 2.0))
    assert not repeats.is_one(30, (1.0, 3.0))
    assert not repeats.is_one(5, (1.0, 3.0))
    repeats.forget()
    assert not repeats.is_one(6, (1.0, 3.0))


def test_a_repeated_reading_counts_once_where_others_are_missing_between():
    """As in a table whose rows hold one reading each: NaN took the next one for a new reading."""
    values = np.full(12, np.nan)
    values[::2] = [1.0, 1.0, 1.0, 2.0, 2.0, 1.0]
    left = once_each(np.arange(12) * 1_000_000, values)
    assert np.flatnonzero(~np.isnan(left)).tolist() == [0, 6, 10]
    assert left[[0, 6, 10]].tolist() == [1.0, 2.0, 1.0]


@pytest.mark.parametrize("step", [0.0, 1e-4, 1e-3, 1e-2, 0.05])
@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-3, 1e-2])
@pytest.mark.parametrize("motion", ["sine", "rests", "ramps", "taps"])
def test_a_coarse_sensor_and_a_tool_that_rests_repeat_nothing(motion, noise, step):
    time_s = 0.002 * np.arange(10_000)
    depth = {
        "sine": 1.2 - 1.8 * np.cos(4.4 * time_s),
        "rests": np.clip(2.0 * np.sin(1.9 * time_s), -1.0, 1.0),
        "ramps": 2.0 * np.abs(time_s % 2.0 - 1.0) - 0.5,
        "taps": 3.0 * np.sin(50.0 * time_s),
    }[motion]
    force = 0.4 * np.maximum(depth, 0.0) ** 1.5
    for k, values in enumerate((depth, force)):
        read = values + noise * np.random.default_rng(k).standard_normal(values.size)
        if step:
            read = step * np.round(read / step)
        sentence, repeats = held(Readings("force", "N", time_s, read))
        assert not sentence
        assert math.isnan(repeats)


def test_a_channel_whose_repeated_readings_are_left_out_has_no_gaps():
    """Regression: "readings are lost, late or no numbers", where they had been left out."""
    generator = np.random.default_rng(1)
    time_s = 0.002 * np.arange(5000)
    depth = 1.0 + 3.0 * np.sin(3.0 * time_s)
    speed = 9.0 * np.cos(3.0 * time_s)
    force = np.maximum(depth, 0.0) ** 1.5 * (0.5 + 0.02 * speed)
    force += 0.01 * generator.standard_normal(time_s.size)
    left = depth + 0.002 * generator.standard_normal(time_s.size)
    left[generator.random(len(left)) < 0.6] = np.nan
    assert [s.check for s in check_samples(time_s, left, force)] == [Check.RATE]
    assert check_samples(time_s, left, force, math.inf, ("displacement",)) == []
    assert len(check_samples(time_s, left, force, math.inf, ("force",))) == 1
    found = {}
    for once in ((), ("displacement",)):
        watch = SuspicionWatch()
        watch.counted_once = once
        for look in range(4):
            for stamp, place, newtons in zip(time_s, left, force, strict=True):
                watch.add(round(1e9 * (stamp + look * time_s[-1])), place, newtons)
            watch.look(10.0 * look)
            watch.look(10.0 * look + 5.0)
        found[once] = [s.check for s in watch.suspicions]
    assert Check.RATE in found[()]
    assert Check.RATE not in found[("displacement",)]


def test_an_input_of_sensors_leaves_out_what_is_said_to_repeat():
    values = {"input.source": "sensors", "input.position.held": True, "input.force.held": False}
    assert counted_once(values) == ("displacement",)
    assert counted_once({**values, "input.source": "sample"}) == ()
    assert channels_held_by({"input.force.held": True}) == ("force",)  # what a bag says of its node
    assert channels_held_by({}) == ()
