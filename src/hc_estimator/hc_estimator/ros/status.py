"""What the node says of itself on /diagnostics, once a second."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

from hc_estimator import PARAMETER_NAMES, Rejection
from hc_estimator.ros.channel import Channel
from hc_estimator.ros.inputs import Input, why_unmatched
from hc_estimator.stream.readings import NO_NUMBERS, SUSPECT, Suspicion
from hc_estimator.stream.session import EstimationSession
from hc_estimator.stream.vocabulary import STARTED_AFRESH
from hc_msgs_py.diagnostics import Level, Status
from hc_msgs_py.histogram import DurationHistogram
from hc_msgs_py.latency import is_latency

_QUANTILES = (("p50", 0.5), ("p99", 0.99))
FRUITLESS = 3
"""Statuses; a node that has just become active has messages before it has samples of them."""
WAITING_S = 5.0
"""So long nobody may have found whom the node waits for without a warning."""
SHARE_REFUSED = 0.05
SHARE_WAITING = 0.25
"""More than this share of the allowed backlog waits: the node falls behind, and says so."""
_REFUSED = {
    Rejection.NOT_FINITE: "a reading is no finite number, or a force comes before the first "
    "position (after a gap, too)",
    Rejection.TIME_REPEATED: "their stamp is that of the sample before",
    Rejection.TIME_BACKWARD: "their stamp lies before that of the sample before",
    Rejection.OUT_OF_RANGE: "a reading beyond force_limit or displacement_limit",
    Rejection.NUMERICAL: "the filter failed numerically",
}

_NOT_FINITE = {f"{name}_not_finite": f"{name}s that {NO_NUMBERS}" for name in ("force", "position")}
"""What an input counts of readings that nothing can be made of."""

_UNUSABLE = {
    **_NOT_FINITE,
    "attitude_unusable": "attitudes whose quaternion has no length: let the driver fill it",
    "joint_missing": "messages without the joint, or what is read of it (input.position.joint)",
    "frame_missing": "messages of frames that do not connect input.position.base_frame and "
    "child_frame",
    "surface_missing": "readings before the first pose of the surface (input.contact.topic)",
}
"""What an input counts of messages that it cannot use."""

_LATE = {
    "attitude_late": "forces without a pose of the tool at their stamp: raise "
    "input.pairing.maximum_wait, or give both publishers one clock",
    "surface_late": "readings without a pose of the surface at their stamp: raise "
    "input.pairing.maximum_wait, or give its publisher the clock of the tool's pose",
}
"""What an input counts of readings for which the nearest pose had to do."""


_CHANNELS = ("channel_delay", "contact_position", "force_zero")
"""What an estimate says of the channels, where its filter says it: [s], [mm] and [N]."""


class StatusReporter:
    """Makes the status from a session's counters.

    Attributes:
        foreign_stamps: samples that another clock stamped: none of them is in the latencies since
            the start.
        wrenches_left_out: of samples that waited together; the node writes it.
    """

    def __init__(self, session: EstimationSession) -> None:
        self.foreign_stamps = 0
        self._latency = DurationHistogram()  # of this computer's clock, since the last status
        self._foreign = DurationHistogram()  # of another one
        self.wrenches_left_out = 0
        self._session = session
        self._total_latency = DurationHistogram()
        self._total_computation = DurationHistogram()
        self._before: dict[str, float] = {}
        self._fruitless = 0  # statuses in a row with messages on all topics and no sample of them
        self._before_s = self._started_s = time.perf_counter()

    def add_latency(self, latency_ns: int) -> None:
        """Take in the time from a sample's stamp to the publication of its estimate [ns].

        A clock that was set, or a source that came back with another one, spoils what is said of
        the time since the last status, and nothing else.
        """
        if is_latency(latency_ns):
            self._latency.add(latency_ns)
        else:
            self._foreign.add(latency_ns)
            self.foreign_stamps += 1

    def collect(self, source: Input, suspicions: Sequence[Suspicion]) -> Status:
        """Return the status of the time since the last call.

        Args:
            source: the input of the session.
            suspicions: what is suspicious about its readings.
        """
        suspicions = [*suspicions, *source.doubts]
        session = self._session
        now_s = time.perf_counter()
        elapsed_s = now_s - self._before_s
        counts = self._counts(source)
        before = self._before  # of an input that gave way to another, which counts anew, some
        since = {n: c - before[n] if c >= before.get(n, math.inf) else c for n, c in counts.items()}
        self._before, self._before_s = counts, now_s
        come = bool(source.channels) and all(since[c.topic] for c in source.channels)
        self._fruitless = self._fruitless + 1 if come and not since["received"] else 0
        values: dict[str, Any] = {
            "rate_hz": since["received"] / elapsed_s if elapsed_s > 0.0 else 0.0,
            "samples": counts["received"],
            "estimates": counts["estimates"],
            "lost": counts["lost"],
            "skipped": counts["skipped"],
            "strays": counts["strays"],
            "restarts": session.counters.restarts,
            "time_jumps": counts["time_jumps"],
            "without_displacement": session.counters.without_displacement,
            "without_force": session.counters.without_force,
            "tissue_changes": session.counters.changes,
            "contacts": session.contacts.contacts,
            "silent_s": session.watch.silent_s if session.watch.silent else 0.0,
        }
        for reason in Rejection:
            if reason is not Rejection.ACCEPTED:
                name = f"rejected_{reason.name.lower()}"
                values[name] = session.counters.rejected[reason]
        values["foreign_stamps"] = self.foreign_stamps
        values |= _quantiles("latency", self._latency, self._total_latency, self._foreign)
        values |= _quantiles("computation", session.computation, self._total_computation)
        values |= self._health(since)
        values |= source.counters
        values["wrenches_left_out"] = self.wrenches_left_out
        for channel in source.channels:
            values[f"publishers of {channel.topic}"] = channel.publishers
            values[f"messages of other publishers on {channel.topic}"] = channel.lines.foreign
            values[f"messages lost on {channel.topic}"] = channel.lines.lost
            values[f"most messages waiting on {channel.topic}"] = channel.most_waiting
        for suspicion in suspicions:
            values[f"{SUSPECT}{suspicion.check.value} of {suspicion.channel}"] = suspicion.sentence
        level, message = self._judge(since, source, suspicions)
        for channel in source.channels:
            channel.most_waiting = 0
        return Status(level, message, values)

    def _counts(self, source: Input) -> dict[str, float]:
        session = self._session
        counters = session.counters
        return {
            "received": counters.received,
            "estimates": counters.estimates,
            "lost": session.guard.lost,
            "strays": session.guard.strays,
            "skipped": counters.skipped,
            "time_jumps": counters.time_jumps,
            "readings": counters.readings,
            "nis_sum": counters.nis_sum,
            "undecodable": source.undecodable,
            "zero_stamps": session.guard.faults.zero_stamps,
            "repeated_stamps": session.guard.faults.repeated_stamps,
            "stamp_jumps": session.guard.faults.stamp_jumps,
            **{channel.topic: channel.received for channel in source.channels},
            **{
                name: source.counters[name]
                for name in (*_UNUSABLE, *_LATE)
                if name in source.counters
            },
            **{reason.name: counters.rejected[reason] for reason in Rejection},
        }

    def _health(self, since: Mapping[str, float]) -> dict[str, Any]:
        session = self._session
        estimator, estimate = session.estimator, session.last_estimate
        values: dict[str, Any] = {
            "filter": estimator.filter,
            "state_space": estimator.state_space,
            "contact_model": estimator.contact_model,
            "configuration_revision": session.revision.number,
        }
        if since["readings"]:  # 2 in a consistent filter, also where samples hold one reading
            values["nis_mean"] = 2.0 * since["nis_sum"] / since["readings"]
        if estimate is not None:
            values["contact"] = estimate.contact
            values["model_mismatch"] = estimate.model_mismatch
            deviations = estimate.parameters_std
            for i, name in enumerate(PARAMETER_NAMES):
                values[name] = float(estimate.parameters[i])
                values[f"{name}_std"] = float(deviations[i])
            for name in _CHANNELS:
                for said in (name, f"{name}_std"):
                    value = getattr(estimate, said)
                    if math.isfinite(value):
                        values[said] = value
        return values

    def _judge(
        self, since: Mapping[str, float], source: Input, suspicions: Sequence[Suspicion]
    ) -> tuple[Level, str]:
        """Return the worst that there is to say, and all of it."""
        session = self._session
        level = Level.OK
        problems = []
        for channel in source.channels:
            if channel.crowded:
                both = channel.speaking > 1
                level = max(level, Level.ERROR if both else Level.WARN)
                problems.append(_crowd(channel, both))
        silent = session.check_silence(time.perf_counter_ns())
        if silent or session.counters.received == 0:
            jump_ns = session.guard.faults.largest_jump_ns
            reasons = _reasons(since, source, jump_ns, fruitless=self._fruitless >= FRUITLESS)
            if silent:
                unusable = any(since[channel.topic] for channel in source.channels)
                level = max(level, Level.ERROR if unusable else Level.STALE)
                start = f"no usable {session.watch.silent_what} for {session.watch.silent_s:.1f} s"
            else:
                start = "waits for the first sample"
                if self._waiting_s() > WAITING_S and reasons:
                    level = max(level, Level.WARN)
            problems.append(f"{start}: {'; '.join(reasons)}" if reasons else start)
            return level, "; ".join(problems)
        if since["time_jumps"]:
            problems.append(f"{session.last_jump}: {STARTED_AFRESH}")
        problems += session.watch.alarms
        problems += [suspicion.sentence for suspicion in suspicions]
        if not session.guard.counted:
            problems.append("the numbers of the samples are no count: losses cannot be told")
        problems += [*source.problems, *_refusals(since)]
        problems += [
            f"{since[name]:.0f} {what}"
            for name, what in _LATE.items()
            if since.get(name, 0) > SHARE_REFUSED * since["received"] and not source.problems
        ]
        problems += [
            f"{since[name]:.0f} {what}"
            for name, what in _NOT_FINITE.items()
            if since.get(name, 0) > max(SHARE_REFUSED * since["received"], 1.0)
        ]
        problems += [
            f"cannot keep up: {channel.most_waiting} messages waited on {channel.topic}"
            for channel in source.channels
            if channel.most_waiting > max(1.0, SHARE_WAITING * channel.maximum_backlog)
        ]
        for name in ("lost", "skipped", "strays"):
            if since[name]:
                problems.append(f"{since[name]:.0f} samples {name}")
        if problems:
            return max(level, Level.WARN), "; ".join(problems)
        return level, "estimating"

    def _waiting_s(self) -> float:
        return time.perf_counter() - self._started_s


def _crowd(channel: Channel, both: bool) -> str:
    """Say that a topic has several publishers, and what to do."""
    names = ", ".join(channel.publisher_names)
    if not both:
        return f"{channel.publishers} publishers on {channel.topic} ({names}), one of them speaks"
    return (
        f"{channel.publishers} publishers on {channel.topic} ({names}): follows the one that was "
        "first; stop the others, or give each run a domain of its own (ROS_DOMAIN_ID)"
    )


def _reasons(
    since: Mapping[str, float], source: Input, jump_ns: int, *, fruitless: bool
) -> list[str]:
    """Return why nothing can be used, a phrase for each cause that is seen.

    Args:
        since: counts since the last status.
        source: the input of the session.
        jump_ns: largest jump of the stamps [ns].
        fruitless: whether messages have been coming for a while, and make no sample.
    """
    reasons = []
    for channel in source.channels:
        names = channel.publisher_names
        if not since[channel.topic]:
            if why := why_unmatched(channel):
                reasons.append(why)
            elif not names:
                reasons.append(f"nobody publishes {channel.topic}")
            else:
                reasons.append(f"no message on {channel.topic} from {', '.join(names)}")
    if since["undecodable"]:
        reasons.append(f"{since['undecodable']:.0f} messages that cannot be decoded")
    reasons += [f"{since[name]:.0f} {what}" for name, what in _UNUSABLE.items() if since.get(name)]
    if since["zero_stamps"]:
        reasons.append(
            f"{since['zero_stamps']:.0f} samples with stamp zero: let the source fill header.stamp"
        )
    if since["repeated_stamps"]:
        reasons.append(f"{since['repeated_stamps']:.0f} samples with one and the same stamp")
    if since["stamp_jumps"]:
        reasons.append(
            f"{since['stamp_jumps']:.0f} samples whose stamps jump (by up to "
            f"{jump_ns * 1e-9:.3g} s): let the source stamp them when they are measured"
        )
    reasons += _refusals(since)
    if fruitless and not reasons:
        topics = " and ".join(channel.topic for channel in source.channels)
        reasons.append(
            f"messages come on {topics} and make no sample: their stamps stand still, or are not "
            "of one clock, or no seconds (hc topic echo TOPIC --field header.stamp)"
        )
    return reasons


def _refusals(since: Mapping[str, float]) -> list[str]:
    """Return a phrase for each reason for which many samples were refused."""
    received = since["received"]
    return [
        f"{since[reason.name]:.0f} of {received:.0f} samples refused: {_REFUSED[reason]}"
        for reason in Rejection
        if reason in _REFUSED and since[reason.name] > max(SHARE_REFUSED * received, 1.0)
    ]


def _quantiles(
    name: str,
    recent: DurationHistogram,
    total: DurationHistogram,
    passing: DurationHistogram | None = None,
) -> dict[str, float]:
    """Return the quantiles since the last status and since the start; recent ones start anew.

    Args:
        name: of what is counted.
        recent: since the last status.
        total: since the start; gets the recent ones.
        passing: recent ones that are not of the time since the start.
    """
    total.merge(recent)
    if passing is not None:
        recent.merge(passing)
        passing.clear()
    values = {}
    for histogram, suffix in ((recent, ""), (total, "_since_start")):
        if histogram.count:
            found = histogram.quantiles_ns([fraction for _, fraction in _QUANTILES])
            for (label, _), quantile_ns in zip(_QUANTILES, found, strict=True):
                values[f"{name}_{label}_us{suffix}"] = quantile_ns / 1000.0
            values[f"{name}_max_us{suffix}"] = histogram.maximum_ns / 1000.0
    recent.clear()
    return values
