"""How late the machine itself wakes a thread that sleeps to a deadline, in a process of its own.

Usage: python -m hc_bringup.machine_wake_ups FILE HZ SECONDS. Beside a measurement of latencies it
tells what of their tail is the machine's: the processor that was asleep, the host that had taken it
away, the kernel. In real time it runs one priority above the suite, so that it waits for nothing of
it. It wakes HZ times a second until its input is closed, SECONDS at most, and writes to FILE (.npy)
by how much each wake-up was late [s]; those after a stall count as the samples do, each by itself.
"""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_msgs_py import realtime

FASTEST_HZ: Final = 1000.0
"""It takes 1 % of a core then, which the suite has not; its tail is the same at higher rates."""


def wake_ups(rate_hz: float, number: int, closed: threading.Event) -> NDArray[np.float64]:
    """Sleep to deadlines that are a period apart.

    Args:
        rate_hz: deadlines a second, beyond FASTEST_HZ those.
        number: of deadlines at most.
        closed: ends it before.

    Returns:
        How late each wake-up was [s], shape (number or fewer,).
    """
    period_s = 1.0 / min(rate_hz, FASTEST_HZ)
    late_s = np.full(number, -1.0)  # touched: no page of it comes into memory in the middle
    start_s = time.monotonic()
    done = 0
    while done < number and not closed.is_set():
        deadline_s = start_s + (done + 1) * period_s
        left_s = deadline_s - time.monotonic()
        if left_s > 0.0:
            time.sleep(left_s)
        late_s[done] = time.monotonic() - deadline_s
        done += 1
    return late_s[:done]


def main() -> int:
    """Measure until the input is closed; returns the exit status."""
    file, rate_hz, seconds = Path(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])
    closed = threading.Event()

    def wait_for_end() -> None:
        sys.stdin.read()
        closed.set()

    threading.Thread(target=wait_for_end, daemon=True).start()
    realtime.enter(below=-1)
    np.save(file, wake_ups(rate_hz, round(seconds * min(rate_hz, FASTEST_HZ)), closed))
    return 0


if __name__ == "__main__":
    sys.exit(main())
