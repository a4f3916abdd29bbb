"""The decorator that compiles the rig's kernels, with a disk cache that cannot go stale.

The kernels here call the contact law of hc_estimator, so their cache carries a hash of its
sources too (why one is needed at all: hc_estimator.compilation).
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

from hc_estimator import contact
from hc_estimator.compilation import with_cache

F = TypeVar("F", bound=Callable[..., Any])

# No kernel and no constant of a kernel comes from files with these endings.
WITHOUT_KERNELS = ("node", "pictures", "pacing", "records")


@functools.cache
def _source_stamp() -> str:
    """Hash of every source file that a kernel here may come from."""
    here = Path(__file__).parent
    paths = [path for path in here.rglob("*.py") if not path.stem.endswith(WITHOUT_KERNELS)]
    paths += Path(contact.__file__).parent.rglob("*.py")
    content = hashlib.sha256()
    for path in sorted(paths):
        content.update(path.name.encode())
        content.update(path.read_bytes())
    return content.hexdigest()


def compiled(function: F) -> F:
    """Compile a function with numba in nopython mode at its first call, cached on disk.

    Args:
        function: function of arrays and scalars within what numba compiles.

    Returns:
        The dispatcher, callable like the function itself.
    """
    return with_cache(function, _source_stamp(), nogil=False)


def inlined(function: F) -> F:
    """Compile a small helper that only other kernels call (no cache file of its own).

    Args:
        function: as for `compiled`.

    Returns:
        The dispatcher.
    """
    return numba.njit(error_model="numpy")(function)  # type: ignore[no-any-return]
