"""What waits to be sent to one viewer: bounded, the newest wins.

A viewer that does not keep up (a sleeping laptop, a stopped browser) must cost nobody anything. Of
a status or a map only the latest is worth sending; of rows the oldest are dropped, and the page
asks for the missing ones once it has time again.
"""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Final

MOST_ROW_FRAMES: Final = 32
"""About a second of frames at 30 Hz."""
MOST_ANSWERS: Final = 64


class Outbox:
    """Messages for one viewer; belongs to the server's thread.

    Attributes:
        dropped: frames that the viewer was too slow for.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self._answers: deque[str | bytes] = deque()
        self._latest: dict[str, str | bytes] = {}
        self._rows: deque[bytes] = deque()
        self._something = asyncio.Event()

    def put_answer(self, message: str | bytes) -> None:
        """Queue what the viewer asked for."""
        if len(self._answers) >= MOST_ANSWERS:
            self._answers.popleft()
            self.dropped += 1
        self._answers.append(message)
        self._something.set()

    def put_latest(self, kind: str, message: str | bytes) -> None:
        """Queue a message that replaces the one of its kind that still waits."""
        self.dropped += kind in self._latest
        self._latest[kind] = message
        self._something.set()

    def put_rows(self, frame: bytes) -> None:
        """Queue a frame of rows."""
        if len(self._rows) >= MOST_ROW_FRAMES:
            self._rows.popleft()
            self.dropped += 1
        self._rows.append(frame)
        self._something.set()

    def __len__(self) -> int:
        return len(self._answers) + len(self._latest) + len(self._rows)

    async def next(self) -> str | bytes:
        """Wait for the message that is to be sent next."""
        while True:
            if self._answers:
                return self._answers.popleft()
            if self._latest:
                return self._latest.pop(next(iter(self._latest)))
            if self._rows:
                return self._rows.popleft()
            self._something.clear()
            await self._something.wait()
