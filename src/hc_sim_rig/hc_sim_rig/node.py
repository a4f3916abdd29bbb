"""Node `indenter`: runs a scenario in real time and publishes what its sensors read.

Thin: parameters in, samples out. What moves and how is the rig's (rig.py), when is the deadline
thread's (pacing.py).
"""

from __future__ import annotations

import dataclasses
import sys
import threading
import time
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool

from hc_msgs_py.background import STARTING, BackgroundWork
from hc_msgs_py.diagnostics import DiagnosticsPublisher, Level, Status
from hc_msgs_py.node_main import NodeStartError, run_node
from hc_msgs_py.parameters import declare, declare_specified, refuse_unknown
from hc_msgs_py.qos import SERVICE_QOS
from hc_msgs_py.services import add_ready_service
from hc_msgs_py.topics import NODE_INDENTER
from hc_sim_rig.drives import Teleoperation
from hc_sim_rig.pacing import DeadlineThread
from hc_sim_rig.rig import Rig
from hc_sim_rig.ros.ahead import Block, RowsEncoder, messages_ahead
from hc_sim_rig.ros.options import declare_options
from hc_sim_rig.ros.outputs import Outputs
from hc_sim_rig.ros.remote_side import RemoteSide
from hc_sim_rig.ros.simulated_time import SimulatedTime
from hc_sim_rig.scenario import load_scenario
from hc_sim_rig.schema import ScenarioError
from hc_sim_rig.settings import SETTINGS

SCENARIO_PERIOD_S = 0.05
"""Between two looks at whether another scenario is wanted."""


