"""Taps and ramps with a force sensor that nobody tared, at a contact position that is off.

Regressions of 2026-11-28. A tool that begins in the tissue and leaves it again and again shows both
zeros; K was 10 to 40 % wrong for as long as it tapped, with a misfit told, in one run of eight:
where the air read more than five deviations, it passed for a contact, and the parabolas through
where the contact began left more than noise with the right zeros as well (`point_error`); a zero
that was read in the air was taken for one that had moved there; and a velocity next to nothing, of
a tool at rest, looked like a drag wherever p is below one.
"""

import numpy as np
import pytest

import hc_estimator as hc
from hc_evaluation.accuracy import together
from hc_evaluation.accuracy.drawn_contact import drawn_contact
from hc_evaluation.accuracy.scenarios import simulate

FILTER = "self_tuning_ukf"
K, B, N, P = 1.17, 0.0113, 1.27, 1.07
NOISE = (0.0025, 0.006)
SECONDS = 12.0


def taps(seed, *, rate=1000.0, position=0.0, zero=0.0, breathing=0.0, quick=False):
    """Time, displacement and force; sines that leave the tissue for up to a third of the time."""
    draw = np.random.default_rng(seed)
    time = np.arange(0.0, SECONDS, 1.0 / rate)
    frequency = draw.uniform(2.1, 2.5) if quick else draw.uniform(1.2, 2.0)
    middle, swing = (1.6, 1.9) if quick else (1.4, 2.2)
    phase = draw.uniform(0.0, 6.28, 2)
    angle = 2.0 * np.pi * frequency * time
    place = np.sin(angle + phase[0]) + 0.1 * np.sin(3.3 * angle + phase[1])
    place = middle + swing * place
    surface = breathing * np.sin(2.0 * np.pi * 0.25 * time + phase[1])
    depth = place - surface
    speed = np.gradient(depth, time)
    law = K + B * np.sign(speed) * np.abs(speed) ** P
    force = np.maximum(depth, 0.0) ** N * np.maximum(law, 0.0)
    return (
        time,
        place + position + NOISE[0] * draw.standard_normal(time.size),
        force + zero + NOISE[1] * draw.standard_normal(time.size),
    )


def error_of(series, time, begin):
    """Errors of ln K from a time on."""
    return np.abs(np.log(series.parameters[time > begin, 0] / K))


def run_over(contact):
    """Series of the filter over a drawn contact, which samples count, and errors of ln K there."""
    series = hc.create_estimator(FILTER).run(
        contact.time_s, contact.displacement_mm, contact.force_n
    )
    late = contact.time_s > 8.0
    off = np.abs(np.log(series.parameters[late, 0] / contact.parameters[late, 0]))
    return series, late, off


@pytest.mark.parametrize("zero", [0.035, 0.06, -0.05])
@pytest.mark.parametrize("position", [0.12, -0.2])
@pytest.mark.parametrize("rate", [200.0, 1000.0])
def test_both_zeros_are_found_while_it_taps(zero, position, rate):
    time, place, force = taps(3, rate=rate, position=position, zero=zero)
    series = hc.create_estimator(FILTER).run(time, place, force)
    assert np.median(error_of(series, time, 8.0)) < 0.01
    assert series.force_zero[-1] == pytest.approx(zero, abs=0.01)
    assert series.contact_position[-1] == pytest.approx(position, abs=0.02)
    assert np.mean(series.model_mismatch[time > 8.0]) < 0.05
    assert not series.change_detected.any()


@pytest.mark.parametrize("seed", range(1, 5))
def test_both_zeros_are_found_of_quick_taps_that_hardly_leave(seed):
    """In the air for a tenth of a second, at more than five deviations: never outside."""
    time, place, force = taps(seed, position=0.12, zero=0.04, quick=True)
    series = hc.create_estimator(FILTER).run(time, place, force)
    assert np.median(error_of(series, time, 8.0)) < 0.01
    assert series.force_zero[-1] == pytest.approx(0.04, abs=0.01)
    assert series.contact_position[-1] == pytest.approx(0.12, abs=0.02)
    assert np.mean(series.model_mismatch[time > 8.0]) < 0.05


@pytest.mark.parametrize("seed", range(3))
def test_a_force_zero_is_found_on_a_surface_that_breathes(seed):
    time, place, force = taps(seed, zero=0.045, breathing=0.35)
    series = hc.create_estimator(FILTER).run(time, place, force)
    assert np.median(error_of(series, time, 10.0)) < 0.02
    assert series.force_zero[-1] == pytest.approx(0.045, abs=0.01)
    assert not series.model_mismatch[-1]


@pytest.mark.parametrize("seed", [21005, 21006, 21008])
def test_what_was_felt_before_the_zero_was_read_in_the_air_moves_along(seed):
    contact = simulate(together.contact_of("tapping, zeros off", seed), seed)
    series, late, off = run_over(contact)
    assert np.quantile(off, 0.9) < 0.02
    assert np.mean(series.model_mismatch[late]) < 0.1


def test_a_zero_that_the_first_touch_shows_is_moved_once():
    """Presses out of step: the air said it a second later once more, and K was 46 % wrong."""
    seed = 21014
    scenario = together.contact_of("presses, zeros off, out of step", seed)
    contact = simulate(scenario, seed)
    series, _late, off = run_over(contact)
    largest = contact.force.max()
    found = series.force_zero[series.force_zero != 0.0]
    assert found.size > 1000
    assert np.max(np.abs(found - scenario.force_zero_n)) < 2e-3 * largest
    assert off[-1] < 0.05


def test_ramps_with_rests_show_a_force_zero():
    """Where p is below one a velocity of a hundredth is a drag of a tenth; K was 15 % wrong."""
    contact = drawn_contact(("force zero",), 30005)
    series, _late, off = run_over(contact)
    assert np.median(off) < 0.02
    assert np.mean(series.model_mismatch[contact.time_s > 12.0]) < 0.05
