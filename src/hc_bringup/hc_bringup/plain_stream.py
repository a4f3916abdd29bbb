"""Standard output and error that show control characters rather than obey them.

What the command prints holds names out of files and messages of others. What draws on the terminal
on purpose (the live view, bars of progress) takes the stream of `drawing_on`.
"""

from __future__ import annotations

import io
from typing import IO, Any, Final, cast

from hc_msgs_py.plain_text import visible

_COLOURS_OFF: Final = "\x1b[0m"
"""What colorama, which numba brings along, writes to a terminal when Python ends."""


def make_plain(stream: io.TextIOWrapper) -> None:
    """Let a stream write control characters visibly, whoever writes to it."""

    def write(text: str) -> int:
        return type(stream).write(stream, text if text == _COLOURS_OFF else visible(text))

    stream.__dict__["write"] = write


def drawing_on(stream: Any) -> IO[str]:
    """Return a stream to the same place that leaves text as it is."""
    return cast("IO[str]", _Drawing(stream))


class _Drawing:
    """All that a stream is, with the writing of its class."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write text as it is."""
        return int(type(self._stream).write(self._stream, text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
