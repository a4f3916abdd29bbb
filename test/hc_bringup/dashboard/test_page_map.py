"""The map of the stiffness in a real browser: a lump, single places, and no place at all."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from hc_bringup.dashboard.palpation import MAP_COLUMNS

Make = Callable[..., Any]

pytestmark = [pytest.mark.timeout(180), pytest.mark.process]
PLACE = {name: i for i, name in enumerate(MAP_COLUMNS)}


def map_of(
    x_mm: ArrayLike, stiffness: ArrayLike, exponent: float, variance: float = 1e-4
) -> NDArray[np.float64]:
    """Cells of the map, 4 mm deep, with K and n at places; the variance is that of ln K."""
    cells = np.zeros((len(np.asarray(x_mm)), len(MAP_COLUMNS)))
    cells[:, PLACE["x"]] = x_mm
    cells[:, PLACE["count"]] = 5.0
    cells[:, PLACE["ln_K"]] = np.log(stiffness)
    cells[:, PLACE["n"]] = exponent
    cells[:, PLACE["var_ln_K"]] = variance
    cells[:, PLACE["deepest"]] = 4.0
    return cells


def contact_of(parameters: list[float], peak_depth: float, number: int = 1) -> dict[str, Any]:
    """A contact that has ended, with K, B, n, p and its largest depth [mm]."""
    return {
        "number": number,
        "start": 0.0,
        "end": 1.0,
        "parameters": parameters,
        "std": [0.01, 0.001, 0.02, 0.02],
        "stiffness_exponent_covariance": 0.0,
        "peak_depth": peak_depth,
    }


def publish_contact(live: Any, parameters: list[float], peak_depth: float) -> None:
    """The first contact has ended."""
    live.server.publish_text("contacts", {"items": [contact_of(parameters, peak_depth)]})


def test_the_lump_is_found_and_said(page: Any, live: Any, make_estimates: Make) -> None:
    table = make_estimates(100)
    table["model_mismatch"] = False
    live.feed(table)
    x_mm = np.arange(80) * 0.5 + 0.25
    stiffness = 0.2 + 0.4 * np.exp(-(((x_mm - 20.0) / 4.0) ** 2))
    live.server.publish_map(0, 0.5, map_of(x_mm, stiffness, 1.6))
    live.open()
    page.wait_for("HC.app.map && HC.app.map.kind === 'line'")
    lump = page.run("return HC.app.map.lump")
    assert lump["x"] == pytest.approx(20.0, abs=0.5)
    assert lump["factor"] == pytest.approx(3.0, abs=0.1)
    # Where it is, how hard, how sure: in the first sentence.
    said = page.wait(
        lambda: (text := page.text("#headline")).startswith("A hard spot at ") and text, "the words"
    )
    assert re.match(r"A hard spot at (19|20)\.\d mm: [23]\.\d ± 0\.\d times as stiff as", said)
    shown = page.run("return HC.app.map.spots[40].value")
    assert shown == pytest.approx(stiffness[40] * 1.6 * 2.0**0.6, rel=1e-9)
    assert page.complaints() == []


@pytest.mark.parametrize("width", [320, 1300])
def test_the_name_of_the_lump_is_not_cut_off(
    page: Any, live: Any, make_estimates: Make, width: int
) -> None:
    """Regression: "hard spot: 3.0 ± 0.1 times a" in a window of 320 pixels."""
    page.resize(width, 900)
    live.feed(make_estimates(100))
    x_mm = np.arange(80) * 0.5 + 0.25
    stiffness = 0.2 + 0.4 * np.exp(-(((x_mm - 20.0) / 4.0) ** 2))
    live.server.publish_map(0, 0.5, map_of(x_mm, stiffness, 1.6))
    live.open()
    page.run(
        """
        const draw = HC.MapPanel.prototype.drawLump;
        HC.MapPanel.prototype.drawLump = function (ctx, px, py, box) {
          const write = ctx.fillText;
          ctx.fillText = function (text, left, line) {
            const end = left + ctx.measureText(text).width;
            window.lumpName = {text, fits: left >= box.left && end <= box.left + box.width};
            write.call(ctx, text, left, line);
          };
          draw.call(this, ctx, px, py, box);
          ctx.fillText = write;
        };
        """
    )
    live.feed(make_estimates(100, first=100))
    live.server.publish_map(0, 0.5, map_of(x_mm, 1.01 * stiffness, 1.6))
    named = page.wait_for("window.lumpName")
    assert re.search(r"3\.\d ± 0\.\d times as stiff$", named["text"])
    assert named["text"].startswith("hard spot: ") == (width > 320)
    assert named["fits"]


def test_a_lump_that_was_not_passed_has_no_place_yet(
    page: Any, live: Any, make_estimates: Make
) -> None:
    """Regression: half way up the flank, "a hard spot at 21.0 mm" of a lump at 15 mm."""
    table = make_estimates(100)
    table["model_mismatch"] = False
    live.feed(table)
    x_mm = np.arange(40) * 0.5 + 0.25
    stiffness = 0.2 + 0.4 * np.exp(-(((x_mm - 22.0) / 4.0) ** 2))
    live.server.publish_map(0, 0.5, map_of(x_mm, stiffness, 1.6))
    live.open()
    page.wait_for("HC.app.map && HC.app.map.kind === 'line'")
    page.wait(lambda: page.text("#headline").startswith("Harder up to 19.8 mm"), "the words")
    assert page.complaints() == []


def test_without_a_position_the_map_gives_its_room_away(
    page: Any, live: Any, make_estimates: Make
) -> None:
    """A robot that tells no position, in its first contact: no empty chart on top of the page."""
    table = make_estimates(500)
    live.feed(table)
    live.open(tip=False)
    page.wait_for("document.getElementById('map').hidden")
    publish_contact(live, [0.2, 0.01, 1.6, 1.0], peak_depth=3.0)
    page.wait_for("!document.getElementById('map').hidden")
    assert "over the contacts" in page.text("#map .note")


def test_presses_at_one_place_are_no_map(page: Any, live: Any, make_estimates: Make) -> None:
    """Regression: a robot that presses at x = 400 mm saw one block in an empty chart, as a map."""
    table = make_estimates(500)
    live.feed(table)
    cells = map_of([400.0, 400.5], 0.7, 1.4)
    live.server.publish_map(0, 0.5, cells[:1])
    live.open()
    page.wait_for("HC.app.map && HC.app.map.kind === 'line'")  # no contact has ended yet
    publish_contact(live, [0.7, 0.01, 1.4, 1.0], peak_depth=4.0)
    page.wait_for("HC.app.map.kind === 'contacts'")
    assert "at one place" in page.text("#map .note")
    live.server.publish_map(0, 0.5, cells)  # the neighbour is the same place
    page.wait_for("HC.app.map.cells.length === 2 && HC.app.map.kind === 'contacts'")
    cells[1, PLACE["x"]] = 402.0
    live.server.publish_map(0, 0.5, cells)
    page.wait_for("HC.app.map.kind === 'line'")
    assert page.complaints() == []


def test_places_far_apart_show_their_value_and_neighbours_a_line(
    page: Any, live: Any, make_estimates: Make
) -> None:
    """Regression: of three places pressed one after another only pale boxes were to be seen."""
    table = make_estimates(500)
    live.feed(table)
    x_mm, stiffness = [450.0, 462.0, 474.0, 486.0, 486.5], [0.3, 0.9, 0.15, 0.5, 0.5]
    live.server.publish_map(0, 0.5, map_of(x_mm, stiffness, 1.5, 1e-2))
    live.open()
    page.wait_for("HC.app.map && HC.app.map.kind === 'line'")
    dots = page.run(
        """const { plot } = HC.app.map.chart, seen = [];
        const arc = plot.ctx.arc;
        plot.ctx.arc = (x, y, ...rest) => { seen.push([x, y]); arc.call(plot.ctx, x, y, ...rest); };
        HC.app.map.draw(plot);
        delete plot.ctx.arc;
        return [seen, HC.app.map.spots.map((spot) =>
          [plot.valToPos(spot.x, "x", true), plot.valToPos(spot.value, "y", true)])];"""
    )
    np.testing.assert_allclose(dots[0], dots[1][:3], atol=0.5)
    assert page.complaints() == []


def test_tissue_that_is_the_same_everywhere_has_one_colour(
    page: Any, live: Any, make_estimates: Make
) -> None:
    """Regression: 0.7400 to 0.7403 N/mm went from the softest colour to the hardest."""
    table = make_estimates(100)
    live.feed(table)
    x_mm = np.arange(0.0, 10.0)
    live.server.publish_map(0, 1.0, map_of(x_mm, 0.35 + 1e-4 * (x_mm % 3), 1.5, variance=1e-7))
    live.open()
    page.wait_for("HC.app.map.spots.length === 10")
    low, high = page.run("return HC.app.map.colours")
    assert high - low == pytest.approx(0.1 * (low + high) / 2)
    shades = page.run(
        "return HC.app.map.spots.map((s) => (s.value - arguments[0]) / arguments[1])",
        low,
        high - low,
    )
    assert max(shades) - min(shades) < 0.02


def test_what_changed_with_the_time_is_no_hard_spot(
    page: Any, live: Any, make_estimates: Make
) -> None:
    """Regression: tissue that became stiffer at one place was "hard spot: 2.0 ± 0.1 times".

    No position was known, so that nobody knows whether it is another place.
    """
    live.feed(make_estimates(500))
    live.open(tip=False)
    stiffness = [0.3] * 5 + [0.6] * 5
    contacts = [contact_of([k, 0.01, 1.5, 1.0], 4.0, i + 1) for i, k in enumerate(stiffness)]
    live.server.publish_text("contacts", {"items": contacts})
    page.wait_for("HC.app.map && HC.app.map.kind === 'contacts' && HC.app.map.lump")
    named = page.run(
        """const { plot } = HC.app.map.chart, seen = [];
        const write = plot.ctx.fillText;
        plot.ctx.fillText = (text, ...rest) => { seen.push(text); };
        HC.app.map.draw(plot);
        delete plot.ctx.fillText;
        return [seen, HC.app.map.lump.x];"""
    )
    assert named[0] == [f"contact {named[1]}: 2.0 ± 0.2 times as stiff"]
    assert page.complaints() == []
