"""The page without a mouse and without eyes: names of everything, the keyboard's way through."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from hc_bringup.dashboard.digest import Digest

Make = Callable[..., Any]

pytestmark = [pytest.mark.timeout(180), pytest.mark.process]

NAMED = {"button", "combobox", "ComboBoxMenu", "textbox", "slider", "checkbox", "image", "img"}
NAMED |= {"meter", "region", "link", "toolbar", "listbox", "spinbutton", "complementary"}


@pytest.fixture
def shown(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make, make_status: Make
) -> Any:
    """The page with estimates, its controls open."""
    served = serve()
    digest = Digest()
    table = make_estimates(500)
    rows = digest.add(table, make_stamps(table), estimates=True)
    served.server.publish_rows(digest.epoch, rows)
    page.open(served.address)
    page.wait_for("HC.app && HC.app.state === 'connected' && HC.app.store")
    served.server.publish_text("status", make_status())
    page.wait_for("HC.app.store.count > 0 && HC.app.status")
    return page


def test_everything_has_a_name(shown: Any) -> None:
    """What a screen reader says of the page, as the browser tells it."""
    shown.press("c")
    nodes = shown.send("Accessibility.getFullAXTree")["nodes"]
    told = [
        (node["role"]["value"], node.get("name", {}).get("value", ""))
        for node in nodes
        if not node.get("ignored") and "role" in node
    ]
    nameless = [role for role, name in told if role in NAMED and not name.strip()]
    assert nameless == []
    pictures = {name for role, name in told if role in ("image", "img")}
    wanted = ("Force over depth", "K, stiffness", "What happened", "Is it honest?", "Force [N]")
    for title in wanted:
        assert any(name.startswith(f"chart: {title}") for name in pictures), (title, pictures)
    roles = [role for role, _name in told]
    assert {"main", "banner", "status", "complementary"} <= set(roles)
    # The state is said when it changes; numbers that change twenty times a second are not.
    assert shown.run("return document.getElementById('state').getAttribute('role')") == "status"
    assert shown.run("return document.getElementById('banner').getAttribute('role')") == "alert"
    assert shown.run("return document.getElementById('headline').ariaLive") == "off"


def test_the_keyboard_reaches_everything_and_one_sees_where_it_is(shown: Any) -> None:
    from selenium.webdriver.common.keys import Keys

    shown.press("c")
    focused = """
        const e = document.activeElement;
        const style = getComputedStyle(e);
        const box = e.getBoundingClientRect();
        const name = e.id || e.dataset.service || e.className || e.tagName;
        return {id: e === document.body ? "BODY" : name, width: box.width,
          outline: style.outlineStyle === "none" ? 0 : parseFloat(style.outlineWidth)};
    """
    seen = []
    for _ in range(60):
        shown.press(Keys.TAB)
        now = shown.run(focused)
        if seen and now["id"] == seen[0]["id"]:
            break
        seen.append(now)
    reached = [entry["id"] for entry in seen]
    wanted = ["skip", "window", "freeze", "open-controls", "theme", "help", "close-controls"]
    wanted += ["record", "mark-text", "reset", "tare", "find_surface", "parameter-name"]
    assert [name for name in wanted if name not in reached] == [], reached
    for entry in seen:
        if entry["id"] not in ("BODY", "main"):
            assert entry["outline"] >= 2 or entry["width"] == 0, entry
    # A key typed into a field is text, not a command.
    shown.run("document.getElementById('mark-text').focus()")
    shown.press("f")
    shown.press(" ")
    shown.press("1")
    assert shown.run("return document.getElementById('mark-text').value") == "f 1"
    assert not shown.run("return HC.app.frozen")
    assert shown.run("return HC.app.seconds") == 30
    # Escape leaves the controls.
    shown.press(Keys.ESCAPE)
    shown.wait_for("document.getElementById('controls').hidden")
