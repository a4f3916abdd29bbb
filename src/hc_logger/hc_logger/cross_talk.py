"""Cross-talk of a force/torque sensor: a force across the press shows along it as well.

No tissue knows of it. What is read along the press is described by depth and speed, in powers of
them and not by a law, with the forces across beside them: what these explain that depth and speed
do not is cross-talk, or a sensor that sits turned by a few degrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hc_estimator.stream.merger import Merged

Array = NDArray[np.float64]

LARGEST: Final = 0.12
"""Of the force across: more is an axis that was taken for another, or a tool that turns."""
LEAST: Final = 0.01
LEAST_GAIN: Final = 0.7
"""What is left of the variance with the forces across, at most."""
ALIKE: Final = 0.25
"""Of it, by which the two halves of a recording may differ."""
LEAST_SAMPLES: Final = 1000
MOST_ROWS: Final = 20_000
SMOOTH_S: Final = 0.03
PULLED: Final = 0.1
"""Of the deviation in the direction in which the tool is pulled most."""


class CrossTalk(NamedTuple):
    """A force across that shows along the press.

    Attributes:
        share: of it that shows, in the direction from which most does.
        direction: along which to read, so that it shows no more, shape (3,).
        force_n: by how much it goes up and down along the press, 98 of 100 readings [N].
    """

    share: float
    direction: Array
    force_n: float


def cross_talk_line(
    topic: str,
    forces: ArrayLike,
    stamps_ns: Sequence[int],
    samples: Sequence[Merged],
    read: Sequence[float],
) -> str:
    """Say that a force across the press shows along it; empty if it does not.

    Args:
        topic: of the forces.
        forces: readings [N], three components each, shape (n, 3) or (3 n,).
        stamps_ns: of the forces [ns], n of them.
        samples: made of them, with the displacement.
        read: unit vector along which they are read, before the sign.
    """
    values: Array = np.asarray(forces, np.float64).reshape(-1, 3)
    if len(values) != len(stamps_ns) or not len(samples):
        return ""  # those that repeat one are left out, and nobody knows which
    origin_ns = stamps_ns[0]
    known = [
        ((s.stamp_ns - origin_ns) * 1e-9, s.displacement)
        for s in samples
        if s.displacement is not None
    ]
    if not known:
        return ""
    stamps_s: Array = (np.asarray(stamps_ns, np.int64) - origin_ns) * np.float64(1e-9)
    times, places = np.array(known, np.float64).T
    at = np.interp(stamps_s, times, places, left=np.nan, right=np.nan)
    found = find_cross_talk(
        stamps_s, np.asarray(at, np.float64), values, np.asarray(read, np.float64)
    )
    if found is None:
        return ""
    numbers = ",".join(f"{x + 0.0:.3f}" for x in found.direction)
    return (
        f"{100.0 * found.share:.1f} % of the force across the press shows along it, up to "
        f"{found.force_n:.2g} N in {topic}: cross-talk of the sensor, or it sits turned by "
        f"{np.degrees(np.arctan(found.share)):.1f} degrees: --input force.axis=direction --input "
        f"force.direction={numbers} (or calibrate the sensor, and keep what pulls across away)"
    )


def find_cross_talk(
    stamps_s: Array, displacement: Array, forces_n: Array, read: Array
) -> CrossTalk | None:
    """Return the cross-talk that readings show; None where there is none, or nobody can tell.

    Args:
        stamps_s: of the forces [s], shape (n,).
        displacement: into the tissue at these stamps, in any unit, shape (n,).
        forces_n: three components each [N], shape (n, 3).
        read: unit vector along which they are read, before the sign, shape (3,).
    """
    finite = np.isfinite(displacement) & np.isfinite(forces_n).all(axis=1)
    rows = np.flatnonzero(finite)[:: max(1, int(finite.sum()) // MOST_ROWS)]
    if len(rows) < LEAST_SAMPLES or not np.ptp(displacement[rows]) > 0.0:
        return None
    times, depth, forces = stamps_s[rows], displacement[rows], forces_n[rows]
    step_s = float(np.median(np.diff(times)))
    if not step_s > 0.0 or not (np.diff(times) > 0.0).all():
        return None
    along = forces @ read
    first = np.eye(3)[int(np.argmin(np.abs(read)))]
    one = np.cross(read, first)
    axes = np.stack([one / np.linalg.norm(one), np.cross(read, one / np.linalg.norm(one))])
    axes = _pulled_along(forces, axes)
    across = forces @ axes.T
    motion = _powers(times, depth, along, max(3, round(SMOOTH_S / step_s)))
    half = len(rows) // 2
    shares, left = _fitted(motion, across, along)
    share = float(np.linalg.norm(shares))
    without = _fitted(motion, across[:, :0], along)[1]
    if left > LEAST_GAIN * without or not LEAST < share < LARGEST:
        return None
    for part in (slice(half), slice(half, None)):
        of_part, _left = _fitted(motion[part], across[part], along[part])
        if float(np.linalg.norm(of_part - shares)) > ALIKE * share:
            return None
    low, high = np.quantile(across @ shares, (0.01, 0.99))
    direction = read - shares @ axes
    return CrossTalk(share, direction / np.linalg.norm(direction), 0.5 * float(high - low))


def _pulled_along(forces: Array, axes: Array) -> Array:
    """Return the directions across in which the tool is pulled, shape (1 or 2, 3).

    Where it is pulled in one alone the other holds noise, and nothing tells what of it would show.
    """
    varies = np.cov((forces @ axes.T).T)
    squares, vectors = np.linalg.eigh(varies)
    kept = squares > PULLED**2 * squares[-1]
    return np.asarray(vectors[:, kept].T @ axes)


def _powers(times: Array, depth: Array, along: Array, width: int) -> Array:
    """Return powers of depth and speed, shape (n, columns)."""
    window = np.ones(width) / width
    padded = np.pad(depth, (width // 2, width - 1 - width // 2), "edge")
    smooth = np.convolve(padded, window, "valid")
    speed = np.gradient(smooth, times)
    # The surface is not known: it lies where the force begins to grow, and powers from there on.
    levels = np.quantile(smooth, np.linspace(0.0, 0.9, 10))
    hinges = np.maximum(smooth[:, None] - levels[None, :], 0.0) / max(float(np.ptp(smooth)), 1e-12)
    speed = speed / max(float(np.std(speed)), 1e-12)
    return np.column_stack([np.ones(len(times)), hinges, hinges**2, hinges * speed[:, None], speed])


def _fitted(motion: Array, across: Array, along: Array) -> tuple[Array, float]:
    """Return how much of the forces across shows along the press, and the variance left [N^2]."""
    columns = np.column_stack([motion, across])
    fitted = np.linalg.lstsq(columns, along, rcond=1e-9)[0]
    return np.asarray(fitted[motion.shape[1] :], np.float64), float(
        np.var(along - columns @ fitted)
    )
