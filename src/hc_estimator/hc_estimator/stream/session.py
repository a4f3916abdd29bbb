"""One estimator under a stream of samples that never ends: revisions, faults, events, counters.

The session is what the node would be without ROS: samples go in, and a listener hears of
estimates, events, contacts and new revisions of the configuration. Nothing here raises on data.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from hc_estimator.estimate import Estimate
from hc_estimator.estimator import Estimator
from hc_estimator.stream.contacts import ContactSummary, ContactTracker
from hc_estimator.stream.stream_guard import Break, StreamGuard, StreamSample
from hc_estimator.stream.stream_watch import StreamWatch
from hc_estimator.stream.vocabulary import (
    Batch,
    Cause,
    Counters,
    Event,
    EventKind,
    Listener,
    Revision,
    SessionSettings,
)
from hc_msgs_py.histogram import DurationHistogram


class EstimationSession:
    """Feeds an estimator and tells a listener what comes of it.

    Attributes:
        estimator: the estimator in use; replace it with `replace_estimator`.
        counters: what was counted.
        guard: counts lost and stray samples.
        contacts: the contact that goes on and the number of contacts.
        computation: wall times of the estimation steps since `computation.clear()`.
        revision: the revision in force.
        loaded: the state that was gone on from last; None if there was none.
        watch: what is wrong with the input or the fit.
        started: whether a first revision was announced.
        last_estimate: the newest estimate; None before the first.
        last_jump: what jumped last, of the stamps or the clock, and how far; empty before.
    """

    def __init__(
        self,
        estimator: Estimator,
        listener: Listener,
        settings: SessionSettings | None = None,
        *,
        revisions_before: int = 0,
    ) -> None:
        """Make a session that has not begun.

        Args:
            estimator: to be fed.
            listener: hears what comes of it.
            settings: how to judge the stream.
            revisions_before: revisions of the sessions before this one, to count on from.
        """
        self.estimator = estimator
        self.counters = Counters()
        self.guard = StreamGuard(maximum_gap_ns=1)
        self.contacts = ContactTracker()
        self.computation = DurationHistogram()
        self.revision = Revision(revisions_before, 0, 0, Cause.STARTED)
        self.started = False
        self.loaded: Mapping[str, Any] | None = None
        self.last_estimate: Estimate | None = None
        self.last_jump = ""
        self._listener = listener
        self._at: tuple[int, int] | None = None  # the sample of a batch that is spoken of now
        self._origin_ns: int | None = None
        self._last_time_ns: int | None = None
        self.watch = StreamWatch(self.counters, self.report)
        self.settings = settings or SessionSettings()
        self.apply_settings(self.settings)

    def apply_settings(self, settings: SessionSettings) -> None:
        """Judge the stream by other settings from the next sample on."""
        self.settings = self.watch.settings = settings
        self.guard.maximum_gap_ns = round(settings.maximum_gap_s * 1e9)
        self.contacts.minimum_duration_ns = round(settings.contact_minimum_s * 1e9)
        self.contacts.release_ns = round(settings.contact_release_s * 1e9)

    # What a user or the node asks for, between two samples.

    def start(self) -> None:
        """Announce the first revision."""
        self._revise(Cause.STARTED, None)

    def reset(
        self, cause: Cause = Cause.RESET, estimator: Estimator | None = None, reason: str = ""
    ) -> None:
        """Start afresh with the same parameters, or with a fresh estimator; time starts anew.

        Args:
            cause: why, for the revision.
            estimator: replaces the present one, whose samples are forgotten otherwise.
            reason: why, for the event.
        """
        self._finish_contact()
        if estimator is None:
            self.estimator.reset()
        else:
            self.estimator = estimator
        self._origin_ns = None
        self.watch.forget_fit()
        self.last_estimate = None
        self._revise(cause, None)
        if cause is Cause.RESET:
            why = f": {reason}" if reason else ""
            self.report(EventKind.RESET, f"the estimator was started afresh{why}")

    def reconfigure(self, parameters: Mapping[str, Any]) -> None:
        """Change parameters of the estimator from the next sample on.

        Raises:
            ValueError: see Estimator.reconfigure; nothing has changed then.
        """
        self.estimator.reconfigure(**parameters)
        self.announce_reconfiguration(", ".join(f"{k} = {v}" for k, v in parameters.items()))

    def replace_estimator(self, estimator: Estimator, reason: str) -> None:
        """Go on with another estimator that has taken over what this one knew."""
        self.estimator = estimator
        self.announce_reconfiguration(reason)

    def announce_reconfiguration(self, what: str) -> None:
        """Make a new revision for a changed setting that the estimator itself does not hold."""
        self._revise(Cause.RECONFIGURED, self._origin_ns)
        self.report(EventKind.RECONFIGURED, what)

    def load(self, state: Mapping[str, Any], time_origin_ns: int) -> None:
        """Go on from a saved state of an estimator of the same kind.

        Args:
            state: what `save` returned.
            time_origin_ns: its time origin, so that the gap since then is seen as one.

        Raises:
            ValueError: see Estimator.restore; nothing has changed then.
        """
        self.estimator.restore(state)
        self._finish_contact()
        self._origin_ns = time_origin_ns
        self.loaded = state
        self._revise(Cause.STATE_LOADED, time_origin_ns)
        self.report(EventKind.STATE_LOADED, "a saved state was loaded")

    @property
    def time_origin_ns(self) -> int | None:
        """Stamp that is second 0 of the estimator's time; None before the first sample."""
        return self._origin_ns

    def time_jumped(self, reason: str) -> None:
        """The clock jumped: start afresh, and take the next stamp as it comes."""
        self.guard.forget()
        self._jump(reason)

    def skip(self, number: int) -> None:
        """Count samples that the node left out because it could not keep up."""
        self.guard.expect_gap(number)
        self.watch.note_skipped(time.perf_counter_ns(), number)

    def report(self, kind: EventKind, reason: str) -> None:
        """Tell the listener of an event at the last sample."""
        guard = self.guard
        stamp_ns, sequence = self._at or (guard.last_stamp_ns or 0, guard.last_sequence)
        self._listener.on_event(Event(kind, stamp_ns, sequence, reason))

    def end(self) -> None:
        """The stream is over: report what was gathered, and the contact that still goes on."""
        self.watch.tell_skipped()
        self._finish_contact()

    # The stream.

    def process(self, stamp_ns: int, sequence: int, displacement_mm: float, force_n: float) -> None:
        """Take in one sample.

        Args:
            stamp_ns: stamp [ns].
            sequence: number of the sample; 0 throughout if the source does not count.
            displacement_mm: penetration [mm], positive into the tissue; NaN if there is no reading
                at this stamp.
            force_n: contact force [N], compression positive; NaN as above.
        """
        self.counters.received += 1
        if self.guard.is_next(stamp_ns, sequence):
            self._use(stamp_ns, sequence, displacement_mm, force_n)
        else:
            self._out_of_place(StreamSample(stamp_ns, sequence, displacement_mm, force_n))

    def process_many(self, batch: Batch) -> None:
        """Take in samples that wait together: the numbers and events of `process` one by one.

        Those that follow one another go through the estimator in one compiled call. What comes of
        them is told after that: first all estimates, then the events in the order of the samples.
        """
        guard = self.guard
        begin = 0
        stamps, sequences = batch.stamps_ns.tolist(), batch.sequences.tolist()
        self.counters.received += len(stamps)
        for i, (stamp_ns, sequence) in enumerate(zip(stamps, sequences, strict=True)):
            if guard.is_next(stamp_ns, sequence):
                continue
            self._use_many(batch.part(begin, i))
            one = (float(batch.displacements_mm[i]), float(batch.forces_n[i]))
            self._out_of_place(StreamSample(stamp_ns, sequence, *one))
            begin = i + 1
        self._use_many(batch.part(begin, len(stamps)))

    def check_silence(self, now_ns: int) -> bool:
        """Say whether the input is silent, and tell of skips; see `StreamWatch.check_silence`."""
        return self.watch.check_silence(now_ns)

    def _out_of_place(self, sample: StreamSample) -> None:
        samples, broken = self.guard.push(sample)
        if broken is Break.TIME_JUMP:
            before = self._last_time_ns or 0
            self._jump(f"stamps jumped by {(samples[0].stamp_ns - before) * 1e-9:+.3f} s")
        elif broken is Break.RESTARTED:
            self.counters.restarts += 1
            self.report(
                EventKind.SOURCE_RESTARTED, f"the source numbers anew from {samples[0].sequence}"
            )
        for one in samples:
            self._use(*one)

    def _use(self, stamp_ns: int, sequence: int, displacement_mm: float, force_n: float) -> None:
        origin = self._origin_ns
        if origin is None:
            origin = self._begin(stamp_ns, sequence)
        before = time.perf_counter_ns()
        estimate = self.estimator.step((stamp_ns - origin) * 1e-9, displacement_mm, force_n)
        after = time.perf_counter_ns()
        self.watch.note_arrival(after, displacement_mm, force_n)
        self._last_time_ns = stamp_ns
        computation_ns = after - before
        self.computation.add(computation_ns)
        self.counters.estimates += 1
        self.last_estimate = estimate
        # First of all the estimate goes out; what follows may take its time.
        self._listener.on_estimate(stamp_ns, sequence, force_n, estimate, computation_ns)
        self._watch(after, stamp_ns, sequence, displacement_mm, force_n, estimate)

    def _use_many(self, batch: Batch) -> None:
        """As `_use` for each of them; events carry stamp and number of their sample."""
        count = len(batch.stamps_ns)
        rows = list(zip(*(column.tolist() for column in batch), strict=True))
        if count <= 1:
            for row in rows:
                self._use(*row)
            return
        origin = self._origin_ns
        if origin is None:
            origin = self._begin(*rows[0][:2])
        before = time.perf_counter_ns()
        times = (batch.stamps_ns - np.int64(origin)) * 1e-9
        series = self.estimator.run(times, batch.displacements_mm, batch.forces_n)
        after = time.perf_counter_ns()
        self._last_time_ns = rows[-1][0]
        self.counters.estimates += count
        each_ns = (after - before) // count
        self._listener.on_estimates(batch, series, each_ns)
        for i, (stamp_ns, sequence, displacement_mm, force_n) in enumerate(rows):
            estimate = self.last_estimate = series[i]
            self._at = (stamp_ns, sequence)
            self.watch.note_arrival(after, displacement_mm, force_n)
            self.computation.add(each_ns)
            self._watch(after, stamp_ns, sequence, displacement_mm, force_n, estimate)
        self._at = None

    def _begin(self, stamp_ns: int, sequence: int) -> int:
        """Count time from this sample on; returns its stamp."""
        self._origin_ns = stamp_ns
        self.revision = self.revision._replace(
            valid_from_sequence=sequence, time_origin_ns=stamp_ns
        )
        self._listener.on_revision(self.revision)
        return stamp_ns

    def _watch(
        self,
        now_ns: int,
        stamp_ns: int,
        sequence: int,
        displacement_mm: float,
        force_n: float,
        estimate: Estimate,
    ) -> None:
        """Look for what is worth an event, and for contacts."""
        self.watch.look(now_ns, displacement_mm, force_n, estimate)
        made, over = self.contacts.update(stamp_ns, sequence, displacement_mm, force_n, estimate)
        if made is not None:
            self.report(EventKind.CONTACT_MADE, f"contact {made.number}")
        if over is not None:
            self._tell_contact(over)

    def _jump(self, reason: str) -> None:
        self.counters.time_jumps += 1
        self.last_jump = reason
        self.reset(Cause.TIME_JUMP)
        self.report(EventKind.TIME_JUMP, reason)

    def _finish_contact(self) -> None:
        summary = self.contacts.finish()
        if summary is not None:
            self._tell_contact(summary)

    def _tell_contact(self, summary: ContactSummary) -> None:
        self.report(
            EventKind.CONTACT_LOST, f"contact {summary.number} after {summary.duration_s:.3f} s"
        )
        self._listener.on_contact(summary)

    def _revise(self, cause: Cause, time_origin_ns: int | None) -> None:
        number = self.revision.number + 1
        first = self.guard.last_stamp_ns is None
        valid_from = 0 if first else self.guard.last_sequence + 1
        self.revision = Revision(number, valid_from, time_origin_ns or 0, cause)
        self.started = True
        self._listener.on_revision(self.revision)
