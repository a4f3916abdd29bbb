"""One run as reports and pictures need it: samples, estimates, truth, where the tip was, events.

Estimates are kept as records with the fields and units of hc_msgs/HuntCrossleyEstimate, whether
they were recorded or are made anew, so that whatever shows them knows one form.
"""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.run_clock import RunClock
from hc_bringup.sample_places import places_of
from hc_bringup.tip_path import TipPath, TipSource, tip_of
from hc_estimator import PARAMETER_NAMES, EstimateSeries, Estimator, __version__
from hc_estimator.stream.in_pieces import run_in_pieces
from hc_estimator.stream.together import of_two_readings, together
from hc_logger.bag import Bag
from hc_logger.definitions import installed_definition
from hc_logger.errors import BagError
from hc_logger.events import events_of
from hc_logger.foreign import open_bag
from hc_logger.layout import INTEGER, REAL, record_dtype, records, stamps
from hc_logger.mixed_estimates import are_mixed
from hc_logger.recorded import only_topic
from hc_logger.recording import Recording
from hc_logger.type_names import ESTIMATE_TYPE
from hc_msgs_py.estimate_fields import estimate_fields
from hc_msgs_py.topics import TRUTH

Array = NDArray[np.float64]

TRUTH_TYPE: Final = "hc_msgs/msg/IndenterTruth"
_EARLIEST_NS: Final = 10**18
"""Of 2001: smaller times count from some start."""
STAMP_FIELDS: Final = ("header.stamp.sec", "header.stamp.nanosec", "header.frame_id")


class RunEvent(NamedTuple):
    """Something that happened: time [s] of the run, kind of hc_msgs/EstimatorEvent, a line."""

    time_s: float
    kind: int
    reason: str


@dataclass(frozen=True)
class RunData:
    """One run; all arrays share the sample axis.

    Attributes:
        name: name of the recording.
        estimator: filter and state space.
        time_s: since the first sample [s]; where the clock was set it goes on (run_clock.py).
        displacement_mm: measured displacement [mm]; NaN where a sample has none.
        force_n: measured force [N]; NaN where a sample has none.
        estimates: records of hc_msgs/HuntCrossleyEstimate without header, (samples,).
        truth: true K, B, n, p where the rig tells, shape (samples, 4), or None.
        tip: where the tip was, or None.
        events: what was recorded on hc/events, or None where nothing was.
        settings: of the estimator, by name.
        versions: of the software, by name.
        findings: what is unusual about the recording, a line each.
        begins_ns: when it begins, since 1970 [ns]; None where its times do not say.
    """

    name: str
    estimator: str
    time_s: Array
    displacement_mm: Array
    force_n: Array
    estimates: NDArray[Any]
    truth: Array | None = None
    tip: TipPath | None = None
    events: tuple[RunEvent, ...] | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    findings: tuple[str, ...] = ()
    begins_ns: int | None = None

    @property
    def title(self) -> str:
        """Name of the recording and of the estimator."""
        return f"{self.name}, {self.estimator}"

    @functools.cached_property
    def parameters(self) -> Array:
        """K, B, n, p, shape (samples, 4)."""
        return np.column_stack([self.estimates[name] for name in PARAMETER_NAMES])

    @functools.cached_property
    def parameters_std(self) -> Array:
        """Their standard deviations, shape (samples, 4)."""
        return np.column_stack([self.estimates[f"{name}_std"] for name in PARAMETER_NAMES])

    @functools.cached_property
    def identifiability(self) -> Array:
        """How much the data said about each, shape (samples, 4)."""
        names = [f"{name}_identifiability" for name in PARAMETER_NAMES]
        return np.column_stack([self.estimates[name] for name in names])

    @property
    def covariance(self) -> Array:
        """Covariance of K, B, n, p, shape (samples, 4, 4)."""
        return np.asarray(self.estimates["covariance"]).reshape(-1, 4, 4)

    @property
    def force_predicted_n(self) -> Array:
        """Force expected before the sample was used [N], shape (samples,)."""
        return np.asarray(self.estimates["force_predicted"])

    @property
    def nis(self) -> Array:
        """Normalised innovation squared, as of two readings (ideal 2), shape (samples,)."""
        names = ("innovation_displacement", "innovation_force")
        innovation = np.column_stack([self.estimates[name] for name in names])
        return of_two_readings(self.estimates["nis"], innovation)

    def together(self, rows: NDArray[Any]) -> tuple[Array, Array, Array]:
        """Times, displacements and forces of the instants with a force; of a choice of rows."""
        return together(self.time_s[rows], self.displacement_mm[rows], self.force_n[rows])

    @property
    def contact(self) -> NDArray[np.bool_]:
        """True while the tool touches the tissue, shape (samples,)."""
        return np.asarray(self.estimates["contact"], bool)

    @property
    def used(self) -> NDArray[np.bool_]:
        """True where the sample was used, shape (samples,)."""
        return np.asarray(self.estimates["rejected"] == 0)

    @property
    def change_detected(self) -> NDArray[np.bool_]:
        """True where a change of the tissue was detected, shape (samples,)."""
        return np.asarray(self.estimates["change_detected"], bool)

    @property
    def model_mismatch(self) -> NDArray[np.bool_]:
        """True where the contact law did not fit, shape (samples,)."""
        return np.asarray(self.estimates["model_mismatch"], bool)


