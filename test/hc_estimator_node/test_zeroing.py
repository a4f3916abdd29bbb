"""Two who want zeros at once: the second joins the first, or takes its place and says so."""

import numpy as np
import pytest

from hc_estimator.ros.services import NotPossibleError
from hc_estimator.ros.zeroing import Refusal, Zeroing


def feed(zeroing, depths, force=0.0):
    """Give samples until something comes of them; returns that."""
    for depth in depths:
        outcome = zeroing.add(depth, force)
        if outcome is not None:
            return outcome
    return None


def test_a_second_tare_joins_the_first_and_does_not_make_it_wait():
    """A storm of requests would otherwise keep a tare from ever ending."""
    zeroing = Zeroing()
    zeroing.tare(100, 0.0, forced=False)
    assert feed(zeroing, [1.0] * 60) is None
    assert "under way already" in zeroing.tare(100, 0.5, forced=False)
    assert feed(zeroing, [1.0] * 39) is None
    assert feed(zeroing, [1.0]).samples == 100
    assert not zeroing.active


def test_a_second_who_forces_it_forces_it_for_both():
    zeroing = Zeroing()
    zeroing.tare(100, 0.0, forced=False)
    zeroing.tare(100, 0.0, forced=True)
    moving = [0.1 * k for k in range(100)]
    assert feed(zeroing, moving).displacement_mm == pytest.approx(4.95)
    zeroing.tare(100, 0.0, forced=False)
    assert isinstance(feed(zeroing, moving), Refusal)


def test_another_service_takes_the_place_of_what_is_under_way():
    zeroing = Zeroing()
    zeroing.tare(100, 0.0, forced=False)
    assert zeroing.under_way == "tare"
    zeroing.find_surface(forced=False)
    assert zeroing.under_way == "find_surface"
    assert "looks for the surface already" in zeroing.find_surface(forced=False)
    assert zeroing.cancel() == "find_surface"
    assert zeroing.cancel() == ""


def test_a_refused_one_leaves_what_is_under_way_alone():
    zeroing = Zeroing()
    zeroing.find_surface(forced=False)
    for k in range(2000):
        zeroing.watch.add(0.002 * k - 1.0, max(0.0, 0.01 * (k - 500)))
    assert zeroing.watch.pressing
    with pytest.raises(NotPossibleError, match="lift it free"):
        zeroing.tare(100, 0.0, forced=False)
    assert zeroing.under_way == "find_surface"


def test_what_is_felt_is_said_while_zeros_are_looked_for():
    zeroing = Zeroing()
    assert zeroing.feels == ""
    zeroing.tare(100, 0.0, forced=False)
    feed(zeroing, [1.0] * 60)
    assert zeroing.feels == "60 of 100 samples"
    zeroing.find_surface(forced=False)
    assert zeroing.feels == "no sample has come yet"
    zeroing.cancel()
    assert zeroing.feels == ""


def test_a_tare_waits_for_samples_that_come_slowly_and_gives_up_where_none_comes():
    """At 40 Hz the 500 samples of a tare never came: it was given up after 10 s."""
    zeroing = Zeroing()
    zeroing.tare(500, 0.0, forced=False)
    for k in range(499):
        assert feed(zeroing, [1.0]) is None
        assert zeroing.overdue(0.025 * k) == ""
    assert zeroing.overdue(22.4) == ""
    assert zeroing.overdue(22.5) == "only 499 of 500 samples came, and none for 10 s"
    assert not zeroing.active


def press_after_press(presses=3, samples=3000):
    """Depth [mm] and force [N] of presses from the air, the first of them with a hold in it."""
    phase = np.linspace(0.0, 2.0 * np.pi * presses, presses * samples)
    depth = -1.0 - 3.0 * np.cos(phase)
    noise = np.random.default_rng(3).normal(0.0, 0.005, depth.size)
    return depth, 0.4 * np.maximum(depth - 0.3, 0.0) ** 1.5 + noise


def test_a_search_that_was_asked_for_in_a_press_begins_once_the_tool_was_lifted():
    """Regression: it was refused, and a tool that was held in the tissue would be its zero."""
    zeroing = Zeroing()
    depths, forces = press_after_press()
    asked, found = 0, None
    for k, (depth, force) in enumerate(zip(depths, forces, strict=True)):
        zeroing.watch.add(depth, force)
        if not asked and depth > 1.5:
            said = zeroing.find_surface(forced=False)
            assert "the tool presses with" in said
            assert "lift it free of contact, and press again" in said
            asked = k
        if asked and k < asked + 200:
            assert zeroing.waits_for_lift
            assert zeroing.feels.endswith("lift it free of contact")
        if zeroing.active and (found := zeroing.add(depth, force)) is not None:
            break
    assert found is not None
    assert found.displacement_mm == pytest.approx(0.3, abs=0.05)
    assert found.force_n == pytest.approx(0.0, abs=0.005)
    assert not zeroing.waits_for_lift


def test_a_search_that_waits_gives_way_and_may_be_forced():
    zeroing = Zeroing()
    for k in range(2000):
        zeroing.watch.add(0.002 * k - 1.0, max(0.0, 0.01 * (k - 500)))
    zeroing.find_surface(forced=False)
    assert zeroing.waits_for_lift
    zeroing.tare(100, 0.0, forced=True)
    assert not zeroing.waits_for_lift
    assert feed(zeroing, [1.0] * 100).samples == 100
    zeroing.find_surface(forced=False)
    zeroing.find_surface(forced=True)
    assert not zeroing.waits_for_lift
    zeroing.cancel()
    zeroing.find_surface(forced=False)
    assert zeroing.cancel() == "find_surface"
    assert not zeroing.waits_for_lift
