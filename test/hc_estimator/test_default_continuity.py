"""The default filter gives the same numbers sample by sample, in a batch, and saved in between.

Above all in the middle of something: while a change is on trial, after a sudden turn of the tool,
with readings held back, and with readings that come alone.
"""

import json

import numpy as np
import pytest

import hc_estimator as hc

FILTER = "self_tuning_ukf"
TISSUE = (0.2, 0.009, 1.8, 1.05)
COLUMNS = [n for n in dir(hc.Estimate) if not n.startswith("_")]


def change(plant):
    """Another tissue at 4 s."""
    time = np.arange(4500) / 1000.0
    d, v = plant.motion(time)
    force = np.where(
        time < 4.0, plant.force(d, v, *TISSUE), plant.force(d, v, 0.5, 0.03, 1.5, 1.05)
    )
    return (time, *plant.noisy(d, force, 1)), {}


def turn(plant):
    """A steady press that is reversed at once, time and again."""
    time = np.arange(4000) / 1000.0
    phase = (time / 0.8) % 1.0
    d = 1.0 + 2.5 * np.abs(2.0 * phase - 1.0)
    v = np.where(phase < 0.5, -1.0, 1.0) * 5.0 / 0.8
    return (time, *plant.noisy(d, plant.force(d, v, 0.3, 0.05, 1.6, 1.0), 2)), {}


def held(plant):
    """The force 20 ms late; the displacement is held back once that is found."""
    time = np.arange(3500) / 500.0
    d, _ = plant.motion(time)
    return (time, *plant.noisy(d, plant.force(*plant.motion(time - 0.02), *TISSUE), 3)), {}


def alone(plant):
    """Readings that come alone, the force 20 ms late."""
    (time, d, force), _ = held(plant)
    d[1::2], force[2::2] = np.nan, np.nan
    return (time, d, force), {"missing_readings": True}


def change_on_trial(memory):
    return memory["change"]["testing"] == 1


def just_turned(memory):
    return memory["maneuver"]["since"] < 10.0 and memory["maneuver"]["density"] > 0.0


def holds_readings(memory):
    return memory["held"]["count"] > memory["held"]["first"]


def fields(estimate):
    return [np.asarray(getattr(estimate, name), float) for name in COLUMNS]


CASES = [
    (change, change_on_trial),
    (turn, just_turned),
    (held, holds_readings),
    (alone, holds_readings),
]


@pytest.mark.parametrize(("scene", "in_the_middle"), CASES)
def test_step_run_save_and_restore_give_the_same_bits(scene, in_the_middle, plant):
    samples, options = scene(plant)
    whole = hc.create_estimator(FILTER, **options).run(*samples)
    single = hc.create_estimator(FILTER, **options)
    saved = []
    steps = []
    for k, sample in enumerate(zip(*samples, strict=True)):
        steps.append(single.step(*sample))
        if len(saved) < 3 and k % 3 == 0 and in_the_middle(single._memory[0]):
            saved.append((k + 1, json.dumps(single.state())))
    assert saved, "the scene never came to what it is for"
    for name, column in zip(COLUMNS, fields(whole), strict=True):
        np.testing.assert_array_equal(
            np.array([getattr(step, name) for step in steps], float), column, err_msg=name
        )
    for cut, text in saved:
        other = hc.create_estimator(FILTER, **options)
        other.restore(json.loads(text))
        rest = other.run(*(column[cut:] for column in samples))
        for name, column in zip(COLUMNS, fields(rest), strict=True):
            expected = np.asarray(getattr(whole, name), float)[cut:]
            np.testing.assert_array_equal(column, expected, err_msg=f"{name} from {cut}")
    assert json.dumps(other.state()["memory"]) == json.dumps(single.state()["memory"])
