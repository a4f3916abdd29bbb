"""Viewers of the live page without a browser, in a process of their own, for a measurement.

Usage: python -m hc_bringup.viewer_load ADDRESS READING STALLED. READING connections read all that
comes; STALLED ones are as good as a sleeping laptop: connected, and reading nothing. A line tells
when all are connected; once the input is closed, one JSON line tells what came and the end follows.
"""

from __future__ import annotations

import asyncio
import json
import socket
import sys
import time
from urllib.parse import urlsplit

from aiohttp import ClientSession, CookieJar, WSMsgType

SMALL_BUFFER = 4096
"""Bytes that the system takes for a viewer that does not read; the server sees the rest."""


class Viewers:
    """Connections to one page; counts what came."""

    def __init__(self, address: str) -> None:
        parts = urlsplit(address)
        self.host = parts.netloc
        self.origin = f"http://{parts.netloc}"
        self._token = parts.fragment.removeprefix("token=")
        self.received = 0
        self._tasks: list[asyncio.Task[None]] = []
        self._stalled: list[socket.socket] = []

    async def open(self, session: ClientSession, reading: int, stalled: int) -> None:
        """Connect."""
        headers = {"Origin": self.origin}
        async with session.post(
            f"{self.origin}/session", json={"token": self._token}, headers=headers
        ) as answer:
            answer.raise_for_status()
            cookie = "; ".join(f"{one.key}={one.value}" for one in answer.cookies.values())
        for _ in range(reading):
            self._tasks.append(asyncio.ensure_future(self._read(session, headers)))
        host, port = self.host.rsplit(":", 1)
        for _ in range(stalled):
            connection = socket.create_connection((host, int(port)))
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SMALL_BUFFER)
            connection.sendall(
                f"GET /ws HTTP/1.1\r\nHost: {self.host}\r\nUpgrade: websocket\r\n"
                "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                f"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nOrigin: {self.origin}\r\n"
                f"Cookie: {cookie}\r\n\r\n".encode()
            )
            self._stalled.append(connection)

    async def _read(self, session: ClientSession, headers: dict[str, str]) -> None:
        async with session.ws_connect(
            f"ws://{self.host}/ws", headers=headers, max_msg_size=2**26
        ) as connection:
            async for message in connection:
                if message.type is WSMsgType.BINARY:
                    self.received += len(message.data)
                else:
                    self.received += len(message.data.encode())

    def close(self) -> None:
        """Disconnect."""
        for task in self._tasks:
            task.cancel()
        for connection in self._stalled:
            connection.close()


async def load(address: str, reading: int, stalled: int) -> None:
    """Look until the input is closed."""
    async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as session:
        viewers = Viewers(address)
        await viewers.open(session, reading, stalled)
        print("connected", flush=True)
        start = time.monotonic()
        await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
        seconds = time.monotonic() - start
        viewers.close()
        each = viewers.received / max(reading, 1) / seconds
        print(json.dumps({"bytes_per_second_each": each}), flush=True)


if __name__ == "__main__":
    asyncio.run(load(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])))
