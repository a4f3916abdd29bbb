"""Node `indenter`: runs a scenario in real time and publishes what its sensors read.

Thin: parameters in, samples out. What moves and how is the rig's (rig.py), when is the deadline
thread's (pacing.py).
"""

from __future__ import annotations

import sys
import time
from typing import Any

from geometry_msgs.msg import WrenchStamped
from hc_msgs.msg import IndenterSample, IndenterTruth
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from hc_msgs_py.conversion import (
    fill_force,
    fill_sample,
    fill_truth,
    new_sample_message,
    new_truth_message,
)
from hc_msgs_py.diagnostics import DiagnosticsPublisher, Level, Status
from hc_msgs_py.node_main import NodeStartError, run_node
from hc_msgs_py.parameters import declare
from hc_msgs_py.qos import SAMPLE_QOS
from hc_msgs_py.services import add_ready_service
from hc_msgs_py.topics import (
    FRAME_INDENTER_TIP,
    JOINT_STATES,
    NODE_INDENTER,
    SAMPLE,
    TRUTH,
    WRENCH,
)
from hc_msgs_py.units import METRE_IN_MM, set_stamp
from hc_sim_rig.drives import Teleoperation
from hc_sim_rig.pacing import DeadlineThread
from hc_sim_rig.remote_side_node import RemoteSide
from hc_sim_rig.rig import Rig, RigSample
from hc_sim_rig.scenario import load_scenario
from hc_sim_rig.schema import ScenarioError
from hc_sim_rig.settings import SETTINGS
from hc_sim_rig.simulated_time_node import SimulatedTime

LISTENERS_EVERY = 20
"""Samples between two looks at who listens to the topics that not everybody needs."""


