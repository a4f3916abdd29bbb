"""Which of several sensors `hc setup` proposes: two arms with a wrench and a pose are two pairs.

What tells them apart is a word of their names: the namespace of a topic, the frame of a message.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from hc_bringup.robot_streams import Stream


def best(
    streams: Sequence[Stream], kinds: tuple[str, ...], beside: Stream | None = None
) -> Stream | None:
    """Return the stream of some kinds to propose: of the first kind that lives, the fastest.

    Frames of tf are in the order in which they are proposed.

    Args:
        streams: what is there.
        kinds: best first.
        beside: what it has to go with: one that shares more words with it comes first.
    """
    for kind in kinds:
        alive = [s for s in streams if s.kind == kind and s.rate_hz > 0.0]
        if alive:
            alive = _nearest(alive, beside) if beside else alive
            return alive[0] if kind == "tf" else max(alive, key=lambda s: s.rate_hz)
    return None


def _nearest(streams: list[Stream], beside: Stream) -> list[Stream]:
    """Return those that share the most words with a stream, of words that not all of them have."""
    words = [_words(stream) for stream in streams]
    telling = _words(beside).difference(words[0].intersection(*words))
    shared = [len(telling & of_one) for of_one in words]
    return [s for s, count in zip(streams, shared, strict=True) if count == max(shared)]


def _words(stream: Stream) -> set[str]:
    """Return the words of a stream's names, of both its frames too."""
    names = f"{stream.topic}/{stream.frame}/{stream.child}".lower()
    return set(re.split(r"[^0-9a-z]+", names)) - {""}
