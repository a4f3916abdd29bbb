"""Foxglove Studio itself, in a browser: connected with the dashboard, drawing by our layout."""

from __future__ import annotations

import functools
import http.server
import json
import threading
import time
import urllib.parse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hc_logger.recording import read_recording

ROOT = Path(__file__).resolve().parents[3]
STUDIO = ROOT / "test" / "hc_bringup" / "studio"
LAYOUT = ROOT / "config" / "layouts" / "foxglove.json"
TOKEN = "token-of-the-test"
CLICK = """
const button = [...document.querySelectorAll("button, [role=tab]")].find(
  (e) => [e.getAttribute("aria-label"), e.title, e.textContent.trim().replace(/\\d+$/, "")]
    .includes(arguments[0]));
if (button) button.click();
return Boolean(button);
"""

pytestmark = [pytest.mark.process, pytest.mark.slow, pytest.mark.timeout(480)]


class Files(http.server.SimpleHTTPRequestHandler):
    """Serves Studio's files and the layout, and says nothing."""

    layout = b""

    def do_GET(self) -> None:
        if self.path == "/layout.json":
            self.send_response(200)
            self.end_headers()
            self.wfile.write(self.layout)
        else:
            super().do_GET()

    def log_message(self, *_arguments: object) -> None:
        """Say nothing."""


@pytest.fixture
def studio() -> Iterator[str]:
    """The address of Studio's page, which begins with our layout."""
    if not (STUDIO / "node_modules").is_dir():
        pytest.skip(f"Foxglove Studio is not there: run npm ci in {STUDIO}")
    content = json.loads(LAYOUT.read_text(encoding="utf-8"))
    for panel in content["configById"].values():
        if "legendDisplay" in panel:  # the values are switched on, to be read here
            panel |= {"legendDisplay": "floating", "showLegend": True}
            panel["showPlotValuesInLegend"] = True
    Files.layout = json.dumps(content).encode()
    handler = functools.partial(Files, directory=str(STUDIO))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as files:
        threading.Thread(target=files.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{files.server_port}"
        files.shutdown()


def shown(page: Any) -> str:
    return str(page.run("return document.getElementById('root').textContent"))


def open_problems(page: Any) -> bool:
    """Open the list of what Studio complains about; the sidebar of the source may be closed."""
    if page.run(CLICK, "Problems"):
        return True
    page.run(CLICK, "Data source")
    time.sleep(1.0)
    return bool(page.run(CLICK, "Problems"))


def test_studio_connects_and_draws_with_our_layout(
    page: Any, studio: str, command_line: Any, recorded_bag: Path
) -> None:
    command_line.environment["HC_DASHBOARD_TOKEN"] = TOKEN
    dashboard = command_line.start("dashboard", "--port", "0", "--allow-origin", studio)
    said = [dashboard.stdout.readline() for _ in range(2)]
    address = said[1].split(": ", 1)[1].strip()
    source = urllib.parse.quote(address)
    page.open(f"{studio}/index.html?ds=foxglove-websocket&ds.url={source}")
    page.wait(lambda: "hc dashboard" in shown(page), "the connection", 60.0)
    panels = json.loads(Files.layout)["configById"].values()
    titles = [panel["title"] for panel in panels if "title" in panel]
    for title in titles:
        page.wait(lambda title=title: title in shown(page), title)
    replay = command_line.start("replay", str(recorded_bag), "--headless", "--rate", "0.3")
    estimates = read_recording(recorded_bag).estimates
    last = estimates[-1]
    for field in ("stiffness", "damping", "displacement_exponent", "velocity_exponent_std", "nis"):
        # Studio writes a number as JavaScript does: shortest digits that give the same number.
        written = page.run("return String(arguments[0])", float(last[field]))
        page.wait(lambda text=written: text in shown(page), f"{field} {written}", 120.0)
    assert replay.wait(60) == 0
    # What a panel cannot read it says; nothing of ours is complained about.
    page.wait(lambda: open_problems(page), "the list of problems")
    time.sleep(1.0)
    words = shown(page)
    for complaint in ("Unknown panel type", "Failed to parse", "Panel error", "unadvertised"):
        assert complaint not in words, words
    page.open("about:blank")
    page.complaints()
