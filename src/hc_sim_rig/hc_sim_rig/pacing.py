"""A thread that acts at absolute deadlines and catches up after a stall without leaving any out.

Free of ROS: the stamps' clock is handed in. rclpy's own timers run 0.04 to 0.14 % slow
(measured at 1 kHz with rclpy 7.1.6), a sleep to an absolute deadline does not.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

NANOSECONDS = 1_000_000_000
RESYNCHRONISE_NS = NANOSECONDS // 4
"""How often the stamps' clock is compared with the monotonic clock that the thread sleeps on."""
JUMP_NS = NANOSECONDS // 10
"""A difference beyond this is a jump of the stamps' clock: counted once, and not followed."""
LONGEST_SLEEP_S = 0.1
"""So that a stop is noticed soon at low rates."""


@dataclass
class PacingReport:
    """What happened so far; read by the node's diagnostics."""

    acts: int = 0
    overruns: int = 0
    """Deadlines missed by more than a period (each sample of a burst that catches up counts)."""
    largest_delay_ns: int = 0
    """Largest delay of an act behind its deadline since the report was last taken."""
    clock_jumps: int = 0


class DeadlineThread:
    """Calls `act(index, stamp_ns)` once per period until it returns False or stop() is called.

    Stamps are start + index * period exactly, whatever the delays. The deadlines follow the
    stamps' clock while it is slewed (NTP), not when it jumps.
    """

    def __init__(
        self, rate_hz: float, act: Callable[[int, int], bool], clock_ns: Callable[[], int]
    ) -> None:
        """Prepare the thread; start() starts it.

        Args:
            rate_hz: acts per second [Hz].
            act: what to do; takes the index of the act and the time of its deadline on the
                stamps' clock [ns]; returns False to end.
            clock_ns: the stamps' clock [ns].
        """
        self._act = act
        self._clock_ns = clock_ns
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="sampler", daemon=True)
        self._period_ns = NANOSECONDS / rate_hz
        self._start_ns = 0
        self.report = PacingReport()
        self.error: Exception | None = None

    @property
    def started(self) -> bool:
        """Whether start() was called."""
        return self._thread.ident is not None

    @property
    def running(self) -> bool:
        """Whether the thread still acts."""
        return self._thread.is_alive()

    def stamp_ns(self, index: int) -> int:
        """Return the deadline of an act by the stamps' clock [ns]; for `act` to look ahead."""
        return self._start_ns + round(index * self._period_ns)

    def start(self) -> None:
        """Start acting: the first deadline is now."""
        self._thread.start()

    def stop(self) -> None:
        """End after the act in progress and wait for the thread."""
        self._stop.set()
        if self.started:
            self._thread.join()

    def raise_failure(self, kind: type[Exception], who: str) -> None:
        """Raise what ended the thread, if anything did.

        Args:
            kind: of the exception.
            who: acted, for its message.
        """
        if self.error is not None:
            raise kind(f"{who} stopped: {self.error}") from self.error

    def take_largest_delay_ns(self) -> int:
        """Return the largest delay since the last call."""
        delay, self.report.largest_delay_ns = self.report.largest_delay_ns, 0
        return delay

    def _run(self) -> None:
        """Act at every deadline; an error is kept for the node, which reports it and ends."""
        try:
            self._loop()
        except Exception as error:  # noqa: BLE001 - handed to the owner, who raises it again
            self.error = error

    def _loop(self) -> None:
        report = self.report
        period_ns = self._period_ns
        start_ns = self._start_ns = self._clock_ns()
        offset_ns = start_ns - time.monotonic_ns()
        check_ns = start_ns + RESYNCHRONISE_NS
        jumped_ns = 0  # by all jumps together
        index = 0
        while not self._stop.is_set():
            stamp_ns = self.stamp_ns(index)
            deadline_ns = stamp_ns - offset_ns
            wait_ns = deadline_ns - time.monotonic_ns()
            if wait_ns > 0:
                if wait_ns > LONGEST_SLEEP_S * NANOSECONDS:
                    time.sleep(LONGEST_SLEEP_S)
                    continue
                time.sleep(wait_ns * 1e-9)
            delay_ns = time.monotonic_ns() - deadline_ns
            if delay_ns > period_ns:
                report.overruns += 1
            report.largest_delay_ns = max(report.largest_delay_ns, delay_ns)
            if not self._act(index, stamp_ns):
                return
            index += 1
            report.acts = index
            if stamp_ns >= check_ns:
                check_ns = stamp_ns + RESYNCHRONISE_NS
                change_ns = self._clock_ns() - time.monotonic_ns() - offset_ns - jumped_ns
                if abs(change_ns) < JUMP_NS:
                    offset_ns += change_ns
                else:
                    report.clock_jumps += 1
                    jumped_ns += change_ns
