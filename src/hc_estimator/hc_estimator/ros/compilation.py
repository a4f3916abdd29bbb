"""The filters are compiled in a thread while the node already answers; the log says so."""

from __future__ import annotations

from functools import partial
from typing import Any

from hc_estimator import available_filters, create_estimator
from hc_msgs_py.background import BackgroundWork

LONG_S = 3.0
"""Longer than it takes to load the compiled filters from the cache."""


class Compilation(BackgroundWork):
    """Compiles all filters, so that a change of filter under a running stream finds them done."""

    def __init__(self, logger: Any) -> None:
        """Begin.

        Args:
            logger: of the node.
        """
        super().__init__(
            "compiling the filters", [partial(_compile, name) for name in available_filters()]
        )
        self._logger = logger
        self._announced = False

    def look(self) -> bool:
        """Return whether it is done; tell once if it lasts, and then when it is done."""
        if not self.done:
            if self.seconds > LONG_S and not self._announced:
                self._announced = True
                self._logger.info(
                    f"{self.progress}: this takes some minutes, once after an installation"
                )
            return False
        if self._announced:
            self._announced = False
            self._logger.info(f"compiled the filters in {self.seconds:.0f} s")
        return True


def compile_all() -> None:
    """Compile all filters here and now, or load them from the cache."""
    for name in available_filters():
        _compile(name)


def _compile(name: str) -> None:
    create_estimator(name).warm_up()
