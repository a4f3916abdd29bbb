"""The one decorator that compiles the package's kernels, with a disk cache that cannot go stale.

numba recompiles a cached function when the file that holds it changes, but not when a function
that it calls changes in another file. Here every cached kernel carries a stamp of all sources of
this package instead, so that an edit anywhere invalidates all of them. Nothing is compiled at
import; the first call (or `Estimator.warm_up`) compiles or loads from the cache.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])

WITHOUT_KERNELS = ("node.py", "ros", "input", "online")  # nothing in there is compiled


@functools.cache
def _package_stamp() -> tuple[tuple[str, float, int], ...]:
    """Name, modification time and size of every source file that may hold or feed a kernel."""
    root = Path(__file__).parent
    stamps = []
    for path in sorted(root.rglob("*.py")):
        if path.relative_to(root).parts[0] in WITHOUT_KERNELS:
            continue
        status = path.stat()
        stamps.append((path.relative_to(root).as_posix(), status.st_mtime, status.st_size))
    return tuple(stamps)


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
    try:
        dispatcher = numba.njit(cache=True, error_model="numpy")(function)
    except RuntimeError:  # numba found no folder for the cache
        return numba.njit(error_model="numpy")(function)  # type: ignore[no-any-return]
    # numba offers no public way to add to the stamp; its index file holds it in this attribute.
    dispatcher._cache._cache_file._source_stamp = _package_stamp()
    return dispatcher  # type: ignore[no-any-return]
