"""Node `master`: the hand's side of a teleoperation, live at 1 kHz.

Thin: the hand (simulated, or a haptic device over CRTK's measured_cp and servo_cf) and the link go
to bilateral/sides, whose force goes back to the hand and out on topics.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

from geometry_msgs.msg import PoseStamped, WrenchStamped
from hc_msgs.msg import HuntCrossleyEstimate
from rclpy.node import Node
from std_srvs.srv import SetBool

from hc_msgs_py.diagnostics import DiagnosticsPublisher, Level, Status
from hc_msgs_py.node_main import NodeStartError, run_node
from hc_msgs_py.parameters import declare, refuse_unknown
from hc_msgs_py.qos import NEWEST_QOS, SERVICE_QOS, SERVO_QOS
from hc_msgs_py.services import add_ready_service
from hc_msgs_py.topics import MASTER_MEASURED_CP, MASTER_MODEL, MASTER_SERVO_CF, NODE_MASTER
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp, set_stamp
from hc_sim_rig.bilateral.device_poses import DevicePoses
from hc_sim_rig.bilateral.sides import MasterSample, MasterSide
from hc_sim_rig.bilateral.simulated_hand import SimulatedHand
from hc_sim_rig.bilateral.task import palpation_task, recorded_task
from hc_sim_rig.bilateral.wave_arrivals import SILENCE_S
from hc_sim_rig.pacing import DeadlineThread
from hc_sim_rig.ros.side_options import (
    RefusalWatch,
    declare_link,
    declare_settings,
    link_values,
)

MODEL_EVERY = 20
"""Samples between two messages of the model."""
AXES = ("x", "y", "z")


class MasterNode(Node):  # type: ignore[misc]  # rclpy ships no types
    """Makes the hand feel what the slave sends: its model, force, position or waves."""

    def __init__(self) -> None:
        """Declare parameters, open the link, compile, and start unless told to wait.

        Raises:
            ScenarioError: a setting cannot be.
            ValueError: a parameter's value is not allowed, or the link cannot be.
        """
        super().__init__(NODE_MASTER)
        seed = declare(
            self, "seed", 0, "seed of tremor, sensor and added loss", minimum=0, read_only=True
        )
        self._device = declare(
            self,
            "device.kind",
            "simulated",
            "simulated: hand and device are simulated here; crtk: a haptic device publishes "
            "measured_cp and takes servo_cf",
            choices=("simulated", "crtk"),
            read_only=True,
        )
        settings = declare_settings(self, ("operator", "device", "feedback"))
        self._axis = AXES.index(
            declare(self, "device.axis", "z", "axis of the press", choices=AXES, read_only=True)
        )
        self._lateral_axis = AXES.index(
            declare(self, "device.lateral_axis", "x", "axis sideways", choices=AXES, read_only=True)
        )
        sign = declare(
            self,
            "device.sign",
            -1,
            "-1: the axis points out of the tissue",
            minimum=-1,
            maximum=1,
            read_only=True,
        )
        if sign == 0:
            raise ValueError("parameter device.sign = 0 is not 1 or -1")
        self._sign = float(sign)
        self._scale = declare(
            self,
            "device.scale",
            1.0,
            "motion of the slave over that of the hand",
            minimum=1e-3,
            maximum=1e3,
            read_only=True,
        )
        motion = declare(
            self,
            "motion",
            "",
            "CSV of a recorded hand motion (time_s, displacement_mm, lateral_mm) for the "
            "simulated hand to make; empty: the palpation task",
            read_only=True,
        )
        start_paused = declare(
            self, "start_paused", False, "begin only when ~/run is called with true", read_only=True
        )
        self._exit_at_end = declare(
            self, "exit_at_end", False, "end with the simulated hand's task", read_only=True
        )
        rate_hz = settings.rate_hz
        task = recorded_task(Path(motion), rate_hz) if motion else palpation_task(rate_hz)
        self._hand = SimulatedHand(settings, task, seed) if self._device == "simulated" else None
        self._link = declare_link(self, "master", seed)
        refuse_unknown(self)
        self._side = MasterSide(settings, self._link, self._scale)
        self._side.warm_up()
        self._poses = DevicePoses(self._scale)
        self._samples = self._before = self._silent_samples = self._refused_before = 0
        self._force_n = self._largest_update_n = self._lowest_tank_mj = 0.0
        self._newest: MasterSample | None = None
        self._force = self.create_publisher(WrenchStamped, MASTER_SERVO_CF, SERVO_QOS)
        self._model = self.create_publisher(HuntCrossleyEstimate, MASTER_MODEL, SERVO_QOS)
        self._wrench, self._pose_message = WrenchStamped(), PoseStamped()
        self._model_message = HuntCrossleyEstimate()
        for message in (self._wrench, self._pose_message, self._model_message):
            message.header.frame_id = "master"
        if self._hand is None:
            self.create_subscription(PoseStamped, MASTER_MEASURED_CP, self._on_pose, NEWEST_QOS)
        else:
            self._position = self.create_publisher(PoseStamped, MASTER_MEASURED_CP, SERVO_QOS)
        self._sampler = DeadlineThread(rate_hz, self._act, time.time_ns)
        self.create_service(SetBool, "~/run", self._run, qos_profile=SERVICE_QOS)
        add_ready_service(self, list)
        refusals = RefusalWatch(self._link)
        self._diagnostics = DiagnosticsPublisher(
            self, f"{self._device} device", lambda: refusals.reported_in(self._status())
        )
        if not start_paused:
            self._sampler.start()

    def _run(self, request: Any, response: Any) -> Any:
        """Service ~/run: begin."""
        if request.data and not self._sampler.started:
            self._sampler.start()
        response.success = bool(request.data)
        response.message = "runs" if request.data else "a hand does not pause"
        return response

    def _on_pose(self, message: Any) -> None:
        """A haptic device says where it is [m]."""
        point = message.pose.position
        place = (point.x, point.y, point.z)
        position_mm = self._sign * METRE_IN_MM * place[self._axis]
        lateral_mm = METRE_IN_MM * place[self._lateral_axis]
        stamp_s = 1e-9 * nanoseconds_from_stamp(message.header.stamp)
        self._poses.take(position_mm, lateral_mm, time.monotonic(), stamp_s)

    def _where(self) -> tuple[float, float, float | None] | None:
        """Position and lateral position of the hand [mm], and since when; None: nobody tells."""
        if self._hand is not None:
            return self._hand.reading_mm(), self._hand.lateral_mm, None
        return self._poses.where(time.monotonic())

    def _act(self, _index: int, stamp_ns: int) -> bool:
        """One sample; the sampler's thread calls this."""
        where = self._where()
        force_n = 0.0
        if where is None:
            self._silent_samples += 1
            self._side.rest(time.time_ns())
        else:
            sample = self._side.step(time.time_ns(), *where)
            force_n = sample.force_n
            self._newest = sample
            self._largest_update_n = max(self._largest_update_n, abs(sample.update_n))
            self._lowest_tank_mj = min(self._lowest_tank_mj, sample.tank_mj)
        self._force_n = force_n
        self._publish_force(stamp_ns, force_n)
        if self._hand is not None and where is not None:
            self._publish_pose(stamp_ns, *where[:2])
            self._hand.move(force_n)
        if self._samples % MODEL_EVERY == 0 and self._newest is not None:
            self._publish_model(stamp_ns, self._newest)
        self._samples += 1
        return not (self._exit_at_end and self._hand is not None and self._hand.finished)

    def _publish_force(self, stamp_ns: int, force_n: float) -> None:
        set_stamp(self._wrench.header.stamp, stamp_ns)
        vector = self._wrench.wrench.force
        # What pushes the hand out of the tissue, in the device's axes.
        setattr(vector, AXES[self._axis], -self._sign * force_n)
        self._force.publish(self._wrench)

    def _publish_pose(self, stamp_ns: int, position_mm: float, lateral_mm: float) -> None:
        set_stamp(self._pose_message.header.stamp, stamp_ns)
        point = self._pose_message.pose.position
        factor = METRE_IN_MM * self._scale
        setattr(point, AXES[self._axis], self._sign * position_mm / factor)
        setattr(point, AXES[self._lateral_axis], lateral_mm / factor)
        self._position.publish(self._pose_message)

    def _publish_model(self, stamp_ns: int, sample: MasterSample) -> None:
        """Publish what is rendered: parameters, what is known of them, force."""
        message, newest = self._model_message, self._link.newest
        set_stamp(message.header.stamp, stamp_ns)
        message.sequence = self._samples
        stiffness, damping, exponent, velocity_exponent, surface = sample.model
        message.stiffness, message.damping = stiffness, damping
        message.displacement_exponent = exponent
        message.velocity_exponent = velocity_exponent
        message.contact_position = surface / METRE_IN_MM
        message.contact = sample.position_mm > surface
        message.displacement = sample.position_mm / METRE_IN_MM
        message.velocity = sample.velocity_mm_s / METRE_IN_MM
        message.force_reconstructed = sample.force_n
        if newest is not None:
            message.force_measured = newest.force_n
            message.channel_delay = self._link.age_s(time.time_ns())
            message.channel_delay_std = 1e-9 * self._link.clock.bound_ns(time.time_ns())
            (
                message.stiffness_std,
                message.damping_std,
                message.displacement_exponent_std,
                message.velocity_exponent_std,
                surface_std_mm,
            ) = newest.deviations
            message.contact_position_std = surface_std_mm / METRE_IN_MM
        self._model.publish(message)

    def _status(self) -> Status:
        """Return what /diagnostics says."""
        now_ns = time.time_ns()
        rate, self._before = self._samples - self._before, self._samples
        values: dict[str, Any] = {
            "samples": self._samples,
            "rate_hz": rate,
            "overruns": self._sampler.report.overruns,
            "largest_delay_us": self._sampler.take_largest_delay_ns() / 1000.0,
            "largest_update_n": self._largest_update_n,
            "lowest_tank_mj": self._lowest_tank_mj,
            **link_values(self._link, now_ns),
        }
        poses = self._poses
        if self._hand is None:
            values |= {"poses": poses.accepted, "samples_without_pose": self._silent_samples}
            values |= {f"poses_refused_{reason}": n for reason, n in poses.refused.items()}
            values["pose_why_refused"] = poses.why_refused
        newest = self._link.newest
        if newest is not None:
            values |= {"model_sure": newest.sure, "model_relative_std": newest.relative_std}
        values["force_n"] = self._force_n
        if not self._sampler.started:
            return Status(Level.OK, "waits for ~/run", values)
        if self._hand is None:
            refused = sum(poses.refused.values())
            new, self._refused_before = refused - self._refused_before, refused
            reason = f"poses of the haptic device are refused ({poses.why_refused})"
            if not poses.heard(time.monotonic()):
                reason = reason if new else "the haptic device says nothing"
                return Status(Level.ERROR, f"no force: {reason}", values)
            if new:
                return Status(Level.WARN, f"{reason}: no force meanwhile", values)
        if self._link.silence_s(now_ns) > SILENCE_S:
            return Status(Level.WARN, "nothing comes from the slave", values)
        if newest is not None and not newest.sure:
            return Status(Level.OK, "renders the last model that counted, if any", values)
        return Status(Level.OK, "renders", values)

    def finished(self) -> bool:
        """Whether the node wants to end by itself.

        Raises:
            NodeStartError: if the sampler's thread failed.
        """
        self._sampler.raise_failure(NodeStartError, "the master")
        return self._sampler.started and not self._sampler.running

    def close(self) -> None:
        """End the thread, let go of the hand, close the link."""
        self._sampler.stop()
        self._publish_force(time.time_ns(), 0.0)
        self._diagnostics.publish_last()
        self._link.close()


def main() -> int:
    """Run the node; returns the exit status."""
    return run_node(MasterNode)


if __name__ == "__main__":
    sys.exit(main())
