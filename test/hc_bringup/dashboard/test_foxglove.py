"""The Foxglove protocol: by its specification with a plain client, and with Foxglove's own."""

from __future__ import annotations

import asyncio
import concurrent.futures
import json
import shutil
import signal
import socket
import struct
import subprocess
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import pytest

from hc_bringup.dashboard.foxglove import MOST_WAITING, Channel, FoxgloveServer
from hc_bringup.dashboard.security import Gate
from hc_bringup.dashboard.server import DashboardServer
from hc_bringup.dashboard.taps import Arrival
from hc_logger.recording import read_recording

ROOT = Path(__file__).resolve().parents[3]
NODE_FOLDER = ROOT / "test" / "hc_bringup" / "node"
TOKEN = "token-of-the-test"
CHANNELS = (
    Channel(1, "/hc/estimate", "hc_msgs/msg/HuntCrossleyEstimate", "float64 x"),
    Channel(7, "/other", "std_msgs/msg/String", "string data"),
)


class Served:
    """A server that speaks the protocol, without ROS."""

    def __init__(self, backend: Any, control: bool) -> None:
        self.wanted: frozenset[int] = frozenset()
        self.requests: list[dict[str, Any]] = []
        bound = socket.create_server(("127.0.0.1", 0))
        self.host = f"127.0.0.1:{bound.getsockname()[1]}"
        gate = Gate(TOKEN, [self.host], ["https://app.example"])
        self.foxglove = FoxgloveServer(gate, self.request, self.want, control=control)
        self.server = DashboardServer(gate, backend, bound, self.foxglove)
        self.server.start()
        self.server.call(self.foxglove.set_channels, CHANNELS)

    def want(self, numbers: frozenset[int]) -> None:
        self.wanted = numbers

    def request(self, message: dict[str, Any]) -> concurrent.futures.Future[dict[str, Any]]:
        self.requests.append(message)
        entry = {"name": "gain", "value": 2.0, "type": "number"}
        future: concurrent.futures.Future[dict[str, Any]] = concurrent.futures.Future()
        future.set_result({"ok": True, "message": "", "parameters": [entry]})
        return future

    def deliver(self, number: int, *messages: bytes) -> None:
        arrivals = [Arrival(data, 1_000 + place) for place, data in enumerate(messages)]
        self.server.call(self.foxglove.deliver, number, arrivals)


@pytest.fixture
def speak(serve: Callable[..., Any]) -> Iterator[Callable[..., Served]]:
    """Starts servers that speak the protocol."""
    running: list[Served] = []

    def start(*, control: bool = False) -> Served:
        running.append(Served(serve().backend, control))
        return running[-1]

    yield start
    for served in running:
        served.server.stop()


def run(job: Callable[[aiohttp.ClientSession], Awaitable[Any]]) -> Any:
    async def main() -> Any:
        async with aiohttp.ClientSession(timeout=aiohttp.ClientTimeout(total=30)) as session:
            return await job(session)

    return asyncio.run(main())


async def connect(
    session: aiohttp.ClientSession,
    served: Served,
    path: str = f"/foxglove?token={TOKEN}",
    protocols: tuple[str, ...] = ("foxglove.websocket.v1",),
    **headers: str,
) -> aiohttp.ClientWebSocketResponse:
    return await session.ws_connect(
        f"ws://{served.host}{path}", protocols=protocols, headers=headers, max_msg_size=0
    )


