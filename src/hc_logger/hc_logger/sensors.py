"""A recording from two sensors of one's own: a wrench topic and a position topic of a bag.

Axis, sign, scale, zero and time offset mean what the parameters input.force.* and
input.position.* of the estimator node mean, and the readings of the two become one stream as they
do there: every one at its own stamp, nothing is interpolated.
"""

from __future__ import annotations

import math
import os
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hc_estimator.stream.arrival_clock import ARRIVAL, MEASURED, measured_stamps
from hc_estimator.stream.contact_frame import Quaternion, Vector
from hc_estimator.stream.mapping import make_mapping
from hc_estimator.stream.merger import Merged, Merger
from hc_estimator.stream.readings import NO_NUMBERS
from hc_estimator.stream.repeats import SHARE, Repeats, channels_held
from hc_logger.bag import Bag
from hc_logger.bag_frames import Frame, poses_of, tool_frame
from hc_logger.bag_sensors import force_topics, joints_of, moving_topics, position_topics
from hc_logger.cross_talk import cross_talk_line
from hc_logger.decoder import decoder
from hc_logger.errors import BagError
from hc_logger.findings import findings_of
from hc_logger.foreign import open_bag
from hc_logger.press_direction import off_axis_line
from hc_logger.recorded import Recording
from hc_logger.selection import full_name
from hc_logger.sensor_clocks import why_no_pairs
from hc_logger.type_names import (
    FORCE_TYPE,
    FRAMES_TYPE,
    JOINT_TYPE,
    POSE_TYPE,
    POSITION_TYPES,
)
from hc_msgs_py.units import METRE_IN_MM, NANOSECONDS

LONGEST_S = 1e9
_FEW_PAIRS = 10
"""Chance ones, where the stamps are of two clocks or stand still."""
_FEW_OUTSIDE = 10
"""One sensor always begins before the other: nobody needs to hear of so few readings."""


@dataclass(frozen=True)
class Sensor:
    """How the messages of a topic become displacement or force.

    Attributes:
        topic: topic name; empty takes the only one of a type that fits.
        axis: x, y, z or direction (of the force, or of a pose's position).
        direction: three numbers, for axis direction.
        sign: 1 or -1: penetration and compression are to be positive.
        scale: factor of the reading, for a sensor that does not speak SI.
        zero: reading that counts as zero, after sign and scale (N or mm).
        time_offset_s: added to the stamps.
        joint: name of the joint in a JointState; empty takes the only one.
        child_frame: child frame of a TransformStamped, empty takes any; or of /tf, where empty
            takes the only one that may be the tool's.
        base_frame: of /tf, the frame in which that is told; empty takes what it hangs on, or with
            an empty child_frame the root.
        held: the topic repeats the last reading until there is a new one: each counts once.
        stamps: measured, or arrival: stamps say when a reading came, of a sensor at an even rate.
    """

    topic: str = ""
    axis: str = "z"
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)
    sign: int = 1
    scale: float = 1.0
    zero: float = 0.0
    time_offset_s: float = 0.0
    joint: str = ""
    child_frame: str = ""
    base_frame: str = ""
    held: bool = False
    stamps: str = MEASURED


@dataclass(frozen=True)
class Pairing:
    """How force and position are brought together; as input.pairing.* of the estimator node [s]."""

    maximum_wait_s: float = 0.05
    reorder_window_s: float = 0.0
    maximum_gap_s: float = 0.1


