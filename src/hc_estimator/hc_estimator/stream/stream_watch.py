"""What is worth an event in a stream of samples: silence, frozen readings, rejections, a misfit."""

from __future__ import annotations

import math
from collections.abc import Callable

from hc_estimator.estimate import Estimate, Rejection
from hc_estimator.stream.vocabulary import Counters, EventKind, SessionSettings

MISFIT = "the contact law does not describe what the sensors say"
SKIP_GATHERING_NS = 500_000_000
"""Skips within so long are one event: a node that cannot keep up skips with every message."""


class StreamWatch:
    """Looks at readings and estimates one by one, counts, and reports what has become so.

    Attributes:
        settings: how to judge the stream.
        silent: whether the input counted as silent when it was looked at last.
        silent_s: for how long a channel had no reading, when it was looked at last.
        silent_what: which one: displacement, force, or sample for both.
    """

    def __init__(self, counters: Counters, report: Callable[[EventKind, str], None]) -> None:
        """Begin with nothing seen.

        Args:
            counters: counted up here.
            report: told of an event.
        """
        self.settings = SessionSettings()
        self.silent = False
        self.silent_s = 0.0
        self.silent_what = "sample"
        self._counters = counters
        self._report = report
        self._displacement_ns: int | None = None  # when its last reading came
        self._force_ns: int | None = None
        self._burst = 0
        self._burst_reason = 0
        self._force = 0.0  # the last reading
        self._displacement = 0.0
        self._equal_forces = 0
        self._equal_displacements = 0
        self._mismatch = False
        self._skipped = 0  # not told yet
        self._first_skip_ns = self._last_skip_ns = 0

    @property
    def alarms(self) -> list[str]:
        """What is wrong with the input or the fit at this moment, a line each."""
        result = []
        if self._burst >= self.settings.rejection_burst:
            reason = Rejection(self._burst_reason).name.lower()
            result.append(f"{self._burst} samples rejected in a row ({reason})")
        if self._equal_forces >= self.settings.frozen_samples:
            result.append(f"force frozen at {self._force:.6g} N")
        if self._equal_displacements >= self.settings.frozen_samples:
            result.append(f"displacement frozen at {self._displacement:.6g} mm")
        if self._mismatch:
            result.append(MISFIT)
        return result

    def forget_fit(self) -> None:
        """The estimator begins anew: there is no misfit yet."""
        self._mismatch = False

    def check_silence(self, now_ns: int) -> bool:
        """Say whether the input is silent, and tell of skips; to be called some times a second.

        Args:
            now_ns: time.perf_counter_ns().

        Returns:
            True if a channel had no reading for longer than the timeout.
        """
        if now_ns - self._first_skip_ns >= SKIP_GATHERING_NS:
            self.tell_skipped()
        if self._displacement_ns is None or self._force_ns is None:
            return False
        limit_s = self.settings.silence_timeout_s
        displacement_s = (now_ns - self._displacement_ns) * 1e-9
        force_s = (now_ns - self._force_ns) * 1e-9
        self.silent_s = max(displacement_s, force_s)
        if min(displacement_s, force_s) > limit_s:
            self.silent_what = "sample"
        else:
            self.silent_what = "force" if force_s > displacement_s else "displacement"
        if not self.silent and self.silent_s > limit_s:
            self.silent = True
            text = f"no {self.silent_what} for {self.silent_s:.2f} s"
            self._report(EventKind.INPUT_SILENT, text)
        return self.silent

    def note_skipped(self, now_ns: int, number: int) -> None:
        """Count samples that the node left out; those of half a second are told together."""
        if self._skipped and now_ns - self._first_skip_ns >= SKIP_GATHERING_NS:
            self.tell_skipped()
        if not self._skipped:
            self._first_skip_ns = now_ns
        self._last_skip_ns = now_ns
        self._skipped += number
        self._counters.skipped += number

    def tell_skipped(self) -> None:
        """Report the skips that were gathered, if there are any."""
        number, self._skipped = self._skipped, 0
        if number:
            span_s = (self._last_skip_ns - self._first_skip_ns) * 1e-9
            within = f" within {span_s:.2f} s" if span_s >= 0.01 else ""
            text = f"{number} sample{'s' * (number > 1)} skipped{within}: too many were waiting"
            self._report(EventKind.SAMPLES_SKIPPED, text)

    def note_arrival(self, now_ns: int, displacement_mm: float, force_n: float) -> None:
        """Remember when each channel had a reading last; NaN is none."""
        without_displacement, without_force = math.isnan(displacement_mm), math.isnan(force_n)
        if without_displacement != without_force:
            self._counters.without_displacement += without_displacement
            self._counters.without_force += without_force
        if not without_displacement or self._displacement_ns is None:
            self._displacement_ns = now_ns
        if not without_force or self._force_ns is None:
            self._force_ns = now_ns

    def look(self, now_ns: int, displacement_mm: float, force_n: float, estimate: Estimate) -> None:
        """Look at a sample whose arrival was noted, and at what the estimator made of it."""
        if self.silent and not self._is_overdue(now_ns):
            self.silent = False
            self._report(EventKind.INPUT_RECOVERED, "samples come again")
        self._look_at_rejection(estimate)
        self._look_at_readings(displacement_mm, force_n)
        self._look_at_fit(estimate)

    def _is_overdue(self, now_ns: int) -> bool:
        assert self._displacement_ns is not None
        assert self._force_ns is not None
        oldest_ns = min(self._displacement_ns, self._force_ns)
        return (now_ns - oldest_ns) * 1e-9 > self.settings.silence_timeout_s

    def _look_at_rejection(self, estimate: Estimate) -> None:
        rejected, counters = estimate.rejected, self._counters
        if not rejected:
            self._burst = 0
            counters.accepted += 1
            displacement, force = estimate.innovation.tolist()  # NaN where none was used
            counters.readings += (displacement == displacement) + (force == force)
            counters.nis_sum += estimate.nis
            return
        counters.rejected[rejected] += 1
        self._burst += 1
        self._burst_reason = rejected
        if self._burst == self.settings.rejection_burst:
            kind = EventKind.REJECTION_BURST
            reason = f"{self._burst} samples rejected in a row ({rejected.name.lower()})"
            if rejected is Rejection.OUT_OF_RANGE:
                kind = EventKind.INPUT_SATURATED
                reason = f"readings out of range: {self._burst} samples rejected in a row"
            self._report(kind, reason)

    def _look_at_readings(self, displacement_mm: float, force_n: float) -> None:
        """Count equal readings of each channel, those that are missing left out."""
        limit = self.settings.frozen_samples
        # Zero is what a simulated force reads in free motion: not a frozen sensor.
        if not math.isnan(force_n):
            self._equal_forces = self._equal_forces + 1 if force_n == self._force != 0.0 else 0
            self._force = force_n
            if self._equal_forces == limit:
                self._report(EventKind.INPUT_FROZEN, f"force frozen at {force_n:.6g} N")
        if not math.isnan(displacement_mm):
            equal = displacement_mm == self._displacement != 0.0
            self._equal_displacements = self._equal_displacements + 1 if equal else 0
            self._displacement = displacement_mm
            if self._equal_displacements == limit:
                text = f"displacement frozen at {displacement_mm:.6g} mm"
                self._report(EventKind.INPUT_FROZEN, text)

    def _look_at_fit(self, estimate: Estimate) -> None:
        if estimate.change_detected:
            self._counters.changes += 1
            self._report(EventKind.TISSUE_CHANGE, "the tissue changed")
        mismatch = estimate.model_mismatch
        if mismatch and not self._mismatch:
            self._report(EventKind.MODEL_MISMATCH, MISFIT)
        self._mismatch = mismatch
