"""Filters are compiled in a thread while their node already answers; the log says so."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from hc_estimator import available_filters, create_estimator
from hc_msgs_py.background import BackgroundWork

LONG_S = 3.0
"""Longer than it takes to load the compiled filters from the cache."""


class Compilation(BackgroundWork):
    """Compiles filters, or loads them from the cache."""

    def __init__(self, logger: Any, what: str, steps: Sequence[Callable[[], object]]) -> None:
        """Begin.

        Args:
            logger: of the node.
            what: what is compiled, for example "the filters".
            steps: compile it, one after the other.
        """
        super().__init__(f"compiling {what}", steps)
        self._compiled = what
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
            self._logger.info(f"compiled {self._compiled} in {self.seconds:.0f} s")
        return True


def all_filters() -> list[Callable[[], object]]:
    """Steps that compile all filters: a change of filter under a running stream finds them done."""
    return [partial(_compile, name) for name in available_filters()]


def compile_all() -> None:
    """Compile all filters here and now, or load them from the cache."""
    for step in all_filters():
        step()


def _compile(name: str) -> None:
    create_estimator(name).warm_up()
