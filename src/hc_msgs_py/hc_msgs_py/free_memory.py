"""Whether there is memory for a result before it is made.

Linux gives memory that it does not have, and ends the program without a word once it is written to.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Final

MEMINFO: Final = Path("/proc/meminfo")
CGROUP: Final = Path("/sys/fs/cgroup")
"""Of a container: what it may use, and what it does."""
BYTES_PER_SAMPLE: Final = 500
"""Of the estimates of a long recording, with what is made of them: 485 were measured."""


class NotEnoughMemoryError(MemoryError):
    """There is not enough memory for a result; one line that says how much is needed."""


def require_memory_for(samples: int) -> None:
    """See that the estimates of so many samples find room.

    Raises:
        NotEnoughMemoryError: if they do not.
    """
    needed, free = samples * BYTES_PER_SAMPLE, free_bytes()
    if needed > free:
        raise NotEnoughMemoryError(
            f"the estimates of {samples:,} samples need {needed / 1e9:.1f} GB of memory, and "
            f"{free / 1e9:.1f} GB are free: make a bag of the recording (hc bag convert), cut it "
            "into parts (hc bag split --every 3600), and take these one by one"
        )


def free_bytes() -> float:
    """Return how much memory can be had, swap included; infinity where nothing tells."""
    free = math.inf
    try:
        said = MEMINFO.read_text()
        found = re.findall(r"^(?:MemAvailable|SwapFree):\s+(\d+) kB", said, re.MULTILINE)
        if found:
            free = 1024.0 * sum(map(int, found))
        limit = (CGROUP / "memory.max").read_text().strip()
        if limit.isdecimal():
            used = int((CGROUP / "memory.current").read_text())
            # Files that were read count as used, and give way.
            said = (CGROUP / "memory.stat").read_text()
            read = re.findall(r"^(?:in)?active_file (\d+)$", said, re.MULTILINE)
            free = min(free, float(int(limit) - used + sum(map(int, read))))
    except (OSError, ValueError):  # no such file in this kernel or container: nothing is known
        return free
    return free
