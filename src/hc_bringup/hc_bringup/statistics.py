"""Running statistics of a stream of estimates, in constant memory however long the run is."""

from __future__ import annotations

import functools
import math
from collections import Counter, deque, namedtuple
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from numpy.typing import NDArray

from hc_bringup.explanation import RecentMotion
from hc_bringup.force_error import SETTLING_S, one_step_error
from hc_bringup.zero_effect import DeepestTouch
from hc_bringup.zero_words import Zeros
from hc_msgs_py.histogram import DurationHistogram
from hc_msgs_py.latency import AHEAD_S, NO_LATENCY_S
from hc_msgs_py.units import METRE_IN_MM

REJECTION_NAMES: Final = {
    1: "not_finite",
    2: "time_repeated",
    3: "time_backward",
    4: "outlier",
    5: "out_of_range",
    6: "numerical",
}
"""Names of the codes of HuntCrossleyEstimate.rejected."""

PARAMETERS: Final = ("stiffness", "damping", "displacement_exponent", "velocity_exponent")

_STAMP_FIELDS: Final = {"header.stamp.sec": "stamp_sec", "header.stamp.nanosec": "stamp_nanosec"}
_RECENT = 1000
LONGEST_COUNTED_GAP = 1_000_000
"""A jump of the sequence beyond this is no loss: somebody counts otherwise, or not at all."""
_MOST_JUMPS = 0.01
"""Share of the estimates; where more of them jump, the sequence is no counter."""

_SAMPLES_KEPT = 1000
"""Two estimators tell of one sample within so many."""


class _Stamp(NamedTuple):
    sec: int
    nanosec: int


class _Header(NamedTuple):
    stamp: _Stamp


@functools.cache
def _row_type(names: tuple[str, ...]) -> Any:
    row = namedtuple("EstimateRow", [_STAMP_FIELDS.get(name, name) for name in names])  # type: ignore[misc]
    header = property(lambda self: _Header(_Stamp(self.stamp_sec, self.stamp_nanosec)))
    setattr(row, "header", header)  # noqa: B010 - mypy knows the fields of the tuple alone
    return row


def estimate_rows(table: NDArray[Any]) -> Iterator[Any]:
    """Yield the estimates of a table, to be read as hc_msgs/HuntCrossleyEstimate is.

    Args:
        table: records of such messages without frame_id (hc_bringup.dashboard.parsing).
    """
    make = _row_type(table.dtype.names or ())._make
    return map(make, table.tolist())


