"""Says in one line that kernels are being compiled, when that lasts longer than a moment.

The first command after an installation or an update compiles the filters, which takes minutes, and
whoever sees nothing meanwhile takes it for a hang. Nodes say it in their log instead
(hc_estimator.ros.compilation).
"""

from __future__ import annotations

import sys
import threading
from typing import Any, Final

from numba.core import event

AFTER_S: Final = 1.5
"""Longer than small kernels take."""
NOTICE: Final = (
    "compiling the filters: this takes some minutes, once after an installation or an update"
)
_COMPILES: Final = "numba:compile"  # sent where the cache did not have the code


class CompilationNotice(event.Listener):  # type: ignore[misc]  # numba ships no types
    """Prints the line on standard error, once, while something is still being compiled."""

    def __init__(self, after_s: float = AFTER_S) -> None:
        """Begin to listen.

        Args:
            after_s: so long a compilation lasts before it is told [s].
        """
        self._after_s = after_s
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
        if self._depth == 0 and self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def close(self) -> None:
        """Listen no more."""
        event.unregister(_COMPILES, self)

    def _tell(self) -> None:
        self._is_shown = True
        print(NOTICE, file=sys.stderr, flush=True)
