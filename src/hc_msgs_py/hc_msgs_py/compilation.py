"""The one way in which the suite compiles kernels, with a disk cache that cannot go stale.

numba compiles a cached function anew when the file that holds it changes, but not when a function
that it calls changes in another file. Here every cached kernel carries a hash of all sources that
kernels of its package are made of instead: an edit anywhere makes all of them anew, a new checkout
of the same text none. Nothing is compiled at import; the first call compiles or loads.

Division follows IEEE rules (no ZeroDivisionError out of a kernel). Where no folder for the cache
can be written (read-only installation, no home), a function is compiled anew in each process.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])


class KernelCompiler:
    """Decorator of the kernels of one package.

    Attributes:
        stamp: hash of the sources, made when it is needed first.
    """

    def __init__(self, sources: Callable[[], Iterable[Path]]) -> None:
        """Say what the kernels are made of.

        Args:
            sources: names every file that a kernel, or a constant of one, may come from.
        """
        self._sources = sources

    @functools.cached_property
    def stamp(self) -> str:
        """Hash of every source: the same numbers come of the same hash."""
        content = hashlib.sha256()
        for path in [Path(__file__), *sorted(self._sources())]:
            content.update(path.name.encode())
            content.update(path.read_bytes())
        return content.hexdigest()

    def __call__(self, function: F) -> F:
        """Compile a function with numba in nopython mode at its first call, cached on disk.

        Args:
            function: function of arrays and scalars within what numba compiles.

        Returns:
            The dispatcher, callable like the function itself (its plain form is `.py_func`).
        """
        return self._compiled(function, nogil=False)

    def without_lock(self, function: F) -> F:
        """Compile as the call does; other Python threads run meanwhile."""
        return self._compiled(function, nogil=True)

    def _compiled(self, function: F, *, nogil: bool) -> F:
        try:
            dispatcher = numba.njit(cache=True, error_model="numpy", nogil=nogil)(function)
        except RuntimeError:  # numba found no folder for the cache
            return inlined(function, nogil=nogil)
        # numba offers no public way to add to the stamp; its index file holds it here.
        dispatcher._cache._cache_file._source_stamp = self.stamp
        return dispatcher  # type: ignore[no-any-return]


def inlined(function: F, *, nogil: bool = False) -> F:
    """Compile a small helper that only other kernels call: no cache file of its own."""
    return numba.njit(error_model="numpy", nogil=nogil)(function)  # type: ignore[no-any-return]
