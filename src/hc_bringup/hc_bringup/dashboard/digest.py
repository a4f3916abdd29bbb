"""A thousand estimates a second to fifty rows: least, greatest and last of every 20 ms.

A row's last values are those of one estimate, so what the page shows is what was published: the
last one with a force, where sensors have rates of their own and some estimates have none. Rows
follow the stamps, not the arrival, so a stall of the network leaves no trace in the curves.
"""

from __future__ import annotations

from collections import deque
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.dashboard.columns import COLUMNS, INDEX, PARAMETERS
from hc_bringup.force_error import one_step_error

Rows = NDArray[np.float64]

ROW_NS: Final = 20_000_000
RESTART_NS: Final = 500_000_000
"""Stamps that go back by more than this are another recording: the page starts afresh."""
LONGEST_LOSS: Final = 1_000_000
"""A jump of the sequence beyond this is a restarted source, not a loss."""
TRUTHS_KEPT: Final = 600
"""Of the simulated truth, for estimates that come late: ten seconds and more."""
MM: Final = 1000.0

_NAMES = ("stiffness", "damping", "displacement_exponent", "velocity_exponent")
_FROM_ESTIMATE = {
    "sequence": ("sequence", 1.0),
    "displacement": ("displacement", MM),
    "velocity": ("velocity", MM),
    "force": ("force_measured", 1.0),
    "predicted": ("force_predicted", 1.0),
    "contact": ("contact", 1.0),
    "mismatch": ("model_mismatch", 1.0),
    "hypothesis": ("hypothesis", 1.0),
    "delay": ("channel_delay", 1.0),
    "delay_std": ("channel_delay_std", 1.0),
    "contact_position": ("contact_position", MM),
    "contact_position_std": ("contact_position_std", MM),
    "force_zero": ("force_zero", 1.0),
    "force_zero_std": ("force_zero_std", 1.0),
    **{short: (name, 1.0) for short, name in zip(PARAMETERS, _NAMES, strict=True)},
    **{
        f"{short}_std": (f"{name}_std", 1.0) for short, name in zip(PARAMETERS, _NAMES, strict=True)
    },
    **{
        f"{short}_known": (f"{name}_identifiability", 1.0)
        for short, name in zip(PARAMETERS, _NAMES, strict=True)
    },
}
_FROM_SAMPLE = {
    "sequence": ("sequence", 1.0),
    "displacement": ("displacement", MM),
    "force": ("force", 1.0),
}
_WITH_RANGE = ("displacement", "force", "predicted")


