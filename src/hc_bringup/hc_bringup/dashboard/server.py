"""The web server of the live page, in a thread of its own: files, connections, viewers.

The node's thread hands in rows, maps and texts (publish_*), which are turned into frames once and
put into every viewer's outbox. What a viewer asks for goes to the backend, which answers by a
future. Nothing here knows ROS.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import json
import logging
import secrets
import socket
import threading
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
from aiohttp import WSMsgType, web
from aiohttp.http_exceptions import HttpProcessingError
from aiohttp.typedefs import Handler
from numpy.typing import NDArray

from hc_bringup.dashboard.frames import MAP, ROWS, TAXELS, encode_frame
from hc_bringup.dashboard.history import History
from hc_bringup.dashboard.palpation import MAP_COLUMNS
from hc_bringup.dashboard.security import (
    HEADERS,
    LARGEST_MESSAGE,
    Gate,
    RateLimit,
    RefusedError,
    content_security_policy,
)
from hc_bringup.dashboard.viewers import Outbox
from hc_bringup.plain_json import to_compact_json

PAGE_FOLDER: Final = Path(__file__).with_name("page")
CONTENT_TYPES: Final = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
    ".txt": "text/plain",
}
MOST_VIEWERS: Final = 16
MESSAGES_PER_SECOND: Final = 20
HEARTBEAT_S: Final = 15.0
"""A viewer that does not answer for so long is gone."""
STOP_TIMEOUT_S: Final = 3.0
POLICY_VIOLATION: Final = 1008


class Backend(Protocol):
    """What the server asks of the node; called in the server's thread."""

    def hello(self) -> dict[str, Any]:
        """Return what a page is told when it opens."""

    def watched(self, viewers: int) -> None:
        """Take note of how many pages are open."""

    def request(self, message: dict[str, Any]) -> concurrent.futures.Future[dict[str, Any]]:
        """Begin to do what a page asks for; the future gives the answer."""


class Extension(Protocol):
    """Another protocol on the same server; see foxglove.FoxgloveServer."""

    def accepts(self, request: web.Request) -> bool:
        """Whether a request for an address of the page is meant for it."""

    async def handle(self, request: web.Request) -> web.StreamResponse:
        """Serve a connection to its end."""


@dataclass(eq=False)
class Viewer:
    """One open page."""

    socket: web.WebSocketResponse
    outbox: Outbox
    limit: RateLimit


