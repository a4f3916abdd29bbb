"""The Foxglove WebSocket protocol on the page's server: topics as raw CDR with their definitions.

Foxglove, Lichtblick and PlotJuggler connect to ws://HOST/foxglove?token=TOKEN and need no ROS.
Protocol: foxglove/ws-protocol, docs/spec.md, subprotocols foxglove.websocket.v1 and
foxglove.sdk.v1 (the same messages under a newer name). Here is the side of the connections; what
of ROS it needs is in foxglove_topics.
"""

from __future__ import annotations

import asyncio
import json
import struct
import time
from collections import deque
from collections.abc import Callable, Collection
from concurrent.futures import Future
from typing import Any, Final, NamedTuple

from aiohttp import WSMsgType, web

from hc_bringup.dashboard.security import LARGEST_MESSAGE, Gate, RateLimit
from hc_bringup.dashboard.taps import Arrival
from hc_bringup.plain_json import to_compact_json

PATH: Final = "/foxglove"
SUBPROTOCOLS: Final = ("foxglove.sdk.v1", "foxglove.websocket.v1")
MOST_CLIENTS: Final = 16
MOST_WAITING: Final = 4000
"""Messages that wait for a client; of more the newest win."""
MESSAGES_PER_SECOND: Final = 200
HEARTBEAT_S: Final = 15.0
NODES: Final = ("estimator", "indenter")
_MESSAGE_HEADER: Final = struct.Struct("<BIQ")
_MESSAGE_DATA: Final = 1
_WARNING, _ERROR = 1, 2


class Channel(NamedTuple):
    """A topic that clients may subscribe to."""

    number: int
    topic: str
    type_name: str
    schema: str

    def advertised(self) -> dict[str, Any]:
        """Return it as the protocol tells it."""
        return {
            "id": self.number,
            "topic": self.topic,
            "encoding": "cdr",
            "schemaName": self.type_name,
            "schema": self.schema,
            "schemaEncoding": "ros2msg",
        }


class _Client:
    """One connected program: its subscriptions, and what waits to be sent to it."""

    def __init__(self, socket: web.WebSocketResponse) -> None:
        self.socket = socket
        self.subscriptions: dict[int, int] = {}  # the client's number by channel
        self.limit = RateLimit(MESSAGES_PER_SECOND, 1.0)
        self._texts: deque[str] = deque(maxlen=200)
        self._messages: deque[bytes] = deque(maxlen=MOST_WAITING)
        self._something = asyncio.Event()

    def put_text(self, content: dict[str, Any]) -> None:
        """Queue what belongs to the conversation."""
        self._texts.append(to_compact_json(content))
        self._something.set()

    def put_messages(self, messages: Collection[bytes]) -> None:
        """Queue messages of a topic; the oldest make room for them."""
        self._messages.extend(messages)
        self._something.set()

    async def send_all(self) -> None:
        """Send what waits until the connection ends."""
        try:
            while not self.socket.closed:
                if self._texts:
                    await self.socket.send_str(self._texts.popleft())
                elif self._messages:
                    await self.socket.send_bytes(self._messages.popleft())
                else:
                    self._something.clear()
                    await self._something.wait()
        except ConnectionError:
            return


