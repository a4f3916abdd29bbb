"""The controls of the page in a real browser: what they ask for, and who may use them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

Make = Callable[..., Any]

pytestmark = [pytest.mark.timeout(180), pytest.mark.process]


def test_controls_ask_and_say_the_answer(page: Any, live: Any) -> None:
    live.open()
    page.press("c")
    page.wait_for("!document.getElementById('controls').hidden")
    page.run("document.querySelector('[data-service=tare]').click()")
    page.wait(lambda: page.text("#message") == "as you say", "the answer")
    asked = {"op": "call", "node": "estimator", "service": "tare"}
    assert any(asked.items() <= request.items() for request in live.backend.requests)
    # A mark carries what was written.
    page.run("document.getElementById('mark-text').value = 'here'")
    page.run("document.querySelector('#mark-form button').click()")
    page.wait(lambda: any(r.get("text") == "here" for r in live.backend.requests), "the mark")


def test_scenarios_of_the_rig_are_offered(page: Any, live: Any) -> None:
    scenario = {
        "name": "scenario",
        "value": "lump",
        "type": "text",
        "about": "what the rig does",
        "read_only": False,
        "suggestions": ["lump", "multisine"],
    }
    answer_all = live.backend.request

    def answer(message: dict[str, Any]) -> Any:
        future = answer_all(message)
        if message.get("node") == "indenter" and message["op"] != "set":
            future = type(future)()
            future.set_result({"ok": True, "message": "", "parameters": [scenario]})
        return future

    live.backend.request = answer
    live.open()
    page.press("c")
    page.wait_for("document.getElementById('rig-scenario')")
    offered = page.run(
        "return [...document.getElementById('rig-scenario').list.options].map((o) => o.value)"
    )
    assert offered == ["lump", "multisine"]
    page.run("document.getElementById('rig-scenario').value = 'multisine'")
    page.run("document.querySelector('#rig-form button').click()")
    wanted = {"op": "set", "node": "indenter", "parameters": {"scenario": "multisine"}}
    page.wait(lambda: any(wanted.items() <= r.items() for r in live.backend.requests), "the change")


def test_read_only_switches_the_controls_off(page: Any, live: Any) -> None:
    live.backend.control = False
    live.open()
    page.press("c")
    page.wait_for("[...document.querySelectorAll('fieldset')].every((set) => set.disabled)")
    assert page.run("return !document.querySelector('.read-only').hidden")


def test_keys(page: Any, live: Any) -> None:
    live.open()
    page.press(" ")
    assert page.run("return HC.app.frozen")
    page.press(" ")
    assert not page.run("return HC.app.frozen")
    page.press("1")
    assert page.run("return HC.app.seconds") == 5
    dark = page.run("return HC.isDark()")
    page.press("t")
    assert page.run("return HC.isDark()") != dark
    page.press("t")
    page.press("?")
    assert page.run("return document.getElementById('keys').open")


def test_controls_that_a_key_opened_leave_the_keys_alone(page: Any, live: Any) -> None:
    """Regression: closed again with c, space pressed their button and opened them anew."""
    live.open()
    page.press("c")
    page.press("c")
    page.press(" ")
    assert page.run("return HC.app.frozen")
    assert page.run("return document.getElementById('controls').hidden")
    page.press(" ")
    page.run("document.getElementById('open-controls').focus()")
    page.run("document.getElementById('open-controls').click()")
    page.run("document.getElementById('close-controls').click()")
    assert page.run("return document.activeElement.id") == "open-controls"


def test_no_figure_leaves_its_card(page: Any, live: Any, make_estimates: Make) -> None:
    """Regression: beside open controls B ± its deviation ran into the card of n."""
    page.resize(1280, 900)
    table = make_estimates(500)
    table["damping"], table["damping_std"] = 0.006010, 0.0000412
    live.feed(table)
    live.open()
    page.press("c")
    page.wait_for("document.querySelector('#parameter-B .value').textContent.includes('±')")
    wide = page.run(
        "return [...document.querySelectorAll('.card .value')].map((value) => "
        "value.getBoundingClientRect().right"
        " - value.closest('.card').getBoundingClientRect().right)"
    )
    assert max(wide) < 0, wide
