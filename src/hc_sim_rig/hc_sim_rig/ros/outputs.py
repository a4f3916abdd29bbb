"""Topics of the indenter node: a publisher each, the fast ones as bytes (hc_msgs_py.wire)."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import PointStamped, WrenchStamped
from hc_msgs.msg import IndenterSample, IndenterSamples, IndenterTruth, TactileSample
from rclpy.node import Node
from sensor_msgs.msg import JointState

from hc_msgs_py.conversion import fill_force
from hc_msgs_py.parameters import declare
from hc_msgs_py.qos import SAMPLE_QOS
from hc_msgs_py.topics import (
    FRAME_INDENTER_TIP,
    JOINT_STATES,
    SAMPLE,
    SAMPLES,
    TACTILE_SAMPLE,
    TIP,
    TRUTH,
    WRENCH,
)
from hc_msgs_py.units import METRE_IN_MM, set_stamp
from hc_msgs_py.wire import SampleEncoder, TruthEncoder
from hc_msgs_py.wire_arrays import ArraysEncoder, SamplesEncoder
from hc_sim_rig.records import RigSample
from hc_sim_rig.scenario import Scenario
from hc_sim_rig.taxels import TaxelPad

LISTENERS_EVERY = 20
"""Samples between two looks at who listens to the topics that not everybody needs."""
TIP_EVERY = 10
"""Samples between two positions of the tip: sideways it is slow."""
FRAME_STAGE = "stage"
FRAME_PAD = "tactile_pad"


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
        self._waiting: list[tuple[int, int, float, float]] = []
        kind = IndenterSample if together == 1 else IndenterSamples
        self._sample = node.create_publisher(kind, self.sample_topic, SAMPLE_QOS)
        self._samples_encoder = SamplesEncoder()
        self._truth = node.create_publisher(IndenterTruth, TRUTH, SAMPLE_QOS)
        self._wrench = node.create_publisher(WrenchStamped, WRENCH, SAMPLE_QOS)
        self._joints = node.create_publisher(JointState, JOINT_STATES, SAMPLE_QOS)
        self._tip = node.create_publisher(PointStamped, TIP, SAMPLE_QOS)
        self._sample_encoder = SampleEncoder()
        self._truth_encoder = TruthEncoder()
        self._wrench_message = WrenchStamped()
        self._wrench_message.header.frame_id = FRAME_INDENTER_TIP
        self._joints_message = JointState(name=["master", "slave"])
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
        self._pad: TaxelPad | None = None
        self._tactile: Any = None
        self._tactile_encoder = ArraysEncoder(TactileSample, FRAME_PAD)
        self.published = 0
        self.first_sequence = 0

    def set_scenario(self, scenario: Scenario, seed: int) -> None:
        """Publish the readings of the scenario's tactile array from now on, if it has one."""
        self._pad = None
        if scenario.taxels is None:
            return
        sensors = scenario.sensors
        if self._tactile is None:
            self._tactile = self._node.create_publisher(TactileSample, TACTILE_SAMPLE, SAMPLE_QOS)
        self._pad = TaxelPad(
            scenario.taxels, sensors.displacement.noise_std_mm, sensors.force.noise_std_n, seed
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

    def publish(self, stamp_ns: int, sample: RigSample) -> None:
        """Publish one sample on all topics that are listened to."""
        if self.published % LISTENERS_EVERY == 0:
            self._truth_wanted = self._truth.get_subscription_count() > 0
            self._wrench_wanted = self._wrench.get_subscription_count() > 0
            self._joints_wanted = self._joints.get_subscription_count() > 0
            self._tip_wanted = self._tip.get_subscription_count() > 0
        if self._with_sensors:
            self._publish_sensors(stamp_ns, sample)
        if self._pad is not None:
            self._publish_taxels(self._pad, stamp_ns, sample)
        if self._with_truth and self._truth_wanted:
            sequence = self.first_sequence + sample.sequence
            self._truth.publish(self._truth_encoder.encode(stamp_ns, sequence, *sample.truth))
        if self._joints_wanted:
            self._publish_joints(stamp_ns, sample)
        self.published += 1

    def _publish_sensors(self, stamp_ns: int, sample: RigSample) -> None:
        """Publish what the sensors read."""
        sequence = self.first_sequence + sample.sequence
        if self._together == 1:
            self._sample.publish(
                self._sample_encoder.encode(
                    stamp_ns, sequence, sample.displacement_mm, sample.force_n
                )
            )
        else:
            self._waiting.append((stamp_ns, sequence, sample.displacement_mm, sample.force_n))
            if len(self._waiting) == self._together:
                self.flush()
        if self._wrench_wanted:
            fill_force(self._wrench_message, stamp_ns, sample.force_n)
            self._wrench.publish(self._wrench_message)
        if self._tip_wanted and self.published % TIP_EVERY == 0:
            self._publish_tip(stamp_ns, sample)

    def flush(self) -> None:
        """Publish the samples that wait for their message to be full."""
        if self._waiting:
            stamps, sequences, displacements, forces = zip(*self._waiting, strict=True)
            self._waiting.clear()
            self._sample.publish(
                self._samples_encoder.encode(stamps, sequences[0], displacements, forces)
            )

    def _publish_taxels(self, pad: TaxelPad, stamp_ns: int, sample: RigSample) -> None:
        """Publish what the taxels read."""
        displacements_mm, forces_n = pad.readings(sample.truth)
        record = self._tactile_encoder.record(len(forces_n), stamp_ns)
        record["sequence"] = self.first_sequence + sample.sequence
        record["columns"] = pad.taxels.columns
        record["pitch"] = pad.taxels.pitch_mm / METRE_IN_MM
        record["displacement"] = displacements_mm / METRE_IN_MM
        record["force"] = forces_n
        self._tactile.publish(record.tobytes())

    def _publish_tip(self, stamp_ns: int, sample: RigSample) -> None:
        """Publish where the tip is: x sideways, z up, so that penetration is negative."""
        set_stamp(self._tip_message.header.stamp, stamp_ns)
        point = self._tip_message.point
        point.x = sample.lateral_mm / METRE_IN_MM
        point.z = -sample.slave.position_mm / METRE_IN_MM
        self._tip.publish(self._tip_message)

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