class DashboardServer:
    """Serves the page until it is stopped."""

    def __init__(
        self, gate: Gate, backend: Backend, bound: socket.socket, extension: Extension | None = None
    ) -> None:
        """Prepare the server.

        Args:
            gate: who may look.
            backend: who answers.
            bound: a listening socket.
            extension: another protocol that is served beside the page.
        """
        self._gate, self._backend, self._socket = gate, backend, bound
        self._extension = extension
        self._cookie = f"hc_dashboard_{bound.getsockname()[1]}"
        self._files = {
            f"/{path.name}": (path.read_bytes(), CONTENT_TYPES[path.suffix])
            for path in PAGE_FOLDER.iterdir()
            if path.suffix in CONTENT_TYPES
        }
        self._history = History()
        self._life = secrets.token_hex(8)  # rows of two processes may have the same numbers
        self._map = encode_frame(MAP, 0, 0, np.empty((0, len(MAP_COLUMNS))))
        self._taxels: bytes | None = None
        self._texts: dict[str, str] = {}
        self._viewers: set[Viewer] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="web server", daemon=True)
        self._started = threading.Event()
        self._stopping: asyncio.Event | None = None
        self.error: BaseException | None = None

    # From the node's thread.

    def start(self) -> None:
        """Start to serve."""
        self._thread.start()
        self._started.wait()

    def stop(self) -> None:
        """Close all connections and end the thread."""
        if self._thread.is_alive() and self._stopping is not None:
            self.call(self._stopping.set)
            self._thread.join(STOP_TIMEOUT_S)

    def call(self, function: Callable[..., None], *arguments: Any) -> None:
        """Let the server's thread call a function."""
        try:
            self._loop.call_soon_threadsafe(function, *arguments)
        except RuntimeError:  # the loop has ended: nobody is left to be told
            return

    def publish_rows(self, epoch: int, rows: NDArray[Any]) -> None:
        """Show rows (m, columns) of the digest."""
        self.call(self._add_rows, epoch, rows)

    def publish_map(self, epoch: int, cell_mm: float, table: NDArray[Any]) -> None:
        """Show the palpation map, (cells, 9)."""
        self.call(self._set_map, encode_frame(MAP, epoch, round(1000.0 * cell_mm), table))

    def publish_taxels(self, cell_mm: float, table: NDArray[Any]) -> None:
        """Show a tactile array, (taxels, 9)."""
        self.call(self._set_taxels, encode_frame(TAXELS, 0, round(1000.0 * cell_mm), table))

    def publish_text(self, kind: str, content: dict[str, Any]) -> None:
        """Show a status, settings and so on; pages that open later get the latest of each kind."""
        self.call(self._set_text, kind, to_compact_json({"op": kind, **content}))

    # In the server's thread.

    def _add_rows(self, epoch: int, rows: NDArray[Any]) -> None:
        if epoch != self._history.epoch:
            self._history.clear(epoch)
        frame = encode_frame(ROWS, epoch, self._history.count, rows)
        self._history.add(rows)
        for viewer in self._viewers:
            viewer.outbox.put_rows(frame)

    def _set_map(self, frame: bytes) -> None:
        self._map = frame
        for viewer in self._viewers:
            viewer.outbox.put_latest("map", frame)

    def _set_taxels(self, frame: bytes) -> None:
        self._taxels = frame
        for viewer in self._viewers:
            viewer.outbox.put_latest("taxels", frame)

    def _set_text(self, kind: str, text: str) -> None:
        self._texts[kind] = text
        for viewer in self._viewers:
            viewer.outbox.put_latest(kind, text)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        except BaseException as error:  # noqa: BLE001 - the node's thread tells the user
            self.error = error
        finally:
            self._started.set()
            self._loop.close()

    async def _serve(self) -> None:
        self._stopping = asyncio.Event()
        runner = web.AppRunner(
            self._application(),
            access_log=None,
            logger=_own_logger(),
            keepalive_timeout=30.0,
            shutdown_timeout=1.0,
            handler_cancellation=True,
        )
        await runner.setup()
        await web.SockSite(runner, self._socket, backlog=64).start()
        self._started.set()
        await self._stopping.wait()
        for viewer in list(self._viewers):
            await viewer.socket.close(code=1001, message=b"the dashboard ends")
        await runner.cleanup()

    def _application(self) -> web.Application:
        application = web.Application(client_max_size=LARGEST_MESSAGE, middlewares=[self._guard])
        application.router.add_post("/session", self._open_session)
        application.router.add_get("/ws", self._view)
        application.router.add_get("/{name:.*}", self._file)
        return application

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Check every request's Host and Origin, and put the headers on every answer."""
        host = ""
        try:
            host = self._gate.check_host(request.headers)
            if self._is_foreign(request):
                self._gate.check_foreign_origin(request.headers, host)
            else:
                needed = request.method != "GET" or request.path == "/ws"
                self._gate.check_origin(request.headers, host, needed=needed)
            response = await handler(request)
        except RefusedError as error:
            body = f"{error}\n".encode("utf-8", "backslashreplace")  # it may name what was sent
            response = web.Response(status=error.status, body=body, content_type="text/plain")
        except web.HTTPException as error:
            response = web.Response(status=error.status, text=f"{error.reason}\n")
        if not response.prepared:
            response.headers.update(HEADERS)
            response.headers["Content-Security-Policy"] = content_security_policy(host)
        return response

    def _is_foreign(self, request: web.Request) -> bool:
        return self._extension is not None and self._extension.accepts(request)

    async def _file(self, request: web.Request) -> web.StreamResponse:
        if self._extension is not None and self._extension.accepts(request):
            return await self._extension.handle(request)
        path = "/index.html" if request.path == "/" else request.path
        if path not in self._files:
            raise RefusedError(404, "there is no such file")
        body, content_type = self._files[path]
        return web.Response(body=body, content_type=content_type, charset="utf-8")

    async def _open_session(self, request: web.Request) -> web.Response:
        """Take the token of the address and give a cookie for it."""
        try:
            message = json.loads(await request.read())
        except (ValueError, RecursionError):
            message = None
        self._gate.check_token(message.get("token") if isinstance(message, dict) else None)
        response = web.Response(status=204)
        response.set_cookie(
            self._cookie, self._gate.open_session(), httponly=True, samesite="Strict", path="/"
        )
        return response

    async def _view(self, request: web.Request) -> web.StreamResponse:
        self._gate.check_session(request.cookies, self._cookie)
        if len(self._viewers) >= MOST_VIEWERS:
            raise RefusedError(503, f"{MOST_VIEWERS} pages are open already: close one")
        socket_ = web.WebSocketResponse(
            heartbeat=HEARTBEAT_S, max_msg_size=LARGEST_MESSAGE, compress=False
        )
        await socket_.prepare(request)
        viewer = Viewer(socket_, Outbox(), RateLimit(MESSAGES_PER_SECOND, 1.0))
        self._greet(viewer)
        self._viewers.add(viewer)
        self._backend.watched(len(self._viewers))
        sender = asyncio.ensure_future(_send_all(viewer))
        try:
            await self._listen(viewer)
        finally:
            sender.cancel()
            self._viewers.discard(viewer)
            self._backend.watched(len(self._viewers))
        return socket_

    def _greet(self, viewer: Viewer) -> None:
        content = self._backend.hello()
        content |= {
            "life": self._life,
            "epoch": self._history.epoch,
            "rows": self._history.count,
        }
        viewer.outbox.put_answer(to_compact_json({"op": "hello", **content}))
        for text in self._texts.values():
            viewer.outbox.put_answer(text)
        viewer.outbox.put_answer(self._map)
        if self._taxels is not None:
            viewer.outbox.put_answer(self._taxels)

    async def _listen(self, viewer: Viewer) -> None:
        async for message in viewer.socket:
            if message.type is not WSMsgType.TEXT:
                await viewer.socket.close(code=POLICY_VIOLATION, message=b"text, please")
                return
            if viewer.limit.full():
                await viewer.socket.close(code=POLICY_VIOLATION, message=b"too many messages")
                return
            viewer.limit.note()
            try:
                content = json.loads(message.data)
            except (ValueError, RecursionError):
                content = None
            if not isinstance(content, dict):
                await viewer.socket.close(code=POLICY_VIOLATION, message=b"JSON, please")
                return
            self._answer(viewer, content)

    def _answer(self, viewer: Viewer, content: dict[str, Any]) -> None:
        if content.get("op") == "rows":
            number = content.get("from")
            if content.get("epoch") == self._history.epoch and isinstance(number, int):
                first, rows = self._history.since(max(0, number))
                frame = encode_frame(ROWS, self._history.epoch, first, rows, answer=True)
                viewer.outbox.put_answer(frame)
            return
        number = content.get("id")
        number = number if isinstance(number, (int, str)) else None
        spawn(_wait_for(self._backend.request(content), viewer.outbox, number))


