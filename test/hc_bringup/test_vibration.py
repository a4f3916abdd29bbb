"""A vibration that stands in one channel alone is named, and one of the tip is not."""

import numpy as np
import pytest

from hc_bringup.diagnosis import diagnose
from hc_bringup.sensor_effect import doubted_effect
from hc_bringup.summary import why_unusable
from hc_bringup.vibration import find_vibration
from hc_estimator.stream.readings import Check
from hc_evaluation.accuracy.drawn_contact import drawn_contact
from hc_evaluation.channels import evenly_spaced

STIFFNESS, DAMPING, EXPONENT = 0.6, 0.012, 1.5


def presses(ripple_n=0.0, ripple_mm=0.0, tip_mm=0.0, hz=25.0, duration_s=20.0):
    """Return stamps, depths and forces of presses, with ripples of sensors or a tip that shakes."""
    random = np.random.default_rng(3)
    time_s = np.arange(0.0, duration_s, 1e-3)
    wave = np.sin(2.0 * np.pi * hz * time_s + 0.3)
    depth = 2.0 - 2.5 * np.cos(2.0 * np.pi * 0.4 * time_s) + tip_mm * wave
    speed = np.gradient(depth, time_s)
    touching = np.maximum(depth, 0.0) ** EXPONENT
    force = np.maximum(touching * (STIFFNESS + DAMPING * speed), 0.0)
    noise = random.standard_normal((2, len(time_s)))
    return (
        time_s,
        depth + ripple_mm * wave + 0.002 * noise[0],
        force + ripple_n * wave + 0.01 * noise[1],
    )


@pytest.mark.parametrize("hz", [25.0, 50.0, 120.0])
def test_a_ripple_of_the_force_is_named(hz: float) -> None:
    found = find_vibration(presses(ripple_n=0.3, hz=hz))
    assert found is not None
    assert found.channel == "force"
    assert found.frequency_hz == pytest.approx(hz, abs=0.1)
    assert found.amplitude == pytest.approx(0.3, rel=0.05)


def test_a_ripple_of_the_position_is_named() -> None:
    found = find_vibration(presses(ripple_mm=0.02))
    assert found is not None
    assert found.channel == "displacement"
    assert "± 0.02 mm in the position, and none in the force" in found.words


@pytest.mark.parametrize("tip_mm", [0.0, 0.01, 0.05])
def test_a_tip_that_vibrates_is_not(tip_mm: float) -> None:
    assert find_vibration(presses(tip_mm=tip_mm)) is None


@pytest.mark.parametrize("seed", range(8, 14))
def test_nor_are_other_contacts(seed: int) -> None:
    """Of seed 8 the tool moves at 3.6 Hz, and the force has twice that: no law is linear."""
    contact = drawn_contact((), seed)
    even = evenly_spaced(contact.time_s, contact.displacement_mm, contact.force_n)
    assert find_vibration(even) is None


def test_a_short_or_still_recording_has_none() -> None:
    time_s, depth, force = presses()
    assert find_vibration((time_s[:50], depth[:50], force[:50])) is None
    assert find_vibration((time_s, depth, np.zeros(len(time_s)))) is None


def test_the_doctor_names_its_frequency_and_takes_it_off() -> None:
    """Regression: "the contact law does not fit in 100 % of the contact: relaxing or layered"."""
    diagnosis = diagnose(*presses(ripple_n=0.3))
    (finding,) = diagnosis.findings
    assert finding.what.startswith("a vibration of 25.0 Hz and ± 0.3 N in the force")
    assert not finding.settings
    assert diagnosis.estimated is not None
    assert diagnosis.estimated.mismatch < 0.05
    assert diagnosis.estimated.parameters[0] == pytest.approx(STIFFNESS, rel=0.01)


def test_an_estimate_names_it_and_stays_a_result() -> None:
    doubt = doubted_effect(presses(ripple_n=0.3), [], 0.95, 0.0, 0.01)
    assert doubt is not None
    assert doubt.check is Check.VIBRATION
    assert not why_unusable([doubt.check.value], 0.95)  # K is right, and less sure
