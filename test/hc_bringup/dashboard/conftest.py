"""A dashboard's server without ROS, estimates as records, and a browser where there is one."""

from __future__ import annotations

import concurrent.futures
import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hc_bringup.dashboard.columns import COLUMNS, HYPOTHESES
from hc_bringup.dashboard.digest import Digest
from hc_bringup.dashboard.latency import EDGES_S
from hc_bringup.dashboard.nis import nis_bands
from hc_bringup.dashboard.palpation import MAP_COLUMNS
from hc_bringup.dashboard.security import Gate
from hc_bringup.dashboard.server import DashboardServer
from hc_logger.definitions import installed_definition
from hc_logger.layout import record_dtype

TOKEN = "token-of-the-test"
ORIGIN_NS = 1_700_000_000_000_000_000
PERIOD_NS = 1_000_000


def estimate_records(count: int, *, first: int = 0, seed: int = 0) -> NDArray[Any]:
    """Estimates with a value of its own in every field that the page shows."""
    dtype = record_dtype(installed_definition("hc_msgs/msg/HuntCrossleyEstimate"), 1)
    names = [name for name in dtype.names or () if name != "header.frame_id"]
    table = np.zeros(count, np.dtype([(name, dtype[name]) for name in names]))
    random = np.random.default_rng(seed)
    for name in names:
        if table[name].dtype == np.float64:
            table[name] = random.uniform(0.1, 1.0, table[name].shape)
    table["sequence"] = np.arange(first, first + count)
    table["contact"] = True
    return table


def stamps_of(table: NDArray[Any], start_ns: int = ORIGIN_NS) -> NDArray[np.int64]:
    """Stamps of a thousand a second by the sequence."""
    return start_ns + table["sequence"].astype(np.int64) * PERIOD_NS


class FakeBackend:
    """Answers requests as it is told, and remembers them."""

    def __init__(self) -> None:
        self.requests: list[dict[str, Any]] = []
        self.viewers = 0
        self.control = True
        self.space = ""

    def hello(self) -> dict[str, Any]:
        return {
            "columns": COLUMNS,
            "map_columns": MAP_COLUMNS,
            "hypotheses": HYPOTHESES,
            "control": self.control,
            "space": self.space,
            "latency_edges": EDGES_S.tolist(),
            "nis_band": nis_bands(),
        }

    def watched(self, viewers: int) -> None:
        self.viewers = viewers

    def request(self, message: dict[str, Any]) -> concurrent.futures.Future[dict[str, Any]]:
        self.requests.append(message)
        future: concurrent.futures.Future[dict[str, Any]] = concurrent.futures.Future()
        future.set_result({"ok": True, "message": "as you say", "parameters": []})
        return future


class Served:
    """A running server."""

    def __init__(self, *, port: int = 0, token: str = TOKEN, **options: Any) -> None:
        self.backend = FakeBackend()
        bound = socket.create_server(("127.0.0.1", port))
        self.port = bound.getsockname()[1]
        self.host = f"127.0.0.1:{self.port}"
        self.gate = Gate(token, [self.host], **options)
        self.server = DashboardServer(self.gate, self.backend, bound)
        self.server.start()

    @property
    def origin(self) -> str:
        return f"http://{self.host}"

    @property
    def address(self) -> str:
        return f"{self.origin}/#token={TOKEN}"


def status(**fields: Any) -> dict[str, Any]:
    """A status as the feed makes it."""
    content: dict[str, Any] = {
        "epoch": 0,
        "origin": ORIGIN_NS * 1e-9,
        "silent_s": 0.0,
        "estimating": True,
        "tip": True,
        "rate_hz": 1000.0,
        "estimates": 1000,
        "lost": 0,
        "rejected": 0,
        "latency": [0] * (len(EDGES_S) + 1),
        "viewers": 1,
        "zero_effect": "",
        "configuration": {"filter": "ukf", "revision": 1},
        "nodes": {},
    }
    return content | fields


@pytest.fixture
def make_estimates() -> Callable[..., NDArray[Any]]:
    """Function (count, first=, seed=) -> records of estimates."""
    return estimate_records


