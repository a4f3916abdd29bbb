"""What made the numbers of a batch: versions for people, and a stamp that no edit leaves as it is.

Workers on other machines must have the same stamp, and a batch that is taken up again keeps the
results of the same stamp only.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.metadata
import platform
from pathlib import Path
from typing import Final

from hc_estimator import __version__
from hc_msgs_py.entry_points import sources_of

_PACKAGES: Final = ("hc_msgs_py", "hc_estimator", "hc_logger", "hc_bringup")
_OF_OTHERS: Final = ("hc.filters", "hc.contact_laws")
"""Entry points of other packages: their filters and laws make numbers too."""
_LIBRARIES: Final = ("numpy", "scipy", "numba", "mcap", "rosbags")


@functools.cache
def software_stamp() -> str:
    """Return a hash of all sources that a result may depend on, and of what they run on."""
    digest = hashlib.sha256()
    for package in _PACKAGES:
        root = Path(str(importlib.import_module(package).__file__)).parent
        for path in sorted(root.rglob("*.py")):
            digest.update(f"{package}/{path.relative_to(root).as_posix()}\0".encode())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    for group in _OF_OTHERS:
        for path in sorted(set(sources_of(group))):
            digest.update(f"{group}/{path.parent.name}/{path.name}\0".encode())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    for name, version in software_versions().items():
        digest.update(f"{name} {version}\n".encode())
    return digest.hexdigest()


def software_versions() -> dict[str, str]:
    """Return the versions of what makes the numbers, by name."""
    versions = {"hc": __version__, "python": platform.python_version()}
    return versions | {name: importlib.metadata.version(name) for name in _LIBRARIES}
