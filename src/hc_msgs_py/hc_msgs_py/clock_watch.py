"""Keeps a node going when the system clock is set back.

The wheels wait on the system clock even where they mean a span of time (their C++ library is that
old): set it back by an hour, and a wait of 10 ms takes an hour and 10 ms. Timers then stand still,
the executor hears no signal, and after 20 s the middleware of others takes the node for dead. A
thread that counts with the steady clock notices it and wakes them: a timer that is reset makes the
waiting thread look at the time again.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from typing import Any

PERIOD_S = 0.1
SMALLEST_STEP_S = 0.02
"""Slewing moves the clock by less than 0.1 ms in a period."""


class ClockWatch:
    """Watches the clock from a thread of its own. Use as a context manager.

    Attributes:
        steps_back: how often the clock was set back.
    """

    def __init__(
        self,
        executor: Any,
        timers: Callable[[], Iterable[Any]],
        *,
        each_look: Callable[[], None] = lambda: None,
        wall: Callable[[], float] = time.time,
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        """Prepare the watch.

        Args:
            executor: the EventsExecutor that spins.
            timers: returns the timers of its nodes.
            each_look: called every PERIOD_S, by the watch's thread.
            wall: the system clock [s].
            steady: a clock that nobody sets [s].
        """
        self._executor = executor
        self._timers = timers
        self._each_look = each_look
        self._wall = wall
        self._steady = steady
        self._difference = wall() - steady()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="clock_watch", daemon=True)
        self.steps_back = 0

    def __enter__(self) -> ClockWatch:
        self._thread.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stop.wait(PERIOD_S):
            self.look()
            self._each_look()

    def look(self) -> None:
        """Look whether the clock was set back, and wake what waits for it if so."""
        difference = self._wall() - self._steady()
        step, self._difference = difference - self._difference, difference
        if step > -SMALLEST_STEP_S:
            return
        self.steps_back += 1
        for timer in list(self._timers()):
            timer.reset()
        self._executor.wake()
