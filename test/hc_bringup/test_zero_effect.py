"""What a zero that is off would make of K."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hc_bringup.summary import zero_lines
from hc_bringup.zero_effect import (
    POSITION_MM,
    UNKNOWN,
    ZERO_SHARE,
    DeepestTouch,
    ZeroEffect,
    effect_in,
    effect_where_exact,
    zero_effect,
)
from hc_bringup.zero_words import Zeros

EXACT = {"contact_position_std": 0.0, "force_zero_std": 0.0}


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.1])
@pytest.mark.parametrize("depth", [1.0, 3.0, 8.0])
def test_the_law_with_the_other_zero_says_the_same_forces(depth, exponent):
    points = np.array([depth, 0.5 * depth])
    felt = 0.7 * points**exponent
    by_position, by_zero = zero_effect(depth, exponent)
    for change, places, forces in (
        (by_position, points - POSITION_MM, felt),
        (by_zero, points, felt - ZERO_SHARE * felt[0]),
    ):
        slope = np.diff(np.log(forces))[0] / np.diff(np.log(places))[0]
        stiffness = np.exp(np.log(forces[0]) - slope * np.log(places[0]))
        assert 0.7 * (1.0 + change) == pytest.approx(stiffness, rel=1e-12)


def test_a_law_whose_exponent_is_fixed_is_not_bent():
    by_position, by_zero = zero_effect(2.0, 1.0, fixed=True)
    assert 0.7 * (1.0 + by_position) == pytest.approx(0.7 * 2.0 / 1.9, rel=1e-12)
    assert by_zero == pytest.approx(-ZERO_SHARE, rel=1e-12)


@pytest.mark.parametrize(
    ("depth", "exponent"),
    [(0.3, 1.5), (math.nan, 1.5), (math.inf, 1.5), (2.0, math.nan), (2.0, 7.0), (1e300, 6.0)],
)
def test_nothing_is_said_where_the_law_says_nothing(depth, exponent):
    effect = zero_effect(depth, exponent)
    assert effect.known == (depth == 1e300)  # 0.1 mm of that is nothing
    assert bool(effect.words) == bool(effect.sentence) == effect.known


@pytest.mark.parametrize(
    ("settings", "zeros", "exact"),
    [
        (EXACT, (0.0, 0.0), True),
        ({"process_noise": 1.0}, (math.nan, math.nan), True),  # a filter that asks for neither
        ({}, (0.0, 0.0), False),
        (EXACT | {"contact_position_std": 0.03}, (0.0, 0.0), False),
        (EXACT | {"force_zero_std": 0.03}, (0.0, 0.0), False),
        (EXACT, (0.2, 0.0), False),
        (EXACT, (0.0, -0.01), False),
    ],
)
def test_it_is_said_where_nobody_called_the_zeros_unsure_and_none_was_found(settings, zeros, exact):
    effect = effect_where_exact(settings, 2.0, 1.5, 0.1, zeros, (0.5, 0.001))
    assert effect == (zero_effect(2.0, 1.5) if exact else UNKNOWN)


def test_nothing_is_said_where_the_deviation_of_k_says_more():
    largest = max(map(abs, zero_effect(2.0, 1.5)))
    for stiffness in (0.5, -0.5, 0.0):
        for share, said in ((0.9, stiffness != 0.0), (1.1, False)):
            known = (stiffness, share * largest * abs(stiffness) or 0.1)
            effect = effect_where_exact(EXACT, 2.0, 1.5, 0.1, (0.0, 0.0), known)
            assert effect.known is said, known


def estimates(depths, revisions):
    names = ["displacement", "displacement_exponent", "displacement_exponent_std"]
    names += ["contact_position", "force_zero", "stiffness", "stiffness_std"]
    kinds = [(name, float) for name in names]
    kinds += [("contact", bool), ("rejected", np.uint8), ("configuration_revision", np.uint32)]
    table = np.zeros(len(depths), kinds)
    table["displacement"] = 1e-3 * np.array(depths)
    table["displacement_exponent"], table["displacement_exponent_std"] = 1.5, 0.1
    table["contact"], table["configuration_revision"] = True, revisions
    table["stiffness"], table["stiffness_std"] = 0.5, 0.001
    return table


def test_of_a_recording_stiffness_found_with_the_settings_of_its_end_counts():
    table = estimates([9.0, 2.0, 8.0, 7.0, np.nan, 1.0], [1, 2, 2, 2, 2, 2])
    table["contact"][2], table["rejected"][3] = False, 4
    assert effect_in(EXACT, table) == zero_effect(2.0, 1.5)
    assert effect_in(EXACT, table[:0]) == UNKNOWN


def test_of_a_stream_stiffness_found_with_the_settings_in_force_counts():
    touch = DeepestTouch()
    latest = SimpleNamespace(
        configuration_revision=1,
        displacement_exponent=1.5,
        displacement_exponent_std=0.1,
        contact_position=0.0,
        force_zero=0.0,
        stiffness=0.5,
        stiffness_std=0.001,
    )
    assert touch.effect(None) == UNKNOWN
    for depth in (9.0, math.nan, 1.0):
        touch.add(depth, 1)
    assert touch.effect(latest) == UNKNOWN  # nobody has said which settings that were
    touch.configure(EXACT, 1)
    assert touch.effect(latest) == zero_effect(9.0, 1.5)
    touch.add(2.0, 2)
    assert touch.effect(latest) == UNKNOWN
    latest.configuration_revision = 2
    assert touch.effect(latest) == UNKNOWN
    touch.configure(EXACT, 2)
    assert touch.effect(latest) == zero_effect(2.0, 1.5)


def test_the_words_name_both_and_what_to_do():
    summary = {"stiffness_if_position_off": 0.12, "stiffness_if_force_zero_off": -0.05}
    (line,) = zero_lines(summary)
    sentence = ZeroEffect(0.12, -0.05).sentence
    for words in ("12 % wrong", "5 %", "contact_position_std", "force_zero_std"):
        assert words in line
        assert words in sentence
    nothing = dict.fromkeys((*summary, *Zeros._fields), math.nan)
    assert zero_lines(nothing) == []
    assert zero_lines(nothing | {"contact_position": 0.0, "force_zero": 0.0}) == []


@pytest.mark.parametrize(
    ("zeros", "words"),
    [
        (
            (-0.184, 0.0162, 0.0, math.nan),
            "contact begins at -0.184 ± 0.016 mm in the end; K, B, n and p count from there",
        ),
        (
            (0.0, math.nan, 0.012, 0.0),
            "the force reads 12 mN without contact in the end; K, B, n and p count from there",
        ),
        (
            (-0.0, 0.41, 0.0, 0.02),
            "contact begins at 0.00 ± 0.41 mm and the force reads 0 ± 20 mN without contact; "
            "K, B, n and p are as unsure as that makes them",
        ),
        ((math.nan, math.nan, math.nan, math.nan), ""),
    ],
)
def test_zeros_that_were_found_or_are_in_doubt_are_said(zeros, words):
    assert Zeros(*zeros).words == words
    summary = {"stiffness_if_position_off": math.nan, "stiffness_if_force_zero_off": math.nan}
    assert zero_lines(summary | Zeros(*zeros)._asdict()) == ([words] if words else [])


def test_a_message_is_in_metres():
    fields = {"contact_position": 1e-3, "contact_position_std": 2e-4}
    fields |= {"force_zero": 0.3, "force_zero_std": 0.1}
    assert Zeros.from_message(fields.__getitem__) == pytest.approx((1.0, 0.2, 0.3, 0.1))
    assert "123 % wrong" in ZeroEffect(1.234, 0.1).words
