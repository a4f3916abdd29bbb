"""Topics of the indenter node: a publisher each, the fast ones as bytes (hc_msgs_py.wire)."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import PointStamped, WrenchStamped
from hc_msgs.msg import IndenterSample, IndenterSamples, IndenterTruth, TactileSample
from numpy.typing import NDArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from sensor_msgs.msg import JointState

from hc_msgs_py.conversion import fill_force
from hc_msgs_py.parameters import declare
from hc_msgs_py.qos import SAMPLE_PUBLISHER_QOS, SAMPLE_QOS
from hc_msgs_py.topics import (
    FRAME_INDENTER_TIP,
    JOINT_STATES,
    NODE_RECORDER,
    SAMPLE,
    SAMPLES,
    TACTILE_SAMPLE,
    TIP,
    TRUTH,
    WRENCH,
)
from hc_msgs_py.units import METRE_IN_MM, set_stamp
from hc_msgs_py.wire import SampleEncoder, TruthEncoder, publish_bytes
from hc_msgs_py.wire_arrays import ArraysEncoder, SamplesEncoder
from hc_sim_rig.layout import OUT_DISPLACEMENT, OUT_FORCE
from hc_sim_rig.records import RigSample, Truth, series_from_rows
from hc_sim_rig.ros.ahead import (
    FRAME_STAGE,
    JOINT_NAMES,
    TIP_EVERY,
    Block,
    Message,
    RowsEncoder,
)
from hc_sim_rig.scenario import Scenario
from hc_sim_rig.taxels import TaxelPad

LISTENERS_PERIOD_S = 0.05
"""Between two looks at who listens to the topics that not everybody needs."""
FRAME_PAD = "tactile_pad"


class Listeners(NamedTuple):
    """Who listens to a topic.

    Attributes:
        number: how many.
        recorder_only: recorders, and nobody else.
    """

    number: int
    recorder_only: bool


class Outputs:
    """Publishes samples; what nobody listens to is not even made.

    Attributes:
        published: samples published.
        first_sequence: sequence of the rig's first sample; not 0 once the scenario was changed.
    """

    def __init__(
        self,
        node: Node,
        with_sensors: bool,
        together: int = 1,
        with_truth: bool | None = None,
    ) -> None:
        """Make the publishers and declare whom ~/ready waits for.

        Args:
            node: the node that publishes.
            with_sensors: False for a master alone, whose host has no sensors.
            together: samples that are published in one message; 1: on indenter/sample, each in one
                of its own; more: on indenter/samples.
            with_truth: publish the truth behind the readings; as with_sensors if None.
        """
        self._node = node
        self._with_sensors = with_sensors
        self._with_truth = with_sensors if with_truth is None else with_truth
        self._together = together
        kind = IndenterSample if together == 1 else IndenterSamples
        self._sample = node.create_publisher(kind, self.sample_topic, SAMPLE_PUBLISHER_QOS)
        self._samples_encoder = SamplesEncoder()
        self._truth = node.create_publisher(IndenterTruth, TRUTH, SAMPLE_QOS)
        self._wrench = node.create_publisher(WrenchStamped, WRENCH, SAMPLE_QOS)
        self._joints = node.create_publisher(JointState, JOINT_STATES, SAMPLE_QOS)
        self._tip = node.create_publisher(PointStamped, TIP, SAMPLE_QOS)
        self._sample_encoder = SampleEncoder()
        self._truth_encoder = TruthEncoder()
        self._wrench_message = WrenchStamped()
        self._wrench_message.header.frame_id = FRAME_INDENTER_TIP
        self._joints_message = JointState(name=list(JOINT_NAMES))
        self._rows_encoder = RowsEncoder()
        self._tip_message = PointStamped()
        self._tip_message.header.frame_id = FRAME_STAGE
        self._by_topic = {
            self.sample_topic: self._sample,
            TRUTH: self._truth,
            WRENCH: self._wrench,
            JOINT_STATES: self._joints,
            TIP: self._tip,
        }
        for topic in self._by_topic:
            declare(
                node,
                self._expected_parameter(topic),
                0,
                f"subscribers of {topic} that ~/ready waits for",
                minimum=0,
                maximum=1000,
            )
        self._listeners: dict[str, Listeners] = {}
        self.look_who_listens()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(LISTENERS_PERIOD_S, self.look_who_listens, clock=steady)
        self._pad: TaxelPad | None = None
        self._tactile: Any = None
        self._tactile_encoder = ArraysEncoder(TactileSample, FRAME_PAD)
        self.published = 0
        self.first_sequence = 0

    def set_scenario(self, scenario: Scenario, seed: int) -> None:
        """Publish the readings of the scenario's tactile array from now on, if it has one."""
        self._pad = None
        if scenario.taxels is None or not self._with_sensors:
            return
        sensors = scenario.sensors
        if self._tactile is None:
            self._tactile = self._node.create_publisher(
                TactileSample, TACTILE_SAMPLE, SAMPLE_PUBLISHER_QOS
            )
        self._pad = TaxelPad(
            scenario.taxels, sensors.displacement.noise_std_mm, sensors.force.noise_std_n, seed
        )

    def take_settings(self, settings: Mapping[str, float]) -> None:
        """Let the taxels, if there are any, be as noisy as the rig's own sensors are set to."""
        if self._pad is not None:
            self._pad.set_noise(
                settings["displacement_noise_std_mm"], settings["force_noise_std_n"]
            )

    @property
    def sample_topic(self) -> str:
        """Where the samples go."""
        return SAMPLE if self._together == 1 else SAMPLES

    def _expected_parameter(self, topic: str) -> str:
        """The same name for either topic of the samples."""
        return expected_parameter(SAMPLE if topic == SAMPLES else topic)

    def missing(self) -> list[str]:
        """Return who is not there yet, for ~/ready."""
        lines = []
        for topic, publisher in self._by_topic.items():
            expected = self._node.get_parameter(self._expected_parameter(topic)).value
            found = publisher.get_subscription_count()
            if found < expected:
                lines.append(f"{topic} has {found} of {expected} subscribers")
        return lines

    def look_who_listens(self) -> None:
        """Ask who listens to the topics that not everybody needs: now and then, and at a start."""
        for topic in (TRUTH, WRENCH, JOINT_STATES, TIP):
            count = self._by_topic[topic].get_subscription_count()
            before = self._listeners.get(topic)
            if before is not None and before.number == count:
                continue
            name = self._by_topic[topic].topic_name
            found = self._node.get_subscriptions_info_by_topic(name) if count else ()
            others = {info.node_name for info in found} - {NODE_RECORDER}
            self._listeners[topic] = Listeners(count, count > 0 and not others)

    def _wanted(self, topic: str) -> bool:
        return self._listeners[topic].number > 0

    def publish(self, stamp_ns: int, sample: RigSample) -> None:
        """Publish one sample on all topics that are listened to."""
        if self._with_sensors:
            self._publish_sensors(stamp_ns, sample)
        if self._pad is not None:
            self._tactile.publish(
                self._taxels_of(self._pad, stamp_ns, sample.sequence, sample.truth)
            )
        if self._with_truth and self._wanted(TRUTH):
            sequence = self.first_sequence + sample.sequence
            self._truth.publish(self._truth_encoder.encode(stamp_ns, sequence, *sample.truth))
        if self._wanted(JOINT_STATES):
            self._publish_joints(stamp_ns, sample)
        self.published += 1

    def warm_up(self) -> None:
        """Load what `make` needs, so that the first samples do not wait for it."""
        self._rows_encoder.warm_up()

    def make(self, stamps_ns: Sequence[int], first: int, rows: NDArray[np.float64]) -> Block:
        """Make the messages of samples that are not due yet.

        What only a recorder listens to, and the truth, which is for evaluation, goes out after
        the last of them: a bag is the same, and nobody is woken for each.

        Args:
            stamps_ns: of the samples [ns].
            first: number of the first sample among those of the rig.
            rows: what the rig gives (`Rig.rows`), whole messages of samples unless the scenario
                ends.
        """
        stamps = np.array(stamps_ns, np.int64)
        count, together = len(stamps), self._together
        due: list[list[Message]] = [[] for _ in range(-(-count // together))]
        after: list[tuple[Any, list[bytes]]] = []
        sequence = self.first_sequence + first
        wanted = [TRUTH] if self._with_truth and self._wanted(TRUTH) else []
        if self._wanted(JOINT_STATES):
            wanted.append(JOINT_STATES)
        if self._with_sensors:
            if self._wanted(WRENCH):
                wanted.append(WRENCH)
            if together == 1:
                wanted.append(SAMPLE)
            else:
                for k, data in enumerate(self._samples_together(stamps, sequence, rows)):
                    due[k].append((self._sample, data))
        made = self._rows_encoder.encode(stamps, sequence, rows, wanted)
        for k, data in enumerate(made.pop(SAMPLE, ())):
            due[k].append((self._sample, data))
        if self._with_sensors and self._wanted(TIP):
            for i, data in self._rows_encoder.tips(stamps, first, rows):
                due[i // together].append((self._tip, data))
        if self._pad is not None:
            truths = series_from_rows(rows, first).truth.each()
            for i, truth in enumerate(truths):
                taxels = self._taxels_of(self._pad, stamps_ns[i], first + i, truth)
                due[i // together].append((self._tactile, taxels))
        for topic, messages in made.items():
            publisher, listeners = self._by_topic[topic], self._listeners[topic]
            if topic == TRUTH or listeners.recorder_only:
                after.append((publisher, messages))
            else:
                for i, data in enumerate(messages):
                    due[i // together].append((publisher, data))
        counts = [min(together, count - k * together) for k in range(len(due))]
        return Block(deque(zip(counts, due, strict=True)), after)

    def _samples_together(
        self, stamps: NDArray[np.int64], sequence: int, rows: NDArray[np.float64]
    ) -> Iterator[bytes]:
        """Yield messages of several samples."""
        for i in range(0, len(stamps), self._together):
            some = slice(i, i + self._together)
            yield self._samples_encoder.encode(
                stamps[some], sequence + i, rows[some, OUT_DISPLACEMENT], rows[some, OUT_FORCE]
            )

    def publish_due(self, block: Block) -> None:
        """Publish what is due at the next deadline, and what comes after the last of them."""
        count, messages = block.due.popleft()
        for publisher, data in messages:
            publish_bytes(publisher, (data,))
        self.published += count
        if not block.due:
            self.publish_after(block)

    def publish_after(self, block: Block) -> None:
        """Publish what belongs to the samples that were published: all of them, or so far."""
        waiting = sum(count for count, _messages in block.due)
        for publisher, several in block.after:
            publish_bytes(publisher, several[: len(several) - waiting])

    def _publish_sensors(self, stamp_ns: int, sample: RigSample) -> None:
        """Publish what the sensors read."""
        sequence = self.first_sequence + sample.sequence
        self._sample.publish(
            self._sample_encoder.encode(stamp_ns, sequence, sample.displacement_mm, sample.force_n)
        )
        if self._wanted(WRENCH):
            fill_force(self._wrench_message, stamp_ns, sample.force_n)
            self._wrench.publish(self._wrench_message)
        if self._wanted(TIP) and sample.sequence % TIP_EVERY == 0:
            self._fill_tip(stamp_ns, sample.lateral_mm, sample.slave.position_mm)
            self._tip.publish(self._tip_message)

    def _taxels_of(self, pad: TaxelPad, stamp_ns: int, sequence: int, truth: Truth) -> bytes:
        """Return what the taxels read."""
        displacements_mm, forces_n = pad.readings(truth)
        record = self._tactile_encoder.record(len(forces_n), stamp_ns)
        record["sequence"] = self.first_sequence + sequence
        record["columns"] = pad.taxels.columns
        record["pitch"] = pad.taxels.pitch_mm / METRE_IN_MM
        record["displacement"] = displacements_mm / METRE_IN_MM
        record["force"] = forces_n
        return record.tobytes()

    def _fill_tip(self, stamp_ns: int, lateral_mm: float, depth_mm: float) -> None:
        """Say where the tip is: x sideways, z up, so that penetration is negative."""
        set_stamp(self._tip_message.header.stamp, stamp_ns)
        point = self._tip_message.point
        point.x = float(lateral_mm) / METRE_IN_MM
        point.z = -float(depth_mm) / METRE_IN_MM

    def _publish_joints(self, stamp_ns: int, sample: RigSample) -> None:
        """Publish both joints; of a side that is on another host, what this one knows."""
        master, slave, message = sample.master, sample.slave, self._joints_message
        set_stamp(message.header.stamp, stamp_ns)
        message.position = [
            master.position_mm / METRE_IN_MM,
            slave.position_mm / METRE_IN_MM,
        ]
        message.velocity = [
            master.velocity_mm_s / METRE_IN_MM,
            slave.velocity_mm_s / METRE_IN_MM,
        ]
        message.effort = [master.effort_n, slave.effort_n]
        self._joints.publish(message)


def expected_parameter(topic: str) -> str:
    """Name of the parameter that says how many subscribers of a topic ~/ready waits for."""
    return f"expected_{topic.rsplit('/', 1)[-1]}_subscribers"
