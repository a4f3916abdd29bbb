"""Node `estimator`: samples in, estimates out, as a managed node that starts by itself.

Thin: parameters are declared and checked in ros/settings, samples come from ros/inputs and
ros/sensors, the stream with its faults is judged in stream/session, ros/sample_flow hands samples
there and what comes of them to ros/outputs, ros/service_calls answers, and ros/state_keeper keeps
the state.
"""

from __future__ import annotations

import sys
import time

from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from hc_estimator import Estimator, create_estimator
from hc_estimator.ros.channel import (
    QosOverrideError,
    SubscriptionError,
    idle_overrides,
    is_replayed,
)
from hc_estimator.ros.clock_jumps import watch_jumps
from hc_estimator.ros.compilation import Compilation, all_filters, compile_all
from hc_estimator.ros.event_log import EventLog
from hc_estimator.ros.inputs import (
    Input,
    missing_publishers,
    publisher_conflict,
)
from hc_estimator.ros.lifecycle import answer_impossible_transitions
from hc_estimator.ros.namesakes import Namesakes
from hc_estimator.ros.node_settings import (
    NEEDS_OTHER_SUBSCRIPTIONS,
    READING,
)
from hc_estimator.ros.outputs import Outputs
from hc_estimator.ros.sample_flow import SampleFlow
from hc_estimator.ros.service_calls import ServiceCalls
from hc_estimator.ros.services import NotPossibleError
from hc_estimator.ros.settings import Change, Settings
from hc_estimator.ros.settings_meaning import counted_once, session_settings
from hc_estimator.ros.sources import INPUTS
from hc_estimator.ros.state_keeper import StateKeeper, parameters_of
from hc_estimator.ros.status import StatusReporter
from hc_estimator.ros.zero_setting import ZeroSetting
from hc_estimator.ros.zeroing import TAKEN_OFF
from hc_estimator.stream.handover import can_hand_over, hand_over
from hc_estimator.stream.session import EstimationSession
from hc_estimator.stream.state_file import SavedState
from hc_estimator.stream.suspicion_watch import SuspicionWatch
from hc_estimator.stream.vocabulary import Cause, EventKind
from hc_msgs_py.diagnostics import FEELS, DiagnosticsPublisher, Level, Status
from hc_msgs_py.late_destruction import LateDestruction
from hc_msgs_py.node_main import GivenWrongError, NodeStartError, run_node
from hc_msgs_py.services import add_ready_service
from hc_msgs_py.topics import NODE_ESTIMATOR

WATCH_PERIOD_S = 0.1
"""Between two looks at silence, at who listens and at the state to keep."""


