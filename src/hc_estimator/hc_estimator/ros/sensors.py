"""A force and a position sensor of one's own as the node's input.

Any geometry_msgs/WrenchStamped goes with a JointState, PoseStamped, TransformStamped, or a frame of
/tf. The readings of the two become one stream in the order of their stamps and, so that they can be
recorded and plotted like any other source, are published on indenter/sample: NaN for a reading that
the other sensor does not have at that stamp.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from typing import Any

from geometry_msgs.msg import PoseStamped, TransformStamped, WrenchStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState

from hc_estimator.ros.channel import Channel
from hc_estimator.ros.inputs import Receiver
from hc_estimator.ros.joints import joint_index
from hc_estimator.ros.moving_surface import MovingSurface
from hc_estimator.ros.sample_output import SampleOutput
from hc_estimator.ros.settings_meaning import contact_frame, sensor_mapping
from hc_estimator.ros.tool_frames import ToolFrames
from hc_estimator.stream import frame_compliance
from hc_estimator.stream.arrival_clock import ARRIVAL, ArrivalClock, Timed
from hc_estimator.stream.clock_drift import ClockDrift
from hc_estimator.stream.contact_frame import Quaternion, Vector, unit_quaternion
from hc_estimator.stream.contact_reading import ContactReading
from hc_estimator.stream.dry_friction import DryFriction
from hc_estimator.stream.frame_compliance import FrameCompliance
from hc_estimator.stream.merger import Merged, Merger
from hc_estimator.stream.normal_finder import NormalFinder
from hc_estimator.stream.poses import SurfacePose, ToolPose
from hc_estimator.stream.readings import Suspicion
from hc_estimator.stream.repeats import SHARE, Repeats
from hc_estimator.stream.tool_motion import Reading, ToolMotion
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp, sent_mm

_CHANNELS = ("force", "position")
FRAME_CHANGE_SAID_S = 2.0
"""So long the position's last change of frame is a problem: of one status, or of all."""
_POSITION_TYPES = {"joint": JointState, "pose": PoseStamped, "transform": TransformStamped}


