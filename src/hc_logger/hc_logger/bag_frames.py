"""Frames of /tf in a bag: which may be the tool's, and where it was by them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from typing import Any, Final, NamedTuple

from hc_estimator.stream.contact_frame import Quaternion, Vector
from hc_estimator.stream.frame_poses import FramePoses, plain_name, tool_frames
from hc_logger.bag import Bag
from hc_logger.decoder import decoder
from hc_logger.errors import BagError
from hc_logger.type_names import FORCE_TYPE, STATIC

_LOOKED_AT: Final = 2000
"""Messages until it is known which frames move."""


class Frame(NamedTuple):
    """A frame, and the one that it is told in; empty: the frame that it hangs on."""

    name: str
    base: str


def candidates(bag: Bag, topic: str) -> list[Frame]:
    """Return the frames of a topic that may be the tool's, best first, each with its root."""
    poses = FramePoses(lambda *_pose: None)
    _take_fixed(bag, topic, poses)
    decode = decoder(bag.topics[topic].definition)
    for message in islice(bag.messages({topic}), _LOOKED_AT):
        poses.take_moving(decode(message.data))
    return [Frame(*found[:2]) for found in tool_frames(poses, _wrench_frames(bag))]


def tool_frame(bag: Bag, topic: str, wanted: Frame) -> Frame:
    """Return the tool's frame: the wanted one, else the only one that it may be.

    Raises:
        BagError: if it is open which it is; says how to name it.
    """
    if wanted.name:
        return wanted
    found = candidates(bag, topic)
    if len(found) == 1:
        return Frame(found[0].name, wanted.base or found[0].base)
    if not found:
        raise BagError(f"{bag.path}: no frame of {topic} moves")
    names = ", ".join(frame.name for frame in found)
    first = found[0]
    raise BagError(
        f"{bag.path}: {len(found)} frames of {topic} may be the tool's ({names}); name one: "
        f"--input position.child_frame={first.name} --input position.base_frame={first.base}, say"
    )


def poses_of(
    bag: Bag, topic: str, frame: Frame, take: Callable[[int, str, Vector, Quaternion], None]
) -> Callable[[bytes], None]:
    """Return what takes the messages of a topic of frames, one after another.

    Args:
        bag: an open bag.
        topic: the frames that move; those that do not are those of the same topic with _static.
        frame: whose poses are told.
        take: as of FramePoses: stamp [ns], base, place [m] and attitude.
    """
    poses = FramePoses(take)
    _take_fixed(bag, topic, poses)
    poses.follow(plain_name(frame.name), plain_name(frame.base))
    decode = decoder(bag.topics[topic].definition)
    return lambda data: poses.take_moving(decode(data))


def _take_fixed(bag: Bag, topic: str, poses: FramePoses) -> None:
    fixed = bag.topics.get(topic + STATIC)
    if fixed is not None:
        decode: Any = decoder(fixed.definition)
        for message in bag.messages({fixed.name}):
            poses.take_fixed(decode(message.data))


def _wrench_frames(bag: Bag) -> list[str]:
    """Return the frames in which the wrenches of a bag are told."""
    found = []
    for topic in (t for t in bag.topics.values() if t.definition.name == FORCE_TYPE):
        decode = decoder(topic.definition)
        found += [decode(m.data).header.frame_id for m in islice(bag.messages({topic.name}), 1)]
    return found
