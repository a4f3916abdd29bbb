"""The one way in which the suite compiles kernels, with a disk cache that cannot go stale.

numba compiles a cached function anew when the file that holds it changes, but not when a function
that it calls changes in another file. Here every cached kernel carries a hash of all sources that
kernels of its package are made of instead: an edit anywhere makes all of them anew, a new checkout
of the same text none. Nothing is compiled at import; the first call compiles or loads.

The cache is beside the sources. numba uses it there only where it may write; a user who may not
(another user's checkout, a read-only one) would compile all that is there anew. `ShippedCode` reads
it all the same, and keeps what is not there in the user's own cache if he has one.

Division follows IEEE rules (no ZeroDivisionError out of a kernel). Where no folder for the cache
can be written (read-only installation, no home), what is not in the shipped cache is compiled anew
in each process.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import llvmlite.binding
import numba
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    InTreeCacheLocator,
)

F = TypeVar("F", bound=Callable[..., Any])


class KernelCompiler:
    """Decorator of the kernels of one package.

    Attributes:
        stamp: hash of the sources, made when it is needed first.
    """

    def __init__(
        self,
        sources: Callable[[], Iterable[Path]],
        beside: Callable[[Any], Iterable[Path]] = lambda _: (),
    ) -> None:
        """Say what the kernels are made of.

        Args:
            sources: names every file that a kernel, or a constant of one, may come from.
            beside: names the files that one function, of another package, needs as well.
        """
        self._sources = sources
        self._beside = beside

    @functools.cached_property
    def stamp(self) -> str:
        """Hash of every source: the same numbers come of the same hash."""
        return _hash([Path(__file__), *sorted(self._sources())])

    def stamp_of(self, function: Callable[..., Any]) -> str:
        """Hash of every source of one function."""
        beside = sorted(self._beside(function))
        return self.stamp + _hash(beside) if beside else self.stamp

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
        if numba.config.DISABLE_JIT:  # a debugger steps through plain functions
            return _plain(function)
        own, stamp = None, self.stamp_of(function)
        try:
            dispatcher: Any = numba.njit(cache=True, error_model="numpy", nogil=nogil)(function)
        except RuntimeError:  # numba found no folder for the cache
            dispatcher = inlined(function, nogil=nogil)
        else:
            own = dispatcher._cache
            _check_by(own, stamp)
        _link_current_mathematics()
        # Who names another folder may want other code (NUMBA_BOUNDSCHECK): the shipped is not his.
        if not numba.config.CACHE_DIR:
            shipped = ShippedCode(function, stamp, own)
            if own is None or shipped.cache_path != own.cache_path:
                dispatcher._cache = shipped
        return dispatcher  # type: ignore[no-any-return]


def _plain(function: F) -> F:
    """Return a function as it is, with what a dispatcher has (NUMBA_DISABLE_JIT=1)."""
    function.py_func = function  # type: ignore[attr-defined]
    return function


@functools.cache
def _link_current_mathematics() -> None:
    """Let kernels call the C library's exp, log and pow as they are now.

    numba hands out those that its own wheel was linked with: the wrappers of glibc before 2.29,
    which add an eighth to each call for an error handling that nobody asks for. The numbers are
    the same. To be called after numba has made its first dispatcher, which names them.
    """
    try:
        library = ctypes.CDLL("libm.so.6")
    except OSError:  # another C library: numba's stay
        return
    for name in ("exp", "log", "pow"):
        address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
        llvmlite.binding.add_symbol(name, address)


def _hash(paths: Iterable[Path]) -> str:
    """Hash of files, by name and content."""
    content = hashlib.sha256()
    for path in paths:
        content.update(path.name.encode())
        content.update(path.read_bytes())
    return content.hexdigest()


def inlined(function: F, *, nogil: bool = False) -> F:
    """Compile a small helper that only other kernels call: no cache file of its own."""
    if numba.config.DISABLE_JIT:
        return _plain(function)
    return numba.njit(error_model="numpy", nogil=nogil)(function)  # type: ignore[no-any-return]


def inlined_always(function: F) -> F:
    """Compile a small function without branches into whatever calls it.

    LLVM makes no vector loop of one with a call in it, and left to itself it inlines what it likes.
    """
    if numba.config.DISABLE_JIT:
        return _plain(function)
    return numba.njit(error_model="numpy", forceinline=True)(function)  # type: ignore[no-any-return]


def by_code(functions: Sequence[Callable[..., Any]], code: int = 0) -> Callable[..., Any]:
    """Return a compiled function of a code and arguments that calls the function with that code.

    These links have no cache of their own: they are compiled into the kernels that call them,
    which have. (numba would make a tuple of functions one of pointers, which it cannot inline.)

    Args:
        functions: compiled ones, the position being the code; one at least.
        code: of the first.
    """
    function = functions[0]
    if len(functions) == 1:
        last: Callable[..., Any] = numba.njit(error_model="numpy")(
            lambda _code, *arguments: function(*arguments)
        )
        return last
    others = by_code(functions[1:], code + 1)

    def choose(wanted: int, *arguments: Any) -> Any:
        if wanted == code:
            return function(*arguments)
        return others(wanted, *arguments)

    chosen: Callable[..., Any] = numba.njit(error_model="numpy")(choose)
    return chosen


class CheckedCode(IndexDataCacheFile):  # type: ignore[misc]
    """Cached code of one function that says itself what it was made of.

    numba writes the index before the code that it names. A process that reads in between, as of two
    that compile after an upgrade, found what an older source or another signature had left there.
    """

    def save(self, key: Any, data: Any) -> None:
        """Keep the code of a signature."""
        super().save(key, (self._source_stamp, key, data))

    def load(self, key: Any) -> Any:
        """Return the code of a signature; None if there is none of these sources."""
        kept = super().load(key)
        if not isinstance(kept, tuple) or kept[:2] != (self._source_stamp, key):
            return None
        return kept[2]


def _check_by(cache: Any, stamp: str) -> None:
    """Let a function's cache hold for sources of this stamp; numba offers no public way."""
    cache._cache_file = CheckedCode(cache._cache_path, cache._impl.filename_base, stamp)


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
        _check_by(self, stamp)
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