def recorded(recording: Recording, tip: TipSource | None = None) -> RunData | None:
    """Return the run as it was recorded, or None if the recording holds no estimates of one.

    Args:
        recording: the recording.
        tip: where the tip's position is; None takes what `tip_path.tip_of` finds.

    Raises:
        UserError: if the bag cannot be read, or has no such topic.
    """
    if not recording.is_bag:
        return None
    try:
        table = recording.estimates
    except BagError as error:
        raise UserError(str(error)) from error
    if not len(table) or are_mixed(table):
        return None
    rows = places_of(stamps(table), table["sequence"], recording.stamps, recording.sequence)
    table, rows = table[rows >= 0], rows[rows >= 0]
    if not len(table):
        return None
    configurations = recording.configurations
    settings: dict[str, Any] = {}
    versions = {"this software": __version__}
    estimator = "as recorded"
    if configurations:
        last = configurations[-1]
        estimator = f"{last.filter} on {last.state_space}"
        settings = {"contact_model": last.contact_model, **last.parameters}
        versions["hc_estimator that made the estimates"] = last.software_version
    with open_bag(recording.path, recording.namespace) as bag:
        beside = _beside(bag, recording, stamps(table), table["sequence"], tip)
        versions |= {
            name: value for name, value in bag.custom_data.items() if name.endswith("version")
        }
    return _in_one_clock(
        RunData(
            name=recording.path.name,
            estimator=estimator,
            time_s=recording.time_s[rows] - recording.time_s[0],
            displacement_mm=recording.displacement_mm[rows],
            force_n=recording.force_n[rows],
            estimates=_filled(table),
            settings=settings,
            versions=versions,
            **beside,
        ),
        recording,
    )


def estimated(recording: Recording, estimator: Estimator, tip: TipSource | None = None) -> RunData:
    """Return the run with the estimates of an estimator over the recording.

    Args:
        recording: the recording.
        estimator: as made.
        tip: as for `recorded`.

    Raises:
        UserError: if a position of the tip is asked for that is not there.
    """
    series = run_in_pieces(
        estimator, recording.time_s, recording.displacement_mm, recording.force_n
    )
    return of_series(recording, estimator, series, tip)


def of_series(
    recording: Recording,
    estimator: Estimator,
    series: EstimateSeries,
    tip: TipSource | None = None,
) -> RunData:
    """Return the run with the estimates of a series that the estimator made of the recording.

    Args:
        recording: the recording.
        estimator: that made the series.
        series: its estimates.
        tip: as for `recorded`.

    Raises:
        UserError: if a position of the tip is asked for that is not there.
    """
    beside: dict[str, Any] = {"findings": tuple(recording.findings.lines())}
    if recording.is_bag:
        with open_bag(recording.path, recording.namespace) as bag:
            beside = _beside(bag, recording, recording.stamps, recording.sequence, tip)
            beside |= {"events": None}
    elif tip is not None:
        raise UserError(
            f"{recording.path} is a CSV file: it holds no position of the tip", WRONG_USE
        )
    with np.errstate(invalid="ignore", over="ignore"):  # times need not be finite
        time_s = recording.time_s - recording.time_s[0]
    return _in_one_clock(
        RunData(
            name=recording.path.name,
            estimator=f"{estimator.filter} on {estimator.state_space}",
            time_s=time_s,
            displacement_mm=recording.displacement_mm,
            force_n=recording.force_n,
            estimates=records_of_series(series, recording.force_n, recording.sequence),
            settings={"contact_model": estimator.contact_model, **estimator.configuration},
            versions={"this software": __version__},
            **beside,
        ),
        recording,
    )


