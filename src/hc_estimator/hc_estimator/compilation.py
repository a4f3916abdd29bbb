"""The one decorator that compiles the package's kernels, with a disk cache that cannot go stale.

numba recompiles a cached function when the file that holds it changes, but not when a function
that it calls changes in another file. Here every cached kernel carries a hash of all sources of
this package that kernels are made of instead: an edit anywhere invalidates all of them, a new
checkout of the same text none. Nothing is compiled at import; the first call (or
`Estimator.warm_up`) compiles or loads from the cache.

The cache is beside the sources. numba uses it there only where it may write; a user who may not
(another user's checkout, a read-only one) would compile all that is there anew. `ShippedCode` reads
it all the same, and keeps what is not there in the user's own cache if he has one.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, InTreeCacheLocator

F = TypeVar("F", bound=Callable[..., Any])

# No kernel and no constant of a kernel comes from here: what calls them, the node and its own.
WITHOUT_KERNELS = ("input", "online", "ros", "node.py", "array.py")


@functools.cache
def package_stamp() -> str:
    """Hash of every source file of the package that a kernel may depend on: the same numbers."""
    root = Path(__file__).parent
    content = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        if path.relative_to(root).parts[0] not in WITHOUT_KERNELS:
            content.update(path.relative_to(root).as_posix().encode())
            content.update(path.read_bytes())
    return content.hexdigest()


def compiled(function: F) -> F:
    """Compile a function with numba in nopython mode at its first call, cached on disk.

    Division follows IEEE rules (no ZeroDivisionError out of a kernel). Where no folder for the
    cache can be written (read-only installation, no home), what is not in the shipped cache is
    compiled anew in each process.

    Args:
        function: function of arrays and scalars within what numba compiles.

    Returns:
        The dispatcher, callable like the function itself (its plain form is `.py_func`).
    """
    return _compiled(function, nogil=False)


def compiled_without_lock(function: F) -> F:
    """Compile as `compiled` does; other Python threads run meanwhile."""
    return _compiled(function, nogil=True)


def _compiled(function: F, *, nogil: bool) -> F:
    return with_cache(function, package_stamp(), nogil=nogil)


def with_cache(function: F, stamp: str, *, nogil: bool) -> F:
    """Return the dispatcher of a function, whose compiled code is kept on disk.

    Args:
        function: as for `compiled`.
        stamp: whatever it was compiled from; code with another stamp is not used.
        nogil: whether other Python threads run meanwhile.
    """
    try:
        dispatcher = numba.njit(cache=True, error_model="numpy", nogil=nogil)(function)
    except RuntimeError:  # numba found no folder for the cache
        dispatcher = numba.njit(error_model="numpy", nogil=nogil)(function)
        own = None
    else:
        own = dispatcher._cache
        # numba offers no public way to add to the stamp; its index file holds it in this attribute.
        own._cache_file._source_stamp = stamp
    # Who names another folder may want other code (NUMBA_BOUNDSCHECK): what is shipped is not his.
    if not numba.config.CACHE_DIR:
        shipped = ShippedCode(function, stamp, own)
        if own is None or shipped.cache_path != own.cache_path:
            dispatcher._cache = shipped
    return dispatcher  # type: ignore[no-any-return]


class _BesideTheSources(InTreeCacheLocator):  # type: ignore[misc]  # numba ships no types
    """The folder beside the sources, whether it can be written or not."""

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _BesideTheSources:
        """Return it for a function."""
        return cls(py_func, py_file)


class _ShippedFiles(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_BesideTheSources,)


class ShippedCode(FunctionCache):  # type: ignore[misc]
    """Compiled code beside the sources, which is only read, and behind it the user's own."""

    _impl_class = _ShippedFiles

    def __init__(self, function: Callable[..., Any], stamp: str, own: FunctionCache | None) -> None:
        """Use what was compiled from sources of this stamp; None for a user without a cache."""
        super().__init__(function)
        self._cache_file._source_stamp = stamp
        self._own = own

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code for a signature, None if it is in neither place."""
        try:
            code = super().load_overload(sig, target_context)
        except OSError:  # not for this user to read
            code = None
        if code is None and self._own is not None:
            code = self._own.load_overload(sig, target_context)
        return code

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep new code in the user's own cache, if he has one."""
        if self._own is not None:
            self._own.save_overload(sig, data)
