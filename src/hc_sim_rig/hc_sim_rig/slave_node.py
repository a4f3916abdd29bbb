"""Node `slave`: the tool's side of a teleoperation, live at 1 kHz, with simulated arm and tissue.

Thin: the link and the estimator's answers go to bilateral/sides, whose readings go out on the
topics of the rig (indenter/...). The estimator is a node of its own beside this one.
"""

from __future__ import annotations

import math
import sys
import time
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from hc_msgs.msg import HuntCrossleyEstimate, HuntCrossleyEstimates
from rclpy.node import Node
from std_srvs.srv import SetBool

from hc_msgs_py.diagnostics import DiagnosticsPublisher, Level, Status
from hc_msgs_py.estimates_reader import EstimatesReader
from hc_msgs_py.node_main import NodeStartError, run_node
from hc_msgs_py.parameters import declare, refuse_unknown
from hc_msgs_py.qos import ESTIMATE_QOS, SERVICE_QOS, SERVO_QOS
from hc_msgs_py.services import add_ready_service
from hc_msgs_py.topics import ESTIMATE, ESTIMATES, NODE_SLAVE, SLAVE_SETPOINT_CP
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp, set_stamp
from hc_sim_rig.bilateral.model_source import OLDEST_S, ModelSource
from hc_sim_rig.bilateral.sides import SlaveSample, SlaveSide
from hc_sim_rig.bilateral.wave_arrivals import SILENCE_S
from hc_sim_rig.pacing import DeadlineThread
from hc_sim_rig.records import Coupling, Joint, RigSample, Truth
from hc_sim_rig.ros.estimator_zeros import EstimatorZeros
from hc_sim_rig.ros.outputs import Outputs
from hc_sim_rig.ros.side_options import (
    SLAVE_FEEDBACK,
    RefusalWatch,
    declare_link,
    declare_settings,
    link_values,
)

USED_EVERY = 10
"""Estimates between two that become the model: the model is renewed at a hundredth of a second."""
LISTENERS_EVERY = 100
ARRAYS_S = 1.0
"""Whoever told estimates on hc/estimate so lately is not listened to on hc/estimates as well."""


