"""A search for the surface that finds none says what was felt, and where it looked."""

import pytest

from hc_bringup.zeroing_command import why_none
from hc_estimator.stream.surface import PRESSES, SurfaceFinder

FREE = "free of contact: +0.01 N from its zero, noise 0.05 N; press with 5 N at least"
WEAK = "presses with 1.2 N; 5 N are enough"
ALONG = {"frame": "sensor", "normal": [0.0, 0.0, 1.0]}
SURFACE = {"frame": "surface", "normal": [1.0, 0.0, 0.0]}


def test_what_it_feels_is_told() -> None:
    """Regression: "no zeros were found within 5 s; the estimator goes on looking", and no why."""
    assert why_none([FREE, FREE], ALONG) == [f"it feels now: {FREE}"]
    assert why_none([WEAK], SURFACE) == [f"it feels now: {WEAK}"]


def test_a_press_that_was_too_weak_is_told_after_it_has_ended() -> None:
    assert why_none([FREE, WEAK, FREE], {}) == [
        f"in its last press it felt: {WEAK}",
        f"it feels now: {FREE}",
    ]


@pytest.mark.parametrize("said", [[FREE], []])
def test_a_normal_across_the_press_is_named_where_no_press_was_seen(said: list[str]) -> None:
    assert "input.contact.normal (1, 0, 0)" in why_none(said, SURFACE)[-1]


def test_the_estimator_begins_its_words_of_a_press_so() -> None:
    finder = SurfaceFinder()
    for i in range(200):
        finder.add(0.0, 0.001 * (-1) ** i)
    assert not finder.feels.startswith(PRESSES)
    finder.add(0.1, 0.05)
    assert finder.feels.startswith(PRESSES)
