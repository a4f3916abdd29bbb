"""Whether a tool turns while it is recorded: then no axis of its sensors is one direction.

A force along an axis of a sensor that turns takes part of the tool's weight along, and a pose of a
flange moves by its distance from the tip times the angle (0.1 m and 10 degrees: 17 mm).
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

TURNS_DEG: Final = 2.0
"""Less is the noise of a tracker, or costs less than the surface's own slope."""
_SHARE: Final = 99.0  # percentile: one attitude that is wrong is no turn


def turned_deg(quaternions: Any) -> float:
    """Return by how much a tool turned [degree] from where it was usually; 0 where none is told.

    Args:
        quaternions: attitudes, shape (n, 4), any order of the components; those without a length
            are left out.
    """
    found: NDArray[np.float64] = np.asarray(quaternions, float).reshape(-1, 4)
    lengths = np.linalg.norm(found, axis=1)
    usable = np.isfinite(lengths) & (lengths > 1e-6)
    if not usable.any():
        return 0.0
    found = found[usable] / lengths[usable, None]
    found *= np.where(found @ found[0] < 0.0, -1.0, 1.0)[:, None]  # q and -q are one attitude
    usual = np.median(found, axis=0)
    usual /= np.linalg.norm(usual)
    angles = 2.0 * np.degrees(np.arccos(np.clip(np.abs(found @ usual), 0.0, 1.0)))
    return float(np.percentile(angles, _SHARE))


def turning_line(degrees: float) -> str:
    """Return what to say of a tool that turned so far, and what to do; empty if it did not."""
    if degrees < TURNS_DEG:
        return ""
    return (
        f"the tool turned by up to {degrees:.0f} degrees: read along one axis of each sensor, "
        "force and depth are wrong then, and so are K, B, n and p. Let it keep its attitude, or "
        "have all six axes read: input.contact.frame: surface, with tip, mounting and hc payload "
        "(docs/node.md, Six axes)"
    )
