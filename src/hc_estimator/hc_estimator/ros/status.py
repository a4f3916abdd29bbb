"""What the node says of itself on /diagnostics, once a second."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from hc_estimator import PARAMETER_NAMES, Rejection
from hc_estimator.online.histogram import DurationHistogram
from hc_estimator.online.session import EstimationSession
from hc_msgs_py.diagnostics import Level, Status

_QUANTILES = (("p50", 0.5), ("p99", 0.99))


class StatusReporter:
    """Makes the status from a session's counters.

    Attributes:
        latency: stamp to publication, since the last status; the node adds to it.
    """

    def __init__(self, session: EstimationSession) -> None:
        self.latency = DurationHistogram()
        self._session = session
        self._total_latency = DurationHistogram()
        self._total_computation = DurationHistogram()
        self._before = self._counts()
        self._before_s = time.perf_counter()

    def collect(self, publishers: Mapping[str, int], counters: Mapping[str, int]) -> Status:
        """Return the status of the time since the last call.

        Args:
            publishers: matched publishers by input topic.
            counters: what the input itself counted.
        """
        session = self._session
        now_s = time.perf_counter()
        elapsed_s = now_s - self._before_s
        counts = self._counts()
        since = {name: counts[name] - self._before[name] for name in counts}
        self._before, self._before_s = counts, now_s
        values: dict[str, Any] = {
            "rate_hz": since["received"] / elapsed_s if elapsed_s > 0.0 else 0.0,
            "samples": counts["received"],
            "estimates": counts["estimates"],
            "lost": counts["lost"],
            "skipped": counts["skipped"],
            "strays": counts["strays"],
            "restarts": session.counters.restarts,
            "time_jumps": session.counters.time_jumps,
            "tissue_changes": session.counters.changes,
            "contacts": session.contacts.contacts,
        }
        for reason in Rejection:
            if reason is not Rejection.ACCEPTED:
                name = f"rejected_{reason.name.lower()}"
                values[name] = session.counters.rejected[reason]
        values |= _quantiles("latency", self.latency, self._total_latency)
        values |= _quantiles("computation", session.computation, self._total_computation)
        values |= self._health(since)
        values |= counters
        for topic, number in publishers.items():
            values[f"publishers of {topic}"] = number
        level, message = self._judge(since, publishers)
        return Status(level, message, values)

    def _counts(self) -> dict[str, float]:
        session = self._session
        counters = session.counters
        return {
            "received": counters.received,
            "estimates": counters.estimates,
            "lost": session.guard.lost,
            "strays": session.guard.strays,
            "skipped": counters.skipped,
            "accepted": counters.accepted,
            "nis_sum": counters.nis_sum,
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
        if since["accepted"]:
            values["nis_mean"] = since["nis_sum"] / since["accepted"]
        if estimate is not None:
            values["contact"] = estimate.contact
            values["model_mismatch"] = estimate.model_mismatch
            deviations = estimate.parameters_std
            for i, name in enumerate(PARAMETER_NAMES):
                values[name] = float(estimate.parameters[i])
                values[f"{name}_std"] = float(deviations[i])
        return values

    def _judge(
        self, since: Mapping[str, float], publishers: Mapping[str, int]
    ) -> tuple[Level, str]:
        session = self._session
        crowded = [topic for topic, number in publishers.items() if number > 1]
        if crowded:
            number = publishers[crowded[0]]
            return Level.ERROR, f"{number} publishers on {crowded[0]}: stop all but one"
        if session.check_silence(time.perf_counter_ns()):
            return Level.STALE, "no samples: is the source running?"
        if session.counters.received == 0:
            return Level.OK, "waits for the first sample"
        problems = session.alarms
        for name in ("lost", "skipped", "strays"):
            if since[name]:
                problems.append(f"{since[name]:.0f} samples {name}")
        if problems:
            return Level.WARN, "; ".join(problems)
        return Level.OK, "estimating"


def _quantiles(name: str, recent: DurationHistogram, total: DurationHistogram) -> dict[str, float]:
    """Return the quantiles since the last status and since the start; recent ones start anew."""
    total.merge(recent)
    values = {}
    for histogram, suffix in ((recent, ""), (total, "_since_start")):
        if histogram.count:
            for label, fraction in _QUANTILES:
                values[f"{name}_{label}_us{suffix}"] = histogram.quantile_ns(fraction) / 1000.0
            values[f"{name}_max_us{suffix}"] = histogram.maximum_ns / 1000.0
    recent.clear()
    return values
