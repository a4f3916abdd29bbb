"""Node `estimator`: samples in, estimates out, as a managed node that starts by itself.

Thin: parameters are declared and checked in ros/settings, samples come from ros/inputs, the
stream with its faults is judged in online/session, messages go out through ros/outputs.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from hc_estimator import Estimate, Estimator, create_estimator
from hc_estimator.online.contacts import ContactSummary
from hc_estimator.online.session import Cause, EstimationSession, Event, Revision
from hc_estimator.ros.inputs import SampleInput
from hc_estimator.ros.node_settings import session_settings
from hc_estimator.ros.outputs import Outputs
from hc_estimator.ros.settings import Settings
from hc_estimator.ros.status import StatusReporter
from hc_msgs_py.diagnostics import DiagnosticsPublisher, Level, Status
from hc_msgs_py.node_main import NodeStartError, run_node
from hc_msgs_py.services import add_ready_service
from hc_msgs_py.topics import ESTIMATE, NODE_ESTIMATOR

WATCH_PERIOD_S = 0.1
"""Between two looks at silence and at who listens."""


class EstimatorNode(LifecycleNode):  # type: ignore[misc]  # rclpy ships no types
    """Estimates contact parameters from a stream of samples."""

    def __init__(self) -> None:
        """Declare parameters, and configure and activate unless told to wait.

        Raises:
            NodeStartError: for a parameter that does not exist, or if activation fails.
            ValueError: for a parameter's value that is not allowed.
        """
        super().__init__(NODE_ESTIMATOR)
        self._settings = Settings(self)
        self._outputs: Outputs | None = None
        self._session: EstimationSession | None = None
        self._status: StatusReporter | None = None
        self._input: SampleInput | None = None
        self.add_pre_set_parameters_callback(self._settings.fill_defaults)
        self.add_on_set_parameters_callback(self._settings.check)
        self.add_post_set_parameters_callback(self._apply)
        add_ready_service(self, self._missing)
        # The machine's own steady clock: simulated time may stand still.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(WATCH_PERIOD_S, self._watch, clock=self._steady)
        self._diagnostics = DiagnosticsPublisher(self, "estimator", self._collect_status)
        self._jump_handle = self.get_clock().create_jump_callback(
            JumpThreshold(
                min_forward=Duration(seconds=self._settings.values["input.maximum_gap"]),
                min_backward=Duration(nanoseconds=-1),
                on_clock_change=True,
            ),
            post_callback=self._on_clock_jump,
        )
        if self._settings.values["autostart"]:
            self._prepare()  # here, where what goes wrong is told
            for trigger in (self.trigger_configure, self.trigger_activate):
                if trigger() != TransitionCallbackReturn.SUCCESS:
                    raise NodeStartError("the node cannot be activated")

    # Lifecycle.

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Make the estimator, compile it and make the publishers."""
        if self._session is None:
            self._prepare()
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen to the samples."""
        session, outputs = self._parts()
        if session.revision.number == 0:
            session.start()
        self._input = SampleInput(
            self,
            session.process,
            session.skip,
            outputs.set_frame,
            self._settings.values["input.maximum_backlog"],
        )
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop listening; what is known stays."""
        self._stop_listening()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget everything."""
        self._stop_listening()
        if self._outputs is not None:
            self._outputs.close()
        self._outputs = self._session = self._status = None
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop for good."""
        self._stop_listening()
        return super().on_shutdown(state)

    def _prepare(self) -> None:
        estimator = self._new_estimator()
        estimator.warm_up()
        self._outputs = Outputs(self)
        self._session = EstimationSession(estimator, self, session_settings(self._settings.values))
        self._status = StatusReporter(self._session)

    def _new_estimator(self) -> Estimator:
        kind = self._settings.kind
        return create_estimator(
            kind.filter,
            state_space=kind.state_space,
            contact_model=kind.contact_model,
            **self._settings.estimator_values(),
        )

    def _parts(self) -> tuple[EstimationSession, Outputs]:
        assert self._session is not None
        assert self._outputs is not None
        return self._session, self._outputs

    def _stop_listening(self) -> None:
        if self._input is not None:
            self._input.close()
            self._input = None
        if self._session is not None:
            self._session.end()

    # What the session says.

    def on_estimate(
        self, stamp_ns: int, sequence: int, force_n: float, estimate: Estimate, computation_ns: int
    ) -> None:
        """Publish an estimate."""
        assert self._outputs is not None
        assert self._session is not None
        assert self._status is not None
        latency_ns = self._outputs.publish_estimate(
            stamp_ns, sequence, force_n, estimate, computation_ns, self._session.revision.number
        )
        self._status.latency.add(latency_ns)

    def on_event(self, event: Event) -> None:
        """Publish an event and write it to the log."""
        session, outputs = self._parts()
        outputs.publish_event(event, session.revision.number)
        self.get_logger().info(f"{event.kind.name.lower()}: {event.reason}")

    def on_contact(self, summary: ContactSummary) -> None:
        """Publish the summary of a contact."""
        session, outputs = self._parts()
        outputs.publish_contact(summary, session.revision.number)

    def on_revision(self, revision: Revision) -> None:
        """Publish the configuration in force."""
        session, outputs = self._parts()
        outputs.publish_configuration(revision, session.estimator)

    # What clients ask for.

    def _apply(self, parameters: list[Parameter]) -> None:
        """Post-set callback: apply checked parameters between two samples."""
        change = self._settings.take(parameters)
        if self._session is None:
            return
        if change.node:
            self._session.apply_settings(session_settings(self._settings.values))
            if self._input is not None:
                self._input.maximum_backlog = self._settings.values["input.maximum_backlog"]
        if change.kind is not None:
            self._session.reset(Cause.RESET, self._new_estimator())
        elif change.estimator:
            self._session.reconfigure(change.estimator)

    def _missing(self) -> list[str]:
        """Return who is not there yet, for ~/ready."""
        if self._input is None or self._outputs is None:
            return ["estimator is not active"]
        missing = []
        expected = self._settings.values["expected_sample_publishers"]
        for topic, found in self._input.publishers.items():
            if found < expected:
                missing.append(f"{topic} has {found} of {expected} publishers")
        expected = self._settings.values["expected_estimate_subscribers"]
        found = self._outputs.estimate_subscribers
        if found < expected:
            missing.append(f"{ESTIMATE} has {found} of {expected} subscribers")
        return missing

    # Watching.

    def _watch(self) -> None:
        if self._outputs is not None:
            self._outputs.look_who_listens()
        if self._session is not None and self._input is not None:
            self._session.check_silence(time.perf_counter_ns())

    def _on_clock_jump(self, jump: Any) -> None:
        if self._session is not None and self._session.time_origin_ns is not None:
            self._session.time_jumped(f"the clock jumped by {jump.delta.nanoseconds * 1e-9:+.3f} s")

    def _collect_status(self) -> Status:
        if self._status is None:
            return Status(Level.OK, "not configured", {})
        if self._input is None:
            return Status(Level.OK, "not active", {})
        return self._status.collect(self._input.publishers)

    def finished(self) -> bool:
        """Whether the node wants to end by itself: never."""
        return False

    def close(self) -> None:
        """Report the contact that still goes on and a last status."""
        self._diagnostics.publish()
        self._stop_listening()


def main() -> int:
    """Run the node; returns the exit status."""
    return run_node(EstimatorNode)


if __name__ == "__main__":
    sys.exit(main())
