"""Lumps on a surface that moves: least squares say what tissue and surface do.

Regression of 2026-11: with a lump on a surface that sank or breathed K was 5 to 8 % off in the
median and 80 to 110 % in one run of ten, and said to be known to 2 % (`hc bench accuracy
together`).
"""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.estimate import Hypothesis
from hc_estimator.multiple_model.spline_records import STEADY, VARIES
from hc_evaluation.accuracy.drawn_contact import drawn_contact
from hc_evaluation.accuracy.measure import Setup
from hc_evaluation.accuracy.misfit import misfit_contact
from hc_evaluation.accuracy.scan import KINDS, scanned
from hc_evaluation.accuracy.scenarios import simulate
from hc_evaluation.accuracy.together import contact_of
from hc_evaluation.accuracy.troubles import TroubleTask, trouble_run

FILTER = "self_tuning_ukf"
SETTLED_S = 10.0


def run_pair(name, seed, **settings):
    """Relative error of K, and how many of its deviations that is, from SETTLED_S on."""
    contact = simulate(contact_of(name, seed), seed)
    series = hc.create_estimator(FILTER, **settings).run(
        contact.time_s, contact.displacement_mm, contact.force_n
    )
    late = contact.time_s > SETTLED_S
    error = np.log(series.parameters[late, 0] / contact.parameters[late, 0])
    deviation = series.parameters_std[late, 0] / series.parameters[late, 0]
    return np.abs(error), np.abs(error) / deviation


@pytest.mark.parametrize("name", ["breathing, lumps", "lumps, surface sinks"])
def test_a_lump_on_a_surface_that_moves_is_followed(name):
    errors, scores = zip(*(run_pair(name, seed) for seed in range(5000, 5004)), strict=True)
    assert np.median(np.concatenate(errors)) < 0.03
    assert np.mean(np.concatenate(scores) < 3.0) > 0.8
    without = [run_pair(name, seed, fit_movement=False)[0] for seed in range(5000, 5004)]
    assert np.median(np.concatenate(without)) > 1.5 * np.median(np.concatenate(errors))


@pytest.mark.parametrize("seed", [1015, 1017, 1026, 1029])
def test_a_surface_that_sinks_is_no_stiffness_that_drifts(seed):
    """Regression of 2026-11-26: a spline of ln K explained it, and K was 22 to 99 % off."""
    numbers = trouble_run(TroubleTask(Setup(), "sinking", seed))
    assert numbers["wrong"] < 0.02
    assert numbers["K"] < 0.08


@pytest.mark.parametrize("seed", [1001, 1004, 1010, 1019])
def test_a_stiffness_that_drifts_is_no_surface_that_sinks(seed):
    """Since the way into a contact counts (2026-11-28) 1019 is wrong for 9 % of its time."""
    numbers = trouble_run(TroubleTask(Setup(), "drift", seed))
    assert numbers["wrong"] < (0.12 if seed == 1019 else 0.05)
    assert numbers["K"] < 0.05


def test_a_tissue_that_relaxes_is_no_surface_that_moves():
    """It would be explained to within the noise, with K 1.8 times too large."""
    time, displacement, force = misfit_contact("press", 1014)
    with_it = hc.create_estimator(FILTER).run(time, displacement, force)
    without = hc.create_estimator(FILTER, fit_movement=False).run(time, displacement, force)
    assert np.mean(with_it.model_mismatch) > 0.8 * np.mean(without.model_mismatch)
    assert with_it.parameters[-1, 0] == pytest.approx(without.parameters[-1, 0], rel=0.05)


def test_layers_whose_exponent_varies_are_no_surface_that_moves():
    """One that is found is believed for 2.5 s: single scans say little."""
    kind, shares = next(k for k in KINDS if k.name == "layers"), []
    for seed in range(5000, 5012):
        _, contact = scanned(kind, seed)
        series = hc.create_estimator(FILTER).run(
            contact.time_s, contact.displacement_mm, contact.force_n
        )
        moved = series.hypothesis == Hypothesis.SURFACE_MOVES
        shares.append(np.mean(moved[contact.time_s > 3.0]))
    assert np.mean(shares) < 0.08
    assert np.median(shares) < 0.03


def test_steps_and_a_batch_say_the_same_through_its_fits():
    contact = simulate(contact_of("breathing, lumps", 5000), 5000)
    count = int(np.searchsorted(contact.time_s, 6.0))
    readings = contact.time_s[:count], contact.displacement_mm[:count], contact.force_n[:count]
    whole = hc.create_estimator(FILTER).run(*readings)
    half, estimator = count // 2 + 7, hc.create_estimator(FILTER)
    estimator.run(*(r[:half] for r in readings))
    restored = hc.create_estimator(FILTER)
    restored.restore(estimator.state())
    rest = restored.run(*(r[half:] for r in readings))
    np.testing.assert_array_equal(rest.parameters, whole.parameters[half:])


def test_a_state_is_taken_back_whatever_was_asked_last():
    """Regression of 2026-11-26: one saved after the fit of a steady drift was refused (2 %)."""
    contact = drawn_contact(("lumps",), 1002)
    estimator, other = hc.create_estimator(FILTER), hc.create_estimator(FILTER)
    readings = (contact.time_s, contact.displacement_mm, contact.force_n)
    begin, kinds = 0, set()
    for until_s in np.arange(5.0, 6.5, 0.02):
        end = int(np.searchsorted(contact.time_s, until_s))
        estimator.run(*(channel[begin:end] for channel in readings))
        begin = end
        kind = int(estimator._memory[0]["fit"]["kind"])
        if kind in kinds:
            continue  # to write and read a state takes fifty times as long as to look
        kinds.add(kind)
        state = estimator.state()
        other.restore(state)
        assert other.state() == state
    assert VARIES + STEADY in kinds
