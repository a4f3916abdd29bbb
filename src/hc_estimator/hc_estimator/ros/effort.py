"""The node's input without a force sensor: one joint's position and motor effort.

A sensor_msgs/JointState says where the tool is and what its motor pushes; a filter of
stream/effort_filters makes the contact force of it. What it finds is handed on as samples and, as
with other sensors of one's own, published on indenter/sample if wanted.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import JointState

from hc_estimator.ros.channel import Channel
from hc_estimator.ros.inputs import Receiver
from hc_estimator.ros.joints import joint_index
from hc_estimator.ros.sample_output import SampleOutput
from hc_estimator.ros.settings_meaning import effort_settings, sensor_mapping
from hc_estimator.stream import frame_compliance
from hc_estimator.stream.effort_filters import EffortSettings, make_force_filter
from hc_estimator.stream.force_filter import ForceFilter
from hc_estimator.stream.frame_compliance import FrameCompliance
from hc_estimator.stream.merger import JUMP_NS
from hc_estimator.stream.normal_finder import NormalFinder
from hc_estimator.stream.readings import Suspicion
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp, sent_mm


class EffortInput:
    """Subscribes to a joint's position and effort, and hands on displacement and force."""

    def __init__(self, node: Node, receiver: Receiver, values: Mapping[str, Any]) -> None:
        """Start listening.

        Raises:
            SubscriptionError: if the topic cannot be subscribed to.
        """
        self.position: tuple[tuple[float, float, float], str] | None = None
        self.undecodable = 0
        self.normal_finder: NormalFinder | None = None
        self.problems: tuple[str, ...] = ()
        self.doubts: tuple[Suspicion, ...] = ()
        self._receiver = receiver
        self._missing_joint = self._unused = self._sequence = 0
        self._origin_ns = self._newest_ns = 0
        self._frame_id = ""
        self._frame = FrameCompliance()
        self._joints = Channel(
            node,
            JointState,
            values["input.position.topic"],
            self._take,
            skip=self._on_skip,
            fail=receiver.on_failure,
        )
        self.channels = (self._joints,)
        self._samples = SampleOutput(node, values)
        self._reading: tuple[Any, ...] = ()
        self._filter: ForceFilter = make_force_filter(EffortSettings())
        self.configure(values)

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other settings; the filter begins anew if it, or what it is given, is another."""
        self._force_zero = values["input.force.zero"]
        self._position_zero = values["input.position.zero"]
        self._frame.mm_per_n = values[frame_compliance.SETTING.name]
        self._mapping = sensor_mapping(values, "position")
        self._effort_factor = values["input.position.sign"] * values["input.effort.scale"]
        self._offset_ns = round(values["input.position.time_offset"] * 1e9)
        self._joint = values["input.position.joint"]
        self._joints.maximum_backlog = values["input.maximum_backlog"]
        wanted = effort_settings(values)
        if wanted.method != "sir_pf":  # the others know no tissue
            wanted = dataclasses.replace(wanted, surface_mm=0.0)
        reading = (self._mapping, self._effort_factor, self._offset_ns, self._joint, wanted)
        if reading != self._reading:
            self._reading = reading
            self._filter = make_force_filter(wanted)

    @property
    def counters(self) -> Mapping[str, int]:
        """Messages without the joint or its effort, and readings that were none."""
        return {"joint_missing": self._missing_joint, "effort_unused": self._unused}

    def missing_listeners(self) -> list[str]:
        """Say who is not there of those who are to get the samples."""
        return self._samples.missing()

    def close(self) -> None:
        """Stop listening."""
        self._joints.close()
        self._samples.close()

    def _on_skip(self, number: int) -> None:
        self._sequence += number
        self._receiver.on_skip(number)

    def _take(self, message: Any) -> None:
        index = joint_index(message, self._joint, "position", "effort")
        if index is None:
            self._missing_joint += 1
            return
        if message.header.frame_id != self._frame_id:
            self._frame_id = message.header.frame_id
            self._samples.set_frame(self._frame_id)
            self._receiver.on_frame(self._frame_id)
        stamp_ns = nanoseconds_from_stamp(message.header.stamp) + self._offset_ns
        position_mm = self._mapping.of_scalar(message.position[index] * METRE_IN_MM)
        effort_n = self._effort_factor * message.effort[index]
        if stamp_ns < self._newest_ns - JUMP_NS:  # or nothing would be used until it is as late
            self._filter.reset()
            self._origin_ns = self._newest_ns = 0
        self._newest_ns = max(self._newest_ns, stamp_ns)
        # Seconds since the first message: those since 1970 would lose the step's last digits.
        self._origin_ns = self._origin_ns or stamp_ns
        time_s = (stamp_ns - self._origin_ns) * 1e-9
        reading_mm, reading_n = self._filter.step(time_s, position_mm, effort_n)
        sequence, self._sequence = self._sequence, self._sequence + 1
        if math.isnan(reading_mm):
            self._unused += 1
            return
        # The estimator gets what a recorder gets, to the last bit.
        yielded_mm = self._frame.yielded_mm(stamp_ns, reading_n, self._force_zero)
        displacement_mm = sent_mm(reading_mm - self._position_zero - yielded_mm)
        force_n = reading_n - self._force_zero
        if not self._samples.begin():
            return
        self._samples.publish(stamp_ns, sequence, displacement_mm, force_n)
        self._receiver.on_sample(stamp_ns, sequence, displacement_mm, force_n)
