"""The page in a real browser: without the token, and from another site, it gets nothing."""

from __future__ import annotations

import http.server
import threading
from collections.abc import Callable
from typing import Any

import pytest

from hc_bringup.dashboard.columns import COLUMNS
from hc_bringup.dashboard.digest import Digest

Make = Callable[..., Any]

pytestmark = [pytest.mark.timeout(180), pytest.mark.process]


def test_without_the_token_the_page_says_what_to_do(page: Any, serve: Make) -> None:
    served = serve()
    page.open(served.origin)
    page.wait(lambda: "open the page by the address" in page.text("#banner"), "the banner", 5.0)
    assert served.backend.viewers == 0


def test_a_page_is_let_in_by_the_next_dashboard_of_a_run(
    page: Any, serve: Make, make_estimates: Make, make_stamps: Make
) -> None:
    """Regression: after a dashboard that died in a run, an open page said "Not connected" for good.

    What it shows then is of the new one alone, though rows of both have the same numbers.
    """
    first = serve()
    page.open(first.address)
    page.wait_for("HC.app && HC.app.state === 'connected'")
    rows = Digest()
    table = make_estimates(1000)
    first.server.publish_rows(0, rows.add(table, make_stamps(table), estimates=True))
    page.wait_for("HC.app.store.count > 0")
    seen = page.run("return HC.app.store.count")
    first.server.stop()
    page.wait(lambda: page.text("#state") == "disconnected", "disconnected", 5.0)
    second = serve(port=first.port)
    other = make_estimates(3000, seed=1)
    added = Digest().add(other, make_stamps(other), estimates=True)
    assert len(added) > seen
    second.server.publish_rows(0, added)
    page.wait_for("HC.app.state === 'connected'", 10.0)
    page.wait_for(f"HC.app.store.count === {len(added)}")
    shown = page.run(
        "const s = HC.app.store;"
        "return Array.from({length: s.count - s.first}, (_, i) => s.at(s.first + i, 'force'))"
    )
    assert shown == added[:, COLUMNS.index("force")].tolist()


def test_a_page_with_the_token_of_another_run_is_told_what_to_do(page: Any, serve: Make) -> None:
    first = serve()
    page.open(first.address)
    page.wait_for("HC.app && HC.app.state === 'connected'")
    first.server.stop()
    second = serve(port=first.port, token="token-of-another-run")
    page.wait(lambda: "open the page by the address" in page.text("#banner"), "the banner", 10.0)
    assert second.backend.viewers == 0


class Hostile(http.server.BaseHTTPRequestHandler):
    """A page of somebody else on this machine, without any policy of its own."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>evil</title>")

    def log_message(self, *_arguments: object) -> None:
        """Say nothing."""


def test_another_site_cannot_connect(page: Any, serve: Make) -> None:
    """A page from another port of this machine, in a browser that has the cookie, gets nothing."""
    served = serve()
    page.open(served.address)
    page.wait_for("HC.app && HC.app.state === 'connected'")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Hostile) as evil:
        threading.Thread(target=evil.serve_forever, daemon=True).start()
        page.open(f"http://127.0.0.1:{evil.server_port}/")
        answer = page.driver.execute_async_script(
            """
            const [host, done] = arguments;
            const tried = (path) => new Promise((end) => {
              const socket = new WebSocket(`ws://${host}${path}`);
              socket.onopen = () => end("opened");
              socket.onerror = () => end("refused");
            });
            const fetched = (path, options) => fetch(`http://${host}${path}`, options).then(
              (r) => r.text().then((text) => "read " + text.length), () => "refused");
            const post = {method: "POST", body: "{}"};
            Promise.all([tried("/ws"), tried("/"), fetched("/session", post),
              fetched("/", {credentials: "include"})]).then(done);
            """,
            served.host,
        )
        evil.shutdown()
    assert answer == ["refused"] * 4