class SensorInput:
    """Subscribes to two sensors and hands on the samples that they make together.

    With the contact frame `surface`, depth and force are those along the surface's normal: the
    wrench is turned by the attitude that the tool had at its stamp.

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
        self.normal_finder: NormalFinder | None = None
        self._receiver = receiver
        self._missing_joint = self._unusable_attitudes = self._skipped_positions = 0
        self._forces_not_finite = self._positions_not_finite = 0
        self._forces_turning = self._numbers_free = 0  # those of samples that came to nothing
        self._frame_id = self._base_frame_id = ""
        self._frame_change = (-math.inf, "", "")  # when [s], from which frame, to which
        self._reading: tuple[Any, ...] = ()
        self._frames: ToolFrames | None = None
        self._contact: ContactReading | None = None
        self._moving: MovingSurface | None = None
        moves = False
        if values["input.contact.frame"] == "surface":
            moves = values["input.contact.normal_from"] == "topic"
            self._contact = ContactReading(contact_frame(values), moves=moves)
        self._frame = FrameCompliance()
        self._friction, self._motion = DryFriction(), ToolMotion()
        self._repeated_forces, self._repeated_positions = Repeats(), Repeats()
        self._force_clock: ArrivalClock | None = None
        self._position_clock: ArrivalClock | None = None
        self._drift = ClockDrift()
        self._merger = Merger(
            maximum_wait_ns=0, reorder_window_ns=0, maximum_gap_ns=1, with_surface=moves
        )
        with ExitStack() as opened:
            self._positions = self._subscribe_to_positions(node, values, opened)
            self._forces = Channel(
                node,
                WrenchStamped,
                values["input.force.topic"],
                self._take_force,
                skip=self._on_skip,
                fail=receiver.on_failure,
            )
            opened.callback(self._forces.close)
            self.channels = [self._forces, self._positions]
            if moves:
                self._moving = MovingSurface(
                    node, values["input.contact.topic"], self._take_surface, receiver.on_failure
                )
                opened.callback(self._moving.channel.close)
                self.channels.append(self._moving.channel)
            self._samples = SampleOutput(node, values)
            opened.callback(self._samples.close)
            self._opened = opened.pop_all()
        self.configure(values)

    def _subscribe_to_positions(
        self, node: Node, values: Mapping[str, Any], opened: ExitStack
    ) -> Channel:
        kind, topic = values["input.position.type"], values["input.position.topic"]
        skip, fail = self._on_skipped_positions, self._receiver.on_failure
        if kind == "tf":
            self._frames = ToolFrames(node, topic, self._add_point, skip=skip, fail=fail)
            opened.callback(self._frames.close)
            return self._frames.channel
        take = {
            "joint": self._take_joints,
            "pose": self._take_pose,
            "transform": self._take_transform,
        }[kind]
        channel = Channel(node, _POSITION_TYPES[kind], topic, take, skip=skip, fail=fail)
        opened.callback(channel.close)
        return channel

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other settings that do not need other subscriptions."""
        self._force_zero = values["input.force.zero"]
        self._position_zero = values["input.position.zero"]
        self._frame.mm_per_n = values[frame_compliance.SETTING.name]
        self._friction.configure(values)
        self._motion.configure(values)
        self._force_mapping = sensor_mapping(values, "force")
        self._position_mapping = sensor_mapping(values, "position")
        self._force_factor = values["input.force.sign"] * values["input.force.scale"]
        self._position_factor = values["input.position.sign"] * values["input.position.scale"]
        self._force_offset_ns = round(values["input.force.time_offset"] * 1e9)
        self._position_offset_ns = round(values["input.position.time_offset"] * 1e9)
        self._joint = values["input.position.joint"]
        self._child_frame = values["input.position.child_frame"]
        self._merger.maximum_wait_ns = round(values["input.pairing.maximum_wait"] * 1e9)
        self._merger.reorder_window_ns = round(values["input.pairing.reorder_window"] * 1e9)
        self._merger.maximum_gap_ns = round(values["input.pairing.maximum_gap"] * 1e9)
        for repeats in (self._repeated_forces, self._repeated_positions):
            repeats.longest_ns = round(SHARE * self._merger.maximum_gap_ns)
        self._holds_forces = values["input.force.held"]
        self._holds_positions = values["input.position.held"]
        self._merger.surface_silence_ns = round(values["input.silence_timeout"] * 1e9)
        if self._contact is not None:
            self._contact.frame = contact_frame(values)
        if self._moving is not None:
            self._moving.silence_s = values["input.silence_timeout"]
        if self._frames is not None:
            self._frames.configure(values)
        for channel in self.channels:
            channel.maximum_backlog = values["input.maximum_backlog"]
        reading = (
            self._force_mapping,
            self._position_mapping,
            self._force_offset_ns,
            self._position_offset_ns,
            self._joint,
            self._child_frame,
            values["input.position.base_frame"],
            values["input.force.stamps"],
            values["input.position.stamps"],
        )
        if reading != self._reading:
            of_arrival = (values[f"input.{name}.stamps"] == ARRIVAL for name in _CHANNELS)
            self._force_clock, self._position_clock = (
                ArrivalClock() if is_of_arrival else None for is_of_arrival in of_arrival
            )
        if self._reading and reading != self._reading:
            self._merger.clear()  # readings of before and after do not belong together
            self._drift.forget()
            self._repeated_forces.forget()
            self._repeated_positions.forget()
            self._frame = FrameCompliance(self._frame.mm_per_n)
            self._friction = DryFriction(self._friction.newtons, self._friction.presliding_mm)
            self._motion.forget()
            self._base_frame_id = ""  # another one may be meant now
        self._reading = reading

    @property
    def counters(self) -> Mapping[str, int]:
        """Readings that are in no sample, and messages without what is read of them."""
        counters, frames, moving = self._merger.counters, self._frames, self._moving
        clocks = (self._force_clock, self._position_clock)
        result = {
            "pairing_late": counters.late,
            "pairing_unpaired": counters.unpaired,
            "pairing_resets": counters.resets,
            "arrival_mistaken": sum(clock.mistaken for clock in clocks if clock is not None),
            "positions_skipped": self._skipped_positions,
            "force_not_finite": self._forces_not_finite,
            "force_turning": self._forces_turning,
            "force_motion_unknown": self._motion.unknown,
            "position_not_finite": self._positions_not_finite,
            "joint_missing": self._missing_joint,
            "frame_missing": 0 if frames is None else frames.missing,
            "attitude_unusable": self._unusable_attitudes
            + (0 if frames is None else frames.unusable)
            + (0 if moving is None else moving.unusable),
        }
        if self._contact is not None:
            result["attitude_late"] = self._contact.without_attitude
            if moving is not None:
                result["surface_late"] = self._contact.without_surface
                result["surface_missing"] = self._contact.before_surface
        return result

    @property
    def problems(self) -> Sequence[str]:
        """What is wrong with the input although samples come."""
        found = [] if self._moving is None else [*self._moving.problems]
        changed_s, before, after = self._frame_change
        if time.monotonic() - changed_s < FRAME_CHANGE_SAID_S:
            found.append(
                f"{self._positions.topic} came in the frame {before!r}, and then in {after!r}: a "
                "place in one is no depth in the other; let its publisher keep to one frame"
            )
        return found

    @property
    def doubts(self) -> Sequence[Suspicion]:
        """What is suspicious of its stamps, by when they came."""
        return self._drift.doubts(time.monotonic(), (self._forces.topic, self._positions.topic))

    def missing_listeners(self) -> list[str]:
        """Say who of those who are to get the samples is missing."""
        return self._samples.missing()

    def close(self) -> None:
        """Stop listening."""
        self._opened.close()

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
        self._forces_not_finite += not math.isfinite(force.x + force.y + force.z)
        value: float | Vector
        if self._contact is None:
            value = self._force_mapping.of_vector(force.x, force.y, force.z)
        else:
            value = (force.x, force.y, force.z)
        came_ns = nanoseconds_from_stamp(message.header.stamp)
        self._drift.add(0, came_ns, self._forces.received_ns)
        for measured_ns, force_or_vector in _timed(self._force_clock, came_ns, value):
            self._add_force(measured_ns + self._force_offset_ns, force_or_vector)

    def _add_force(self, stamp_ns: int, value: float | Vector) -> None:
        if self._holds_forces and self._repeated_forces.is_one(stamp_ns, value):
            return
        arrival_ns = self._forces.received_ns
        self._hand_on(self._merger.add_force(stamp_ns, value, arrival_ns, self._complete_ns()))

    def _take_joints(self, message: Any) -> None:
        index = joint_index(message, self._joint, "position")
        if index is None:
            self._missing_joint += 1
            return
        value = self._position_mapping.of_scalar(message.position[index] * METRE_IN_MM)
        self._positions_not_finite += not math.isfinite(value)
        self._take_position(nanoseconds_from_stamp(message.header.stamp), value)

    def _take_pose(self, message: Any) -> None:
        self._take_message(message, message.pose.position, message.pose.orientation)

    def _take_transform(self, message: Any) -> None:
        if self._child_frame in ("", message.child_frame_id):
            moved = message.transform
            self._take_message(message, moved.translation, moved.rotation)

    def _take_message(self, message: Any, point: Any, q: Any) -> None:
        stamp_ns = nanoseconds_from_stamp(message.header.stamp)
        frame_id = message.header.frame_id
        self._add_point(stamp_ns, frame_id, (point.x, point.y, point.z), (q.x, q.y, q.z, q.w))

    def _add_point(self, stamp_ns: int, frame_id: str, place: Vector, attitude: Quaternion) -> None:
        """Add where the tool is in a frame [m], and its attitude, which may be of any length."""
        if frame_id != self._base_frame_id:
            if self._base_frame_id:
                self._frame_change = (time.monotonic(), self._base_frame_id, frame_id)
            self._base_frame_id = frame_id
        self._positions_not_finite += not math.isfinite(sum(place))
        if self._contact is None:
            self.position = (place, frame_id)
            x, y, z = (METRE_IN_MM * part for part in place)
            self._take_position(stamp_ns, self._position_mapping.of_vector(x, y, z))
            return
        try:
            turned = unit_quaternion(attitude)
        except ValueError:
            self._unusable_attitudes += 1
            return
        self._take_position(stamp_ns, ToolPose(place, turned))

    def _take_position(self, came_ns: int, value: float | ToolPose) -> None:
        self._drift.add(1, came_ns, self._positions.received_ns)
        for measured_ns, place in _timed(self._position_clock, came_ns, value):
            self._add_position(measured_ns, place)

    def _add_position(self, stamp_ns: int, value: float | ToolPose) -> None:
        arrival_ns = self._positions.received_ns
        stamp_ns += self._position_offset_ns
        if self._holds_positions and self._repeated_positions.is_one(stamp_ns, value):
            return
        complete = self._complete_ns()
        self._hand_on(self._merger.add_displacement(stamp_ns, value, arrival_ns, complete))

    def _take_surface(self, stamp_ns: int, surface: SurfacePose) -> None:
        assert self._moving is not None
        times = self._moving.channel.received_ns, self._complete_ns()
        self._hand_on(self._merger.add_surface(stamp_ns, surface, *times))

    def _complete_ns(self) -> int | None:
        """Return when the oldest message that waits came; None if none waits."""
        waiting = (channel.next_ns() for channel in self.channels)
        return min((came_ns for came_ns in waiting if came_ns is not None), default=None)

    def _hand_on(self, samples: list[Merged]) -> None:
        for sample in samples:
            reading = self._read(sample)
            if reading is None:
                self._pass_on(Reading(sample.stamp_ns, sample.sequence, math.nan, math.nan, True))
                continue
            place_mm, force_n = reading
            friction_n = self._friction.at(sample.stamp_ns, place_mm - self._position_zero)
            turns = math.isnan(friction_n) and sample.force is not None
            self._forces_turning += turns
            nothing = turns and math.isnan(place_mm)
            numbers = (sample.stamp_ns, sample.sequence)
            self._pass_on(Reading(*numbers, place_mm, force_n - friction_n, nothing))

    def _pass_on(self, reading: Reading) -> None:
        """Publish and hand on what is complete with a reading, if anything is left of it."""
        for stamp_ns, number, place_mm, force_n, nothing in self._motion.take(reading):
            if nothing:
                self._numbers_free += 1
            elif self._samples.begin():
                # The estimator gets what a recorder gets, to the last bit.
                sample = (
                    stamp_ns,
                    number - self._numbers_free,
                    sent_mm(place_mm - self._position_zero),
                    force_n - self._force_zero,
                )
                self._samples.publish(*sample)
                self._receiver.on_sample(*sample)

    def _read(self, sample: Merged) -> tuple[float, float] | None:
        """Return displacement [mm], less what the robot gave way, and force [N].

        Zeros are not taken off. None if it is no sample.
        """
        along = None if self._contact is None else self._contact.read(sample)
        if self._contact is None:
            place_mm = math.nan if sample.displacement is None else sample.displacement
            force_n = math.nan if sample.force is None else sample.force
        elif along is None:
            return None
        else:
            place_mm = self._position_factor * along.depth_mm
            force_n = self._force_factor * along.force_n
        yielded_mm = self._frame.yielded_mm(sample.stamp_ns, force_n, self._force_zero)
        if math.isnan(yielded_mm) and sample.force is None:
            self._merger.counters.unpaired += 1  # no force says how far the robot gave way
            return None
        depth_mm = place_mm - yielded_mm
        if along is None:
            return depth_mm, force_n
        finder = self.normal_finder
        if along.tip is not None:
            self.position = (along.tip, self._base_frame_id)
            if finder is not None and not math.isnan(depth_mm):
                finder.add_tip(depth_mm - self._position_zero, along.tip)
        if finder is not None and along.push is not None:
            finder.add(along.push, force_n - self._force_zero)
        return depth_mm, force_n


def _timed(clock: ArrivalClock | None, came_ns: int, value: Any) -> Timed:
    """Return readings with when they were measured [ns]: this one, or those that waited with it."""
    return [(came_ns, value)] if clock is None else clock.take(came_ns, value)
