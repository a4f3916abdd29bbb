"""Node `dashboard`: listens like anybody else, and serves a page about what it hears.

Thin: the feed turns topics into what the page shows, the controls serve what it asks for, the
server talks to browsers in a thread of its own.
"""

from __future__ import annotations

import concurrent.futures
import errno
import os
import socket
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from hc_bringup.dashboard.columns import COLUMNS, HYPOTHESES
from hc_bringup.dashboard.controls import Controls
from hc_bringup.dashboard.feed import Feed
from hc_bringup.dashboard.foxglove import FoxgloveServer
from hc_bringup.dashboard.foxglove_topics import FoxgloveTopics
from hc_bringup.dashboard.latency import EDGES_S
from hc_bringup.dashboard.nis import nis_bands
from hc_bringup.dashboard.palpation import MAP_COLUMNS
from hc_bringup.dashboard.recording import NODE_NAME as RECORDER
from hc_bringup.dashboard.recording import Recording
from hc_bringup.dashboard.security import TOKEN_VARIABLE, Gate, new_token
from hc_bringup.dashboard.server import DashboardServer
from hc_bringup.dashboard.taps import Taps
from hc_bringup.paths import config_folder
from hc_msgs_py.diagnostics import DiagnosticsPublisher, Level, Status
from hc_msgs_py.node_main import NodeStartError, run_node
from hc_msgs_py.parameters import declare, refuse_unknown
from hc_msgs_py.services import add_ready_service
from hc_msgs_py.topics import NODE_DASHBOARD

DEFAULT_PORT: Final = 8765
THIS_MACHINE: Final = "127.0.0.1"
ANY_ADDRESS: Final = ("0.0.0.0", "::", "")
FRAME_PERIOD_S: Final = 1.0 / 30.0


