"""The pose of a tool out of messages of /tf: of every frame between it and a base the newest one.

The tool's pose is told with each message that moves one of these frames, at the stamp of what
moved; a message of other frames says nothing of the tool.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final, NamedTuple

from hc_estimator.stream.contact_frame import Quaternion, Vector, unit_quaternion
from hc_estimator.stream.frames import FrameTree, Pose
from hc_estimator.stream.merger import JUMP_NS
from hc_msgs_py.units import nanoseconds_from_stamp

MOST_FRAMES: Final = 6
"""That may be the tool's, at most."""


class _Transform(NamedTuple):
    """Where a frame is in another one, and the stamp of that [ns]."""

    parent: str
    child: str
    pose: Pose
    stamp_ns: int


class FramePoses:
    """Takes tf2_msgs/TFMessage and tells the poses of a frame.

    Attributes:
        missing: messages while nothing connects the two frames.
        unusable: transforms whose quaternion has no length.
    """

    def __init__(self, take: Callable[[int, str, Vector, Quaternion], None]) -> None:
        """Begin without any frame.

        Args:
            take: takes a stamp [ns], the base frame, where the tool's frame is in it [m], and its
                attitude.
        """
        self.missing = self.unusable = 0
        self._take = take
        self._base = self._tool = ""
        self._frames = FrameTree()
        self._moved: dict[str, int] = {}  # stamps [ns] of the frames that are not fixed
        self._waiting_ns: int | None = None  # of a pose that waits for the rest of its frames

    def follow(self, tool: str, base: str) -> None:
        """Tell the poses of another frame; without a base, in the frame that it hangs on."""
        self._tool, self._base = tool, base

    def take_moving(self, message: Any) -> None:
        """Tell the pose of the tool's frame, if the message says anything new of it.

        Where frames between base and tool come in messages of their own, the pose waits for those
        of the same stamp: until the first later one.
        """
        usable = self._usable(message)
        stamps = {moved.child: moved.stamp_ns for moved in usable}
        waiting_ns = self._waiting_ns
        if waiting_ns is not None and self._newest(stamps) > waiting_ns:
            self._tell(waiting_ns)
        self._add(usable)
        self._moved |= stamps
        chain = self._chain()
        if chain is None:
            self.missing += 1
            return
        newest_ns = self._newest(stamps)
        if newest_ns < 0:
            return  # of other frames
        waiting_ns = self._waiting_ns
        if waiting_ns is not None and waiting_ns - JUMP_NS <= newest_ns < waiting_ns:
            return  # of before: the pose that waits is as of now, and its stamp stays
        if all(self._moved.get(frame, newest_ns) == newest_ns for frame in chain):
            self._tell(newest_ns)
        else:
            self._waiting_ns = newest_ns

    def take_fixed(self, message: Any) -> None:
        """Take in frames that do not move (/tf_static)."""
        self._add(self._usable(message))

    def moving(self) -> dict[str, str]:
        """Return the frames that move, those that hang on one that does as well, with their root.

        The root is what the last known frame above hangs on; frames are in the order of how many
        lie between: the tool of an arm is among the last.
        """
        found = {}
        for frame in self._frames.frames():
            root, between = self._frames.root(frame)
            if not self._moved.keys().isdisjoint(between):
                found[frame] = (len(between), root)
        ordered = sorted(found.items(), key=lambda item: item[1][0])
        return {frame: root for frame, (_depth, root) in ordered}

    def parent(self, frame: str) -> str | None:
        """Return the frame that a frame hangs on."""
        return self._frames.parent(frame)

    def mover(self, frame: str) -> str:
        """Return the frame nearest to one, or it itself, that is told again and again."""
        between = self._frames.root(frame)[1]
        return next((name for name in between if name in self._moved), "")

    def _chain(self) -> frozenset[str] | None:
        """Return the frames between base and tool; None if they are not known yet."""
        base = self._base or self._frames.parent(self._tool)
        return None if base is None else self._frames.between(base, self._tool)

    def _newest(self, stamps: Mapping[str, int]) -> int:
        """Return the newest stamp [ns] of frames between base and tool; -1 without any."""
        return max((stamps[f] for f in self._chain() or () if f in stamps), default=-1)

    def _tell(self, stamp_ns: int) -> None:
        """Tell the pose of the tool's frame, as it is known now, at a stamp."""
        self._waiting_ns = None
        base = self._base or self._frames.parent(self._tool)
        pose = None if base is None else self._frames.pose(base, self._tool)
        if base is not None and pose is not None:
            self._take(stamp_ns, base, *pose)

    def _add(self, transforms: list[_Transform]) -> None:
        """Take in where frames are."""
        for one in transforms:
            self._frames.add(one.parent, one.child, one.pose)

    def _usable(self, message: Any) -> list[_Transform]:
        """Return the transforms of a message, counting those whose quaternion has no length."""
        result = []
        for transform in message.transforms:
            place, turn = transform.transform.translation, transform.transform.rotation
            try:
                turned = unit_quaternion((turn.x, turn.y, turn.z, turn.w))
            except ValueError:
                self.unusable += 1
                continue
            result.append(
                _Transform(
                    plain_name(transform.header.frame_id),
                    plain_name(transform.child_frame_id),
                    ((place.x, place.y, place.z), turned),
                    nanoseconds_from_stamp(transform.header.stamp),
                )
            )
        return result


def plain_name(frame: str) -> str:
    """Return a frame's name; older software writes a slash before it."""
    return frame.removeprefix("/")


def tool_frames(poses: FramePoses, wrench_frames: Iterable[str]) -> list[tuple[str, str, str]]:
    """Return frames that may be the tool's, best first: each with its root, and what moves it.

    Of an arm whose every link is a frame only a few are: the frame in which a wrench is told, for
    that is the tool's sensor, and those on which no other one hangs.

    Args:
        poses: knows the frames.
        wrench_frames: frames of the wrenches that there are.
    """
    moving = poses.moving()
    parents = {poses.parent(frame) for frame in moving}
    wrenches = [frame for frame in map(plain_name, wrench_frames) if frame in moving]
    leaves = [frame for frame in reversed(moving) if frame not in parents]
    chosen = list(dict.fromkeys([*wrenches, *leaves]))[:MOST_FRAMES]
    return [(frame, moving[frame], poses.mover(frame)) for frame in chosen]
