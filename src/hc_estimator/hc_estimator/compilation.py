"""The one decorator that compiles the package's kernels, with a disk cache that cannot go stale.

numba recompiles a cached function when the file that holds it changes, but not when a function
that it calls changes in another file. Here every cached kernel carries a hash of all sources of
this package that kernels are made of instead: an edit anywhere invalidates all of them, a new
checkout of the same text none. So does an edit of another package's contact law, which is compiled
into them; a kernel of another package's filter goes with its own folder as well. Nothing is
compiled at import; the first call (or `Estimator.warm_up`) compiles or loads from the cache.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

from hc_estimator.laws_of_others import law_sources, sources_beside

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
    for path in law_sources():
        content.update(path.read_bytes())
    return content.hexdigest()


def _stamp_of(function: Callable[..., Any]) -> str:
    """Stamp of a kernel: that of this package, with its own folder if it comes from another one."""
    beside = sorted(sources_beside(function))
    if not beside:
        return package_stamp()
    content = hashlib.sha256(package_stamp().encode())
    for path in beside:
        content.update(path.read_bytes())
    return content.hexdigest()


def compiled(function: F) -> F:
    """Compile a function with numba in nopython mode at its first call, cached on disk.

    Division follows IEEE rules (no ZeroDivisionError out of a kernel). Where no folder for the
    cache can be written (read-only installation, no home), the function is compiled anew in each
    process.

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
    try:
        dispatcher = numba.njit(cache=True, error_model="numpy", nogil=nogil)(function)
    except RuntimeError:  # numba found no folder for the cache
        plain = numba.njit(error_model="numpy", nogil=nogil)(function)
        return plain  # type: ignore[no-any-return]
    # numba offers no public way to add to the stamp; its index file holds it in this attribute.
    dispatcher._cache._cache_file._source_stamp = _stamp_of(function)
    return dispatcher  # type: ignore[no-any-return]
