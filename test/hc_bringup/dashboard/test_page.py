"""The page in a real browser, fed by a server without ROS: what it shows, and what it survives."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hc_bringup.dashboard.columns import INDEX
from hc_bringup.dashboard.digest import Digest
from hc_bringup.zero_effect import ZeroEffect

Make = Callable[..., Any]

pytestmark = [pytest.mark.timeout(180), pytest.mark.process]


def test_values_are_those_of_the_estimates(page: Any, live: Any, make_estimates: Make) -> None:
    table = make_estimates(3000)
    rows = live.feed(table)
    live.open()
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


def test_a_page_that_is_opened_after_the_samples_have_stopped_says_so(page: Any, live: Any) -> None:
    """Regression: it asked whether a rig was running, beside an estimator that knew better."""
    said = "no usable sample for 19 s: nobody publishes indenter/sample"
    node = {"level": 2, "age_s": 0.1, "message": said, "values": {}}
    live.open(silent_s=None, estimates=0, nodes={"estimator": node})
    page.wait_for("document.querySelector('#state').textContent === 'no samples'")
    assert page.text("#banner") == (
        f"No samples since this page was opened. The estimator says: {said}."
    )
    assert page.text("#headline") == "Waiting for samples."


def test_the_page_of_a_namespace_says_so(page: Any, live: Any) -> None:
    """Regression: of two arms each page was called "hc", with the buttons of its own arm."""
    live.open()
    page.wait_for("HC.app.store")
    assert page.text("h1") == "hc"
    live.backend.space = "right"
    live.open()
    page.wait_for("document.querySelector('h1').textContent === 'hc right'")
    assert page.driver.title == "hc right: soft tissue, live"


def test_an_estimator_that_was_stopped_is_named_where_estimates_stop(
    page: Any, live: Any, make_estimates: Make
) -> None:
    """Regression: "Stopped: no estimates for 5 s." and no word of why."""
    table = make_estimates(500)
    live.feed(table)
    node = {"level": 0, "age_s": 5.2, "message": "estimating", "values": {}}
    live.open(silent_s=5.0, nodes={"estimator": node})
    page.wait_for("document.querySelector('#state').textContent === 'stopped'")
    assert page.text("#banner").endswith(
        "The estimator has said nothing for 5 s: it was stopped, or has ended."
    )


def test_labels_with_many_digits_are_not_cut_off(
    page: Any, live: Any, make_estimates: Make
) -> None:
    """Regression: of 0.01204 beside B the first digit lay outside of the picture."""
    table = make_estimates(3000)
    table["damping"] = 0.012 + 2e-5 * np.sin(np.arange(3000) / 300)
    table["damping_std"] = 1e-5
    live.feed(table)
    live.open()
    page.wait_for("HC.app.parameters[1].chart.plot.axes[1]._values?.some((v) => v.length > 6)")
    room = page.run(
        "const a = HC.app.parameters[1].chart.plot.axes[1];"
        "const c = document.createElement('canvas').getContext('2d');"
        "c.font = '11px system-ui, sans-serif';"
        "return a._size - 7 - Math.max(...a._values.map((v) => c.measureText(v).width))"
    )
    assert room >= 0


def test_says_when_data_stop_and_comes_back(page: Any, live: Any, make_estimates: Make) -> None:
    table = make_estimates(500)
    live.feed(table)
    live.open()
    page.wait(lambda: page.text("#state") == "in contact" or page.words()["state"], "a state")
    silent_from = time.monotonic()
    live.say(silent_s=0.9)
    page.wait(lambda: page.text("#state") == "stopped", "stopped", 2.0)
    assert time.monotonic() - silent_from < 2.0
    assert "no estimates for" in page.text("#banner")
    estimator = {"level": 3, "age_s": 0.1, "message": "no message on ft/wrench", "values": {}}
    live.say(silent_s=1.5, nodes={"estimator": estimator})
    page.wait(lambda: "says: no message on ft/wrench" in page.text("#banner"), "the reason")
    assert page.text("#headline").startswith("Last heard:")
    later = make_estimates(500, first=500)
    live.feed(later)
    live.say(silent_s=0.0)
    page.wait(lambda: page.text("#state") != "stopped", "going on", 2.0)


def test_a_slow_connection_is_not_told_as_silence(
    page: Any, live: Any, make_estimates: Make
) -> None:
    """Regression: "Stopped: no estimates for 9 s." behind a link of 4 kB/s, while they ran."""
    live.feed(make_estimates(100))
    live.open(silent_s=0.02)
    page.wait(lambda: page.text("#state") == "in contact", "a state")
    seen = set()
    for part in range(1, 11):  # rows trickle in, and no status between them
        live.feed(make_estimates(100, first=100 * part))
        time.sleep(0.25)
        seen.add(page.text("#state"))
    assert "slow connection" in seen
    assert not seen & {"stopped", "disconnected"}
    assert page.text("#banner").startswith("The connection is slow: what you see is old, by ")
    assert page.text("#headline").startswith("Last heard:")
    live.say(silent_s=0.02)
    page.wait(lambda: page.text("#state") == "in contact", "as before", 2.0)
    live.say(silent_s=3.0)  # what a status says of a silence is told as one
    page.wait(lambda: page.text("#state") == "stopped", "stopped", 2.0)


def test_a_chart_out_of_sight_catches_up_when_data_have_stopped(
    page: Any, live: Any, make_estimates: Make
) -> None:
    page.resize(1300, 640)  # the time line is far below
    live.open()
    table = make_estimates(3000)
    live.feed(table)
    page.wait_for("HC.app.parameters[0].chart.plot.data[0].length > 100 && !HC.app.changed")
    time.sleep(0.3)  # whatever is still to be drawn is drawn
    assert page.run("return HC.app.timeline.view.end") == 1  # nobody saw it: it was not drawn
    page.run("document.getElementById('timeline').scrollIntoView()")
    page.wait_for("HC.app.timeline.view.end > 2.9", 3.0)


def test_a_robot_that_was_not_tared_is_told_so_on_top(
    page: Any, live: Any, make_estimates: Make
) -> None:
    """Regression: 199 mm off and with a sign that is wrong, "in the air ... press and move"."""
    table = make_estimates(500)
    table["contact"] = False
    table["displacement"] = -0.199
    table["stiffness_identifiability"] = 0.0
    live.feed(table)
    said = "it reads a push as a pull; turn its sign (force.sign)"
    node = {"level": 1, "message": said, "hardware": "", "values": {}, "age_s": 0.2}
    live.open(tip=False, nodes={"estimator": node})
    # Estimates and what the nodes say come by ways of their own.
    page.wait_for("document.getElementById('headline').textContent.includes('was nothing tared')")
    page.wait_for("document.getElementById('headline').textContent.includes('a push as a pull')")
    headline = page.text("#headline")
    assert "-199 mm" in headline
    assert said in headline
    assert "in the air" not in headline


def test_an_error_of_the_estimator_stands_on_top_while_it_runs(
    page: Any, live: Any, make_estimates: Make
) -> None:
    """Regression: of two robots on one topic only a line at the foot of the page knew."""
    table = make_estimates(500)
    live.feed(table)
    said = "2 publishers on /wrench (/a, /b): follows the one that was first"
    node = {"level": 2, "message": said, "hardware": "", "values": {}, "age_s": 0.2}
    live.open(silent_s=0.0, nodes={"estimator": node})
    page.wait(lambda: said in page.text("#banner"), "the banner")
    assert page.run("return document.getElementById('banner').dataset.level") == "bad"
    assert page.text("#state") != "stopped"
    live.say(silent_s=0.0, nodes={"estimator": node | {"level": 1}})
    page.wait_for("document.getElementById('banner').hidden")  # a warning has its line below


def test_a_recorder_that_cannot_write_is_said_on_top(
    page: Any, live: Any, make_estimates: Make
) -> None:
    """Regression: of a disk that was full only a line at the foot of the page knew."""
    live.feed(make_estimates(500))
    full = "cannot write bags/a: No space left on device"
    recorder = {"level": 2, "message": full, "hardware": "", "values": {}, "age_s": 0.2}
    estimator = recorder | {"message": "two publishers"}
    live.open(silent_s=0.0, nodes={"recorder": recorder})
    page.wait(lambda: page.text("#banner") == f"The recorder says: {full}.", "the banner")
    assert page.run("return document.getElementById('banner').dataset.level") == "bad"
    assert page.text("#state") in ("in contact", "law does not fit")
    live.say(silent_s=0.0, nodes={"recorder": recorder, "estimator": estimator})
    both = f"The estimator says: two publishers. The recorder says: {full}."
    page.wait(lambda: page.text("#banner") == both, "both")
    page.press(" ")  # frozen
    page.wait(lambda: page.text("#state") == "frozen", "frozen")
    assert page.text("#banner") == both
    page.press(" ")
    live.say(silent_s=0.0, nodes={"recorder": recorder | {"age_s": 9.0}})
    page.wait_for("document.getElementById('banner').hidden")  # gone: what it said is old


def test_what_zeros_that_are_off_would_do_stands_below_the_parameters(
    page: Any, live: Any, make_estimates: Make
) -> None:
    table = make_estimates(100)
    live.feed(table)
    live.open()
    page.wait_for("document.querySelector('#parameters .zeros')?.hidden")
    said = ZeroEffect(0.123, -0.045).sentence
    live.say(zero_effect=said)
    page.wait(lambda: page.text("#parameters .zeros") == said, "what zeros would do")
    live.say()
    page.wait_for("document.querySelector('#parameters .zeros').hidden")
    assert page.complaints() == []


def test_reconnects_and_fills_the_gap(page: Any, live: Any, make_estimates: Make) -> None:
    table = make_estimates(1000)
    rows = len(live.feed(table))
    live.open()
    page.wait_for(f"HC.app.store.count === {rows}")
    page.run("HC.app.connection.socket.close()")
    page.wait(lambda: page.text("#state") == "disconnected", "disconnected", 3.0)
    assert "what you see is old" in page.text("#banner")
    later = make_estimates(1000, first=1000)
    rows += len(live.feed(later))
    page.wait_for(f"HC.app.store.count === {rows}")
    assert page.run("return HC.app.store.first") == 0
    assert page.run("return HC.app.state") == "connected"


def test_a_dashboard_that_stalls_and_goes_on_is_connected(page: Any, live: Any) -> None:
    """Regression: after a stall of two to six seconds the page said "Not connected" for good."""
    live.open()
    page.wait(lambda: "does not answer" in page.text("#banner"), "that nothing comes", 5.0)
    live.say()
    page.wait_for("HC.app.state === 'connected'", 1.0)
    page.wait(lambda: "Not connected" not in page.text("#banner"), "that it goes on", 1.0)


def test_another_epoch_clears_the_page(page: Any, live: Any, make_estimates: Make) -> None:
    table = make_estimates(1000)
    live.feed(table)
    live.open()
    page.wait_for("HC.app.store.count > 0")
    again = make_estimates(200)
    rows = live.feed(again, earlier_ns=10**12)
    page.wait_for("HC.app.store.epoch === 1")
    page.wait_for(f"HC.app.store.count === {len(rows)}")


def test_names_from_outside_stay_text(page: Any, live: Any) -> None:
    """What comes from topics is shown as text, whatever it contains."""
    evil = "<img src=x onerror=document.title='caught'>"
    node = {"level": 1, "message": evil, "hardware": evil, "values": {}, "age_s": 0.0}
    live.open(nodes={evil: node})
    event = {"time": 1.7e9, "kind": 64, "sequence": 1, "reason": evil}
    live.server.publish_text("events", {"items": [event]})
    page.wait(lambda: evil in page.text("#timeline ol"), "the event")
    page.wait(lambda: evil in page.text("#health tbody"), "the node")
    assert page.run("return document.querySelectorAll('main img').length") == 0
    assert page.driver.title != "caught"


def test_narrow_page_has_no_sideways_scroll(page: Any, live: Any, make_estimates: Make) -> None:
    table = make_estimates(1000)
    page.resize(360, 700)
    live.feed(table)
    live.open()
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
    page: Any, live: Any, make_estimates: Make, make_stamps: Make
) -> None:
    """An hour of rows in a few seconds: what the page keeps does not grow after the first part."""
    live.open()
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
            live.server.publish_rows(0, rows)
            sent += len(rows)
            if number % 5 == 4:
                page.wait_for(f"HC.app.store.count === {sent}")
        page.run("gc()")
        sizes.append(page.send("Runtime.getHeapUsage")["usedSize"] / 1e6)
        assert page.run("return HC.app.store.count - HC.app.store.first") <= 30_000
    assert sent == 180_000
    assert sizes[-1] - sizes[1] < 3.0, sizes


def test_every_kind_of_event_has_a_name(page: Any, live: Any) -> None:
    """Regression: a tare that was refused was "event 18"."""
    from hc_msgs.msg import EstimatorEvent

    live.say()
    page.open(live.address)
    page.wait_for("window.HC && HC.EVENTS")
    constants = type(EstimatorEvent)._Metaclass_EstimatorEvent__constants
    kinds = [value for value in constants.values() if value]
    assert len(kinds) > 18
    names = page.run("return arguments[0].map(HC.eventName)", kinds)
    assert not [name for name in names if name.startswith("event ")]


def test_the_lane_of_the_law_has_one_colour(page: Any, live: Any, make_estimates: Make) -> None:
    """Regression: pieces that let the ground through overlapped: stripes, and not the key's."""
    live.feed(make_estimates(4000))
    live.open()
    page.run("document.getElementById('timeline').scrollIntoView()")
    page.wait_for("HC.app.timeline.chart.plot.data[0].length > 50")
    colours = page.run(
        """
        const plot = HC.app.timeline.chart.plot;
        const { top, height } = plot.bbox;
        const [from, to] = [5, -5].map((i) =>
          Math.round(plot.valToPos(plot.data[0].at(i), "x", true)));
        const y = Math.round(top + 0.375 * height);
        const row = plot.ctx.getImageData(from, y, to - from, 1).data;
        return Array.from({length: to - from}, (_, i) => [...row.slice(4 * i, 4 * i + 3)]);
        """
    )
    assert np.ptp(colours, axis=0).max() <= 3


def test_nothing_is_left_empty_beside_force_over_depth(page: Any, live: Any) -> None:
    """Regression: on a tablet half of the row was."""
    page.resize(768, 1000)
    live.open()
    wide = page.run("return document.getElementById('depth').getBoundingClientRect().width")
    assert wide > 700
