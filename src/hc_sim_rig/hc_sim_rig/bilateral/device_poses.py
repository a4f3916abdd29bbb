"""Where a haptic device says that the hand is: what cannot be a hand gives no force."""

from __future__ import annotations

import math
from typing import NamedTuple

from hc_sim_rig.bilateral.datagrams import LARGEST_MM

TIMEOUT_S = 0.05
"""A device that is silent for so long gets no force."""
FASTEST_MM_S = 2000.0
SLACK_MM = 2.0
"""A hand moves no faster; the slack is for poses that come in a bunch after a stall."""


class HandPlace(NamedTuple):
    """Where the hand is, in the slave's millimetres."""

    position_mm: float
    lateral_mm: float
    elapsed_s: float
    """Since the pose before that was asked for; 0 if it is the same one."""


class _Pose(NamedTuple):
    position_mm: float
    lateral_mm: float
    arrival_s: float
    stamp_s: float


class DevicePoses:
    """Takes a device's poses as they come, from any thread; says where the hand is.

    Attributes:
        accepted: poses.
        refused: poses by reason: no_number, out_of_range, jump.
        why_refused: of the last one that was, in words.
    """

    def __init__(self, scale: float) -> None:
        """Begin without a pose.

        Args:
            scale: millimetres of the slave for one of the device.
        """
        self._scale = scale
        self._place: _Pose | None = None
        self._last: _Pose | None = None
        self._used: _Pose | None = None
        self._breaks = self._breaks_seen = 0
        self.accepted = 0
        self.refused = dict.fromkeys(("no_number", "out_of_range", "jump"), 0)
        self.why_refused = ""

    def take(
        self, position_mm: float, lateral_mm: float, now_s: float, stamp_s: float = 0.0
    ) -> None:
        """Take a pose.

        After one that is refused, a silence or a jump the motion begins anew.

        Args:
            position_mm: into the tissue, in the device's millimetres.
            lateral_mm: the same, sideways.
            now_s: by a clock that nobody sets.
            stamp_s: of the pose, by any clock.
        """
        if not math.isfinite(position_mm + lateral_mm):
            self._refuse("no_number", f"a position is {position_mm + lateral_mm}")
            return
        furthest = max(abs(position_mm), abs(lateral_mm))
        if furthest * max(self._scale, 1.0) > LARGEST_MM:
            self._refuse("out_of_range", f"{furthest / 1e3:g} m from the origin: is it in metres?")
            return
        new = _Pose(position_mm, lateral_mm, now_s, stamp_s)
        last, self._last = self._last, new
        if last is not None:
            silent_s = now_s - last.arrival_s
            apart = math.hypot(position_mm - last.position_mm, lateral_mm - last.lateral_mm)
            if apart > SLACK_MM + FASTEST_MM_S * silent_s:
                self._refuse("jump", f"{apart:.1f} mm in {1e3 * silent_s:.1f} ms")
                return
            if silent_s > TIMEOUT_S:
                self._breaks += 1
        self.accepted += 1
        self._place = new

    def heard(self, now_s: float) -> bool:
        """Whether there is a place, and it is not old."""
        last = self._last
        return self._place is not None and last is not None and now_s - last.arrival_s <= TIMEOUT_S

    def where(self, now_s: float) -> HandPlace | None:
        """Say where the hand is; to be asked by one thread alone.

        None while nobody tells, and once after each break: what was felt before has ended.
        """
        broken, self._breaks_seen = self._breaks != self._breaks_seen, self._breaks
        pose = self._place
        if pose is None or broken or not self.heard(now_s):
            return None
        before, self._used = self._used, pose
        elapsed_s = 0.0
        if before is not None and before is not pose:
            # The longer of the two: poses that come in a bunch, and stamps that nobody sets, must
            # not look like speed.
            elapsed_s = max(pose.arrival_s - before.arrival_s, pose.stamp_s - before.stamp_s)
        return HandPlace(self._scale * pose.position_mm, self._scale * pose.lateral_mm, elapsed_s)

    def _refuse(self, reason: str, why: str) -> None:
        self._place = None
        self._breaks += 1
        self.refused[reason] += 1
        self.why_refused = f"{reason.replace('_', ' ')}: {why}"