class SlaveNode(Node):  # type: ignore[misc]  # rclpy ships no types
    """Follows the master, presses, and sends what the estimator knows."""

    def __init__(self) -> None:
        """Declare parameters, open the link, compile, and start unless told to wait.

        Raises:
            ScenarioError: a setting cannot be.
            ValueError: a parameter's value is not allowed, or the link cannot be.
        """
        super().__init__(NODE_SLAVE)
        seed = declare(
            self, "seed", 1, "seed of the sensors and of added loss", minimum=0, read_only=True
        )
        settings = declare_settings(self, ("slave", "tissue", "feedback"), SLAVE_FEEDBACK)
        self._tissue = settings.tissue
        self._has_sensor = declare(
            self,
            "force_sensor",
            True,
            "false: no force sensor; the estimator takes input.source effort on the joint states, "
            "and the force that is sent is the one that it reads out of them",
            read_only=True,
        )
        find_surface = declare(
            self,
            "find_surface",
            True,
            "ask the estimator for ~/find_surface at the first approach; false: its zeros hold",
            read_only=True,
        )
        start_mm = declare(
            self,
            "start_position",
            -5.0,
            "where the tool begins, the surface being where tissue.surface_mm says",
            minimum=-1000.0,
            maximum=1000.0,
            unit="mm",
            read_only=True,
        )
        start_paused = declare(
            self, "start_paused", False, "begin only when ~/run is called with true", read_only=True
        )
        self._link = declare_link(self, "slave", seed)
        self._outputs = Outputs(self, with_sensors=self._has_sensor, with_truth=True)
        refuse_unknown(self)
        self._side = SlaveSide(settings, self._link, start_mm, seed)
        self._side.warm_up()
        self._models = ModelSource()
        self._setpoint = self.create_publisher(PoseStamped, SLAVE_SETPOINT_CP, SERVO_QOS)
        self._setpoint_wanted = False
        self._pose = PoseStamped()
        self._pose.header.frame_id = "stage"
        self._rate_hz = settings.rate_hz
        self._zeros = EstimatorZeros(self, find_surface, self._is_free)
        self._calculated_n: float | None = None if self._has_sensor else 0.0
        self._estimates = self._usable = self._used = self._before = 0
        self._estimate_ns = self._stamp_ns = 0
        self._peak_n = self._largest_stretch_mm = 0.0
        self._newest: SlaveSample | None = None
        self._arrays = EstimatesReader()
        self._single_estimate_s = -math.inf  # when an estimate last came on hc/estimate
        self.create_subscription(HuntCrossleyEstimate, ESTIMATE, self._on_estimate, ESTIMATE_QOS)
        self.create_subscription(
            HuntCrossleyEstimates, ESTIMATES, self._on_estimates, ESTIMATE_QOS, raw=True
        )
        self._sampler = DeadlineThread(self._rate_hz, self._act, time.time_ns)
        self.create_service(SetBool, "~/run", self._run, qos_profile=SERVICE_QOS)
        add_ready_service(self, self._outputs.missing)
        refusals = RefusalWatch(self._link)
        self._diagnostics = DiagnosticsPublisher(
            self, "slave arm", lambda: refusals.reported_in(self._status())
        )
        if not start_paused:
            self._start()

    def _start(self) -> None:
        self._outputs.look_who_listens()
        self._sampler.start()
        self._zeros.begin()

    def _run(self, request: Any, response: Any) -> Any:
        """Service ~/run: begin."""
        if request.data and not self._sampler.started:
            self._start()
        response.success = bool(request.data)
        response.message = "runs" if request.data else "the slave follows the master"
        return response

    def _is_free(self) -> bool:
        """Whether the tool is above the last surface that is known, if one is."""
        surface_mm, sample = self._models.current.model[-1], self._newest
        return sample is None or math.isnan(surface_mm) or sample.position_mm < surface_mm

    def _on_estimate(self, message: Any) -> None:
        self._single_estimate_s = time.monotonic()
        self._take(message, nanoseconds_from_stamp(message.header.stamp))

    def _on_estimates(self, data: bytes) -> None:
        if time.monotonic() - self._single_estimate_s < ARRAYS_S:
            return  # they come on both topics
        for estimate in self._arrays.read(data):
            self._take(estimate, estimate.stamp_ns)

    def _take(self, message: Any, stamp_ns: int) -> None:
        """An estimate: before the surface is known a force, then a model."""
        self._estimates += 1
        displacement_mm = message.displacement * METRE_IN_MM
        if not self._has_sensor and np.isfinite(message.force_measured):
            self._calculated_n = float(message.force_measured)
        zeros = self._zeros
        if not zeros.hold_for(message.configuration_revision):
            if not zeros.found and np.isfinite(message.force_measured):
                self._models.feel(displacement_mm, message.force_measured)
            return
        # What was made without a force is older than it looks.
        if message.rejected or not np.isfinite(message.force_measured):
            return
        self._usable += 1
        if self._usable % USED_EVERY:
            return
        parameters = np.array(
            [
                message.stiffness,
                message.damping,
                message.displacement_exponent,
                message.velocity_exponent,
            ]
        )
        covariance = np.array(message.covariance).reshape(4, 4)
        surface_mm = message.contact_position * METRE_IN_MM
        late_s = 1e-9 * max(self._stamp_ns - stamp_ns, 0)
        seconds = 1e-9 * max(stamp_ns - self._estimate_ns, 0) if self._estimate_ns else 0.0
        self._estimate_ns = stamp_ns
        self._models.take(
            parameters,
            covariance,
            zeros.zero_mm + surface_mm,
            message.contact_position_std * METRE_IN_MM,
            displacement_mm - surface_mm,
            seconds,
            time.monotonic() - late_s,
        )
        self._used += 1

    # The sampler's thread.

    def _act(self, index: int, stamp_ns: int) -> bool:
        """One sample."""
        self._stamp_ns = stamp_ns
        known = self._models.at(time.monotonic())
        sample = self._side.step(time.time_ns(), known, self._calculated_n)
        self._newest = sample
        self._peak_n = max(self._peak_n, sample.true_force_n)
        self._largest_stretch_mm = max(
            self._largest_stretch_mm, abs(sample.command_mm - sample.position_mm)
        )
        self._outputs.publish(stamp_ns, self._as_rig_sample(index, sample))
        if index % LISTENERS_EVERY == 0:
            self._setpoint_wanted = self._setpoint.get_subscription_count() > 0
        if self._setpoint_wanted:
            set_stamp(self._pose.header.stamp, stamp_ns)
            self._pose.pose.position.x = sample.lateral_mm / METRE_IN_MM
            self._pose.pose.position.z = -sample.command_mm / METRE_IN_MM
            self._setpoint.publish(self._pose)
        return True

    def _as_rig_sample(self, index: int, sample: SlaveSample) -> RigSample:
        """The readings as the rig's topics have them; joints are as read, not true."""
        tissue = self._tissue
        depth = sample.true_position_mm - tissue.surface_mm
        parameters = np.array(tissue.parameters_at(sample.lateral_mm))
        truth = Truth(
            depth, sample.true_velocity_mm_s, sample.true_force_n, parameters, depth > 0.0
        )
        command = Joint(sample.command_mm, 0.0, 0.0)
        slave = Joint(sample.position_mm, sample.velocity_mm_s, sample.effort_n)
        coupling = Coupling(0.0, sample.command_mm, 0.0, sample.force_n)
        return RigSample(
            index / self._rate_hz,
            index,
            sample.position_mm,
            sample.force_n,
            truth,
            command,
            slave,
            sample.lateral_mm,
            coupling,
        )

    def _status(self) -> Status:
        """Return what /diagnostics says."""
        now_ns = time.time_ns()
        published = self._outputs.published
        rate, self._before = published - self._before, published
        now_s = time.monotonic()
        known, age_s = self._models.at(now_s), self._models.age_s(now_s)
        values: dict[str, Any] = {
            "samples": published,
            "rate_hz": rate,
            "overruns": self._sampler.report.overruns,
            "largest_delay_us": self._sampler.take_largest_delay_ns() / 1000.0,
            "method": self._side.method,
            "aligned": self._side.aligned,
            "estimates": self._estimates,
            "estimates_used": self._used,
            "estimates_undecodable": self._arrays.undecodable,
            "estimate_age_ms": 1e3 * age_s,
            "estimators_begun": self._zeros.lives,
            "surface_searched": self._zeros.searching,
            "surface_found": self._zeros.zero_mm is not None,
            "model_sure": known.sure,
            "model_relative_std": known.relative_std,
            "peak_force_n": self._peak_n,
            "largest_stretch_mm": self._largest_stretch_mm,
            **link_values(self._link, now_ns),
        }
        if self._newest is not None:
            values |= {"stiffness": self._newest.stiffness, "command_mm": self._newest.command_mm}
        if not self._sampler.started:
            return Status(Level.OK, "waits for ~/run", values)
        if self._link.silence_s(now_ns) > SILENCE_S:
            return Status(Level.WARN, "nothing comes from the master: stays where it is", values)
        if OLDEST_S < age_s < math.inf:
            return Status(Level.WARN, "follows; the newest estimate is old: nobody is sure", values)
        return Status(Level.OK, "follows", values)

    def finished(self) -> bool:
        """Whether the node wants to end by itself: never.

        Raises:
            NodeStartError: if the sampler's thread failed.
        """
        self._sampler.raise_failure(NodeStartError, "the slave")
        return False

    def close(self) -> None:
        """End the thread, say the last, close the link."""
        self._sampler.stop()
        self._diagnostics.publish_last()
        self._link.close()


def main() -> int:
    """Run the node; returns the exit status."""
    return run_node(SlaveNode)


if __name__ == "__main__":
    sys.exit(main())
