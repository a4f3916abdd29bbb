"""Which of several sensors `hc setup` proposes: two arms with a wrench and a pose are two pairs.

What tells them apart is a word of their names: the namespace of a topic, the frame of a message.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

from hc_bringup.errors import FAILURE, UserError
from hc_bringup.frame_streams import FRAMES
from hc_bringup.robot_streams import POSITIONS, Stream

KINDS: Final = {"force": ("wrench", "effort"), "position": ("pose", "transform", "tf", "joint")}
"""Of streams that may be a sensor, best first."""
_HELP: Final = (
    "is the robot's driver running, in this ROS_DOMAIN_ID and on this machine "
    "(ROS_AUTOMATIC_DISCOVERY_RANGE)?"
)
RELAY: Final = "docs/guide/own_robot.md"
"""Where a node stands that gives readings without a time a stamp."""


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


class Choice:
    """The sensors that there are, of which two are chosen."""

    def __init__(self, streams: Sequence[Stream], others: Mapping[str, str]) -> None:
        """Begin.

        Args:
            streams: what may be a sensor.
            others: topics that only look like one, and why they are none.
        """
        self.streams = list(streams)
        self._others = others

    def given(self, name: str | None, what: str, beside: Stream | None = None) -> Stream:
        """Return the stream of a name, or else the one to propose beside another one.

        Args:
            name: TOPIC, or TOPIC:FRAME of a frame of tf.
            what: "force" or "position".
            beside: what it has to go with.

        Raises:
            UserError: if there is none, or it sends nothing.
        """
        fitting = [s for s in self.streams if s.kind in KINDS[what]]
        names = ", ".join(s.name for s in fitting) or "none"
        if name is None:
            proposed = best(self.streams, KINDS[what], beside)
            if proposed is None:
                raise self._none(what, names)
            return proposed
        full = name if name.startswith("/") else f"/{name}"
        stream = next((s for s in fitting if s.name == full), None) or _frame(fitting, full)
        if stream is None and full in self._others:
            raise UserError(f"{full} {self._others[full]}", FAILURE)
        if stream is None:
            raise UserError(f"there is no {what} topic {full}; there are: {names}", FAILURE)
        if stream.rate_hz == 0.0:
            raise UserError(f"{stream.topic} sends no message: is its driver running?", FAILURE)
        return stream

    def proposed(self, force: str | None, position: str | None) -> list[Stream]:
        """Return force and position: those of a name, or else those to propose.

        An effort and the position of its joint come in one message and are taken together.

        Raises:
            UserError: if there is none, or it sends nothing.
        """
        named = self.given(position, "position") if position is not None else None
        pushes = self.given(force, "force", named)
        if pushes.kind != "effort":
            return [pushes, named or self.given(None, "position", pushes)]
        if named is not None and named.topic != pushes.topic:
            raise UserError(
                f"the effort of {pushes.topic} goes with the position of its own joints"
            )
        return [pushes, pushes._replace(kind="joint")]

    def _none(self, what: str, names: str) -> UserError:
        """Say that nothing of a kind sends anything, and what to look at."""
        kinds = {"force": "WrenchStamped", "position": _position_types()}[what]
        said = f"no {what} topic of type {kinds} sends anything (there are: {names}): "
        if names == "none" and self._others:
            return UserError(
                f"{said}there are those above of other types; {RELAY} has a node that stamps them",
                FAILURE,
            )
        return UserError(said + _HELP, FAILURE)


def _frame(streams: list[Stream], name: str) -> Stream | None:
    """Return the stream of a frame that is not among the proposed ones: TOPIC:FRAME."""
    topic, _, child = name.partition(":")
    of_topic = [s for s in streams if s.kind == "tf" and s.topic == topic]
    return of_topic[0]._replace(child=child) if of_topic and child else None


def _position_types() -> str:
    *first, last = (name.rpartition("/")[2] for name in (*POSITIONS, FRAMES))
    return f"{', '.join(first)} or {last}"
