"""Exchanged columns are told where the tool went through the air, and nothing else is taken so."""

import os
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from hc_bringup.diagnosis import diagnose
from hc_bringup.summary import why_unusable
from hc_estimator.stream.readings import Check
from hc_estimator.stream.sanity import check_samples
from hc_evaluation.accuracy.drawn_contact import drawn_contact
from hc_evaluation.accuracy.mechanics import MECHANICS
from hc_logger.recording import read_recording
from hc_sim_rig.rig import Rig

ROOT = Path(__file__).parents[2]
SHARED = Path(os.environ.get("HC_SHARED_DATA", ROOT.parent / "shared" / "data"))
RATE_HZ = 200.0
TIME_S = np.arange(0.0, 40.0, 1.0 / RATE_HZ)


def smooth(start_s, end_s):
    share = np.clip((TIME_S - start_s) / (end_s - start_s), 0.0, 1.0)
    return share**2 * (3.0 - 2.0 * share)


PRESSES = 4.0 * (smooth(20, 23) - smooth(23, 26) + smooth(28, 31) - smooth(31, 34))
APPROACH = -5.0 + 5.0 * smooth(14, 18)


def law(depth, stiffness=0.5, exponent=1.5):
    return stiffness * np.clip(depth, 0.0, None) ** exponent


def noisy(values, seed=1):
    return values + 0.003 * np.ptp(values) * np.random.default_rng(seed).standard_normal(
        len(values)
    )


def is_exchanged(time_s, displacement, force):
    doubted = {s.check for s in check_samples(time_s, displacement, force)}
    if Check.EXCHANGED in doubted:
        assert doubted <= {Check.EXCHANGED, Check.TIMES}
    return Check.EXCHANGED in doubted


@pytest.mark.parametrize("signs", list(product((1.0, -1.0), repeat=2)))
@pytest.mark.parametrize("exponent", [1.2, 1.5, 2.2])
def test_a_press_from_the_air_shows_them(signs, exponent):
    depth = APPROACH + PRESSES
    force = law(depth, exponent=exponent)
    right = (signs[0] * noisy(depth), signs[1] * noisy(force))
    assert not is_exchanged(TIME_S, *right)
    assert is_exchanged(TIME_S, right[1], right[0])


def resting_on_what_breathes():
    breath = np.where(TIME_S < 20.0, 1.0 + 0.8 * np.sin(1.6 * TIME_S), 1.0)
    return PRESSES, law(PRESSES + breath)


def relaxing_before_it_presses():
    return PRESSES, law(PRESSES + 1.0) * (1.0 + 0.6 * np.exp(-TIME_S / 5.0))


def touched_by_a_hand():
    hand = 2.0 * np.where((TIME_S > 2) & (TIME_S < 10), np.sin((TIME_S - 2) / 8 * np.pi) ** 2, 0.0)
    return APPROACH + PRESSES, law(APPROACH + PRESSES) + hand


def a_force_that_drifts():
    return PRESSES, law(PRESSES) + 1.5 * smooth(0, 20)


def a_position_that_starts_late():
    return np.maximum(PRESSES, 1.2), law(PRESSES)


def steps_that_relax():
    steps = 0.7 * np.floor(TIME_S / 5.0)
    return steps, law(steps) * (1.0 + 0.4 * np.exp(-(TIME_S % 5.0) / 1.5))


@pytest.mark.parametrize(
    "make",
    [
        resting_on_what_breathes,
        relaxing_before_it_presses,
        touched_by_a_hand,
        a_force_that_drifts,
        a_position_that_starts_late,
        steps_that_relax,
    ],
)
def test_a_tool_that_stands_still_while_its_force_changes_is_not_taken_so(make):
    displacement, force = make()
    for sign_d, sign_f in product((1.0, -1.0), repeat=2):
        assert not is_exchanged(TIME_S, sign_d * noisy(displacement), sign_f * noisy(force, 2))


@pytest.mark.parametrize("path", [*sorted(SHARED.glob("*.csv")), ROOT / "bags/example"])
def test_no_recording_is_taken_so(path):
    recording = read_recording(path)
    for sign in (1.0, -1.0):
        columns = (recording.displacement_mm, sign * recording.force_n)
        assert not is_exchanged(recording.time_s, *columns)


@pytest.mark.parametrize("path", sorted((ROOT / "config/scenarios").glob("*.yaml")))
def test_no_scenario_is_taken_so(path):
    series = Rig(path, 1).run(10.0)
    assert not is_exchanged(series.time_s, series.displacement_mm, series.force_n)


def test_drawn_contacts_are_not_taken_so():
    """Of 88 contacts through the air, each exchanged, 76 were found."""
    found = 0
    for seed in range(6000, 6006):
        for contact in (
            drawn_contact(("lumps",), seed),
            drawn_contact(("breathing",), seed),
            drawn_contact((), seed, MECHANICS["hysteresis"]),
        ):
            assert not is_exchanged(contact.time_s, contact.displacement_mm, contact.force_n)
            found += is_exchanged(contact.time_s, contact.force_n, contact.displacement_mm)
    assert found >= 2


def test_the_doctor_says_nothing_else_and_no_number_is_a_result():
    depth = APPROACH + PRESSES
    diagnosis = diagnose(TIME_S, noisy(law(depth)), noisy(depth))
    (finding,) = diagnosis.findings
    assert "--columns displacement=...,force=..." in finding.what
    assert diagnosis.estimated is None
    assert "exchanged" in why_unusable([Check.EXCHANGED.value], 0.0)