class _NotOfPeers(logging.Filter):
    """Lets pass what went wrong here: a request that is no HTTP is answered with 400, and all."""

    def filter(self, record: logging.LogRecord) -> bool:
        error = record.exc_info[1] if record.exc_info else None
        return not isinstance(error, HttpProcessingError)


def _own_logger() -> logging.Logger:
    """Return the server's logger; no program on this machine can fill the terminal through it."""
    logger = logging.getLogger("hc_bringup.dashboard.http")
    if not logger.filters:
        logger.addFilter(_NotOfPeers())
    return logger


async def _wait_for(
    future: concurrent.futures.Future[dict[str, Any]], outbox: Outbox, number: object
) -> None:
    """Put an answer into a viewer's outbox once it is there."""
    answer = await asyncio.wrap_future(future)
    outbox.put_answer(to_compact_json({**answer, "op": "answer", "id": number}))


async def _send_all(viewer: Viewer) -> None:
    """Send what is in a viewer's outbox until it is gone."""
    try:
        while not viewer.socket.closed:
            message = await viewer.outbox.next()
            if isinstance(message, bytes):
                await viewer.socket.send_bytes(message)
            else:
                await viewer.socket.send_str(message)
    except ConnectionError:
        return


_TASKS: set[asyncio.Task[None]] = set()


def spawn(coroutine: Coroutine[Any, Any, None]) -> None:
    """Run a coroutine beside the others; asyncio alone would forget a task that nobody holds."""
    task = asyncio.ensure_future(coroutine)
    _TASKS.add(task)
    task.add_done_callback(_TASKS.discard)
