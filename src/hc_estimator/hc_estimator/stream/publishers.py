"""Follows one of the publishers of a topic, told apart by how each numbers its messages.

A message does not name its publisher, but it comes with its number in that publisher's own count
(the middleware's publication sequence number). The counts of two publishers are two lines over
time; a message belongs to the line that it continues. The line that was there first is followed
until it has been silent for a while.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

LARGEST_GAP = 5000
"""So many messages may be lost in one piece: more than the deepest queue holds."""
_PERIOD_WEIGHT = 1.0 / 64.0
MOST_LINES = 8
"""Lines that are remembered beside the followed one; the one that was silent longest goes."""


@dataclasses.dataclass
class _Line:
    """One publisher: the number of its newest message and when that came."""

    number: int
    arrival_ns: int


class PublisherLines:
    """Decides, message by message, whether it is of the publisher that is followed.

    Attributes:
        takeover_ns: the followed publisher must be silent for so long before another is followed.
        lost: messages of the followed publisher that never came.
        foreign: messages of other publishers.
        takeovers: how often another publisher was followed instead.
    """

    def __init__(self, publishers: Callable[[], int], *, takeover_ns: int = 250_000_000) -> None:
        """Follow whoever speaks first.

        Args:
            publishers: returns how many publishers the topic has; asked only when a message does
                not simply continue the line.
            takeover_ns: see above.
        """
        self.takeover_ns = takeover_ns
        self.lost = 0
        self.foreign = 0
        self.takeovers = 0
        self._publishers = publishers
        self._next = -1
        self._arrival_ns = 0
        self._period_ns = 0.0
        self._others: list[_Line] = []

    def speaking(self, now_ns: int, within_ns: int) -> int:
        """Return how many publishers have sent a message lately.

        Args:
            now_ns: the time now, by the clock of the arrivals.
            within_ns: how long ago "lately" begins.
        """
        lately = now_ns - within_ns
        return (self._next >= 0 and self._arrival_ns >= lately) + sum(
            line.arrival_ns >= lately for line in self._others
        )

    def follows(self, number: int | None, arrival_ns: int) -> bool:
        """Judge a message.

        Args:
            number: its number in its publisher's count; None where the middleware does not say.
            arrival_ns: when it came.

        Returns:
            Whether it is of the publisher that is followed. True without a number.
        """
        if number == self._next and not self._others:
            self._period_ns += (arrival_ns - self._arrival_ns - self._period_ns) * _PERIOD_WEIGHT
            self._next += 1
            self._arrival_ns = arrival_ns
            return True
        if number is None:
            return True
        if self._publishers() <= 1:
            if 0 < number - self._next <= LARGEST_GAP and self._next >= 0:
                self.lost += number - self._next
            self._others.clear()
            self._follow(number, arrival_ns)
            return True
        return self._choose(number, arrival_ns)

    def _choose(self, number: int, arrival_ns: int) -> bool:
        """Find the line among several that a message continues."""
        if self._next < 0:
            self._follow(number, arrival_ns)
            return True
        nearest = min(
            (line for line in self._others if 0 < number - line.number <= LARGEST_GAP),
            key=lambda line: number - line.number,
            default=None,
        )
        advance = number - self._next
        silent_ns = arrival_ns - self._arrival_ns
        if self._continues(advance, silent_ns) and (
            nearest is None or advance + 1 <= number - nearest.number
        ):
            self.lost += advance
            self._follow(number, arrival_ns)
            return True
        if silent_ns > self.takeover_ns:
            if nearest is not None:
                self._others.remove(nearest)
            self.takeovers += 1
            self._follow(number, arrival_ns)
            return True
        if nearest is None:
            self._others.append(_Line(number, arrival_ns))
            if len(self._others) > MOST_LINES:
                self._others.remove(min(self._others, key=lambda line: line.arrival_ns))
        else:
            nearest.number, nearest.arrival_ns = number, arrival_ns
        self.foreign += 1
        return False

    def _continues(self, advance: int, silent_ns: int) -> bool:
        """Whether the followed publisher may have come so far since its last message."""
        if advance == 0:
            return True
        expected_ns = (advance + 1) * self._period_ns
        return 0 < advance <= LARGEST_GAP and 0.5 * expected_ns < silent_ns < 2.0 * expected_ns

    def _follow(self, number: int, arrival_ns: int) -> None:
        self._next = number + 1
        self._arrival_ns = arrival_ns
