"""Work that a node has to do before it can begin, while it already answers: compiling kernels.

A node that compiled in its constructor would answer no parameter and no ~/ready for minutes after
an installation. The work runs in a thread; numba and LLVM let the node's own thread through often
enough that it answers within some hundredths of a second.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import Final

STARTING: Final = "starting: "
"""How ~/ready begins what is missing while a node does such work: it is well, and needs time."""


class BackgroundWork:
    """Steps that are done one after the other in a thread, with their progress in words."""

    def __init__(self, what: str, steps: Sequence[Callable[[], object]]) -> None:
        """Begin.

        Args:
            what: what is done, for example "compiling the filters".
            steps: done in this order; the first one that raises ends the work.
        """
        self._what = what
        self._steps = steps
        self._finished = 0
        self._error: BaseException | None = None
        self._started_s = time.monotonic()
        self._seconds = 0.0
        # A node that is told to end in the middle of it does not wait for the end of it.
        self._thread = threading.Thread(target=self._run, name="background", daemon=True)
        self._thread.start()

    @property
    def done(self) -> bool:
        """Whether the work has ended, well or not."""
        return not self._thread.is_alive()

    @property
    def seconds(self) -> float:
        """For how long it has been going on, or how long it took [s]."""
        return self._seconds or time.monotonic() - self._started_s

    @property
    def progress(self) -> str:
        """What is done and how much of it is finished."""
        return f"{self._what}, {self._finished} of {len(self._steps)} done"

    def wait(self) -> None:
        """Wait for the end.

        Raises:
            Exception: what a step raised.
        """
        self._thread.join()
        if self._error is not None:
            raise self._error

    def _run(self) -> None:
        try:
            for step in self._steps:
                step()
                self._finished += 1
        except Exception as error:  # noqa: BLE001 - raised again where somebody waits
            self._error = error
        self._seconds = time.monotonic() - self._started_s
