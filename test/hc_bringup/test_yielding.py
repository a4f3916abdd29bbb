"""A structure that gives way between position and tip is named, and other tissue is not."""

import numpy as np
import pytest

from hc_bringup.diagnosis import diagnose
from hc_bringup.yielding import find_yielding
from hc_evaluation.accuracy.drawn_contact import drawn_contact
from hc_evaluation.accuracy.mechanics import MECHANICS
from hc_evaluation.channels import diagnose_channels, evenly_spaced, unbroken

STIFFNESS, DAMPING, EXPONENT = 0.6, 0.012, 1.5
COMPLIANCE = 0.3


def presses(mm_per_n=0.0, duration_s=20.0):
    """Return stamps, positions and forces of presses with a structure that gives way."""
    random = np.random.default_rng(4)
    time_s = np.arange(0.0, duration_s, 1e-3)
    depth = 2.0 - 2.5 * np.cos(2.0 * np.pi * 0.4 * time_s)
    depth *= 0.75 + 0.25 * np.sin(2.0 * np.pi * 0.03 * time_s)
    speed = np.gradient(depth, time_s)
    touching = np.maximum(depth, 0.0) ** EXPONENT
    force = np.maximum(touching * (STIFFNESS + DAMPING * speed), 0.0)
    noise = random.standard_normal((2, len(time_s)))
    return time_s, depth + mm_per_n * force + 0.002 * noise[0], force + 0.01 * noise[1]


def test_the_doctor_says_by_how_much_the_structure_gives_way() -> None:
    """Regression: "contact seems to begin at 0.0536 mm" to be typed, K 0.524 of 0.6 N/mm."""
    diagnosis = diagnose(*presses(COMPLIANCE))
    (finding,) = diagnosis.findings
    assert finding.what.startswith("the structure gives way: the position seems to go on by 0.")
    (name,) = finding.settings
    assert name == "position.frame_compliance"
    assert finding.settings[name] == pytest.approx(COMPLIANCE, rel=0.03)
    assert diagnosis.estimated is not None
    expected = (STIFFNESS, DAMPING, EXPONENT)
    assert diagnosis.estimated.parameters[:3] == pytest.approx(expected, rel=0.03)


def test_a_stiff_structure_is_none() -> None:
    readings = presses()
    assert find_yielding(readings, diagnose_channels(*readings)) == 0.0


@pytest.mark.parametrize("trouble", [None, "drag", "friction", "hysteresis", "play", "low-pass"])
def test_nor_is_anything_else(trouble: str | None) -> None:
    contact = drawn_contact((), 1, *([MECHANICS[trouble]] if trouble else []))
    even = evenly_spaced(*unbroken(contact.time_s, contact.displacement_mm, contact.force_n))
    assert find_yielding(even, diagnose_channels(*even)) == 0.0
