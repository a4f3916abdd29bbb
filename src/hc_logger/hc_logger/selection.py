"""Which topics: names and patterns with * and ?, as in a shell."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase


def full_name(name: str, namespace: str = "/") -> str:
    """Return a topic name or pattern with its leading slash, relative ones in the namespace."""
    if name.startswith(("/", "*")):
        return name
    return f"{namespace.rstrip('/')}/{name}"


def is_pattern(name: str) -> bool:
    """Whether a name stands for all topics that fit it."""
    return not set("*?[").isdisjoint(name)


class TopicSelection:
    """Names and patterns to take and to leave out; leaving out wins."""

    def __init__(
        self, take: Sequence[str], leave: Sequence[str] = (), namespace: str = "/"
    ) -> None:
        """Prepare a selection; empty texts are ignored (a ROS list parameter cannot be empty)."""
        self._take = [full_name(name, namespace) for name in take if name]
        self._leave = [full_name(name, namespace) for name in leave if name]

    def names(self) -> list[str]:
        """Return the names that are no patterns."""
        return [name for name in (*self._take, *self._leave) if not is_pattern(name)]

    def leaves_out(self, topic: str) -> bool:
        """Whether a topic is to be left out."""
        return any(fnmatchcase(topic, p) for p in self._leave)

    def __contains__(self, topic: str) -> bool:
        return any(fnmatchcase(topic, p) for p in self._take) and not self.leaves_out(topic)
