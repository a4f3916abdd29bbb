"""A force and a position sensor of one's own as the node's input.

Any geometry_msgs/WrenchStamped goes with a JointState, PoseStamped, TransformStamped, or a frame of
/tf. The readings of the two become one stream in the order of their stamps and, so that they can be
recorded and plotted like any other source, are published on indenter/sample: NaN for a reading that
the other sensor does not have at that stamp.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from geometry_msgs.msg import PoseStamped, TransformStamped, WrenchStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from hc_estimator.ros.channel import Channel, SubscriptionError
from hc_estimator.ros.inputs import Receiver
from hc_estimator.ros.joints import joint_index
from hc_estimator.ros.moving_surface import MovingSurface
from hc_estimator.ros.sample_output import SampleOutput
from hc_estimator.ros.settings_meaning import contact_frame, sensor_mapping
from hc_estimator.stream.contact_frame import (
    ContactFrame,
    NormalFinder,
    Quaternion,
    Vector,
    unit_quaternion,
)
from hc_estimator.stream.frames import FrameTree
from hc_estimator.stream.merger import Merged, Merger
from hc_estimator.stream.surface_track import HeldReading, SurfacePose
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp, sent_mm

_POSITION_TYPES = {"joint": JointState, "pose": PoseStamped, "transform": TransformStamped}

_STATIC_QOS = QoSProfile(
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""As tf2 listens to /tf_static: who comes late gets what was told once."""


def _tf_message() -> Any:
    """Return the class of /tf's messages, which not every installation has.

    Raises:
        SubscriptionError: if this one has not.
    """
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError as error:
        raise SubscriptionError(
            "input.position.type = 'tf' needs the package tf2_msgs, which is not installed"
        ) from error
    return TFMessage


def _name(frame: str) -> str:
    """Return a frame's name; older software writes a slash before it."""
    return frame.removeprefix("/")


class _Vector(NamedTuple):
    """A point, or with w an attitude, as messages name their parts."""

    x: float
    y: float
    z: float
    w: float = 1.0


class _Header(NamedTuple):
    """Stamp and frame, as messages name them."""

    stamp: Any
    frame_id: str


