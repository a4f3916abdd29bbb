"""Events in the log: each kind at most once a second, with the number of those left out."""

from __future__ import annotations

import time
from typing import Any

from hc_estimator.stream.readings import MEANINGS
from hc_estimator.stream.vocabulary import Event, EventKind

PERIOD_S = 1.0

_QUIET = frozenset(
    (EventKind.CONTACT_MADE, EventKind.CONTACT_LOST, EventKind.RECONFIGURED)
)  # part of normal work: on hc/events only, unless the log level is debug
_WARNINGS = frozenset(
    (
        EventKind.REJECTION_BURST,
        EventKind.TIME_JUMP,
        EventKind.INPUT_SILENT,
        EventKind.INPUT_FROZEN,
        EventKind.INPUT_SATURATED,
        EventKind.SOURCE_RESTARTED,
        EventKind.SOURCE_CONFLICT,
        EventKind.SAMPLES_SKIPPED,
        EventKind.MODEL_MISMATCH,
        EventKind.TARE_REFUSED,
        EventKind.INPUT_SUSPECT,
    )
)


class EventLog:
    """Writes events to a node's logger."""

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._next: dict[EventKind, float] = {}
        self._left_out: dict[EventKind, int] = {}

    def write(self, event: Event) -> None:
        """Write an event, or count it if its kind was written less than a second ago."""
        now = time.monotonic()
        kind = event.kind
        if now < self._next.get(kind, 0.0):
            self._left_out[kind] = self._left_out.get(kind, 0) + 1
            return
        self._next[kind] = now + PERIOD_S
        left_out = self._left_out.pop(kind, 0)
        more = f" (and {left_out} more since the last message)" if left_out else ""
        where = f" ({MEANINGS})" if kind is EventKind.INPUT_SUSPECT else ""
        text = f"{kind.name.lower()}: {event.reason}{more}{where}"
        # One line per level: rclpy keeps a level for each place that logs.
        if kind in _QUIET:
            self._logger.debug(text)
        elif kind in _WARNINGS:
            self._logger.warning(text)
        else:
            self._logger.info(text)