async def next_json(client: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
    return json.loads((await client.receive(timeout=10)).data)


async def until_wanted(served: Served, numbers: set[int]) -> None:
    for _ in range(500):
        if served.wanted == numbers:
            return
        await asyncio.sleep(0.01)
    raise AssertionError(f"{served.wanted} is not {numbers}")


@pytest.mark.parametrize("subprotocol", ["foxglove.websocket.v1", "foxglove.sdk.v1"])
def test_greeting_subscription_and_messages(speak: Any, subprotocol: str) -> None:
    served = speak()

    async def job(session: aiohttp.ClientSession) -> None:
        client = await connect(session, served, protocols=("nonsense", subprotocol))
        assert client.protocol == subprotocol
        info = await next_json(client)
        assert info["op"] == "serverInfo"
        assert info["capabilities"] == ["parameters"]
        told = await next_json(client)
        assert told["op"] == "advertise"
        assert [c["topic"] for c in told["channels"]] == ["/hc/estimate", "/other"]
        assert told["channels"][0]["encoding"] == "cdr"
        assert told["channels"][0]["schemaEncoding"] == "ros2msg"
        await client.send_json({"op": "subscribe", "subscriptions": [{"id": 41, "channelId": 1}]})
        await until_wanted(served, {1})
        served.deliver(7, b"not subscribed")
        served.deliver(1, b"\0\1\0\0abc")
        data = (await client.receive(timeout=10)).data
        assert struct.unpack_from("<BIQ", data) == (1, 41, 1_000)
        assert data[13:] == b"\0\1\0\0abc"
        await client.send_json({"op": "unsubscribe", "subscriptionIds": [41]})
        await until_wanted(served, set())
        await client.close()

    run(job)


def test_topics_come_and_go(speak: Any) -> None:
    served = speak()

    async def job(session: aiohttp.ClientSession) -> None:
        client = await connect(session, served)
        await next_json(client)
        await next_json(client)
        await client.send_json({"op": "subscribe", "subscriptions": [{"id": 0, "channelId": 7}]})
        await until_wanted(served, {7})
        new = Channel(9, "/new", "std_msgs/msg/String", "string data")
        served.server.call(served.foxglove.set_channels, (CHANNELS[0], new))
        assert await next_json(client) == {"op": "unadvertise", "channelIds": [7]}
        assert (await next_json(client))["channels"][0]["topic"] == "/new"
        await until_wanted(served, set())
        await client.close()

    run(job)


@pytest.mark.parametrize(
    "message",
    [
        "no JSON",
        "[1]",
        json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 99}]}),
        json.dumps({"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}),
        json.dumps({"op": "subscribe", "subscriptions": [{"id": "x", "channelId": None}]}),
        json.dumps({"op": "advertise", "channels": []}),
        json.dumps({"op": "setParameters", "parameters": [{"name": "/estimator.x", "value": 1}]}),
        json.dumps({}),
        b"\1\0\0\0\0",
    ],
)
def test_what_cannot_be_done_is_said_and_the_connection_lives(speak: Any, message: Any) -> None:
    served = speak()

    async def job(session: aiohttp.ClientSession) -> None:
        client = await connect(session, served)
        await next_json(client)
        await next_json(client)
        if isinstance(message, bytes):
            await client.send_bytes(message)
        else:
            await client.send_str(message)
        answer = await next_json(client)
        assert answer["op"] == "status"
        assert answer["level"] in (1, 2)
        await client.send_json({"op": "getParameters", "parameterNames": 5, "id": "all"})
        values = await next_json(client)
        assert values["id"] == "all"
        assert {p["name"] for p in values["parameters"]} == {"/estimator.gain", "/indenter.gain"}
        assert values["parameters"][0]["type"] == "float64"
        await client.close()

    run(job)
    assert all(request["op"] == "settings" for request in served.requests)


def test_parameters_are_set_with_control(speak: Any) -> None:
    served = speak(control=True)

    async def job(session: aiohttp.ClientSession) -> None:
        client = await connect(session, served)
        await next_json(client)
        await next_json(client)
        entry = {"name": "/indenter.gain", "value": 3, "type": "float64"}
        await client.send_json({"op": "setParameters", "parameters": [entry], "id": "one"})
        values = await next_json(client)
        assert values["op"] == "parameterValues"
        assert values["id"] == "one"
        await client.close()

    run(job)
    assert {"op": "set", "node": "indenter", "parameters": {"gain": 3}} in served.requests


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        ("/foxglove", {}, 403),
        ("/foxglove?token=wrong", {}, 403),
        (f"/foxglove?token={TOKEN}", {"Origin": "https://evil.example"}, 403),
        (f"/foxglove?token={TOKEN}", {"Origin": "file://"}, 403),
        (f"/foxglove?token={TOKEN}", {"Host": "evil.example"}, 421),
        (f"/ws?token={TOKEN}", {}, 403),
    ],
)
def test_who_may_not_connect(speak: Any, path: str, headers: dict[str, str], status: int) -> None:
    served = speak()

    async def job(session: aiohttp.ClientSession) -> None:
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await connect(session, served, path, **headers)
        assert refused.value.status == status

    run(job)


