"""Pictures of the accuracy experiments leave nothing out unsaid."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from hc_evaluation.accuracy import pictures
from hc_sim_rig.picture_style import say_cut


@pytest.mark.parametrize(("value", "marker"), [(31.4, ">"), (0.5, "<")])
def test_a_dot_beyond_the_frame_is_an_arrow_with_its_value(value: float, marker: str) -> None:
    axis = Figure().subplots()
    pictures._dots(axis, [2.0, value], np.arange(2), (1.2, 2.8))
    arrow, dots = axis.get_lines()
    assert (arrow.get_marker(), arrow.get_ydata()[0]) == (marker, 1)
    assert [text.get_text() for text in axis.texts] == [f"{value:.3g}"]
    np.testing.assert_array_equal(dots.get_xdata(), [2.0, np.nan])
    assert axis.get_xlim() == (1.2, 2.8)


def test_without_one_there_are_only_dots() -> None:
    axis = Figure().subplots()
    pictures._dots(axis, [2.0, 2.8], np.arange(2), (1.2, 2.8))
    (dots,) = axis.get_lines()
    np.testing.assert_array_equal(dots.get_xdata(), [2.0, 2.8])
    assert not axis.texts


@pytest.mark.parametrize(
    ("beyond", "said"),
    [
        ([0], "up to 5 at 0.0 s"),
        ([0, 1], "up to 5 at 0.0 s"),
        ([30, 600], "up to 5 between 0.3 s and 6.0 s"),
    ],
)
def test_when_a_curve_leaves_its_frame_is_said(beyond: list[int], said: str) -> None:
    """Regression: of a first guess "up to 1 within 0.0 to 0.0 s"."""
    axis = Figure().subplots()
    value = np.ones(1000)
    value[beyond] = 5.0
    pictures._say_beyond(axis, 0.01 * np.arange(1000.0), value, 2.0)
    assert [text.get_text() for text in axis.texts] == [said]


@pytest.mark.parametrize(("highest", "said"), [(0.9, []), (1.1, ["cut curves go on"])])
@pytest.mark.parametrize("drawn", ["curve", "band"])
def test_a_curve_or_a_band_that_leaves_its_frame_is_said(
    drawn: str, highest: float, said: list[str]
) -> None:
    axis = Figure().subplots()
    if drawn == "curve":
        axis.plot([0.0, 1.0], [0.5, highest])
    else:
        axis.fill_between([0.0, 1.0], [0.2, 0.2], [0.5, highest])
    axis.set_ylim(0.0, 1.0)
    say_cut(axis)
    assert [text.get_text() for text in axis.texts] == said