class Digest:
    """Turns blocks of messages, as record arrays of hc_logger.layout, into rows.

    Attributes:
        epoch: counts how often the stamps started again.
        origin_ns: the stamp that is second 0; None before the first message.
    """

    def __init__(self, row_ns: int = ROW_NS) -> None:
        """Begin.

        Args:
            row_ns: span of a row.
        """
        self.row_ns = row_ns
        self.epoch = 0
        self.origin_ns: int | None = None
        self._open: NDArray[Any] | None = None
        self._of_estimates = True
        self._last_ns: int | None = None
        self._last_sequence: int | None = None
        self._truths: deque[tuple[int, NDArray[np.float64]]] = deque(maxlen=TRUTHS_KEPT)
        self._tip = (np.nan, np.nan)

    def restart(self) -> None:
        """Begin again with the next message, in a new epoch."""
        self.epoch += 1
        self.origin_ns = self._open = self._last_ns = self._last_sequence = None
        self._truths.clear()
        self._tip = (np.nan, np.nan)

    def set_truth(self, record: Any, stamp_ns: int) -> None:
        """Take the latest record of hc_msgs/IndenterTruth; rows get that of their own stamp."""
        if self._truths and stamp_ns <= self._truths[-1][0]:
            self._truths.clear()  # told again from an earlier time on
        self._truths.append((stamp_ns, np.array([float(record[name]) for name in _NAMES])))

    def set_tip(self, x_mm: float, y_mm: float) -> None:
        """Take the latest sideways position of the tip [mm]."""
        self._tip = (x_mm, y_mm)

    def add(self, table: NDArray[Any], stamps: NDArray[np.int64], *, estimates: bool) -> Rows:
        """Take in messages in the order of their stamps and return the rows that are complete.

        Args:
            table: (n,) records of hc_msgs/HuntCrossleyEstimate, or of hc_msgs/IndenterSample
                while nobody estimates.
            stamps: (n,) their stamps [ns].
            estimates: which of the two they are.

        Returns:
            (m, columns) rows; those of a new epoch only, if the stamps have started again.
        """
        if not len(table):
            return _no_rows()
        kept = _none_of(table)
        kept["record"], kept["stamp"] = table, stamps
        if estimates != self._of_estimates:
            self._open, self._of_estimates = None, estimates
        back = np.flatnonzero(np.diff(stamps, prepend=stamps[0]) < -RESTART_NS)
        if len(back):
            self.restart()
            kept = kept[back[-1] :]
        elif self._last_ns is not None and stamps[0] < self._last_ns - RESTART_NS:
            self.restart()
        if self._last_ns is not None:
            kept = kept[kept["stamp"] > self._last_ns]  # told twice, or overtaken
        kept = kept[kept["stamp"] >= np.maximum.accumulate(kept["stamp"])]
        if not len(kept):
            return _no_rows()
        if self.origin_ns is None:
            self.origin_ns = int(kept["stamp"][0])
        self._last_ns = int(kept["stamp"][-1])
        if self._open is not None and len(self._open):
            kept = np.concatenate([self._open, kept])
        places = (kept["stamp"] - self.origin_ns) // self.row_ns
        starts = np.flatnonzero(np.diff(places, prepend=places[0] - 1))
        self._open = kept[starts[-1] :]
        return self._rows(kept[: starts[-1]], starts[:-1])

    def flush(self) -> Rows:
        """Return the row that is not complete, because no more messages come."""
        waiting, self._open = self._open, None
        if waiting is None or not len(waiting):
            return _no_rows()
        return self._rows(waiting, np.zeros(1, np.int64))

    def pause(self) -> Rows:
        """Stop listening for a while: what is published meanwhile is not lost. As `flush`."""
        rows = self.flush()
        self._last_sequence = None
        return rows

    def _rows(self, kept: NDArray[Any], starts: NDArray[np.int64]) -> Rows:
        if not len(kept):
            return _no_rows()
        assert self.origin_ns is not None
        ends = np.append(starts[1:], len(kept)) - 1
        table = kept["record"]
        rows = np.full((len(starts), len(COLUMNS)), np.nan)
        put = _Columns(rows)
        fields = _FROM_ESTIMATE if self._of_estimates else _FROM_SAMPLE
        shown = _last_known(table[fields["force"][0]], starts, ends)
        put["time"] = (kept["stamp"][shown] - self.origin_ns) * 1e-9
        put["samples"] = ends - starts + 1
        put["lost"] = np.add.reduceat(self._lost(table["sequence"]), starts)
        for column, (field, factor) in fields.items():
            put[column] = table[field][shown] * factor
        if not self._of_estimates:  # a sample with a force may have no displacement
            field, factor = fields["displacement"]
            put["displacement"] = table[field][_last_known(table[field], starts, ends)] * factor
        for column in _WITH_RANGE:
            if column in fields:
                field, factor = fields[column]
                put[f"{column}_min"] = np.fmin.reduceat(table[field], starts) * factor
                put[f"{column}_max"] = np.fmax.reduceat(table[field], starts) * factor
        if self._of_estimates:
            self._judged(put, table, starts, shown)
        if self._truths:
            # Estimates may lag behind the truth: what was true at their stamp is what counts.
            known_ns = np.array([stamp for stamp, _ in self._truths], dtype=np.int64)
            values = np.array([truth for _, truth in self._truths])
            since_s = (known_ns - kept["stamp"][shown][0]) * 1e-9
            at_s = (kept["stamp"][shown] - kept["stamp"][shown][0]) * 1e-9
            for place, short in enumerate(PARAMETERS):
                put[f"{short}_true"] = np.interp(at_s, since_s, values[:, place])
        put["tip_x"], put["tip_y"] = self._tip
        return rows

    @staticmethod
    def _judged(
        put: _Columns, table: NDArray[Any], starts: NDArray[np.int64], shown: NDArray[np.int64]
    ) -> None:
        """Fill in what only estimates have."""
        refused = table["rejected"] != 0
        error = one_step_error(table["force_measured"], table["force_predicted"])
        # As in the figures: what a saturated sensor says is no error of the filter.
        error = np.where(refused, np.nan, error)
        put["error"] = error[shown]
        put["error_min"] = np.fmin.reduceat(error, starts)
        put["error_max"] = np.fmax.reduceat(error, starts)
        judged = ~refused & np.isfinite(table["nis"])
        put["rejected"] = np.add.reduceat(refused.astype(float), starts)
        put["nis_sum"] = np.add.reduceat(np.where(judged, table["nis"], 0.0), starts)
        # An estimate with one reading counts as half of one: its NIS has one degree of freedom.
        readings = np.isfinite(table["innovation_displacement"]).astype(float)
        readings += np.isfinite(table["innovation_force"])
        put["nis_count"] = np.add.reduceat(np.where(judged, 0.5 * readings, 0.0), starts)
        put["change"] = np.maximum.reduceat(table["change_detected"].astype(float), starts)
        put["latency"] = np.maximum.reduceat(table["latency"], starts)
        put["K_n_covariance"] = table["covariance"][shown, 2]  # row K, column n of 4x4
        scores = table["hypothesis_scores"]
        for number in range(scores.shape[1]):
            put[f"score_{number}"] = scores[shown, number]

    def _lost(self, sequence: NDArray[Any]) -> Rows:
        counter = sequence.astype(np.int64)
        before = counter[0] - 1 if self._last_sequence is None else self._last_sequence
        gaps = np.diff(counter, prepend=before) - 1.0
        self._last_sequence = int(sequence[-1])
        return np.where((gaps > 0) & (gaps < LONGEST_LOSS), gaps, 0.0)


def _last_known(
    values: NDArray[np.float64], starts: NDArray[np.int64], ends: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return where each row's last finite value is; the row's end if it has none."""
    places = np.where(np.isfinite(values), np.arange(len(values)), -1)
    last = np.maximum.reduceat(places, starts)
    return np.where(last < 0, ends, last)


class _Columns:
    """Writes columns of rows by name."""

    def __init__(self, rows: Rows) -> None:
        self._rows = rows

    def __setitem__(self, name: str, values: Any) -> None:
        self._rows[:, INDEX[name]] = values


def _none_of(table: NDArray[Any]) -> NDArray[Any]:
    """Return room for records and their stamps side by side."""
    return np.empty(len(table), [("record", table.dtype), ("stamp", np.int64)])


def _no_rows() -> Rows:
    return np.empty((0, len(COLUMNS)))