class IndenterNode(Node):  # type: ignore[misc]  # rclpy ships no types
    """Publishes the rig's sensors, truth and joints, sample by sample."""

    def __init__(self) -> None:
        """Load the scenario, compile the rig and start, unless told to wait.

        Raises:
            ScenarioError: if the scenario, or a setting, cannot be.
        """
        super().__init__(NODE_INDENTER)
        self._declare_start()
        self._rig = Rig(self._scenario, self._seed, self._side)
        self._rig.warm_up()
        self._declare_settings()
        self._sample = self.create_publisher(IndenterSample, SAMPLE, SAMPLE_QOS)
        self._truth = self.create_publisher(IndenterTruth, TRUTH, SAMPLE_QOS)
        self._wrench = self.create_publisher(WrenchStamped, WRENCH, SAMPLE_QOS)
        self._joints = self.create_publisher(JointState, JOINT_STATES, SAMPLE_QOS)
        self._sample_message = new_sample_message()
        self._truth_message = new_truth_message()
        self._wrench_message = WrenchStamped()
        self._wrench_message.header.frame_id = FRAME_INDENTER_TIP
        self._joints_message = JointState(name=["master", "slave"])
        self._listeners = (True, True, True)
        self._published = 0
        self._published_before = 0
        self._overruns_before = 0
        self._timeouts_before = 0
        self._simulated = None
        if self._time != "system":
            lockstep = self._time == "lockstep"
            self._simulated = SimulatedTime(self, self._rig.rate_hz, lockstep, self._timeout_s)
        self._remote = None
        if self._side != "both":
            self._remote = RemoteSide(self, self._rig, self._remote_topic)
        self._sampler = DeadlineThread(
            self._rig.rate_hz * self._rate,
            self._publish,
            time.time_ns,  # the node's clock, unless that is the simulated one made here
        )
        self.create_service(SetBool, "~/run", self._run)
        add_ready_service(self, self._missing)
        self.add_on_set_parameters_callback(self._check_settings)
        self.add_post_set_parameters_callback(self._apply_settings)
        self._diagnostics = DiagnosticsPublisher(self, f"rig {self._scenario.name}", self._status)
        if not self._start_paused:
            self._begin()

    def _declare_start(self) -> None:
        """Declare what is fixed at the start."""
        name = declare(
            self,
            "scenario",
            "multisine",
            "name of a scenario, or path of its YAML file",
            read_only=True,
        )
        self._scenario = load_scenario(name)
        self._seed = declare(
            self,
            "seed",
            self._scenario.seed,
            "seed of all random draws",
            minimum=0,
            read_only=True,
        )
        self._start_paused = declare(
            self,
            "start_paused",
            False,
            "take the first sample only when ~/run is called with true",
            read_only=True,
        )
        self._side = declare(
            self,
            "side",
            "both",
            "both: master, channel and slave are simulated here; master or slave: only that one, "
            "the other is a node on another host and the network is the channel",
            choices=("both", "master", "slave"),
            read_only=True,
        )
        self._remote_topic = declare(
            self,
            "remote_topic",
            "",
            "where the other side publishes: the slave's wrench for a master, the master's joint "
            "states for a slave; empty: /slave/indenter/wrench, /master/indenter/joint_states",
            read_only=True,
        )
        self._time = declare(
            self,
            "time",
            "system",
            "system: stamps from the node's clock, in real time; simulated: stamps and /clock from "
            "the rig, at `rate` times real time; lockstep: the same, but each sample waits for "
            "the estimate of the one before",
            choices=("system", "simulated", "lockstep"),
            read_only=True,
        )
        self._rate = declare(
            self,
            "rate",
            1.0,
            "pace of simulated time against real time; in lockstep the largest pace",
            minimum=0.001,
            maximum=1000.0,
            read_only=True,
        )
        if self._time == "system" and self._rate != 1.0:
            raise ValueError(
                f"parameter rate is {self._rate:g}, must be 1 while time is system "
                "(time: simulated runs at another pace)"
            )
        if self._time == "system" and self.get_parameter("use_sim_time").value:
            raise ValueError(
                "parameter use_sim_time is true while time is system: the rig makes time itself "
                "(time: simulated publishes /clock)"
            )
        self._timeout_s = declare(
            self,
            "lockstep_timeout",
            2.0,
            "longest wait for an estimate in lockstep",
            minimum=0.001,
            maximum=3600.0,
            unit="s",
            read_only=True,
        )
        self._exit_at_end = declare(
            self,
            "exit_at_end",
            False,
            "end the process when the scenario's duration is over",
            read_only=True,
        )
        self._expected = {
            topic: declare(
                self,
                f"expected_{topic.rsplit('/', 1)[-1]}_subscribers",
                0,
                f"subscribers of {topic} that ~/ready waits for",
                minimum=0,
                maximum=1000,
            )
            for topic in (SAMPLE, TRUTH, WRENCH, JOINT_STATES)
        }

    def _declare_settings(self) -> None:
        """Declare what may change while the rig runs."""
        given = {}
        for name, value in self._rig.settings().items():
            limits = SETTINGS[name]
            given[name] = declare(
                self,
                name,
                value,
                limits.about,
                minimum=limits.minimum,
                maximum=limits.maximum,
                unit=limits.unit,
            )
        given["pause"] = declare(self, "pause", False, "let the motion come to rest")
        self._rig.start_with(**self._settings_from(given))

    def _settings_from(self, values: dict[str, Any]) -> dict[str, float]:
        """Return the rig's settings for parameter values; a pause is a speed of zero."""
        settings = {name: float(value) for name, value in values.items() if name in SETTINGS}
        if values.get("pause", False):
            settings["speed"] = 0.0
        return settings

    def _check_settings(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse what the rig would refuse."""
        try:
            self._rig.check(**self._settings_from({p.name: p.value for p in parameters}))
        except ScenarioError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_settings(self, parameters: list[Parameter]) -> None:
        """Let the rig glide to what has been set."""
        values = {p.name: p.value for p in parameters}
        if "pause" in values or "speed" in values:
            values["pause"] = self.get_parameter("pause").value
            values["speed"] = self.get_parameter("speed").value
        for topic in self._expected:
            name = f"expected_{topic.rsplit('/', 1)[-1]}_subscribers"
            self._expected[topic] = values.get(name, self._expected[topic])
        self._rig.tune(**self._settings_from(values))

    def _begin(self) -> None:
        """Take the first sample now."""
        if self._simulated is not None:
            self._simulated.begin()
        self._sampler.start()

    def _run(self, request: Any, response: Any) -> Any:
        """Service ~/run: start the samples or the motion, or let the motion come to rest."""
        if request.data and not self._sampler.started:
            self._begin()
            response.message = "first sample taken"
        else:
            response.message = "motion runs" if request.data else "motion comes to rest"
        result = self.set_parameters([Parameter("pause", value=not request.data)])[0]
        response.success = result.successful
        if not result.successful:
            response.message = result.reason
        return response

    def _missing(self) -> list[str]:
        """Return who is not there yet, for ~/ready."""
        publishers = (self._sample, self._truth, self._wrench, self._joints)
        counts = {
            topic: (publisher.get_subscription_count(), expected)
            for publisher, (topic, expected) in zip(publishers, self._expected.items(), strict=True)
        }
        waiting = [] if self._simulated is None else self._simulated.missing()
        if self._remote is not None:
            waiting += self._remote.missing()
        return waiting + [
            f"{topic} has {found} of {expected} subscribers"
            for topic, (found, expected) in counts.items()
            if found < expected
        ]

    def _publish(self, index: int, stamp_ns: int) -> bool:
        """Take one sample and publish it; the sampler's thread calls this."""
        if self._rig.finished:
            return False
        if index % LISTENERS_EVERY == 0:
            self._listeners = (
                self._truth.get_subscription_count() > 0,
                self._wrench.get_subscription_count() > 0,
                self._joints.get_subscription_count() > 0,
            )
        if self._simulated is not None:
            stamp_ns = self._simulated.move_to(self._rig.sequence)
        sample = self._rig.step()
        if self._side != "master":  # the sensors are at the slave
            self._publish_sensors(stamp_ns, sample)
        if self._listeners[2]:
            self._publish_joints(stamp_ns, sample)
        self._published += 1
        if self._simulated is not None:
            self._simulated.wait()
        return True

    def _publish_sensors(self, stamp_ns: int, sample: RigSample) -> None:
        """Publish what the sensors read, and the truth behind it."""
        fill_sample(
            self._sample_message,
            stamp_ns,
            sample.sequence,
            sample.displacement_mm,
            sample.force_n,
        )
        self._sample.publish(self._sample_message)
        truth_wanted, wrench_wanted, _ = self._listeners
        if truth_wanted:
            fill_truth(self._truth_message, stamp_ns, sample.sequence, *sample.truth)
            self._truth.publish(self._truth_message)
        if wrench_wanted:
            fill_force(self._wrench_message, stamp_ns, sample.force_n)
            self._wrench.publish(self._wrench_message)

    def _publish_joints(self, stamp_ns: int, sample: RigSample) -> None:
        """Publish both joints; of a side that is on another host, what this one knows."""
        master, slave, message = sample.master, sample.slave, self._joints_message
        set_stamp(message.header.stamp, stamp_ns)
        message.position = [master[0] / METRE_IN_MM, slave[0] / METRE_IN_MM]
        message.velocity = [master[1] / METRE_IN_MM, slave[1] / METRE_IN_MM]
        message.effort = [master[2], slave[2]]
        self._joints.publish(message)

    def _status(self) -> Status:
        """Return what /diagnostics says."""
        published, report = self._published, self._sampler.report
        rate = published - self._published_before
        self._published_before = published
        late = report.overruns - self._overruns_before
        self._overruns_before = report.overruns
        values = {
            "samples": published,
            "rate_hz": rate,
            "nominal_rate_hz": self._rig.rate_hz,
            "overruns": report.overruns,
            "largest_delay_us": self._sampler.take_largest_delay_ns() / 1000.0,
            "clock_jumps": report.clock_jumps,
            "time_s": self._rig.time_s,
            "seed": self._seed,
        }
        if self._simulated is not None:
            values["lockstep_timeouts"] = self._simulated.timeouts
        if self._remote is not None:
            values["remote_received"] = self._remote.received
            values["remote_overtaken"] = self._remote.overtaken
        elif isinstance(self._rig.scenario.drive, Teleoperation):
            for name, link in zip(("forward", "backward"), self._rig.link_reports(), strict=True):
                values[f"{name}_lost"] = link.lost
                values[f"{name}_overtaken"] = link.overtaken
        if not self._sampler.started:
            return Status(Level.OK, "waits for ~/run", values)
        if self._rig.finished:
            return Status(Level.OK, "scenario finished", values)
        if self._simulated is not None and self._simulated.timeouts > self._timeouts_before:
            self._timeouts_before = self._simulated.timeouts
            return Status(Level.WARN, "no estimate came in time", values)
        if late and self._time != "lockstep":
            return Status(Level.WARN, f"{late} samples late by more than a period", values)
        return Status(Level.OK, "samples", values)

    def finished(self) -> bool:
        """Whether the node wants to end by itself.

        Raises:
            NodeStartError: if the sampler's thread failed.
        """
        if self._sampler.error is not None:
            raise NodeStartError(f"the rig stopped: {self._sampler.error}")
        return bool(self._exit_at_end) and self._rig.finished and not self._sampler.running

    def close(self) -> None:
        """Publish the sample in progress and the final count, and end the thread."""
        if self._simulated is not None:
            self._simulated.close()
        self._sampler.stop()
        self._diagnostics.publish_last()


def main() -> int:
    """Run the node; returns the exit status."""
    return run_node(IndenterNode)


if __name__ == "__main__":
    sys.exit(main())