def read_sensors(
    path: str | os.PathLike[str],
    force: Sensor | None = None,
    position: Sensor | None = None,
    pairing: Pairing | None = None,
) -> Recording:
    """Read force and position of two topics as one recording, each reading at its own stamp.

    Args:
        path: a bag of any kind.
        force: the wrench topic; None takes the only one, force along z.
        position: the JointState, PoseStamped or TransformStamped topic, or where there is none the
            frames of /tf; None as above.
        pairing: limits of the waiting.

    Raises:
        BagError: if there are no such topics or they give no sample.
        ValueError: if a setting is not allowed.
    """
    force, position, pairing = force or Sensor(), position or Sensor(), pairing or Pairing()
    for name, seconds in (
        ("force.time_offset", force.time_offset_s),
        ("position.time_offset", position.time_offset_s),
        ("pairing.maximum_wait", pairing.maximum_wait_s),
        ("pairing.reorder_window", pairing.reorder_window_s),
        ("pairing.maximum_gap", pairing.maximum_gap_s),
    ):
        if not abs(seconds) <= LONGEST_S:
            raise ValueError(f"{name} = {seconds:g} s is not a number up to {LONGEST_S:g}")
    for name, say in (("force", force.stamps), ("position", position.stamps)):
        if say not in (MEASURED, ARRIVAL):
            raise ValueError(f"{name}.stamps={say} is not {MEASURED} or {ARRIVAL}")
    with open_bag(path) as bag:
        force_topic = _topic(bag, force.topic, (FORCE_TYPE,), "force")
        position_topic, frame = _place(bag, position)
        merger = Merger(
            maximum_wait_ns=round(pairing.maximum_wait_s * 1e9),
            reorder_window_ns=round(pairing.reorder_window_s * 1e9),
            maximum_gap_ns=round(pairing.maximum_gap_s * 1e9),
        )
        vectors = array("d")  # as objects those of an hour would take half a gigabyte

        def readers(vectors: array[float]) -> tuple[Reader, Reader]:
            return _force_reader(bag, force_topic, force, vectors), (
                _position_reader(bag, position_topic, position)
                if frame is None
                else _frame_reader(bag, position_topic, position, frame)
            )

        takes = readers(vectors)
        samples: list[Merged] = []
        stamps_of: tuple[list[int], list[int]] = ([], [])  # of the forces, of the positions
        received: tuple[list[int], list[int]] = ([], [])
        not_finite = [0, 0]
        longest_ns = round(SHARE * 1e9 * pairing.maximum_gap_s)
        repeated = (Repeats(longest_ns), Repeats(longest_ns))
        topics, sensors = (force_topic, position_topic), (force, position)
        adds = (merger.add_force, merger.add_displacement)
        measured = [
            _measured(bag, *channel)
            for channel in zip(topics, readers(array("d")), sensors, strict=True)
        ]
        for message in bag.messages(set(topics)):
            channel = topics.index(message.topic)
            for came, value in takes[channel](message.data):
                stamp = next(measured[channel], came)
                if sensors[channel].held and repeated[channel].is_one(stamp, value):
                    continue
                stamps_of[channel].append(stamp)
                received[channel].append(message.log_time)
                not_finite[channel] += not math.isfinite(value)
                samples += adds[channel](stamp, value, message.log_time)
        samples += merger.flush()
        problems, growing = bag.damage, bag.being_recorded
        words = _words(bag, position_topic, position, frame)
    problems += [
        f"{count} of {len(stamps)} readings of {topic} {NO_NUMBERS}"
        for topic, stamps, count in zip(topics, stamps_of, not_finite, strict=True)
        if count
    ]
    counters = merger.counters
    outside = min(_outside(*stamps_of), counters.unpaired)
    for count, text in (
        (counters.unpaired - outside, "of a sensor that was alone"),
        (counters.late, "that came too late, or repeated a stamp"),
    ):
        if count:
            problems.append(f"{count} reading{'s'[: count > 1]} left out {text}")
    if counters.unpaired + counters.late > len(samples):
        wait_ns = round(pairing.maximum_wait_s * NANOSECONDS)
        if why := why_no_pairs(topics, stamps_of, received, wait_ns, force.time_offset_s):
            problems.insert(0, why)
            if len(samples) < _FEW_PAIRS:
                samples = []
    read = _direction(force)
    line = off_axis_line(force_topic, vectors, read, force.sign)
    if line := line or cross_talk_line(force_topic, vectors, stamps_of[0], samples, read):
        problems.append(line)
    if not samples:
        said = "; ".join([*growing, *problems])
        why = said or "there is no reading of one of them at the time of the other"
        raise BagError(f"{path}: {force_topic} and {position_topic} give no sample: {why}")
    notes = [
        f"force along {force.axis} of {force_topic}, displacement of {position_topic}"
        f"{words}: mind their signs and zeros"
    ]
    if outside > _FEW_OUTSIDE:
        notes.append(f"{outside} readings left out before the other sensor began or after it ended")
    stamps = np.array([s.stamp_ns for s in samples], np.int64)
    # None becomes NaN: no reading.
    rows = np.array([(s.displacement, s.force) for s in samples], np.float64)
    return Recording(
        Path(path),
        True,
        (stamps - stamps[0]) * 1e-9,
        stamps,
        np.array([s.sequence for s in samples], np.uint64),
        np.ascontiguousarray(rows[:, 0]),
        np.ascontiguousarray(rows[:, 1]),
        findings_of(rows, np.diff(stamps), tuple(problems))._replace(
            notes=tuple(notes),
            counted_once=channels_held(position.held, force.held),
            being_recorded=tuple(growing),
        ),
    )


def _place(bag: Bag, position: Sensor) -> tuple[str, Frame | None]:
    """Return the topic of the positions, and the tool's frame if it is one of frames."""
    moving = moving_topics(bag)
    others = any(topic.definition.name in POSITION_TYPES for topic in bag.topics.values())
    wanted = full_name(position.topic) if position.topic else ""
    if wanted in moving or (not wanted and not others and len(moving) == 1):
        topic = wanted or moving[0]
        given = Frame(position.child_frame, position.base_frame)
        return topic, tool_frame(bag, topic, given)
    types = POSITION_TYPES if others or not moving else (FRAMES_TYPE,)
    topic = _topic(bag, position.topic, types, "position")
    joints = joints_of(bag, topic)
    if len(joints) > 1 and not position.joint:
        raise BagError(
            f"{bag.path}: {topic} tells {len(joints)} joints ({', '.join(joints)}); the angles of "
            "an arm are no depth: record the tool's pose, or /tf; of a linear axis name it: "
            f"--input position.joint={joints[-1]}, say"
        )
    return topic, None