def _in_one_clock(data: RunData, recording: Recording) -> RunData:
    """Return a run whose times go on where the recording's clock was set, and say so."""
    forward_s = [(stamp - int(recording.stamps[0])) * 1e-9 for stamp in recording.set_forward_ns]
    clock = RunClock.of(data.time_s, forward_s)
    begins_ns = int(recording.stamps[0])
    if begins_ns > _EARLIEST_NS:
        data = dataclasses.replace(data, begins_ns=begins_ns)
    if clock.is_one:
        return data
    events, tip = data.events, data.tip
    if events:
        times = clock.of_others(np.array([event.time_s for event in events]))
        events = tuple(e._replace(time_s=t) for e, t in zip(events, times.tolist(), strict=True))
    return dataclasses.replace(
        data,
        time_s=clock.of_rows(data.time_s),
        events=events,
        tip=None if tip is None else tip._replace(time_s=clock.of_others(tip.time_s)),
        findings=(*data.findings, *clock.lines()),
    )


def tip_path(recording: Recording, tip: TipSource | None = None) -> TipPath | None:
    """Return where the tip was, None where that is not told.

    Args:
        recording: the recording.
        tip: as for `recorded`.

    Raises:
        UserError: if a position of the tip is asked for that is not there.
    """
    if not recording.is_bag:
        return None
    with open_bag(recording.path, recording.namespace) as bag:
        found = _beside(bag, recording, recording.stamps[:0], recording.sequence[:0], tip)["tip"]
    assert found is None or isinstance(found, TipPath)
    return found


def estimate_dtype() -> np.dtype[Any]:
    """Return the dtype of estimates: the fields of the message without its header."""
    whole = record_dtype(installed_definition(ESTIMATE_TYPE), 1)
    names = [name for name in whole.names or () if name not in STAMP_FIELDS]
    return np.dtype([(name, whole[name]) for name in names])


def records_of_series(
    series: EstimateSeries, force_n: Array, sequence: NDArray[np.uint64]
) -> NDArray[Any]:
    """Return a series as records with the fields and units of the message."""
    table = np.zeros(len(series), estimate_dtype())
    table["sequence"] = sequence
    for name, values in estimate_fields(series, force_n):
        table[name] = values
    return table


def _filled(table: NDArray[Any]) -> NDArray[Any]:
    """Return recorded estimates with all fields of today; those of old bags are NaN, or 0."""
    filled = np.zeros(len(table), estimate_dtype())
    for name in filled.dtype.names or ():
        if name in (table.dtype.names or ()):
            filled[name] = table[name]
        elif filled[name].dtype.kind == "f":
            filled[name] = np.nan
    return filled


def _beside(
    bag: Bag,
    recording: Recording,
    stamps_ns: NDArray[Any],
    sequence: NDArray[Any],
    tip: TipSource | None,
) -> dict[str, Any]:
    """Return what a bag holds beside samples and estimates: truth, tip and events.

    What of it is damaged is left out and named among the findings.

    Raises:
        UserError: if a position of the tip was asked for that is not there, or is damaged.
    """
    start_ns = int(recording.stamps[0])
    result: dict[str, Any] = {}
    damaged = []
    for name, read in (
        ("truth", lambda: _truth(bag, stamps_ns, sequence)),
        ("tip", lambda: tip_of(bag, recording, tip)),
        ("events", lambda: _events(bag, start_ns)),
    ):
        try:
            result[name] = read()
        except BagError as error:
            if name == "tip" and tip is not None:
                raise UserError(str(error)) from error
            result[name] = None
            damaged.append(f"the {name} cannot be read: {error}")
    return result | {"findings": (*recording.findings.lines(), *damaged)}


def _truth(bag: Bag, stamps_ns: NDArray[Any], sequence: NDArray[Any]) -> Array | None:
    """Return the true parameters (samples, 4) of these samples, or None."""
    topic = only_topic(bag, TRUTH_TYPE, TRUTH)
    if topic is None:
        return None
    fields = {"sequence": INTEGER, **dict.fromkeys(PARAMETER_NAMES, REAL)}
    table = records(bag.topics[topic].definition, bag.columns(topic), fields)
    at = places_of(stamps_ns, sequence, stamps(table), table["sequence"])
    found = at >= 0
    if not found.any():
        return None
    truth = np.full((len(sequence), 4), np.nan)
    for index, name in enumerate(PARAMETER_NAMES):
        truth[found, index] = table[name][at[found]]
    return truth if np.isfinite(truth).any(axis=0).all() else None


def _events(bag: Bag, start_ns: int) -> tuple[RunEvent, ...] | None:
    events = events_of(bag)
    if events is None:
        return None
    return tuple(RunEvent((e.stamp_ns - start_ns) * 1e-9, e.kind, e.reason) for e in events)
