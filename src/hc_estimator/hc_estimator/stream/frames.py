"""Frames that hang on each other, as /tf tells them: where one is in another.

Of every frame the newest transform counts, however old it is: /tf is not interpolated, because each
reading of a pose has a stamp of its own and is used at that (late_readings.py).
"""

from __future__ import annotations

from hc_estimator.stream.contact_frame import (
    UPRIGHT,
    Quaternion,
    Vector,
    inverse,
    product,
    rotated,
)

Pose = tuple[Vector, Quaternion]
"""Where a frame is in another one [m], and how it is turned there."""

LONGEST_CHAIN = 1000
"""Frames that hang on themselves have no root."""
_HERE: Pose = ((0.0, 0.0, 0.0), UPRIGHT)


class FrameTree:
    """The newest transform of each frame."""

    def __init__(self) -> None:
        self._above: dict[str, tuple[str, Pose]] = {}

    def add(self, parent: str, child: str, pose: Pose) -> None:
        """Take in where a frame is in its parent."""
        self._above[child] = (parent, pose)

    def parent(self, frame: str) -> str | None:
        """Return the frame that a frame hangs on; None if it hangs on none that is known."""
        return self._above[frame][0] if frame in self._above else None

    def frames(self) -> tuple[str, ...]:
        """Return all frames that hang on another one."""
        return tuple(self._above)

    def root(self, frame: str) -> tuple[str, list[str]]:
        """Return what a frame hangs on in the end, and itself and those between, in this order."""
        chain = self._chain(frame)
        return chain[-1], chain[:-1]

    def between(self, base: str, tip: str) -> frozenset[str] | None:
        """Return the frames whose transforms tell where `tip` is in `base`; None if apart."""
        up, down = self._chain(tip), self._chain(base)
        common = next((frame for frame in up if frame in set(down)), None)
        if common is None:
            return None
        return frozenset(up[: up.index(common)] + down[: down.index(common)])

    def pose(self, base: str, tip: str) -> Pose | None:
        """Return where `tip` is in `base`; None if nothing known connects them."""
        up, down = self._chain(tip), self._chain(base)
        common = next((frame for frame in up if frame in set(down)), None)
        if common is None:
            return None
        of_tip = self._collect(up[: up.index(common)])
        return _after(_back(self._collect(down[: down.index(common)])), of_tip)

    def _chain(self, frame: str) -> list[str]:
        """Return a frame and all that it hangs on, in this order."""
        chain = [frame]
        while chain[-1] in self._above and len(chain) < LONGEST_CHAIN:
            chain.append(self._above[chain[-1]][0])
        return chain

    def _collect(self, chain: list[str]) -> Pose:
        """Return where the first frame of a chain is in what its last one hangs on."""
        pose = _HERE
        for frame in chain:
            pose = _after(self._above[frame][1], pose)
        return pose


def _after(outer: Pose, inner: Pose) -> Pose:
    """Return where what is at `inner` in a frame is, if that frame is at `outer`."""
    moved = rotated(outer[1], inner[0])
    place = (outer[0][0] + moved[0], outer[0][1] + moved[1], outer[0][2] + moved[2])
    return place, product(outer[1], inner[1])


def _back(pose: Pose) -> Pose:
    """Return where the outer frame is in the inner one."""
    turn = inverse(pose[1])
    x, y, z = rotated(turn, pose[0])
    return (-x, -y, -z), turn
