"""The doctor invents no delay and no zero where readings are spoilt, and leaves no unit unsaid."""

import numpy as np
import pytest

from hc_bringup.diagnosis import assumed_line, diagnose
from hc_estimator.contact.hunt_crossley import hunt_crossley_force
from hc_estimator.input.sanity import check_samples


def presses():
    """Time [s], penetration [mm] and force [N] of presses at several speeds."""
    generator = np.random.default_rng(3)
    time_s = np.arange(0.0, 8.0, 0.002)
    depth = 1.5 + 2.2 * np.sin(2.1 * time_s) + 0.5 * np.sin(13.0 * time_s)
    speed = 2.2 * 2.1 * np.cos(2.1 * time_s) + 6.5 * np.cos(13.0 * time_s)
    force = [
        hunt_crossley_force(d, v, 0.5, 0.05, 1.5, 1.0) if d > 0.0 else 0.0
        for d, v in zip(depth, speed, strict=True)
    ]
    return (
        time_s,
        depth + 0.003 * generator.standard_normal(time_s.size),
        np.array(force) + 0.01 * generator.standard_normal(time_s.size),
    )


def stuck_force(time_s, depth, force):
    return time_s, depth, np.where(time_s < 3.0, force, force[1500])


def coarse_position(time_s, depth, force):
    return time_s, np.round(depth / 0.5) * 0.5, force


def saturated(time_s, depth, force):
    return time_s, depth, np.minimum(force, 1.5)


@pytest.mark.parametrize(
    ("spoil", "word"),
    [(stuck_force, "stands at"), (coarse_position, "in steps of"), (saturated, "end of its range")],
)
def test_of_spoilt_readings_no_delay_no_zero_and_no_forecast_is_told(spoil, word):
    diagnosis = diagnose(*spoil(*presses()))
    assert word in diagnosis.findings[0].what
    assert "cannot be said" in diagnosis.findings[0].cost
    assert not any(finding.settings for finding in diagnosis.findings), diagnosis.findings
    assert diagnosis.forecasts == ()


def test_gram_force_is_named_beside_millinewtons():
    time_s, depth, force = presses()
    (doubt,) = check_samples(time_s, depth, force / 9.80665e-3)
    assert "in millinewtons: scale it by 0.001" in doubt.sentence
    assert doubt.sentence.endswith("or in gram-force: by 0.00981")


def test_what_the_units_of_a_table_mean_is_said_for_a_person_to_judge():
    _time_s, depth, force = presses()
    assert assumed_line(0.1 * depth, force, table=True).startswith(
        "read as: the tool moves by 0.528 mm"
    )
