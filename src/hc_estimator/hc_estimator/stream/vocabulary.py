"""What a session hears, says and counts: batches, events, revisions, settings, counters."""

from __future__ import annotations

import dataclasses
from enum import IntEnum
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from hc_estimator.estimate import Estimate, EstimateSeries, Rejection
from hc_estimator.stream.contacts import ContactSummary

LOADED_STATE = "loaded_state"
"""Name in a configuration for the state that was loaded: with it the estimates can be repeated."""

STARTED_AFRESH = "the estimator was started afresh"
"""What a node says of itself where the stamps jumped."""

CONTACT_POSITION_STD = "contact_position_std"
"""Setting of the filters that consider how well the surface is known [mm]."""

CHANNEL_DELAY = "channel_delay"
"""Setting of the default filter: by how much the force is late [s], or auto."""


CONTACT_FRAME = "input.contact.frame"
"""Setting of a node with poses: along what force and depth of its samples are read."""
ALONG_SENSOR_AXES = "sensor"
"""Its value where a tool that turns spoils both."""


def recorded_less(setting: str) -> str:
    """Return what says in a configuration that samples are recorded less a setting's value."""
    return f"{setting}.taken_off"


class EventKind(IntEnum):
    """What happened; the numbers of hc_msgs/EstimatorEvent."""

    TISSUE_CHANGE = 1
    CONTACT_MADE = 2
    CONTACT_LOST = 3
    REJECTION_BURST = 4
    RESET = 5
    RECONFIGURED = 6
    TIME_JUMP = 7
    INPUT_SILENT = 8
    INPUT_RECOVERED = 9
    INPUT_FROZEN = 10
    INPUT_SATURATED = 11
    SOURCE_RESTARTED = 12
    SOURCE_CONFLICT = 13
    SAMPLES_SKIPPED = 14
    TARED = 15
    STATE_LOADED = 16
    MODEL_MISMATCH = 17
    TARE_REFUSED = 18
    INPUT_SUSPECT = 19


class Cause(IntEnum):
    """What made a revision; the numbers of hc_msgs/EstimatorConfiguration."""

    STARTED = 0
    RECONFIGURED = 1
    RESET = 2
    TIME_JUMP = 3
    STATE_LOADED = 4


class Event(NamedTuple):
    """Something that a user may want to hear of."""

    kind: EventKind
    stamp_ns: int  # 0 when no sample came yet
    sequence: int
    reason: str


class Revision(NamedTuple):
    """From when on a configuration holds.

    time_origin_ns is 0 as long as no sample came after a start; the same revision is then told
    again with its origin at the first sample.
    """

    number: int
    valid_from_sequence: int
    time_origin_ns: int
    cause: Cause


class Batch(NamedTuple):
    """Samples that wait together, in the order in which they came, an element each."""

    stamps_ns: NDArray[np.int64]
    sequences: NDArray[np.uint64]
    displacements_mm: NDArray[np.float64]
    forces_n: NDArray[np.float64]

    def part(self, begin: int, end: int) -> Batch:
        """Those from one place up to another."""
        chosen = slice(begin, end)
        return Batch(
            self.stamps_ns[chosen],
            self.sequences[chosen],
            self.displacements_mm[chosen],
            self.forces_n[chosen],
        )


class Listener(Protocol):
    """Who hears what the session says."""

    def on_estimate(
        self, stamp_ns: int, sequence: int, force_n: float, estimate: Estimate, computation_ns: int
    ) -> None:
        """A sample was taken in; the estimate after it."""

    def on_estimates(self, batch: Batch, series: EstimateSeries, computation_ns: int) -> None:
        """Samples were taken in together; the estimate after each, and the time for one."""

    def on_event(self, event: Event) -> None:
        """Something happened."""

    def on_contact(self, summary: ContactSummary) -> None:
        """A contact is over."""

    def on_revision(self, revision: Revision) -> None:
        """Another configuration is in force, or the time origin of the present one is known."""


@dataclasses.dataclass
class SessionSettings:
    """How a session judges its stream.

    Attributes:
        silence_timeout_s: without a reading of either channel for so long, the input is silent [s].
        maximum_gap_s: stamps further ahead than this are a time jump [s].
        rejection_burst: samples refused in a row that are worth an event.
        frozen_samples: equal readings in a row that are worth an event.
        contact_minimum_s: shorter touches are not reported [s].
        contact_release_s: so long away, and the contact is over [s].
    """

    silence_timeout_s: float = 0.5
    maximum_gap_s: float = 60.0
    rejection_burst: int = 50
    frozen_samples: int = 200
    contact_minimum_s: float = 0.05
    contact_release_s: float = 0.02


@dataclasses.dataclass
class Counters:
    """What a session counted since it was made.

    Attributes:
        received: samples given to the session.
        estimates: estimates made (rejected samples included).
        rejected: samples refused by the estimator, by reason code.
        skipped: samples left out because the node could not keep up.
        restarts: restarts of the source.
        time_jumps: jumps of the stamps or of the clock.
        changes: tissue changes detected.
        nis_sum: sum of the normalised innovations squared of accepted samples.
        accepted: accepted samples.
        readings: displacements and forces in them.
        without_displacement: samples with a force alone.
        without_force: samples with a displacement alone.
    """

    received: int = 0
    estimates: int = 0
    rejected: list[int] = dataclasses.field(default_factory=lambda: [0] * len(Rejection))
    skipped: int = 0
    restarts: int = 0
    time_jumps: int = 0
    changes: int = 0
    nis_sum: float = 0.0
    accepted: int = 0
    readings: int = 0
    without_displacement: int = 0
    without_force: int = 0