@dataclass
class EstimateStatistics:
    """What a run's summary and live panel say of the estimates that arrived.

    Attributes:
        estimates: how many arrived.
        lost: samples whose sequence number was skipped.
        restarts: how often the sequence numbers started again (a replay that loops), or jumped.
        since_restart: how many estimates arrived since then.
        doubled: how many were of a sample of which another one had just come.
        latency: seconds from a sample's stamp to the publication of its estimate, of samples that
            are stamped by this computer's clock.
        foreign_stamps: samples stamped by another clock: further ahead than clocks differ that are
            set by one another, or so old that they cannot have been on their way.
        changes: how often a change of the tissue was detected.
        mismatch: in how many estimates the contact law did not describe the data.
        rejected: samples not used, by reason.
        latest: the last message (hc_msgs/HuntCrossleyEstimate), or None.
        motion: the last seconds of depth and force, to explain a misfit by.
        touch: how deep the tool has been, for what zeros that are off would do.
    """

    estimates: int = 0
    lost: int = 0
    restarts: int = 0
    since_restart: int = 0
    doubled: int = 0
    latency: DurationHistogram = field(default_factory=DurationHistogram)
    foreign_stamps: int = 0
    changes: int = 0
    mismatch: int = 0
    rejected: Counter[str] = field(default_factory=Counter)
    latest: Any = None
    motion: RecentMotion = field(default_factory=RecentMotion)
    touch: DeepestTouch = field(default_factory=DeepestTouch)
    first_sequence: int | None = None
    force_n: float = math.nan
    _latest_touch: Any = None  # the last estimate in contact
    _first_contact_s: float = math.nan
    _last_sequence: int = -1
    _last_samples: dict[tuple[int, float], None] = field(default_factory=dict)
    _force_error_square_sum: float = 0.0
    _aligned_square_sum: float = 0.0
    _aligned_errors: int = 0
    _force_errors: int = 0
    _recent_square_errors: deque[float] = field(default_factory=lambda: deque(maxlen=_RECENT))

    def add(self, message: Any) -> None:
        """Take one HuntCrossleyEstimate into account."""
        sequence = message.sequence
        stamp = message.header.stamp
        stamp_s = stamp.sec + 1e-9 * stamp.nanosec
        if self.first_sequence is None:
            self.first_sequence = sequence
        else:
            missing = sequence - self._last_sequence - 1
            if 0 <= missing <= LONGEST_COUNTED_GAP:
                self.lost += missing
            else:
                self.restarts += 1
                self.since_restart = 0
        self._last_sequence = sequence
        self._note_sample((sequence, stamp_s))
        self.estimates += 1
        self.since_restart += 1
        self.latest = message
        if not math.isnan(message.force_measured):
            self.force_n = message.force_measured
        if -AHEAD_S <= message.latency < NO_LATENCY_S:
            self.latency.add_s(message.latency)
        else:
            self.foreign_stamps += 1
        if message.rejected:
            self.rejected[REJECTION_NAMES.get(message.rejected, str(message.rejected))] += 1
            return
        depth_mm, revision = message.displacement * METRE_IN_MM, message.configuration_revision
        self.motion.add(stamp_s, depth_mm, message.force_measured, revision)
        self.changes += message.change_detected
        self.mismatch += message.model_mismatch
        if message.contact:
            self._latest_touch = message
            self.touch.add(depth_mm, revision)
            if math.isnan(self._first_contact_s):
                self._first_contact_s = stamp_s
            error = one_step_error(message.force_measured, message.force_predicted)
            square = error * error  # ** raises where this is infinite
            if math.isnan(square):
                return  # a sample without a force
            if stamp_s - self._first_contact_s >= SETTLING_S:
                self._force_error_square_sum += square
                self._force_errors += 1
                if not math.isnan(message.innovation_force):
                    self._aligned_square_sum += message.innovation_force * message.innovation_force
                    self._aligned_errors += 1
            self._recent_square_errors.append(square)

    def _note_sample(self, sample: tuple[int, float]) -> None:
        """Count an estimate of a sample that one of the last estimates was of."""
        last = self._last_samples
        if sample in last:
            self.doubled += 1
        else:
            last[sample] = None
            if len(last) > _SAMPLES_KEPT:
                del last[next(iter(last))]

    @property
    def mixed(self) -> bool:
        """Whether estimates of several estimators came, one among the other."""
        return not self.counts and self.doubled > _MOST_JUMPS * self.estimates

    @property
    def counts(self) -> bool:
        """Whether the sequence numbers count, so that `lost` means something."""
        return self.restarts <= 1 + _MOST_JUMPS * self.estimates

    @property
    def force_rmse_n(self) -> float:
        """RMS of the one-step-ahead force error in contact, after its first second [N]."""
        if not self._force_errors:
            return math.nan
        return math.sqrt(self._force_error_square_sum / self._force_errors)

    @property
    def force_aligned_rmse_n(self) -> float:
        """RMS of the innovation of the force over the same samples [N]; see `force_error`."""
        if not self._aligned_errors:
            return math.nan
        return math.sqrt(self._aligned_square_sum / self._aligned_errors)

    @property
    def recent_force_rmse_n(self) -> float:
        """The same over the last thousand samples in contact [N]."""
        if not self._recent_square_errors:
            return math.nan
        return math.sqrt(sum(self._recent_square_errors) / len(self._recent_square_errors))

    @property
    def channel_delay(self) -> tuple[float, float]:
        """By how much the force is late, and the standard deviation of that [s]; NaN: unknown."""
        return _field(self.latest, "channel_delay"), _field(self.latest, "channel_delay_std")

    def zeros(self) -> dict[str, float]:
        """Return contact position [mm] and force zero [N] with standard deviations by name.

        The position is that of the last contact, of which the parameters are: with the time in the
        air it says less and less about where the next contact begins.
        """
        zeros = Zeros.from_message(functools.partial(_field, self.latest))
        touch = self._latest_touch
        if touch is not None and touch.configuration_revision == self.latest.configuration_revision:
            zeros = zeros.at(Zeros.from_message(functools.partial(_field, touch)))
        return zeros._asdict()

    def parameters(self) -> dict[str, float]:
        """Return the latest K, B, n, p by name."""
        return {name: _field(self.latest, name) for name in PARAMETERS}

    def parameters_std(self) -> dict[str, float]:
        """Return their standard deviations by name."""
        return {name: _field(self.latest, f"{name}_std") for name in PARAMETERS}

    def identifiability(self) -> dict[str, float]:
        """Return their identifiability (0: unknown, 1: known from the data) by name."""
        return {name: _field(self.latest, f"{name}_identifiability") for name in PARAMETERS}


def _field(message: Any, name: str) -> float:
    return math.nan if message is None else float(getattr(message, name))