class FoxgloveServer:
    """Speaks the protocol; belongs to the server's thread."""

    def __init__(
        self,
        gate: Gate,
        request: Callable[[dict[str, Any]], Future[dict[str, Any]]],
        want: Callable[[frozenset[int]], None],
        *,
        control: bool,
    ) -> None:
        """Prepare to serve.

        Args:
            gate: knows the token.
            request: asks the node for parameters and changes them; see controls.Controls.
            want: told which channels somebody is subscribed to, at every change.
            control: whether clients may change parameters.
        """
        self._gate, self._request, self._want = gate, request, want
        self._control = control
        self._channels: dict[int, Channel] = {}
        self._clients: set[_Client] = set()
        self._session = str(time.time_ns())

    def accepts(self, request: web.Request) -> bool:
        """Whether a request is meant for this protocol: older PlotJugglers know no path."""
        wants_socket = request.headers.get("Upgrade", "").lower() == "websocket"
        return request.path == PATH or (request.path == "/" and wants_socket)

    async def handle(self, request: web.Request) -> web.StreamResponse:
        """Serve a connection to its end.

        Raises:
            RefusedError: if the token is wrong.
        """
        self._gate.check_token(request.query.get("token"))
        socket = web.WebSocketResponse(
            heartbeat=HEARTBEAT_S,
            max_msg_size=LARGEST_MESSAGE,
            protocols=SUBPROTOCOLS,
            compress=False,
        )
        if not socket.can_prepare(request):
            return web.Response(status=426, text="this address is for a WebSocket\n")
        await socket.prepare(request)
        if socket.ws_protocol is None or len(self._clients) >= MOST_CLIENTS:
            why = b"too many programs are connected" if socket.ws_protocol else b"wrong subprotocol"
            await socket.close(code=1013 if socket.ws_protocol else 1002, message=why)
            return socket
        client = _Client(socket)
        self._greet(client)
        self._clients.add(client)
        sender = asyncio.ensure_future(client.send_all())
        try:
            await self._listen(client)
        finally:
            sender.cancel()
            self._clients.discard(client)
            self._tell_wanted()
        return socket

    def set_channels(self, channels: Collection[Channel]) -> None:
        """Take note of the topics that there are, and tell the clients what has changed."""
        now = {channel.number: channel for channel in channels}
        gone = [number for number in self._channels if number not in now]
        new = [channel.advertised() for n, channel in now.items() if n not in self._channels]
        self._channels = now
        for client in self._clients:
            for number in gone:
                client.subscriptions.pop(number, None)
            if gone:
                client.put_text({"op": "unadvertise", "channelIds": gone})
            if new:
                client.put_text({"op": "advertise", "channels": new})
        if gone:
            self._tell_wanted()

    def deliver(self, number: int, arrivals: Collection[Arrival]) -> None:
        """Send messages of a channel to who subscribed to it."""
        for client in self._clients:
            subscription = client.subscriptions.get(number)
            if subscription is not None:
                client.put_messages(
                    [
                        _MESSAGE_HEADER.pack(_MESSAGE_DATA, subscription, received_ns) + data
                        for data, received_ns in arrivals
                    ]
                )

    def _greet(self, client: _Client) -> None:
        client.put_text(
            {
                "op": "serverInfo",
                "name": "hc dashboard",
                "capabilities": ["parameters"],
                "supportedEncodings": ["cdr"],
                "metadata": {"ROS_DISTRO": "jazzy"},
                "sessionId": self._session,
            }
        )
        channels = [channel.advertised() for channel in self._channels.values()]
        client.put_text({"op": "advertise", "channels": channels})

    async def _listen(self, client: _Client) -> None:
        async for message in client.socket:
            if client.limit.full():
                await client.socket.close(code=1008, message=b"too many messages")
                return
            client.limit.note()
            if message.type is not WSMsgType.TEXT:
                self._complain(client, "this server takes no messages from clients")
                continue
            try:
                content = json.loads(message.data)
            except (ValueError, RecursionError):
                content = None
            if not isinstance(content, dict):
                self._complain(client, "not a JSON object")
                continue
            await self._serve(client, content)

    async def _serve(self, client: _Client, content: dict[str, Any]) -> None:
        operation = content.get("op")
        if operation == "subscribe":
            for entry in _entries(content.get("subscriptions")):
                self._subscribe(client, entry)
            self._tell_wanted()
        elif operation == "unsubscribe":
            numbers = content.get("subscriptionIds")
            gone = set(numbers) if isinstance(numbers, list) and _whole_numbers(numbers) else set()
            client.subscriptions = {c: s for c, s in client.subscriptions.items() if s not in gone}
            self._tell_wanted()
        elif operation == "getParameters":
            await self._tell_parameters(client, content)
        elif operation == "setParameters":
            await self._set_parameters(client, content)
        else:
            self._complain(client, f"this server does not serve {str(operation)[:40]}")

    def _subscribe(self, client: _Client, entry: dict[str, Any]) -> None:
        number, channel = entry.get("id"), entry.get("channelId")
        if not _whole_numbers([number, channel]) or channel not in self._channels:
            self._complain(client, f"there is no channel {str(channel)[:20]}")
        elif not 0 <= int(number or 0) < 2**32 or number in client.subscriptions.values():
            self._complain(client, f"subscription {number} is in use or out of range")
        elif channel in client.subscriptions:
            self._complain(client, f"subscribed already to channel {channel}")
        else:
            client.subscriptions[int(channel or 0)] = int(number or 0)

    def _tell_wanted(self) -> None:
        self._want(frozenset(n for client in self._clients for n in client.subscriptions))

    @staticmethod
    def _complain(client: _Client, text: str, level: int = _WARNING) -> None:
        client.put_text({"op": "status", "level": level, "message": text})

    async def _tell_parameters(self, client: _Client, content: dict[str, Any]) -> None:
        names = content.get("parameterNames")
        names = names if isinstance(names, list) else []
        parameters = []
        answers = await asyncio.gather(
            *(
                asyncio.wrap_future(self._request({"op": "settings", "node": node}))
                for node in NODES
            )
        )
        for node, answer in zip(NODES, answers, strict=True):
            for entry in answer.get("parameters", []):
                name = f"/{node}.{entry['name']}"
                if not names or name in names:
                    parameters.append(_parameter(name, entry))
        reply: dict[str, Any] = {"op": "parameterValues", "parameters": parameters}
        if isinstance(content.get("id"), str):
            reply["id"] = content["id"]
        client.put_text(reply)

    async def _set_parameters(self, client: _Client, content: dict[str, Any]) -> None:
        if not self._control:
            self._complain(client, "read-only: start the dashboard with --control", _ERROR)
            return
        wanted: dict[str, dict[str, Any]] = {}
        for entry in _entries(content.get("parameters")):
            node, _, name = str(entry.get("name", "")).removeprefix("/").partition(".")
            wanted.setdefault(node, {})[name] = entry.get("value")
        for node, parameters in wanted.items():
            answer = await asyncio.wrap_future(
                self._request({"op": "set", "node": node, "parameters": parameters})
            )
            if not answer["ok"]:
                self._complain(client, answer["message"], _ERROR)
        names = [f"/{node}.{name}" for node, values in wanted.items() for name in values]
        await self._tell_parameters(client, {"parameterNames": names, "id": content.get("id")})


def _parameter(name: str, entry: dict[str, Any]) -> dict[str, Any]:
    answer = {"name": name, "value": entry["value"]}
    # A float64 that happens to be whole must stay one.
    kind = {"number": "float64", "numbers": "float64_array"}.get(entry["type"])
    return answer | {"type": kind} if kind else answer


def _entries(value: object) -> list[dict[str, Any]]:
    items = value if isinstance(value, list) else []
    return [item for item in items if isinstance(item, dict)]


def _whole_numbers(values: list[Any]) -> bool:
    return all(type(value) is int for value in values)
