"""A robot that was not tared, and whose tool something holds back, presses the way that it does."""

import numpy as np
import pytest

from hc_estimator.stream.readings import Check
from hc_estimator.stream.sanity import check_samples
from hc_estimator.stream.sensor_setup import NO_SURFACE, NOT_FREE, propose
from hc_estimator.stream.vector_readings import VectorReadings

RATE_HZ, BIAS_N, SURFACE_MM, PRESLIDING_MM = 400.0, -4.2, -210.0, 0.03


def presses(friction_n):
    """Presses out of 3 mm of air: stamps [s], place [mm], force [N], both far from zero."""
    time_s = np.arange(0.0, 15.0, 1.0 / RATE_HZ)
    depth = -3.0 + 2.75 * (1.0 - np.cos(2.0 * np.pi * 0.4 * time_s))
    speed = np.gradient(depth, time_s)
    held, dragged = np.empty(len(depth)), depth[0]
    for row, place in enumerate(depth):
        dragged = min(max(dragged, place - PRESLIDING_MM), place + PRESLIDING_MM)
        held[row] = (place - dragged) / PRESLIDING_MM
    into = np.maximum(depth, 0.0)
    tissue = np.maximum(0.0, into**1.3 * (1.2 + 0.03 * np.sign(speed) * np.abs(speed) ** 0.7))
    draw = np.random.default_rng(3)
    force = tissue + friction_n * held + 0.02 * draw.standard_normal(len(depth))
    return time_s, depth + SURFACE_MM + 0.003 * draw.standard_normal(len(depth)), force + BIAS_N


def doubts(time_s, place, force):
    return [(s.check, s.channel) for s in check_samples(time_s, place, force)]


@pytest.mark.parametrize("friction_n", [0.1, 0.2, 0.5])
def test_friction_does_not_turn_the_signs_of_both(friction_n):
    """Regression: "force and displacement go down together: turn the signs of both"."""
    time_s, place, force = presses(friction_n)
    assert doubts(time_s, place, force) == [(Check.FRICTION, "force")]
    assert doubts(time_s, -place, -force) == [(Check.SIGN, "both")]
    assert doubts(time_s, place, -force)[0] == (Check.SIGN, "force")
    assert doubts(time_s, -place, force)[0] == (Check.SIGN, "displacement")


def test_a_place_that_counts_from_elsewhere_says_nothing_of_signs():
    """Regression: of a tool that never left the tissue, 210 mm off: "turn the signs of both"."""
    time_s, place, force = presses(0.0)
    pressed = place > SURFACE_MM + 0.5
    sign = (Check.SIGN, "both")
    assert sign not in doubts(time_s[pressed], place[pressed], force[pressed] - 5.0)
    near = place[pressed] - SURFACE_MM - 6.0
    assert sign in doubts(time_s[pressed], near, force[pressed] - 5.0)


def test_a_zero_that_was_not_known_is_known_once_the_diagnosis_found_it():
    """Regression: "contact begins near -210 mm (allowed for)", and "zero: 0.0, not known yet"."""
    time_s, place, force = presses(0.5)

    def vectors(values):
        readings = np.column_stack((np.zeros((len(values), 2)), values))
        return VectorReadings(time_s, readings, ())

    found = propose(vectors(-force), vectors(-place))
    assert (found.force.sign, found.position.sign) == (-1, -1)
    found = found._replace(
        force=found.force._replace(zero=np.nan),
        position=found.position._replace(zero=np.nan),
        notes=(NO_SURFACE, NOT_FREE),
    )
    half = found.corrected(BIAS_N, 0.0)
    assert half.force.zero == BIAS_N
    assert np.isnan(half.position.zero)
    assert half.notes == (NO_SURFACE,)
    both = half.corrected(0.0, SURFACE_MM)
    assert (both.force.zero, both.position.zero, both.notes) == (BIAS_N, SURFACE_MM, ())
