"""The decorators of this package's kernels, and what those are made of.

How they are compiled and cached: hc_msgs_py.compilation.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from hc_msgs_py.compilation import KernelCompiler

# No kernel and no constant of a kernel comes from here: what calls them, the node and its own.
WITHOUT_KERNELS = ("input", "online", "ros", "node.py", "array.py")


def kernel_sources() -> Iterator[Path]:
    """Every source file of the package that a kernel may depend on."""
    root = Path(__file__).parent
    for path in root.rglob("*.py"):
        if path.relative_to(root).parts[0] not in WITHOUT_KERNELS:
            yield path


compiled = KernelCompiler(kernel_sources)
compiled_without_lock = compiled.without_lock
