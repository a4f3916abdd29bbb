"""The decorator of the rig's kernels, and what those are made of.

The kernels here call the contact law of hc_estimator and the tissues of other packages, so their
sources count too. How they are compiled and cached: hc_msgs_py.compilation.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from hc_estimator import contact
from hc_msgs_py.compilation import KernelCompiler, inlined
from hc_msgs_py.entry_points import sources_of

__all__ = ("compiled", "inlined")

# No kernel and no constant of a kernel comes from the folder ros or files with these endings.
WITHOUT_KERNELS = ("node", "pictures", "picture_style", "drawing", "pacing", "records")


def kernel_sources() -> Iterator[Path]:
    """Every source file that a kernel here may come from."""
    for path in Path(__file__).parent.rglob("*.py"):
        if path.parent.name != "ros" and not path.stem.endswith(WITHOUT_KERNELS):
            yield path
    yield from Path(contact.__file__).parent.rglob("*.py")
    yield from sources_of("hc.tissues")


compiled = KernelCompiler(kernel_sources)
