"""What waits for a viewer is bounded: who does not keep up loses the oldest and costs nobody."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Callable
from typing import Any

import aiohttp
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hc_bringup.dashboard.columns import COLUMNS
from hc_bringup.dashboard.frames import HEADER
from hc_bringup.dashboard.viewers import MOST_ANSWERS, MOST_ROW_FRAMES, Outbox

Serve = Callable[..., Any]


async def everything(outbox: Outbox) -> list[str | bytes]:
    return [await outbox.next() for _ in range(len(outbox))]


@given(st.integers(0, 3 * MOST_ROW_FRAMES), st.integers(0, 5), st.integers(0, 2 * MOST_ANSWERS))
def test_the_newest_win(frames: int, states: int, answers: int) -> None:
    async def job() -> None:
        outbox = Outbox()
        for number in range(frames):
            outbox.put_rows(b"%d" % number)
        for number in range(states):
            outbox.put_latest("status", f"status {number}")
        for number in range(answers):
            outbox.put_answer(f"answer {number}")
        got = await everything(outbox)
        rows = [int(one) for one in got if isinstance(one, bytes)]
        assert rows == list(range(frames))[-MOST_ROW_FRAMES:]
        assert [one for one in got if str(one).startswith("status")] == (
            [f"status {states - 1}"] if states else []
        )
        kept = min(answers, MOST_ANSWERS)
        assert sum(str(one).startswith("answer") for one in got) == kept
        lost = frames + states + answers - len(got)
        assert outbox.dropped == lost

    asyncio.run(job())


def test_a_stalled_viewer_costs_the_others_nothing(serve: Serve, token: str) -> None:
    """One viewer reads nothing at all; another one gets every row, and memory stays bounded."""
    served = serve()
    rows = np.zeros((200, len(COLUMNS)))  # 90 kB a frame
    frames = 400

    async def job() -> tuple[int, float]:
        jar = aiohttp.CookieJar(unsafe=True)
        async with aiohttp.ClientSession(cookie_jar=jar) as session:
            headers = {"Origin": served.origin}
            await session.post(f"{served.origin}/session", json={"token": token}, headers=headers)
            cookie = "; ".join(f"{c.key}={c.value}" for c in jar)
            stalled = socket.create_connection(("127.0.0.1", served.port))
            stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            stalled.sendall(
                f"GET /ws HTTP/1.1\r\nHost: {served.host}\r\nUpgrade: websocket\r\n"
                f"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                f"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nOrigin: {served.origin}\r\n"
                f"Cookie: {cookie}\r\n\r\n".encode()
            )
            reader = await session.ws_connect(
                f"ws://{served.host}/ws", headers=headers, max_msg_size=2**26
            )
            while served.backend.viewers < 2:
                await asyncio.sleep(0.01)
            seen = 0
            longest = 0.0
            for number in range(frames):
                before = time.perf_counter()
                served.server.publish_rows(0, rows)
                longest = max(longest, time.perf_counter() - before)
                while seen <= number:
                    message = await reader.receive(timeout=5)
                    if (
                        message.type is aiohttp.WSMsgType.BINARY
                        and HEADER.unpack_from(message.data)[0] == 1
                    ):
                        seen += 1
            slow = next(v for v in served.server._viewers if v.outbox.dropped)
            waiting = len(slow.outbox)
            stalled.close()
            await reader.close()
            return waiting, longest

    waiting, longest = asyncio.run(job())
    assert waiting <= MOST_ROW_FRAMES + MOST_ANSWERS
    assert longest < 0.5  # handing a frame over never waits for a viewer
