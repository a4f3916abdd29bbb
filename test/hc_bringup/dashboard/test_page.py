"""The page in a real browser, fed by a server without ROS: what it shows, and what it survives."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hc_bringup.dashboard.columns import INDEX
from hc_bringup.dashboard.digest import Digest
from hc_bringup.dashboard.palpation import MAP_COLUMNS
from hc_bringup.zero_effect import ZeroEffect

Make = Callable[..., Any]

pytestmark = [pytest.mark.timeout(180), pytest.mark.process]


def feed(served: Any, table: Any, stamps: Any, digest: Digest | None = None) -> Any:
    """Show estimates; returns the rows that the page gets."""
    digest = digest or Digest()
    rows = np.concatenate([digest.add(table, stamps, estimates=True), digest.flush()])
    served.server.publish_rows(digest.epoch, rows)
    return rows


def opened(page: Any, served: Any, make_status: Make, **fields: Any) -> None:
    """Open the page and wait until it is connected."""
    page.open(served.address)
    page.wait_for("HC.app && HC.app.state === 'connected'")
    served.server.publish_text("status", make_status(**fields))


def test_values_are_those_of_the_estimates(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    served = serve()
    table = make_estimates(3000)
    rows = feed(served, table, make_stamps(table))
    opened(page, served, make_status)
    page.wait_for(f"HC.app.store.count === {len(rows)}")
    names = ["K", "B_std", "force", "force_min", "predicted", "nis_sum", "hypothesis", "time"]
    shown = page.run(
        "return arguments[0].map((n) => Array.from({length: HC.app.store.count}, "
        "(_, row) => HC.app.store.at(row, n)))",
        names,
    )
    for name, values in zip(names, shown, strict=True):
        np.testing.assert_array_equal(values, rows[:, INDEX[name]], err_msg=name)
    # What is drawn is what arrived, and what is written is the last of it.
    drawn = page.wait_for("HC.app.parameters[0].chart.plot.data[3].at(-1)")
    assert drawn == table["stiffness"][-1]
    deviation = 2 * table["stiffness_std"][-1]
    page.wait_for("document.querySelector('#parameter-K .value').textContent !== '–'")
    value, written = page.text("#parameter-K .value").split(" ± ")
    assert float(value) == pytest.approx(table["stiffness"][-1], abs=0.01)
    assert float(written) == pytest.approx(deviation, abs=0.05)
    assert "#token" not in page.driver.current_url
    assert page.complaints() == []


def test_the_lump_is_found_and_said(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    served = serve()
    table = make_estimates(100)
    table["model_mismatch"] = False
    feed(served, table, make_stamps(table))
    cells = np.zeros((80, len(MAP_COLUMNS)))
    place = {name: index for index, name in enumerate(MAP_COLUMNS)}
    cells[:, place["x"]] = np.arange(80) * 0.5 + 0.25
    cells[:, place["count"]] = 5.0
    stiffness = 0.2 + 0.4 * np.exp(-(((cells[:, 0] - 20.0) / 4.0) ** 2))
    cells[:, place["ln_K"]] = np.log(stiffness)
    cells[:, place["n"]] = 1.6
    cells[:, place["var_ln_K"]] = 1e-4
    cells[:, place["deepest"]] = 4.0
    served.server.publish_map(0, 0.5, cells)
    opened(page, served, make_status)
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


def test_a_lump_that_was_not_passed_has_no_place_yet(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    """Regression: half way up the flank, "a hard spot at 21.0 mm" of a lump at 15 mm."""
    served = serve()
    table = make_estimates(100)
    table["model_mismatch"] = False
    feed(served, table, make_stamps(table))
    place = {name: index for index, name in enumerate(MAP_COLUMNS)}
    cells = np.zeros((40, len(MAP_COLUMNS)))
    cells[:, place["x"]] = np.arange(40) * 0.5 + 0.25
    cells[:, place["count"]] = 5.0
    cells[:, place["ln_K"]] = np.log(0.2 + 0.4 * np.exp(-(((cells[:, 0] - 22.0) / 4.0) ** 2)))
    cells[:, place["n"]] = 1.6
    cells[:, place["var_ln_K"]] = 1e-4
    cells[:, place["deepest"]] = 4.0
    served.server.publish_map(0, 0.5, cells)
    opened(page, served, make_status)
    page.wait_for("HC.app.map && HC.app.map.kind === 'line'")
    page.wait(lambda: page.text("#headline").startswith("Harder up to 19.8 mm"), "the words")
    assert page.complaints() == []


def test_says_when_data_stop_and_comes_back(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    served = serve()
    table = make_estimates(500)
    digest = Digest()
    feed(served, table, make_stamps(table), digest)
    opened(page, served, make_status)
    page.wait(lambda: page.text("#state") == "in contact" or page.words()["state"], "a state")
    silent_from = time.monotonic()
    served.server.publish_text("status", make_status(silent_s=0.9))
    page.wait(lambda: page.text("#state") == "stopped", "stopped", 2.0)
    assert time.monotonic() - silent_from < 2.0
    assert "no estimates for" in page.text("#banner")
    estimator = {"level": 3, "age_s": 0.1, "message": "no message on ft/wrench", "values": {}}
    silent = make_status(silent_s=1.5, nodes={"estimator": estimator})
    served.server.publish_text("status", silent)
    page.wait(lambda: "says: no message on ft/wrench" in page.text("#banner"), "the reason")
    assert page.text("#headline").startswith("Last heard:")
    later = make_estimates(500, first=500)
    feed(served, later, make_stamps(later), digest)
    served.server.publish_text("status", make_status(silent_s=0.0))
    page.wait(lambda: page.text("#state") != "stopped", "going on", 2.0)


def test_a_chart_out_of_sight_catches_up_when_data_have_stopped(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    served = serve()
    page.resize(1300, 640)  # the time line is far below
    page.open(served.address)
    page.wait_for("HC.app && HC.app.state === 'connected'")
    served.server.publish_text("status", make_status())
    table = make_estimates(3000)
    feed(served, table, make_stamps(table), Digest())
    page.wait_for("HC.app.parameters[0].chart.plot.data[0].length > 100 && !HC.app.changed")
    time.sleep(0.3)  # whatever is still to be drawn is drawn
    assert page.run("return HC.app.timeline.view.end") == 1  # nobody saw it: it was not drawn
    page.run("document.getElementById('timeline').scrollIntoView()")
    page.wait_for("HC.app.timeline.view.end > 2.9", 3.0)


def test_a_robot_that_was_not_tared_is_told_so_on_top(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    """Regression: 199 mm off and with a sign that is wrong, "in the air ... press and move"."""
    served = serve()
    table = make_estimates(500)
    table["contact"] = False
    table["displacement"] = -0.199
    table["stiffness_identifiability"] = 0.0
    feed(served, table, make_stamps(table), Digest())
    said = "it reads a push as a pull; turn its sign (force.sign)"
    node = {"level": 1, "message": said, "hardware": "", "values": {}, "age_s": 0.2}
    opened(page, served, make_status, tip=False, nodes={"estimator": node})
    # Estimates and what the nodes say come by ways of their own.
    page.wait_for("document.getElementById('headline').textContent.includes('was nothing tared')")
    page.wait_for("document.getElementById('headline').textContent.includes('a push as a pull')")
    headline = page.text("#headline")
    assert "-199 mm" in headline
    assert said in headline
    assert "in the air" not in headline


def publish_contact(served: Any, parameters: list[float], peak_depth: float) -> None:
    """The first contact has ended, with K, B, n, p and its largest depth [mm]."""
    contact = {
        "number": 1,
        "start": 0.0,
        "end": 1.0,
        "parameters": parameters,
        "std": [0.01, 0.001, 0.02, 0.02],
        "stiffness_exponent_covariance": 0.0,
        "peak_depth": peak_depth,
    }
    served.server.publish_text("contacts", {"items": [contact]})


def test_without_a_position_the_map_gives_its_room_away(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    """A robot that tells no position, in its first contact: no empty chart on top of the page."""
    served = serve()
    table = make_estimates(500)
    feed(served, table, make_stamps(table), Digest())
    opened(page, served, make_status, tip=False)
    page.wait_for("document.getElementById('map').hidden")
    publish_contact(served, [0.2, 0.01, 1.6, 1.0], peak_depth=3.0)
    page.wait_for("!document.getElementById('map').hidden")
    assert "over the contacts" in page.text("#map .note")


def test_presses_at_one_place_are_no_map(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    """Regression: a robot that presses at x = 400 mm saw one block in an empty chart, as a map."""
    served = serve()
    table = make_estimates(500)
    feed(served, table, make_stamps(table), Digest())
    place = {name: i for i, name in enumerate(MAP_COLUMNS)}
    cells = np.zeros((2, len(MAP_COLUMNS)))
    cells[:, place["x"]] = [400.0, 400.5]
    cells[:, place["ln_K"]] = np.log(0.7)
    cells[:, place["n"]] = 1.4
    cells[:, place["var_ln_K"]] = 1e-4
    cells[:, place["deepest"]] = 4.0
    served.server.publish_map(0, 0.5, cells[:1])
    opened(page, served, make_status)
    page.wait_for("HC.app.map && HC.app.map.kind === 'line'")  # no contact has ended yet
    publish_contact(served, [0.7, 0.01, 1.4, 1.0], peak_depth=4.0)
    page.wait_for("HC.app.map.kind === 'contacts'")
    assert "at one place" in page.text("#map .note")
    served.server.publish_map(0, 0.5, cells)  # the neighbour is the same place
    page.wait_for("HC.app.map.cells.length === 2 && HC.app.map.kind === 'contacts'")
    cells[1, place["x"]] = 402.0
    served.server.publish_map(0, 0.5, cells)
    page.wait_for("HC.app.map.kind === 'line'")
    assert page.complaints() == []


def test_places_far_apart_show_their_value_and_neighbours_a_line(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    """Regression: of three places pressed one after another only pale boxes were to be seen."""
    served = serve()
    table = make_estimates(500)
    feed(served, table, make_stamps(table), Digest())
    place = {name: i for i, name in enumerate(MAP_COLUMNS)}
    cells = np.zeros((5, len(MAP_COLUMNS)))
    cells[:, place["x"]] = [450.0, 462.0, 474.0, 486.0, 486.5]
    cells[:, place["ln_K"]] = np.log([0.3, 0.9, 0.15, 0.5, 0.5])
    cells[:, place["n"]] = 1.5
    cells[:, place["var_ln_K"]] = 1e-2
    cells[:, place["deepest"]] = 4.0
    served.server.publish_map(0, 0.5, cells)
    opened(page, served, make_status)
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


def test_an_error_of_the_estimator_stands_on_top_while_it_runs(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    """Regression: of two robots on one topic only a line at the foot of the page knew."""
    served = serve()
    table = make_estimates(500)
    feed(served, table, make_stamps(table), Digest())
    said = "2 publishers on /wrench (/a, /b): follows the one that was first"
    node = {"level": 2, "message": said, "hardware": "", "values": {}, "age_s": 0.2}
    opened(page, served, make_status, silent_s=0.0, nodes={"estimator": node})
    page.wait(lambda: said in page.text("#banner"), "the banner")
    assert page.run("return document.getElementById('banner').dataset.level") == "bad"
    assert page.text("#state") != "stopped"
    served.server.publish_text(
        "status", make_status(silent_s=0.0, nodes={"estimator": node | {"level": 1}})
    )
    page.wait_for("document.getElementById('banner').hidden")  # a warning has its line below


def test_what_zeros_that_are_off_would_do_stands_below_the_parameters(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    served = serve()
    table = make_estimates(100)
    feed(served, table, make_stamps(table))
    opened(page, served, make_status)
    page.wait_for("document.querySelector('#parameters .zeros')?.hidden")
    said = ZeroEffect(0.123, -0.045).sentence
    served.server.publish_text("status", make_status(zero_effect=said))
    page.wait(lambda: page.text("#parameters .zeros") == said, "what zeros would do")
    served.server.publish_text("status", make_status())
    page.wait_for("document.querySelector('#parameters .zeros').hidden")
    assert page.complaints() == []


def test_reconnects_and_fills_the_gap(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    served = serve()
    digest = Digest()
    table = make_estimates(1000)
    rows = len(feed(served, table, make_stamps(table), digest))
    opened(page, served, make_status)
    page.wait_for(f"HC.app.store.count === {rows}")
    page.run("HC.app.connection.socket.close()")
    page.wait(lambda: page.text("#state") == "disconnected", "disconnected", 3.0)
    assert "what you see is old" in page.text("#banner")
    later = make_estimates(1000, first=1000)
    rows += len(feed(served, later, make_stamps(later), digest))
    page.wait_for(f"HC.app.store.count === {rows}")
    assert page.run("return HC.app.store.first") == 0
    assert page.run("return HC.app.state") == "connected"


def test_a_dashboard_that_stalls_and_goes_on_is_connected(
    page: Any, serve: Make, make_status: Make
) -> None:
    """Regression: after a stall of two to six seconds the page said "Not connected" for good."""
    served = serve()
    opened(page, served, make_status)
    page.wait(lambda: "does not answer" in page.text("#banner"), "that nothing comes", 5.0)
    served.server.publish_text("status", make_status())
    page.wait_for("HC.app.state === 'connected'", 1.0)
    page.wait(lambda: "Not connected" not in page.text("#banner"), "that it goes on", 1.0)


def test_another_epoch_clears_the_page(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    served = serve()
    digest = Digest()
    table = make_estimates(1000)
    feed(served, table, make_stamps(table), digest)
    opened(page, served, make_status)
    page.wait_for("HC.app.store.count > 0")
    again = make_estimates(200)
    rows = feed(served, again, make_stamps(again) - 10**12, digest)
    page.wait_for("HC.app.store.epoch === 1")
    page.wait_for(f"HC.app.store.count === {len(rows)}")


def test_names_from_outside_stay_text(page: Any, serve: Make, make_status: Make) -> None:
    """What comes from topics is shown as text, whatever it contains."""
    served = serve()
    evil = "<img src=x onerror=document.title='caught'>"
    node = {"level": 1, "message": evil, "hardware": evil, "values": {}, "age_s": 0.0}
    opened(page, served, make_status, nodes={evil: node})
    event = {"time": 1.7e9, "kind": 64, "sequence": 1, "reason": evil}
    served.server.publish_text("events", {"items": [event]})
    page.wait(lambda: evil in page.text("#timeline ol"), "the event")
    page.wait(lambda: evil in page.text("#health tbody"), "the node")
    assert page.run("return document.querySelectorAll('main img').length") == 0
    assert page.driver.title != "caught"


def test_narrow_page_has_no_sideways_scroll(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    served = serve()
    table = make_estimates(1000)
    page.resize(360, 700)
    feed(served, table, make_stamps(table))
    opened(page, served, make_status)
    page.wait_for("HC.app.store && HC.app.store.count > 0")
    page.run("document.getElementById('open-controls').click()")
    for part in ("document.documentElement", "document.getElementById('controls')"):
        wide = page.run(f"return [{part}.scrollWidth, {part}.clientWidth]")
        assert wide[0] <= wide[1], part
    outside = page.run(
        "return [...document.querySelectorAll('main *')].filter((e) => "
        "!e.closest('.chart') && e.getBoundingClientRect().right > innerWidth + 1)"
        ".map((e) => e.className || e.tagName)"
    )
    assert outside == []


@pytest.mark.slow
def test_memory_is_flat_over_an_hour(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> None:
    """An hour of rows in a few seconds: what the page keeps does not grow after the first part."""
    served = serve()
    opened(page, served, make_status)
    table = make_estimates(12_000)
    digest = Digest()
    one = np.concatenate([digest.add(table, make_stamps(table), estimates=True), digest.flush()])
    sizes = []
    sent = 0
    for _minutes in range(6):
        for number in range(50):  # 50 times 12 s
            rows = one.copy()
            rows[:, INDEX["time"]] += 0.02 * sent
            rows[:, INDEX["sequence"]] += 20 * sent
            served.server.publish_rows(0, rows)
            sent += len(rows)
            if number % 5 == 4:
                page.wait_for(f"HC.app.store.count === {sent}")
        page.run("gc()")
        sizes.append(page.send("Runtime.getHeapUsage")["usedSize"] / 1e6)
        assert page.run("return HC.app.store.count - HC.app.store.first") <= 30_000
    assert sent == 180_000
    assert sizes[-1] - sizes[1] < 3.0, sizes


def test_every_kind_of_event_has_a_name(page: Any, serve: Make, make_status: Make) -> None:
    """Regression: a tare that was refused was "event 18"."""
    from hc_msgs.msg import EstimatorEvent

    served = serve()
    served.server.publish_text("status", make_status())
    page.open(served.address)
    page.wait_for("window.HC && HC.EVENTS")
    constants = type(EstimatorEvent)._Metaclass_EstimatorEvent__constants
    kinds = [value for value in constants.values() if value]
    assert len(kinds) > 18
    names = page.run("return arguments[0].map(HC.eventName)", kinds)
    assert not [name for name in names if name.startswith("event ")]