class IndenterNode(Node):  # type: ignore[misc]  # rclpy ships no types
    """Publishes the rig's sensors, truth and joints, sample by sample."""

    def __init__(self) -> None:
        """Load the scenario, begin to compile the rig, and start when it is, unless told to wait.

        Raises:
            ScenarioError: if the scenario, or a setting, cannot be.
            ValueError: if parameters contradict each other.
        """
        super().__init__(NODE_INDENTER)
        self._options = options = declare_options(self)
        self._rig = Rig(options.scenario, options.seed, options.side)
        self._changing = threading.Lock()
        self._setting_names: list[str] = []
        self._next_rig: Rig | None = None
        self._declare_settings()
        self._together = options.samples_per_message
        self._outputs = Outputs(
            self, with_sensors=options.side != "master", together=self._together
        )
        refuse_unknown(self)
        self._outputs.set_scenario(options.scenario, self._rig.seed)
        self._outputs.take_settings(self._rig.settings())
        self._published_before = 0
        self._overruns_before = 0
        self._timeouts_before = 0
        self._simulated = None
        if options.time != "system":
            lockstep = options.time == "lockstep"
            timeout_s = options.lockstep_timeout_s
            self._simulated = SimulatedTime(self, self._rig.rate_hz, lockstep, timeout_s)
        self._remote = None
        if options.side != "both":
            self._remote = RemoteSide(self, self._rig, options.remote_topic)
        self._ahead = 1
        if self._simulated is None and self._remote is None:
            self._ahead = messages_ahead(self._rig.rate_hz / self._together)
        steps = [self._rig.warm_up]
        if self._ahead * self._together > 1:
            steps.append(self._outputs.warm_up)
        self._compilation = BackgroundWork("compiling the rig", steps)
        self._begins = not options.start_paused
        self._block: Block | None = None
        self._sampler = self._make_sampler()
        self.create_service(SetBool, "~/run", self._run, qos_profile=SERVICE_QOS)
        add_ready_service(self, self._missing)
        self.add_on_set_parameters_callback(self._check_settings)
        self.add_post_set_parameters_callback(self._apply_settings)
        name = f"rig {options.scenario.name}"
        self._diagnostics = DiagnosticsPublisher(self, name, self._status)
        # Parameters are not undeclared inside a parameter callback: a timer changes the scenario.
        self.create_timer(
            SCENARIO_PERIOD_S, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def _make_sampler(self) -> DeadlineThread:
        return DeadlineThread(
            self._rig.rate_hz * self._options.rate / self._together,
            self._publish if self._ahead * self._together == 1 else self._publish_due,
            time.time_ns,  # the node's clock, unless that is the simulated one made here
        )

    def _declare_settings(self) -> None:
        """Declare what may change while the rig runs; the names of another scenario go."""
        given = {}
        for name in self._setting_names:
            if name not in self._rig.settings():
                self.undeclare_parameter(name)
        known, self._setting_names = self._setting_names, list(self._rig.settings())
        for name, value in self._rig.settings().items():
            if name in known:
                continue
            given[name] = declare_specified(
                self, dataclasses.replace(SETTINGS[name].specification, default=value)
            )
        if not known:
            given["pause"] = declare(self, "pause", False, "let the motion come to rest")
        self._rig.start_with(**self._settings_from(given))

    def _settings_from(self, values: dict[str, Any]) -> dict[str, float]:
        """Return the rig's settings for parameter values; a pause is a speed of zero."""
        settings = {name: float(value) for name, value in values.items() if name in SETTINGS}
        if values.get("pause", False):
            settings["speed"] = 0.0
        return settings

    def _check_settings(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse what the rig would refuse; a scenario is loaded here and begins a little later."""
        values = {p.name: p.value for p in parameters}
        try:
            if "scenario" in values and len(values) > 1:
                raise ScenarioError("set the scenario by itself: it brings its own settings")
            self._rig.check(**self._settings_from(values))
            if "scenario" in values:
                self._next_rig = self._rig_of(values["scenario"])
        except ScenarioError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _rig_of(self, name: str) -> Rig:
        """Return the rig of another scenario, ready to go on at once.

        Raises:
            ScenarioError: if the node cannot go on with it.
        """
        options = self._options
        if options.side != "both" or options.time != "system":
            raise ScenarioError(
                f"the scenario stays as it is with side {options.side}, time {options.time}: "
                "start the rig anew"
            )
        rig = Rig(load_scenario(name), options.seed)
        if rig.rate_hz != self._rig.rate_hz:
            raise ScenarioError(
                f"scenario {name} runs at {rig.rate_hz:g} Hz, this rig at "
                f"{self._rig.rate_hz:g} Hz: start the rig anew"
            )
        rig.warm_up()
        return rig

    def _look(self) -> None:
        """Begin once the rig is compiled, and go on with another scenario if one is wanted."""
        if self._begins and self._compilation.done:
            self._begins = False
            self._compilation.wait()  # raises what ended it
            self._begin()
        self._change_scenario()

    def _change_scenario(self) -> None:
        """Go on with another scenario from its beginning, if one is wanted; samples count on."""
        rig, self._next_rig = self._next_rig, None
        if rig is None:
            return
        with self._changing:
            self._outputs.first_sequence += self._rig.sequence
            self._outputs.set_scenario(rig.scenario, rig.seed)
            self._rig = rig
        self._options = self._options._replace(scenario=rig.scenario)
        for name, value in rig.settings().items():
            if name in self._setting_names:
                self.set_parameters([Parameter(name, value=value)])
        self._declare_settings()
        self.get_logger().info(f"scenario {rig.scenario.name}")
        if self._sampler.started and not self._sampler.running:  # the one before came to its end
            self._sampler, self._overruns_before = self._make_sampler(), 0
            self._begin()

    def _apply_settings(self, parameters: list[Parameter]) -> None:
        """Let the rig glide to what has been set."""
        values = {p.name: p.value for p in parameters}
        if "pause" in values or "speed" in values:
            values["pause"] = self.get_parameter("pause").value
            values["speed"] = self.get_parameter("speed").value
        self._rig.tune(**self._settings_from(values))
        self._outputs.take_settings(self._rig.settings())

    def _begin(self) -> None:
        """Take the first sample now."""
        self._outputs.look_who_listens()
        if self._simulated is not None:
            self._simulated.begin()
        self._sampler.start()

    def _run(self, request: Any, response: Any) -> Any:
        """Service ~/run: start the samples or the motion, or let the motion come to rest."""
        if request.data and not self._compilation.done:
            self._begins = True
            response.message = f"begins when that is done: {self._compilation.progress}"
        elif request.data and not self._sampler.started:
            self._compilation.wait()  # raises what ended it
            self._begins = False
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
        if not self._compilation.done:
            return [f"{STARTING}{self._compilation.progress}"]
        lines = self._outputs.missing()
        if self._simulated is not None:
            lines += self._simulated.missing()
        if self._remote is not None:
            lines += self._remote.missing()
        return lines

    def _publish(self, _index: int, stamp_ns: int) -> bool:
        """Take and publish a sample; the sampler's thread calls this."""
        with self._changing:
            if self._rig.finished:
                return False
            if self._simulated is not None:
                stamp_ns = self._simulated.move_to(self._rig.sequence)
            self._outputs.publish(stamp_ns, self._rig.step())
        if self._simulated is not None:
            self._simulated.wait()
        return True

    def _publish_due(self, index: int, _stamp_ns: int) -> bool:
        """Publish samples that were made before; the sampler's thread calls this.

        Of several samples in one message the last is due now.
        """
        if self._block is None:
            self._block = self._make_block(index)
        if self._block is None:
            return False
        self._outputs.publish_due(self._block)
        if not self._block.due:
            self._block = self._make_block(index + 1)
        return True

    def _make_block(self, index: int) -> Block | None:
        """Take the samples of some deadlines, from one on; None at the scenario's end."""
        with self._changing:
            rig, together = self._rig, self._together
            count = self._ahead * together
            if rig.scenario.at_end == "stop":
                count = min(count, rig.samples_in(rig.scenario.duration_s) - rig.sequence)
            if count <= 0:
                return None
            stamp_ns = self._sampler.stamp_ns
            if together == 1:
                stamps_ns = [stamp_ns(index + i) for i in range(count)]
            else:
                places = [(i % together + 1 - together) * 1e9 / rig.rate_hz for i in range(count)]
                stamps_ns = [
                    stamp_ns(index + i // together) + round(place) for i, place in enumerate(places)
                ]
            return self._outputs.make(stamps_ns, rig.sequence, rig.rows(count))

    def _status(self) -> Status:
        """Return what /diagnostics says."""
        published, report = self._outputs.published, self._sampler.report
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
            "seed": self._options.seed,
        }
        if self._simulated is not None:
            values["lockstep_timeouts"] = self._simulated.timeouts
            values["estimates_undecodable"] = self._simulated.undecodable
        if self._remote is not None:
            values["remote_received"] = self._remote.received
            values["remote_overtaken"] = self._remote.overtaken
        elif isinstance(self._rig.scenario.drive, Teleoperation):
            for name, link in zip(("forward", "backward"), self._rig.link_reports(), strict=True):
                values[f"{name}_lost"] = link.lost
                values[f"{name}_overtaken"] = link.overtaken
        if not self._compilation.done:
            return Status(Level.OK, self._compilation.progress, values)
        if not self._sampler.started:
            return Status(Level.OK, "waits for ~/run", values)
        if self._rig.finished:
            return Status(Level.OK, "scenario finished", values)
        if self._simulated is not None and self._simulated.timeouts > self._timeouts_before:
            self._timeouts_before = self._simulated.timeouts
            return Status(Level.WARN, "no estimate came in time", values)
        if late and self._options.time != "lockstep":
            return Status(Level.WARN, f"{late} samples late by more than a period", values)
        return Status(Level.OK, "samples", values)

    def finished(self) -> bool:
        """Whether the node wants to end by itself.

        Raises:
            NodeStartError: if the sampler's thread failed.
        """
        self._sampler.raise_failure(NodeStartError, "the rig")
        return self._options.exit_at_end and self._rig.finished and not self._sampler.running

    def close(self) -> None:
        """Publish the sample in progress and the final count, and end the thread."""
        if self._simulated is not None:
            self._simulated.close()
        self._sampler.stop()
        if self._block is not None and not self._sampler.error:
            self._outputs.publish_after(self._block)
        self._diagnostics.publish_last()


def prepare() -> None:
    """Load what a node of this process will need (hc_bringup.standby)."""
    Rig("multisine").warm_up()
    RowsEncoder().warm_up()


def main() -> int:
    """Run the node; returns the exit status."""
    return run_node(IndenterNode)


if __name__ == "__main__":
    sys.exit(main())
