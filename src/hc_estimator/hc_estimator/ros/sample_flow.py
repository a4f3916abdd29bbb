"""The way of a sample through the estimator node: from an input to the session, and what it made.

The node is an input's listener and the session's; here it is told, and hands on.
"""

from __future__ import annotations

import math

from hc_estimator import Estimate, EstimateSeries
from hc_estimator.ros.event_log import EventLog
from hc_estimator.ros.inputs import Input
from hc_estimator.ros.node_settings import OWN_SENSORS
from hc_estimator.ros.outputs import EACH, Outputs
from hc_estimator.ros.settings import Settings
from hc_estimator.ros.state_keeper import StateKeeper
from hc_estimator.ros.status import StatusReporter
from hc_estimator.ros.zero_setting import ZeroSetting
from hc_estimator.ros.zeroing import TAKEN_OFF, TAKEN_OFF_ALWAYS
from hc_estimator.stream import dry_friction, frame_compliance, repeats, tool_motion
from hc_estimator.stream.contacts import ContactSummary
from hc_estimator.stream.session import EstimationSession
from hc_estimator.stream.suspicion_watch import SuspicionWatch
from hc_estimator.stream.vocabulary import (
    CONTACT_FRAME,
    Batch,
    Cause,
    Event,
    Revision,
    recorded_less,
)
from hc_msgs_py.diagnostics import DiagnosticsPublisher

FEWEST_TOGETHER = 12
"""Fewer samples are cheaper one by one (28 us each) than by calls for whole arrays: 2 together took
68 us each, 6 took 35, 12 took 27."""
NEVER_TOGETHER = 2**31
"""More samples than ever wait."""


class SampleFlow:
    """The part of the node that samples and estimates pass; the rest of it makes what they need."""

    _session: EstimationSession | None
    _status: StatusReporter | None
    _input: Input | None
    _failure: Exception | None
    _revision: int
    _settings: Settings
    _keeper: StateKeeper
    _log: EventLog
    _outputs: Outputs
    _suspicions: SuspicionWatch
    _zeros: ZeroSetting
    _diagnostics: DiagnosticsPublisher
    _replayed = False  # what the input hears comes out of a recording

    def _configured(self) -> EstimationSession:
        assert self._session is not None
        return self._session

    # What the input says.

    def on_sample(
        self, stamp_ns: int, sequence: int, displacement_mm: float, force_n: float
    ) -> None:
        """Hand a sample to the session, and to a tare that is under way."""
        if self._keeper.on_trial:
            self._keeper.on_sample()
        session = self._configured()
        session.process(stamp_ns, sequence, displacement_mm, force_n)
        contact = session.contacts.current
        if contact is not None and math.isnan(contact.position_m[0]):
            self._say_where(contact)
        # The zeros that it gives hold from the next sample on, and so does the estimator's reset.
        self._suspicions.add(stamp_ns, displacement_mm, force_n)
        self._zeros.add(stamp_ns, displacement_mm, force_n)
        self._use_pause()

    def _say_where(self, contact: ContactSummary) -> None:
        """Write where the tool is into a contact that has just begun, if that is known."""
        position = self._input.position if self._input is not None else None
        if position is not None:
            contact.position_m, contact.position_frame_id = position

    def on_samples(self, batch: Batch) -> None:
        """Hand samples that wait together to the session."""
        self._configured().process_many(batch)
        columns = (column.tolist() for column in batch)
        for stamp_ns, _sequence, displacement_mm, force_n in zip(*columns, strict=True):
            self._suspicions.add(stamp_ns, displacement_mm, force_n)
            self._zeros.add(stamp_ns, displacement_mm, force_n)
        self._use_pause()

    def _use_pause(self) -> None:
        """Do a part of what is due now and then: the next sample is a period away, if none waits.

        Done when its time comes, a status (0.6 ms) would meet a sample on its way half of the time.
        """
        if not (self._suspicions.looking or self._diagnostics.due):
            return
        if self._input is None or any(channel.waits for channel in self._input.channels):
            return
        if self._diagnostics.due:
            self._diagnostics.go_on()
        else:
            self._suspicions.go_on()

    def fewest_together(self) -> int:
        """Return how many samples are better taken as a batch; what goes out so comes so.

        They come one by one where the next may be read otherwise than the one before: while zeros
        are looked for, and after a restart until it is seen that the samples go on.
        """
        if self._zeros.active or self._keeper.on_trial:
            return NEVER_TOGETHER
        return FEWEST_TOGETHER if self._outputs.form == EACH else 2

    def on_skip(self, number: int) -> None:
        """Count samples that were left out."""
        self._configured().skip(number)

    def on_frame(self, frame_id: str) -> None:
        """Name the frame in what is published."""
        self._outputs.set_frame(frame_id)

    def on_failure(self, error: Exception) -> None:
        """Let the node fail where `run_node` sees it."""
        self._failure = error

    # What the session says.

    def on_estimate(
        self, stamp_ns: int, sequence: int, force_n: float, estimate: Estimate, computation_ns: int
    ) -> None:
        """Publish an estimate."""
        latency_ns = self._outputs.publish_estimate(
            stamp_ns, sequence, force_n, estimate, computation_ns, self._revision
        )
        self._add_latency(latency_ns)

    def on_estimates(self, batch: Batch, series: EstimateSeries, computation_ns: int) -> None:
        """Publish the estimates of samples that waited together."""
        for latency_ns in self._outputs.publish_estimates(
            batch, series, computation_ns, self._revision
        ):
            self._add_latency(latency_ns)

    def _add_latency(self, latency_ns: int) -> None:
        assert self._status is not None
        self._status.add_latency(latency_ns)
        # Samples may come out of a bag; sensors of a robot speak now, unless a player does.
        live = not self._replayed and self._settings.values["input.source"] in OWN_SENSORS
        self._suspicions.add_latency(latency_ns, live=live)

    def on_event(self, event: Event) -> None:
        """Publish an event and write it to the log."""
        self._outputs.publish_event(event, self._revision)
        self._log.write(event)

    def on_contact(self, summary: ContactSummary) -> None:
        """Publish the summary of a contact."""
        self._outputs.publish_contact(summary, self._revision)

    def on_revision(self, revision: Revision) -> None:
        """Publish the configuration in force."""
        self._revision = revision.number
        values = self._settings.values
        # Samples made of one's own sensors are published with their zeros already taken off.
        own = values["input.source"] in OWN_SENSORS
        friction_n = values.get(dry_friction.DRY_FRICTION.name, 0.0)
        names = TAKEN_OFF if friction_n else TAKEN_OFF_ALWAYS
        zeros = {name: values[name] for name in names}
        if own:  # what is taken off twice does not show, as a zero would
            zeros = {frame_compliance.TAKEN_OFF_ALREADY: values[frame_compliance.SETTING.name]}
            if values["input.source"] == "sensors":
                zeros |= {dry_friction.TAKEN_OFF_ALREADY: friction_n} if friction_n else {}
                motion = [setting.name for setting in tool_motion.SETTINGS]
                zeros |= {recorded_less(name): values[name] for name in motion if values.get(name)}
                zeros |= {name: True for name in repeats.SETTINGS.values() if values.get(name)}
                if values.get("input.position.type", "joint") != "joint":  # which has no attitude
                    zeros[CONTACT_FRAME] = values[CONTACT_FRAME]
        session = self._configured()
        loaded = session.loaded if revision.cause is Cause.STATE_LOADED else None
        self._outputs.publish_configuration(revision, session.estimator, zeros, loaded)
        self._keeper.hasten()