@pytest.fixture
def make_stamps() -> Callable[..., NDArray[np.int64]]:
    """Function (records, start_ns) -> their stamps."""
    return stamps_of


@pytest.fixture
def make_status() -> Callable[..., dict[str, Any]]:
    """Function (**fields) -> a status as the feed makes it."""
    return status


@pytest.fixture
def token() -> str:
    """The token of every server made here."""
    return TOKEN


@pytest.fixture
def serve() -> Iterator[Callable[..., Served]]:
    """Starts servers, and stops them with the test."""
    running: list[Served] = []

    def start(**options: Any) -> Served:
        running.append(Served(**options))
        return running[-1]

    yield start
    for served in running:
        served.server.stop()


@pytest.fixture(scope="module")
def one_browser() -> Iterator[Any]:
    """A browser for all tests of a file: starting one takes a second."""
    sys.path.insert(0, str(Path(__file__).parent))
    import browser

    reason = browser.why_not()
    if reason:
        pytest.skip(reason)
    opened = browser.Browser()
    yield opened
    opened.close()


@pytest.fixture
def page(one_browser: Any) -> Iterator[Any]:
    """The browser, with an empty page, that must not complain about anything."""
    one_browser.open("about:blank")
    one_browser.resize(1300, 1000)
    one_browser.complaints()
    yield one_browser
    one_browser.open("about:blank")


@pytest.fixture
def recorded_bag(tmp_path: Path) -> Path:
    """A bag of samples and estimates, three seconds at 1 kHz, made without a run."""
    from hc_bringup.run_data import records_of_series
    from hc_estimator import create_estimator
    from hc_logger.layout import encode
    from hc_logger.writer import BagWriter
    from hc_sim_rig import Rig

    signals = Rig("multisine", 1).run(3.0)
    series = create_estimator("ukf").run(signals.time_s, signals.displacement_mm, signals.force_n)
    sequence = signals.sequence.astype(np.uint64)
    estimates = records_of_series(series, signals.force_n, sequence)
    stamps = ORIGIN_NS + np.rint(1e9 * signals.time_s).astype(np.int64)
    header = {"header__stamp__sec": stamps // 10**9, "header__stamp__nanosec": stamps % 10**9}
    names = estimates.dtype.names or ()
    columns = {
        "/indenter/sample": (
            "hc_msgs/msg/IndenterSample",
            {
                "sequence": sequence,
                "displacement": 1e-3 * signals.displacement_mm,
                "force": signals.force_n,
            },
        ),
        "/hc/estimate": (
            "hc_msgs/msg/HuntCrossleyEstimate",
            {name: estimates[name] for name in names},
        ),
    }
    path = tmp_path / "recorded"
    with BagWriter(path) as writer:
        for topic, (kind, fields) in columns.items():
            number = writer.add_topic(topic, kind)
            rows = encode(installed_definition(kind), "indenter_tip", **header, **fields)
            for stamp, row in zip(stamps.tolist(), rows, strict=True):
                writer.write(number, stamp, row.tobytes())
    return path


class Live:
    """A server, and the page that shows what it is fed."""

    def __init__(self, page: Any, served: Served) -> None:
        self.page = page
        self.address = served.address
        self.backend = served.backend
        self.server = served.server
        self._digest = Digest()

    def feed(self, table: Any, earlier_ns: int = 0) -> Any:
        """Show estimates, which follow those before; returns the rows that the page gets."""
        stamps = stamps_of(table) - earlier_ns
        added = self._digest.add(table, stamps, estimates=True)
        rows = np.concatenate([added, self._digest.flush()])
        self.server.publish_rows(self._digest.epoch, rows)
        return rows

    def say(self, **fields: Any) -> None:
        """Publish a status."""
        self.server.publish_text("status", status(**fields))

    def open(self, **fields: Any) -> None:
        """Open the page, wait until it is connected, and publish a status."""
        self.page.open(self.address)
        self.page.wait_for("HC.app && HC.app.state === 'connected'")
        self.say(**fields)


@pytest.fixture
def live(page: Any, serve: Callable[..., Served]) -> Live:
    """The page, and a server to feed it."""
    return Live(page, serve())
