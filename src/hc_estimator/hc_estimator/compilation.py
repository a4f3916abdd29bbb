"""The decorators of this package's kernels, and what those are made of.

How they are compiled and cached: hc_msgs_py.compilation. A contact law of another package is
compiled into the kernels, so that an edit of it makes them anew; a kernel of another package's
filter goes with its own folder as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from hc_estimator.laws_of_others import law_sources, sources_beside
from hc_msgs_py.compilation import KernelCompiler

# No kernel and no constant of a kernel comes from here: what calls them, the node and its own.
WITHOUT_KERNELS = (
    *("stream", "ros", "node.py", "array.py", "given_arrays.py"),
    *("series_table.py", "packed_state.py"),
)


def kernel_sources() -> Iterator[Path]:
    """Every source file that a kernel of this package may depend on."""
    root = Path(__file__).parent
    for path in root.rglob("*.py"):
        if path.relative_to(root).parts[0] not in WITHOUT_KERNELS:
            yield path
    yield from law_sources()


compiled = KernelCompiler(kernel_sources, beside=sources_beside)
compiled_without_lock = compiled.without_lock
