"""Says that kernels are being compiled, when that lasts longer than a moment, and that it goes on.

The first command after an installation or an update compiles the filters, which takes minutes, and
whoever sees nothing meanwhile takes it for a hang. What moves is the number of functions: each is
compiled after those that it calls. Nodes say it in their log (hc_estimator.ros.compilation).
"""

from __future__ import annotations

import sys
import threading
import time
from typing import Any, Final

from numba.core import event

from hc_bringup.heartbeat import MARK

AFTER_S: Final = 1.5
"""Longer than small kernels take."""
AGAIN_S: Final = 20.0
"""Between two lines that it goes on: on a busy machine it takes ten minutes instead of two."""
NOTICE: Final = (
    "compiling the filters: this takes some minutes, once after an installation or an update"
)
_COMPILES: Final = "numba:compile"  # sent where the cache did not have the code


class CompilationNotice(event.Listener):  # type: ignore[misc]  # numba ships no types
    """Prints on standard error that something is still being compiled, and for how long."""

    def __init__(self, after_s: float = AFTER_S, again_s: float = AGAIN_S) -> None:
        """Begin to listen.

        Args:
            after_s: so long a compilation lasts before it is told [s].
            again_s: so often it is told that it goes on [s].
        """
        self._after_s, self._again_s = after_s, again_s
        self._begin_s = 0.0
        self._functions = 0
        self._closed = threading.Event()
        self._depth = 0  # kernels compile the kernels that they call
        self._timer: threading.Timer | None = None
        self._is_shown = False
        event.register(_COMPILES, self)

    def on_start(self, _event: Any) -> None:
        """Set the clock at the outermost kernel."""
        self._depth += 1
        if self._depth == 1 and not self._is_shown:
            self._timer = threading.Timer(self._after_s, self._tell)
            self._timer.daemon = True
            self._timer.start()

    def on_end(self, _event: Any) -> None:
        """Stop the clock when the outermost kernel is done."""
        self._depth -= 1
        self._functions += 1
        if self._depth == 0 and self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def close(self) -> None:
        """Listen and speak no more."""
        self._closed.set()
        event.unregister(_COMPILES, self)

    def _tell(self) -> None:
        self._is_shown = True
        print(NOTICE, file=sys.stderr, flush=True)
        self._begin_s = time.monotonic() - self._after_s
        threading.Thread(target=self._go_on, daemon=True).start()

    def _go_on(self) -> None:
        while not self._closed.wait(self._again_s):
            if self._depth > 0:
                since = time.monotonic() - self._begin_s
                print(
                    f"{MARK}compiling the filters, since {since:.0f} s, "
                    f"{self._functions} functions done",
                    file=sys.stderr,
                    flush=True,
                )