class DashboardNode(Node):  # type: ignore[misc]  # rclpy ships no types
    """Shows the suite in browsers."""

    def __init__(self) -> None:
        """Bind the port and start to serve.

        Raises:
            NodeStartError: if the port is taken or the address is not this machine's.
        """
        # Node.__init__ asks for the subscriptions already.
        self._taps: Taps | None = None
        super().__init__(NODE_DASHBOARD)
        port = declare(
            self,
            "port",
            DEFAULT_PORT,
            "port of the page; 0 takes a free one",
            minimum=0,
            maximum=65535,
            read_only=True,
        )
        fallback = declare(
            self,
            "any_port",
            False,
            "take a free port if the given one is in use",
            read_only=True,
        )
        listen = declare(
            self,
            "listen",
            THIS_MACHINE,
            "address to listen on; another one than 127.0.0.1 lets other machines look",
            read_only=True,
        )
        names = declare(
            self, "names", [""], "further host names by which the page is opened", read_only=True
        )
        origins = declare(
            self,
            "allow_origin",
            [""],
            "origins of Foxglove or Lichtblick in a browser that may connect with the token",
            read_only=True,
        )
        control = declare(
            self,
            "control",
            False,
            "let pages change things; otherwise they only look",
            read_only=True,
        )
        tip = declare(
            self,
            "tip.topic",
            "",
            "position of the tip (PointStamped, PoseStamped); empty: indenter/tip",
            read_only=True,
        )
        axes = declare(
            self,
            "tip.axes",
            "xy",
            "components of the tip's position that are sideways",
            choices=("xy", "xz", "yx", "yz", "zx", "zy"),
            read_only=True,
        )
        bags = declare(
            self, "bags", "bags", "folder for recordings started from the page", read_only=True
        )
        refuse_unknown(self)
        self._control, self._listen = control, listen
        bound = _bind(listen, port, fallback)
        self.port = bound.getsockname()[1]
        hosts = [f"{THIS_MACHINE}:{self.port}", f"localhost:{self.port}"]
        names = [name for name in names if name]
        if names and listen == THIS_MACHINE:
            raise NodeStartError(
                f"--name {names[0]} is for other machines, and {listen} is this one alone: give "
                "--listen ADDRESS as well"
            )
        if listen in ANY_ADDRESS and not names:
            raise NodeStartError(
                f"listening on {listen}: say by which name others open the page, --name HOST"
            )
        if listen != THIS_MACHINE:
            hosts = [f"{name}:{self.port}" for name in names or [listen]] + hosts
        self.host = hosts[0]
        self.token = os.environ.get(TOKEN_VARIABLE) or new_token()
        self._watchers = 0
        gate = Gate(self.token, hosts, [origin for origin in origins if origin])
        self._taps = Taps(self)
        self._topics = FoxgloveTopics(self, self._taps)
        self._foxglove = FoxgloveServer(gate, self.request, self._topics.want, control=control)
        self._server = DashboardServer(gate, self, bound, self._foxglove)
        self._feed = Feed(self, self._taps, self._server, tip_topic=tip, axes=axes)
        self._recording = Recording(Path(bags), lambda: config_folder() / "recorder.yaml")
        self._controls = Controls(self, self._feed, self._recording, allowed=control)
        self._server.start()
        self.create_timer(FRAME_PERIOD_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        add_ready_service(self, list)
        self._diagnostics = DiagnosticsPublisher(self, f"http://{self.host}/", self._status)

    @property
    def subscriptions(self) -> Iterator[Any]:
        """Subscriptions that an executor serves: not those that are emptied."""
        hidden = self._taps.hidden if self._taps is not None else frozenset()
        return (s for s in super().subscriptions if id(s) not in hidden)

    @property
    def address(self) -> str:
        """The page's address with its token."""
        return f"http://{self.host}/#token={self.token}"

    def welcome(self) -> list[str]:
        """Return what the user is told: where the page is, and who can look."""
        lines = [f"live page: {self.address}"]
        lines.append(f"Foxglove, Lichtblick, PlotJuggler: {self.foxglove_address}")
        if self._listen != THIS_MACHINE:
            lines.append(
                f"listening on {self._listen}: whoever reaches this machine and has the address "
                + ("can look and change things" if self._control else "can look")
                + "; nothing is encrypted, so the token can be read on the way"
            )
        if self._control:
            lines.append("the page can change things (--control)")
        return lines

    @property
    def foxglove_address(self) -> str:
        """The address for other programs."""
        return f"ws://{self.host}/foxglove?token={self.token}"

    def _tick(self) -> None:
        self._feed.set_viewers(self._watchers)
        if self._feed.streaming:
            recording = self._recording.status
            self._feed.extra_status = {"recording": recording}
            if not recording["on"]:
                self._feed.rare.forget_node(RECORDER)
        self._topics.tick(self._server, self._foxglove)
        self._feed.tick()
        self._controls.tick()

    # What the server asks for, in its thread.

    def hello(self) -> dict[str, Any]:
        """Return what a page is told when it opens."""
        return {
            "columns": COLUMNS,
            "map_columns": MAP_COLUMNS,
            "hypotheses": HYPOTHESES,
            "control": self._control,
            "space": self.get_namespace().strip("/"),
            "latency_edges": EDGES_S.tolist(),
            "nis_band": nis_bands(),
        }

    def watched(self, viewers: int) -> None:
        """Take note of how many pages are open."""
        self._watchers = viewers

    def request(self, message: dict[str, Any]) -> concurrent.futures.Future[dict[str, Any]]:
        """Begin to do what a page asks for."""
        return self._controls.request(message)

    def _status(self) -> Status:
        values = {"address": f"http://{self.host}/", "viewers": self._watchers}
        values |= {"control": self._control}
        return Status(Level.OK, "serving", values)

    def finished(self) -> bool:
        """Whether the node wants to end by itself.

        Raises:
            NodeStartError: if the server's thread failed.
        """
        if self._server.error is not None:
            raise NodeStartError(f"the web server stopped: {self._server.error}")
        return False

    def close(self) -> None:
        """End the server and a recording that is under way."""
        self._server.stop()
        self._recording.close()


def _bind(address: str, port: int, fallback: bool) -> socket.socket:
    """Return a listening socket.

    Raises:
        NodeStartError: if there can be none.
    """
    try:
        return socket.create_server((address, port))
    except OSError as error:
        if fallback and port:
            return _bind(address, 0, False)
        raise NodeStartError(f"cannot listen on {address}:{port}: {_reason(error)}") from error


def _reason(error: OSError) -> str:
    """Return why, without what Python adds to it, and what to do."""
    number = error.errno or 0  # below zero: of the look-up of a name (EAI_NONAME)
    if number < 0 or number == errno.EADDRNOTAVAIL:
        return "this machine has no such address; give another one to --listen"
    why = os.strerror(error.errno) if error.errno else str(error)
    return f"{why}; give another --port"


def main() -> int:
    """Run the node; returns the exit status."""
    return run_node(DashboardNode)


if __name__ == "__main__":
    sys.exit(main())