class SensorInput:
    """Subscribes to two sensors and hands on the samples that they make together.

    With the contact frame `surface`, depth and force are those along the surface's normal: the
    wrench is turned by the newest attitude of the tool.

    Zeros are taken off at the moment when samples are handed on: a zero that changes while readings
    wait applies to those that come after it.
    """

    def __init__(self, node: Node, receiver: Receiver, values: Mapping[str, Any]) -> None:
        """Start listening.

        Raises:
            SubscriptionError: if a topic cannot be subscribed to.
        """
        self.position: tuple[tuple[float, float, float], str] | None = None
        self.undecodable = 0
        self._receiver = receiver
        self._missing_joint = 0
        self._missing_frame = 0
        self._frames = FrameTree()
        self._moved: dict[str, int] = {}  # stamps [ns] of the frames that are not fixed
        self._waiting: Any = None  # stamp of a pose that waits for the rest of its frames
        self._fixed_frames: Channel | None = None
        self._skipped_positions = 0
        self._frame_id = ""
        self._merger = Merger(maximum_wait_ns=0, reorder_window_ns=0, maximum_gap_ns=1)
        kind = values["input.position.type"]
        take_position = {
            "joint": self._take_joints,
            "pose": self._take_pose,
            "transform": self._take_transform,
            "tf": self._take_frames,
        }[kind]
        self._positions = Channel(
            node,
            _tf_message() if kind == "tf" else _POSITION_TYPES[kind],
            values["input.position.topic"],
            take_position,
            skip=self._on_skipped_positions,
            fail=receiver.on_failure,
            one_publisher=kind != "tf",
        )
        try:
            self._forces = Channel(
                node,
                WrenchStamped,
                values["input.force.topic"],
                self._take_force,
                skip=self._on_skip,
                fail=receiver.on_failure,
            )
        except SubscriptionError:
            self._positions.close()
            raise
        self.channels = [self._forces, self._positions]
        if kind == "tf":
            try:
                fixed = Channel(
                    node,
                    _tf_message(),
                    f"{values['input.position.topic']}_static",
                    self._take_fixed_frames,
                    skip=lambda _number: None,
                    fail=receiver.on_failure,
                    qos=_STATIC_QOS,
                    one_publisher=False,
                )
            except SubscriptionError:
                self._forces.close()
                self._positions.close()
                raise
            self._fixed_frames = fixed
        self._surface = values["input.contact.frame"] == "surface"
        self._moving: MovingSurface | None = None
        if self._surface and values["input.contact.normal_from"] == "topic":
            try:
                self._moving = MovingSurface(
                    node, values["input.contact.topic"], self._take_held, receiver.on_failure
                )
            except SubscriptionError:
                self._forces.close()
                self._positions.close()
                raise
            self.channels.append(self._moving.channel)
        self._samples = SampleOutput(node, values)
        self._reading: tuple[Any, ...] = ()
        self._attitude: Quaternion | None = None
        self._without_attitude = 0
        self._unusable_attitudes = 0
        self.normal_finder: NormalFinder | None = None
        self.configure(values)

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other settings that do not need other subscriptions."""
        self._force_zero = values["input.force.zero"]
        self._position_zero = values["input.position.zero"]
        self._force_mapping = sensor_mapping(values, "force")
        self._position_mapping = sensor_mapping(values, "position")
        self._frame = contact_frame(values)
        self._force_factor = values["input.force.sign"] * values["input.force.scale"]
        self._position_factor = values["input.position.sign"] * values["input.position.scale"]
        self._force_offset_ns = round(values["input.force.time_offset"] * 1e9)
        self._position_offset_ns = round(values["input.position.time_offset"] * 1e9)
        self._joint = values["input.position.joint"]
        self._child_frame = values["input.position.child_frame"]
        self._base_frame = values["input.position.base_frame"]
        self._merger.maximum_wait_ns = round(values["input.pairing.maximum_wait"] * 1e9)
        self._merger.reorder_window_ns = round(values["input.pairing.reorder_window"] * 1e9)
        self._merger.maximum_gap_ns = round(values["input.pairing.maximum_gap"] * 1e9)
        if self._moving is not None:
            self._moving.configure(values)
        for channel in self.channels:
            channel.maximum_backlog = values["input.maximum_backlog"]
        reading = (
            self._force_mapping,
            self._position_mapping,
            self._force_offset_ns,
            self._position_offset_ns,
            self._joint,
            self._child_frame,
            self._base_frame,
            self._frame,
            self._force_factor,
            self._position_factor,
        )
        if self._reading and reading != self._reading:
            self._merger.clear()  # readings of before and after do not belong together
            if self._moving is not None:
                self._merger.counters.unpaired += self._moving.clear()
        self._reading = reading

    @property
    def counters(self) -> Mapping[str, int]:
        """Readings that are in no sample, and messages without what is read of them."""
        counters = self._merger.counters
        return {
            "pairing_late": counters.late,
            "pairing_unpaired": counters.unpaired,
            "pairing_resets": counters.resets,
            "positions_skipped": self._skipped_positions,
            "joint_missing": self._missing_joint,
            "frame_missing": self._missing_frame,
            "attitude_missing": self._without_attitude,
            "attitude_unusable": self._unusable_attitudes
            + (0 if self._moving is None else self._moving.unusable),
            **({} if self._moving is None else self._moving.counters),
        }

    @property
    def problems(self) -> Sequence[str]:
        """What is wrong with the input although samples come."""
        return () if self._moving is None else self._moving.problems

    def close(self) -> None:
        """Stop listening."""
        for channel in self.channels:
            channel.close()
        if self._fixed_frames is not None:
            self._fixed_frames.close()
        self._samples.close()

    def _on_skip(self, number: int) -> None:
        self._merger.skip(number)
        self._receiver.on_skip(number)

    def _on_skipped_positions(self, number: int) -> None:
        self._skipped_positions += number

    def _take_force(self, message: Any) -> None:
        if message.header.frame_id != self._frame_id:
            self._frame_id = message.header.frame_id
            self._samples.set_frame(self._frame_id)
            self._receiver.on_frame(self._frame_id)
        force = message.wrench.force
        stamp_ns = nanoseconds_from_stamp(message.header.stamp) + self._force_offset_ns
        if self._surface:
            if self._attitude is None:
                self._without_attitude += 1
                return
            push = self._frame.contact_force((force.x, force.y, force.z), self._attitude)
            if self._moving is not None:
                self._moving.hold(HeldReading(stamp_ns, self._forces.received_ns, True, push))
                return
            value = self._along_normal(push, self._frame)
        else:
            value = self._force_mapping.of_vector(force.x, force.y, force.z)
        arrival_ns = self._forces.received_ns
        self._hand_on(self._merger.add_force(stamp_ns, value, arrival_ns, self._complete_ns()))

    def _along_normal(self, push: Vector, frame: ContactFrame) -> float:
        """Return the reading of a force in the base frame, its zero not taken off [N]."""
        value: float = self._force_factor * frame.along_normal(push)
        if self.normal_finder is not None:
            self.normal_finder.add(push, value - self._force_zero)
        return value

    def _take_held(self, reading: HeldReading, surface: SurfacePose) -> None:
        """Take a reading and where the moving surface was at its stamp."""
        frame = self._frame._replace(point=surface.point, normal=surface.normal)
        stamp_ns, arrival_ns, is_force, vector = reading
        complete_ns = self._complete_ns()
        if is_force:
            value = self._along_normal(vector, frame)
            samples = self._merger.add_force(stamp_ns, value, arrival_ns, complete_ns)
        else:
            depth_mm = self._position_factor * frame.depth_mm(vector)
            samples = self._merger.add_displacement(stamp_ns, depth_mm, arrival_ns, complete_ns)
        self._hand_on(samples)

    def _take_joints(self, message: Any) -> None:
        index = joint_index(message, self._joint, "position")
        if index is None:
            self._missing_joint += 1
            return
        value = self._position_mapping.of_scalar(message.position[index] * METRE_IN_MM)
        self._add_position(message.header.stamp, value)

    def _take_pose(self, message: Any) -> None:
        self._add_point(message.header, message.pose.position, message.pose.orientation)

    def _take_transform(self, message: Any) -> None:
        if self._child_frame in ("", message.child_frame_id):
            moved = message.transform
            self._add_point(message.header, moved.translation, moved.rotation)

    def _take_fixed_frames(self, message: Any) -> None:
        self._add_frames(message)

    def _take_frames(self, message: Any) -> None:
        """Take the pose of the tool's frame, if the message says anything new of it.

        Where frames between base and tool come in messages of their own, the pose waits for those
        of the same stamp: until the first later one.
        """
        before = self._waiting
        stamps = {_name(t.child_frame_id): t.header.stamp for t in message.transforms}
        if before is not None and self._newest(stamps) > nanoseconds_from_stamp(before):
            self._add_frame(before)
        self._moved |= {f: nanoseconds_from_stamp(s) for f, s in self._add_frames(message).items()}
        chain = self._chain()
        if chain is None:
            self._missing_frame += 1
            return
        newest_ns = self._newest(stamps)
        if newest_ns < 0:
            return  # of other frames
        stamp = next(s for s in stamps.values() if nanoseconds_from_stamp(s) == newest_ns)
        if all(self._moved.get(frame, newest_ns) == newest_ns for frame in chain):
            self._add_frame(stamp)
        else:
            self._waiting = stamp

    def _chain(self) -> frozenset[str] | None:
        """Return the frames between base and tool; None if they are not known yet."""
        base = self._base_frame or self._frames.parent(self._child_frame)
        return None if base is None else self._frames.between(base, self._child_frame)

    def _newest(self, stamps: Mapping[str, Any]) -> int:
        """Return the newest stamp [ns] of frames between base and tool; -1 without any."""
        chain = self._chain() or ()
        return max((nanoseconds_from_stamp(stamps[f]) for f in chain if f in stamps), default=-1)

    def _add_frame(self, stamp: Any) -> None:
        """Add the pose of the tool's frame, as it is known now, at a stamp."""
        self._waiting = None
        base = self._base_frame or self._frames.parent(self._child_frame)
        pose = None if base is None else self._frames.pose(base, self._child_frame)
        if base is not None and pose is not None:
            self._add_point(_Header(stamp, base), _Vector(*pose[0]), _Vector(*pose[1]))

    def _add_frames(self, message: Any) -> dict[str, Any]:
        """Take in the transforms of a message; return their stamps by frame."""
        stamps = {}
        for transform in message.transforms:
            place, turn = transform.transform.translation, transform.transform.rotation
            try:
                turned = unit_quaternion((turn.x, turn.y, turn.z, turn.w))
            except ValueError:
                self._unusable_attitudes += 1
                continue
            child = _name(transform.child_frame_id)
            pose = ((place.x, place.y, place.z), turned)
            self._frames.add(_name(transform.header.frame_id), child, pose)
            stamps[child] = transform.header.stamp
        return stamps

    def _add_point(self, header: Any, point: Any, attitude: Any) -> None:
        if self._surface:
            try:
                turned = unit_quaternion((attitude.x, attitude.y, attitude.z, attitude.w))
            except ValueError:
                self._unusable_attitudes += 1
                return
            self._attitude = turned
            tip = self._frame.tip_at((point.x, point.y, point.z), turned)
            self.position = (tip, header.frame_id)
            if self._moving is not None:
                stamp_ns = nanoseconds_from_stamp(header.stamp) + self._position_offset_ns
                self._moving.hold(HeldReading(stamp_ns, self._positions.received_ns, False, tip))
                return
            depth_mm = self._position_factor * self._frame.depth_mm(tip)
            self._add_position(header.stamp, depth_mm)
            return
        self.position = ((point.x, point.y, point.z), header.frame_id)
        value = self._position_mapping.of_vector(
            point.x * METRE_IN_MM, point.y * METRE_IN_MM, point.z * METRE_IN_MM
        )
        self._add_position(header.stamp, value)

    def _add_position(self, stamp: Any, displacement_mm: float) -> None:
        stamp_ns = nanoseconds_from_stamp(stamp) + self._position_offset_ns
        arrival_ns = self._positions.received_ns
        complete_ns = self._complete_ns()
        self._hand_on(
            self._merger.add_displacement(stamp_ns, displacement_mm, arrival_ns, complete_ns)
        )

    def _complete_ns(self) -> int | None:
        """Return when the oldest message that waits came; None if none waits."""
        waiting = [self._forces.next_ns(), self._positions.next_ns()]
        if self._moving is not None:
            waiting.append(self._moving.oldest_arrival_ns)
        return min((came_ns for came_ns in waiting if came_ns is not None), default=None)

    def _hand_on(self, samples: list[Merged]) -> None:
        for stamp_ns, sequence, reading_mm, reading_n in samples:
            # The estimator gets what a recorder gets, to the last bit.
            displacement_mm = sent_mm(reading_mm - self._position_zero)
            force_n = reading_n - self._force_zero
            if not self._samples.begin():
                continue
            self._samples.publish(stamp_ns, sequence, displacement_mm, force_n)
            self._receiver.on_sample(stamp_ns, sequence, displacement_mm, force_n)