def test_an_origin_that_is_no_text_is_refused_without_a_trace(
    speak: Any, caplog: pytest.LogCaptureFixture
) -> None:
    served = speak()
    host, port = served.host.rsplit(":", 1)
    request = f"GET /foxglove?token={TOKEN} HTTP/1.1\r\nHost: {served.host}\r\nOrigin: http://"
    with socket.create_connection((host, int(port)), timeout=20) as connection:
        connection.sendall(request.encode() + b"\xff\xfe\r\n\r\n")
        assert connection.recv(4096).split()[1] == b"403"
    assert not caplog.records


def test_who_may_connect(speak: Any) -> None:
    """No origin (a program), an origin that was allowed, and older PlotJugglers without a path."""
    served = speak()

    async def job(session: aiohttp.ClientSession) -> None:
        for path, headers in (
            (f"/foxglove?token={TOKEN}", {}),
            (f"/foxglove?token={TOKEN}", {"Origin": "https://app.example"}),
            (f"/?token={TOKEN}", {}),
        ):
            client = await connect(session, served, path, **headers)
            assert (await next_json(client))["op"] == "serverInfo"
            await client.close()
        wrong = await connect(session, served, protocols=("other",))
        assert (await wrong.receive(timeout=10)).data == 1002

    run(job)


def test_a_client_that_does_not_read_keeps_the_newest(speak: Any) -> None:
    served = speak()

    async def job(session: aiohttp.ClientSession) -> None:
        client = await connect(session, served)
        await next_json(client)
        await next_json(client)
        await client.send_json({"op": "subscribe", "subscriptions": [{"id": 0, "channelId": 1}]})
        await until_wanted(served, {1})
        large = bytes(10_000)
        for number in range(20):
            messages = [struct.pack("<I", number * 1000 + i) + large for i in range(1000)]
            served.deliver(1, *messages)
        waiting = next(iter(served.foxglove._clients))._messages
        await asyncio.sleep(0.5)
        assert len(waiting) <= MOST_WAITING
        last = -1
        while last < 19_999:
            data = (await client.receive(timeout=10)).data
            number = struct.unpack_from("<I", data, 13)[0]
            assert number > last
            last = number
        await client.close()

    run(job)


@pytest.mark.process
@pytest.mark.timeout(240)
def test_foxglove_itself_sees_the_bag_that_is_replayed(
    command_line: Any, recorded_bag: Path
) -> None:
    """Foxglove's own client, with definitions as the server tells them, decodes every field."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node on this machine")
    if not (NODE_FOLDER / "node_modules").is_dir():
        pytest.skip(f"the npm packages are not there: run npm ci in {NODE_FOLDER}")
    command_line.environment["HC_DASHBOARD_TOKEN"] = TOKEN
    dashboard = command_line.start("dashboard", "--port", "0")
    said = [dashboard.stdout.readline() for _ in range(2)]
    assert " ws://127.0.0.1:" in said[1], (said, dashboard.stderr.read())
    address = said[1].split(": ", 1)[1].strip()
    script = str(NODE_FOLDER / "foxglove_client.mjs")
    output = command_line.folder / "client.jsonl"  # a pipe would be full after 31 messages
    with output.open("w") as file:
        client = command_line.launch(
            [node, script, address, "foxglove.sdk.v1", "/hc/estimate"],
            stdin=subprocess.PIPE,
            stdout=file,
        )
    replay = command_line.run("replay", str(recorded_bag), "--headless")
    assert replay.returncode == 0, replay.stderr
    client.communicate(timeout=60)  # closes its input
    dashboard.send_signal(signal.SIGINT)
    assert dashboard.wait(15) == 0
    lines = [json.loads(line) for line in output.read_text().splitlines()]
    assert "info" in lines[0]
    assert not [line for line in lines if "error" in line]
    got = [line["message"] for line in lines if "message" in line]
    # It subscribes once the topic is advertised, a second after the player has come.
    assert len(got) > 1000
    estimates = read_recording(recorded_bag).estimates
    by_sequence = {int(row["sequence"]): row for row in estimates}
    for message in got:
        row = by_sequence[int(message["sequence"])]
        for name in ("stiffness", "velocity_exponent_std", "force_predicted", "contact_position"):
            value = np.nan if message[name] is None else message[name]
            np.testing.assert_equal(value, row[name])
        np.testing.assert_array_equal(message["covariance"], row["covariance"])
    sequences = [int(message["sequence"]) for message in got]
    assert sequences == sorted(sequences)