def _words(bag: Bag, topic: str, position: Sensor, frame: Frame | None) -> str:
    """Say which frame of several is read, and along what."""
    if frame is None:
        joint = bag.topics[topic].definition.name == JOINT_TYPE
        return "" if joint else f" along {position.axis}"
    base = f" in {frame.base}" if frame.base else ""
    return f" (frame {frame.name}{base} along {position.axis})"


def _outside(force: list[int], position: list[int]) -> int:
    """Count the readings before the other sensor's first one, or after its last one."""
    if not (force and position):
        return len(force) + len(position)
    begin, end = max(min(force), min(position)), min(max(force), max(position))
    return sum(not begin <= stamp <= end for stamp in (*force, *position))


def _topic(bag: Bag, name: str, types: tuple[str, ...], what: str) -> str:
    fitting = [t.name for t in bag.topics.values() if t.definition.name in types]
    if not name:
        likely = force_topics(bag) if what == "force" else position_topics(bag)
        fitting = [topic for topic in fitting if topic in likely] or fitting
    if name:
        full = full_name(name)
        if full in fitting:
            return full
        raise BagError(
            f"{bag.path} has no {what} topic {full} of type {' or '.join(types)}; "
            f"it has {', '.join(fitting) or 'none of them'}"
        )
    if len(fitting) == 1:
        return fitting[0]
    raise BagError(
        f"{bag.path} has {len(fitting)} {what} topics ({', '.join(fitting) or 'none'}); name one"
        + (f": --input {what}.topic={fitting[0]}, say" if fitting else "")
    )


Reader = Callable[[bytes], Iterator[tuple[int, float]]]


def _measured(bag: Bag, topic: str, take: Reader, sensor: Sensor) -> Iterator[int]:
    """Return when each reading was measured [ns], none where the stamps say so themselves."""
    if sensor.stamps == MEASURED:
        return iter(())
    came = [stamp for message in bag.messages({topic}) for stamp, _value in take(message.data)]
    return iter(measured_stamps(np.array(came, np.int64)).tolist())


def _direction(sensor: Sensor) -> Vector:
    """Return the unit vector along which a sensor is read, before its sign."""
    mapping = make_mapping(sensor.axis, sensor.direction, 1, 1.0, 0.0)
    x, y, z = (mapping.of_vector(*unit) for unit in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    return x, y, z


def _force_reader(bag: Bag, topic: str, sensor: Sensor, vectors: array[float]) -> Reader:
    """Return what reads the forces of a topic, and keeps all three components of each."""
    decode = decoder(bag.topics[topic].definition)
    mapping = make_mapping(sensor.axis, sensor.direction, sensor.sign, sensor.scale, sensor.zero)

    def read(data: bytes) -> Iterator[tuple[int, float]]:
        message = decode(data)
        force = message.wrench.force
        vectors.extend((force.x, force.y, force.z))
        yield _stamp(message, sensor), mapping.of_vector(force.x, force.y, force.z)

    return read


def _position_reader(bag: Bag, topic: str, sensor: Sensor) -> Reader:
    definition = bag.topics[topic].definition
    decode = decoder(definition)
    if definition.name == JOINT_TYPE:
        scalar = make_mapping("x", sensor.direction, sensor.sign, sensor.scale, sensor.zero)

        def read_joint(data: bytes) -> Iterator[tuple[int, float]]:
            message = decode(data)
            names = list(message.name)
            if sensor.joint and sensor.joint not in names:
                return  # many drivers publish their joints in several messages
            index = names.index(sensor.joint) if sensor.joint else 0
            if index < len(message.position):
                value = float(message.position[index]) * METRE_IN_MM
                yield _stamp(message, sensor), scalar.of_scalar(value)

        return read_joint
    mapping = make_mapping(sensor.axis, sensor.direction, sensor.sign, sensor.scale, sensor.zero)

    def read_point(data: bytes) -> Iterator[tuple[int, float]]:
        message = decode(data)
        if definition.name == POSE_TYPE:
            point = message.pose.position
        elif sensor.child_frame in ("", message.child_frame_id):
            point = message.transform.translation
        else:
            return
        value = mapping.of_vector(
            point.x * METRE_IN_MM, point.y * METRE_IN_MM, point.z * METRE_IN_MM
        )
        yield _stamp(message, sensor), value

    return read_point


def _frame_reader(bag: Bag, topic: str, sensor: Sensor, frame: Frame) -> Reader:
    mapping = make_mapping(sensor.axis, sensor.direction, sensor.sign, sensor.scale, sensor.zero)
    offset_ns = round(sensor.time_offset_s * 1e9)
    found: list[tuple[int, float]] = []

    def keep(stamp_ns: int, _base: str, place: Vector, _turned: Quaternion) -> None:
        x, y, z = (METRE_IN_MM * component for component in place)
        found.append((stamp_ns + offset_ns, mapping.of_vector(x, y, z)))

    take = poses_of(bag, topic, frame, keep)

    def read(data: bytes) -> Iterator[tuple[int, float]]:
        found.clear()
        take(data)
        yield from found

    return read


def _stamp(message: Any, sensor: Sensor) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec) + round(sensor.time_offset_s * 1e9)