class EstimatorNode(SampleFlow, ServiceCalls, LateDestruction, LifecycleNode):  # type: ignore[misc]  # rclpy has no types
    """Estimates contact parameters from a stream of samples.

    Publishers and services live as long as the node, through every change of its lifecycle;
    subscriptions come and go with the input and are destroyed late (hc_msgs_py.late_destruction).
    """

    def __init__(self) -> None:
        """Declare parameters and begin to compile; `_watch` activates unless told to wait.

        Raises:
            NodeStartError: for a parameter that does not exist.
            ValueError: for a parameter's value that is not allowed.
            OSError: if the folder for the state cannot be made.
        """
        super().__init__(NODE_ESTIMATOR)
        answer_impossible_transitions(self)
        self._settings = Settings(self)
        folder = self._settings.values["state.folder"]
        self._keeper = StateKeeper(folder, self._settings.changed_of_node)
        self._log = EventLog(self.get_logger())
        self._outputs = Outputs(self)
        self._outputs.form = self._settings.values["output.estimates"]
        self._revision = 0  # of the configuration, counted over all lives of the session
        self._session: EstimationSession | None = None
        self._status: StatusReporter | None = None
        self._input: Input | None = None
        self._failure: Exception | None = None
        self._wants_input = False
        self._cannot_listen = ""  # why there is no input although there should be one
        self._zeros = ZeroSetting(self, self._settings, lambda: self._session, lambda: self._input)
        self._suspicions = SuspicionWatch()
        self._crowded = self._silent = False
        self.add_pre_set_parameters_callback(self._settings.fill_defaults)
        self.add_on_set_parameters_callback(self._settings.check)
        self.add_post_set_parameters_callback(self._apply)
        add_ready_service(self, self._missing)
        self._add_services()
        # The machine's own steady clock: simulated time may stand still.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(WATCH_PERIOD_S, self._watch, clock=self._steady)
        self._diagnostics = DiagnosticsPublisher(
            self, "estimator", self._collect_status, in_parts=True
        )
        self._namesakes = Namesakes(self)
        self._watch_clock()
        self._starts_by_itself = bool(self._settings.values["autostart"])
        self._compilation = Compilation(self.get_logger(), "the filters", all_filters())

    # Lifecycle.

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Make the estimator, compile it and make the publishers."""
        if self._session is None:
            self._prepare()
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen to the samples."""
        session = self._configured()
        if not session.started:
            session.start()
        self._listen()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop listening; what is known stays."""
        self._stop_listening()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget everything."""
        self._stop_listening()
        self._keeper.forget_kept()
        self._session = self._status = None
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop for good."""
        self._stop_listening()
        self._keeper.forget_kept()
        return super().on_shutdown(state)

    def _start(self) -> None:
        """Configure and activate as soon as the filters are compiled."""
        if not self._compilation.look():
            return
        self._starts_by_itself = False
        self._prepare()  # here, where what goes wrong is told
        for trigger in (self.trigger_configure, self.trigger_activate):
            if trigger() != TransitionCallbackReturn.SUCCESS:
                raise NodeStartError("the node cannot be activated")

    def _prepare(self) -> None:
        self._compilation.wait()
        kept = self._keeper.resume(
            self._settings.values["state.maximum_age"],
            self._take_settings,
            self.get_logger().warning,
        )
        self._session = EstimationSession(
            self._new_estimator(),
            self,
            session_settings(self._settings.values),
            revisions_before=self._revision if kept is None else kept.revision,
        )
        self._status = StatusReporter(self._session)
        if kept is not None:
            self._session.load(kept.estimator, kept.time_origin_ns)
            self._keeper.wait_for_samples()

    def _take_settings(self, state: SavedState) -> None:
        """Take over the kind of estimator and the settings of a saved state.

        Raises:
            NotPossibleError: if the node cannot have these settings.
        """
        answer = self.set_parameters_atomically(parameters_of(state))
        if not answer.successful:
            raise NotPossibleError(f"the saved state does not fit: {answer.reason}")

    def _new_estimator(self) -> Estimator:
        kind = self._settings.kind
        return create_estimator(
            kind.filter,
            state_space=kind.state_space,
            contact_model=kind.contact_model,
            **self._settings.estimator_values(),
        )

    def _listen(self) -> None:
        """Make the input that the settings ask for; where that cannot be, `_watch` tries again."""
        self._wants_input = True
        values = self._settings.values
        try:
            self._input = INPUTS[values["input.source"]](self, self, values)
            self._cannot_listen = ""
            for line in idle_overrides(self, self._input.channels):
                self.get_logger().warning(line)
        except SubscriptionError as error:
            self._cannot_listen = str(error)
            if isinstance(error, QosOverrideError):
                self.on_failure(GivenWrongError(str(error)))

    def _stop_listening(self) -> None:
        self._wants_input = False
        self._zeros.give_up("the node is not active any more")
        if self._input is not None:
            self._input.close()
            self._input = None
        if self._session is not None:
            self._session.end()

    # What clients ask for.

    def _apply(self, parameters: list[Parameter]) -> None:
        """Post-set callback: apply checked parameters between two samples."""
        change = self._settings.take(parameters)
        self._outputs.form = self._settings.values["output.estimates"]
        if "input.maximum_gap" in change.node:
            self._jump_handle.unregister()
            self._watch_clock()
        if self._session is None:
            return
        self._session.apply_settings(session_settings(self._settings.values))
        if change.kind is not None:
            self._change_kind()
        elif change.estimator:
            self._session.reconfigure(change.estimator)
        self._apply_to_input(change)

    def _change_kind(self) -> None:
        session = self._configured()
        kind = self._settings.kind
        estimator = self._new_estimator()
        known = session.time_origin_ns is not None
        carry_over = self._settings.values["carry_over"]
        if known and carry_over and can_hand_over(session.estimator, estimator):
            estimator = hand_over(session.estimator, estimator)
            session.replace_estimator(
                estimator, f"{kind.filter} with {kind.state_space} states takes over"
            )
        else:
            session.reset(Cause.RESET, estimator)

    def _apply_to_input(self, change: Change) -> None:
        changed = sorted(name for name in change.node if name.startswith("input."))
        if not self._wants_input or not changed:
            return
        if self._input is not None and NEEDS_OTHER_SUBSCRIPTIONS.isdisjoint(changed):
            self._input.configure(self._settings.values)
        else:
            if self._input is not None:
                self._input.close()
                self._input = None
            self._listen()
        text = ", ".join(f"{name} = {self._settings.values[name]}" for name in changed)
        own = self._settings.values["input.source"] != "sample"
        ways = READING if own else {"input.source", *TAKEN_OFF}
        if not ways.isdisjoint(changed):
            self._zeros.give_up("a sensor is read otherwise from now on")
            self._zeros.forget()
            self._suspicions.forget()
            self._configured().reset(Cause.RESET, self._new_estimator(), text)
        elif change.kind is None and not change.estimator:
            self._configured().announce_reconfiguration(text)

    def _missing(self) -> list[str]:
        """Return who is not there yet, for ~/ready."""
        if self._input is None:
            return [self._inactive()]
        expected = self._settings.values["expected_sample_publishers"]
        missing = missing_publishers(self._input.channels, expected)
        expected = self._settings.values["expected_estimate_subscribers"]
        found = self._outputs.estimate_subscribers
        if found < expected:
            topic = self._outputs.estimate_topic
            missing.append(f"{topic} has {found} of {expected} subscribers")
        return missing + self._input.missing_listeners()

    # Watching.

    def _watch(self) -> None:
        self.destroy_retired()
        self._diagnostics.publish_overdue()
        if self._starts_by_itself:
            self._start()
        self._outputs.look_who_listens()
        if self._wants_input and self._input is None:
            self._listen()
        if self._session is None or self._input is None:
            return
        if self._session.check_silence(time.perf_counter_ns()) and not self._silent:
            self._silent = True
            self._diagnostics.publish()  # not up to a second later
        self._silent = self._session.watch.silent
        limit_n = self._session.estimator.configuration["force_limit"]
        self._suspicions.force_limit_n = float(limit_n)
        self._suspicions.counted_once = counted_once(self._settings.values)
        for suspicion in self._suspicions.look(time.monotonic()):
            self._session.report(EventKind.INPUT_SUSPECT, suspicion.sentence)
        if failure := self._suspicions.failure:
            self.get_logger().error(f"checks failed: {failure}", throttle_duration_sec=10.0)
        self._zeros.look()
        self._watch_publishers(self._session, self._input)
        period_s = self._settings.values["state.autosave_period"]
        try:
            self._keeper.keep(self._session, time.monotonic(), period_s)
        except OSError as error:
            self.get_logger().error(f"state cannot be kept: {error}", throttle_duration_sec=10.0)

    def _watch_publishers(self, session: EstimationSession, source: Input) -> None:
        """Tell of a second publisher on a topic once it is there."""
        conflict = publisher_conflict(source.channels)
        if conflict and not self._crowded:
            session.report(EventKind.SOURCE_CONFLICT, conflict)
        self._crowded = bool(conflict)

    def _watch_clock(self) -> None:
        maximum_gap_s = self._settings.values["input.maximum_gap"]
        self._jump_handle = watch_jumps(self, maximum_gap_s, self._on_clock_jump)

    def _on_clock_jump(self, reason: str) -> None:
        if self._session is not None and self._session.time_origin_ns is not None:
            self._session.time_jumped(reason)

    def _collect_status(self) -> Status:
        if self._starts_by_itself:
            return Status(Level.OK, self._inactive(), {})
        if self._status is None:
            return Status(Level.OK, "not configured", {})
        if self._input is None:
            if self._cannot_listen and self._wants_input:
                return Status(Level.ERROR, self._cannot_listen, {})
            return Status(Level.OK, "not active", {})
        self._replayed = is_replayed(self._input.channels)
        self._status.wrenches_left_out = self._outputs.wrenches_left_out
        status = self._status.collect(self._input, self._suspicions.suspicions)
        status = self._namesakes.added_to(status)
        if self._zeros.active:
            status = status._replace(values={**status.values, FEELS: self._zeros.feels})
        return status

    def finished(self) -> bool:
        """Whether the node wants to end by itself: never.

        Raises:
            Exception: what went wrong where the executor could not tell.
        """
        if self._failure is not None:
            raise self._failure
        return False

    def close(self) -> None:
        """Report the contact that still goes on and a last status."""
        self._diagnostics.publish()
        self._stop_listening()
        self._keeper.finish()

    def forget_kept(self) -> None:
        """Remove the state that is kept for a restart: the node ends as it should."""
        self._keeper.forget_kept()

    def keep_last(self) -> None:
        """Keep the state for a restart as it is now: the node ends, and nobody asked for that."""
        try:
            self._keeper.keep_last(self._session, self._settings.values["state.autosave_period"])
        except OSError as error:
            self.get_logger().error(f"state cannot be kept: {error}")


def prepare() -> None:
    """Load what a node of this process will need (hc_bringup.standby)."""
    compile_all()


def main() -> int:
    """Run the node; returns the exit status."""
    return run_node(
        EstimatorNode,
        at_clean_end=EstimatorNode.forget_kept,
        at_hang_up=EstimatorNode.keep_last,
    )


if __name__ == "__main__":
    sys.exit(main())
