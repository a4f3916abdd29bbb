"""The map of a tactile array: from messages to cells, and from cells to the page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hc_msgs.msg import TactileEstimate
from rclpy.serialization import serialize_message

from hc_bringup.dashboard.palpation import MAP_COLUMNS
from hc_bringup.dashboard.taps import Arrival
from hc_bringup.dashboard.taxels import ARRAY_TYPE, MOST_SHOWN, TaxelMap, arrays_of, chosen_array

PLACE = {name: index for index, name in enumerate(MAP_COLUMNS)}


def arrival(rows: int = 8, columns: int = 8, *, sequence: int = 0, **fields: Any) -> Arrival:
    """An estimate of an array whose taxels all touch, with a lump in row 2, column 5."""
    taxels = rows * columns
    row, column = np.divmod(np.arange(taxels), columns)
    pitch = fields.pop("pitch", 0.002)
    message = TactileEstimate(sequence=sequence, columns=columns, pitch=pitch)
    values = {
        "stiffness": 0.2 + 0.6 * np.exp(-((row - 2) ** 2 + (column - 5) ** 2) / 4.0),
        "damping": 0.008,
        "displacement_exponent": 1.8,
        "velocity_exponent": 1.0,
        "force_measured": 0.5,
        "force_reconstructed": 0.5,
    }
    values |= {f"{name}_std": 0.001 for name in list(values)[:4]}
    for name, value in (values | fields).items():
        setattr(message, name, np.broadcast_to(value, taxels).astype(float).tolist())
    message.contact = np.broadcast_to(fields.get("contact", True), taxels).astype(bool).tolist()
    message.rejected = [0] * taxels
    return Arrival(serialize_message(message), 0)


def test_taxels_stand_where_they_are() -> None:
    taxels = TaxelMap()
    assert taxels.status is None
    assert len(taxels.table()) == 0
    taxels.take([arrival()])
    table = taxels.table()
    assert table.shape == (64, len(MAP_COLUMNS))
    assert taxels.cell_mm == pytest.approx(2.0)
    peak = table[np.argmax(table[:, PLACE["ln_K"]])]
    # Row 2 of 8 is above the middle, column 5 right of it.
    assert (peak[PLACE["x"]], peak[PLACE["y"]]) == (pytest.approx(3.0), pytest.approx(3.0))
    assert np.exp(peak[PLACE["ln_K"]]) == pytest.approx(0.8)
    assert peak[PLACE["var_ln_K"]] == pytest.approx((0.001 / 0.8) ** 2)
    assert taxels.status == {
        "rows": 8,
        "columns": 8,
        "touched": 64,
        "touching": 64,
        "force": pytest.approx(32.0),
        "every": 1,
        "undecodable": 0,
    }


def test_what_let_go_keeps_its_last_estimate_and_what_never_touched_has_none() -> None:
    taxels = TaxelMap()
    left = np.arange(64) % 8 < 4
    taxels.take([arrival(contact=left, stiffness=0.3)])
    assert len(taxels.table()) == 32
    taxels.take([arrival(sequence=1, contact=~left, stiffness=0.9)])
    table = taxels.table()
    stiff = np.exp(table[:, PLACE["ln_K"]])
    np.testing.assert_allclose(stiff, np.where(table[:, PLACE["x"]] < 0, 0.3, 0.9))
    # A sequence that begins anew, or another array, is another touch.
    taxels.take([arrival(sequence=0, contact=left)])
    assert len(taxels.table()) == 32
    taxels.take([arrival(2, 3, sequence=1)])
    assert len(taxels.table()) == 6


def test_what_is_no_array_is_counted_and_left_out() -> None:
    taxels = TaxelMap()
    good = arrival()
    taxels.take([Arrival(b"", 0), Arrival(good.data[:50], 0), good, arrival(columns=0, rows=1)])
    assert taxels.status is not None
    assert taxels.status["undecodable"] == 3
    assert taxels.version == 1
    taxels.take([arrival(sequence=1, stiffness=0.0)])  # held fixed at nothing, say
    assert len(taxels.table()) == 0


@pytest.mark.parametrize("pitch", [0.0, -1.0, np.nan, np.inf, 1e308])
def test_an_array_without_a_size_is_left_out(pitch: float) -> None:
    """Regression: a pitch of 1e308 ended the dashboard."""
    taxels = TaxelMap()
    taxels.take([arrival(), arrival(sequence=1, pitch=pitch)])
    assert taxels.status is not None
    assert taxels.status["undecodable"] == 1
    assert taxels.cell_mm == pytest.approx(2.0)


def test_of_a_great_array_not_every_taxel_is_shown() -> None:
    taxels = TaxelMap()
    taxels.take([arrival(130, 130)])
    assert 1000 < len(taxels.table()) <= MOST_SHOWN
    assert taxels.status is not None
    assert taxels.cell_mm == pytest.approx(2.0 * taxels.status["every"])


@pytest.mark.timeout(180)
@pytest.mark.process
def test_the_page_shows_the_lump_under_the_taxels(
    page: Any, serve: Callable[..., Any], make_status: Callable[..., dict[str, Any]]
) -> None:
    taxels = TaxelMap()
    taxels.take([arrival()])
    served = serve()
    served.server.publish_taxels(taxels.cell_mm, taxels.table())  # before the page: it is greeted
    page.open(served.address)
    page.wait_for("HC.app && HC.app.state === 'connected' && HC.app.taxels")
    assert page.run("return document.getElementById('taxels').hidden")  # until one is told of
    served.server.publish_text("status", make_status(taxels=taxels.status))
    page.wait_for("!document.getElementById('taxels').hidden")
    page.wait_for("HC.app.taxels.kind === 'plane' && HC.app.taxels.spots.length === 64")
    assert page.text("#taxels .figures") == (
        "8 × 8 taxels: 64 touch, 64 have touched; 32.0 N in all."
    )
    lump = page.run("return HC.app.taxels.lump")
    assert (lump["x"], lump["y"]) == (pytest.approx(3.0), pytest.approx(3.0))
    # At 1 mm the stiffness is K n, and without their covariance the deviations add up.
    spot = page.run("return HC.app.taxels.nearest(3, 3)")
    assert spot["value"] == pytest.approx(0.8 * 1.8)
    assert spot["deviation"] / spot["value"] == pytest.approx(0.001 / 0.8 + 0.001 / 1.8)
    # The squares are there to be seen, in the colours of soft and of hard.
    drawn = page.run(
        "const { ctx, valToPos } = HC.app.taxels.chart.plot; const { width, height } = ctx.canvas;"
        "const { data } = ctx.getImageData(0, 0, width, height); const at = (x, y) => {"
        "const [i, j] = [valToPos(y, 'y', true), valToPos(x, 'x', true)].map(Math.round);"
        "const p = 4 * (i * width + j);"
        "return Array.from(data.slice(p, p + 3)); }; return [at(-7, -7), at(3.6, 3.9)]"
    )
    assert sum(abs(a - b) for a, b in zip(*drawn, strict=True)) > 150
    assert page.complaints() == []


def test_the_array_shown_is_that_of_the_namespace_or_the_only_one():
    """Regression: beside an estimator in a namespace an array without one had no map."""
    kinds = {
        "/tactile/estimate": [ARRAY_TYPE],
        "/left/hc/estimate": ["hc_msgs/msg/HuntCrossleyEstimate"],
        "/left/tactile/estimate": [ARRAY_TYPE],
    }
    own = "/left/tactile/estimate"
    assert arrays_of(kinds) == [own, "/tactile/estimate"]
    assert chosen_array(["/tactile/estimate"], own) == "/tactile/estimate"
    assert chosen_array([own, "/tactile/estimate"], own) == own
    assert chosen_array(["/pad/estimate", "/tactile/estimate"], own) == own
    assert chosen_array([], own) == own
