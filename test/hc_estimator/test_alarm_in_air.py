"""What surprises in the air is the tool, and no law: no model error comes of it."""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import change, model_error
from hc_evaluation.accuracy.faulty_sensors import NOTHING, faulty_readings
from hc_evaluation.accuracy.sensor_faults import counted_of

FORCE_NOISE = 0.01


@pytest.mark.parametrize(
    ("depth", "predicted", "reading", "free"),
    [
        (-0.5, 0.0, 0.02, True),
        (-0.5, 0.0, -0.03, True),
        (-0.5, 0.0, 0.05, False),  # there is something that nobody expected
        (-0.5, 0.0, -0.05, False),
        (0.01, 0.0, 0.0, False),  # tissue that lets go
        (-0.001, 0.1, 0.0, False),
        (-0.5, 0.0, None, True),
        (0.5, 0.0, None, False),
    ],
)
def test_a_row_without_force_where_there_is_none_is_in_the_air(
    records_of, depth, predicted, reading, free
):
    _, bank = records_of(hc.create_estimator("self_tuning_ukf"))
    row, clock = bank.rows[0], bank.clock
    row.state[0], row.predicted_force = depth, predicted
    clock.present[0], clock.present[1] = 1, 0 if reading is None else 1
    clock.measurement[1] = np.nan if reading is None else reading
    bank.sensor_noise[1] = FORCE_NOISE**2
    assert model_error.is_in_air(row, clock, bank.sensor_noise) is free


@pytest.mark.parametrize(("depth", "raised"), [(-0.5, False), (0.5, True)])
def test_an_alarm_raises_a_model_error_in_contact_alone(records_of, depth, raised):
    settings, bank = records_of(hc.create_estimator("self_tuning_ukf"))
    row = bank.rows[0]
    row.state[0], row.active, row.alarm = depth, 1, 1
    row.predicted_force = max(depth, 0.0)
    bank.clock.present[1], bank.clock.measurement[1] = 1, max(depth, 0.0)
    bank.sensor_noise[1] = FORCE_NOISE**2
    bank.change.testing = 1  # the test of a change has its answer already
    change.answer(settings, bank, 0.0)
    assert bool(row.model_error > 0.0) is raised


@pytest.mark.parametrize("seed", [6001, 6026, 6028])
def test_a_tool_that_sets_off_above_the_tissue_is_no_misfit(seed):
    """Before, a misfit was said from there on for up to 2.3 s, of it up to 2.1 s in the air."""
    readings = faulty_readings(NOTHING, seed)
    contact = readings.contact
    series = hc.create_estimator("self_tuning_ukf").run(
        contact.time_s, contact.displacement_mm, contact.force_n
    )
    told = series.model_mismatch & counted_of(readings)
    begins = np.flatnonzero(told[1:] & ~told[:-1]) + 1
    assert not np.any(contact.acting_n[begins] == 0.0)
    in_air = contact.acting_n == 0.0
    assert np.mean(told[in_air]) < 0.01
