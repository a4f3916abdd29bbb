"""One summary for each contact, from touch to release: what palpation maps are made of."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.estimate import Estimate


@dataclasses.dataclass
class ContactSummary:
    """One contact. Lengths mm, forces N, energies N mm (mJ), times ns.

    Attributes:
        number: counts contacts from 1.
        start_ns: stamp of the first sample in contact.
        end_ns: stamp of the last sample in contact.
        first_sequence: sequence of the first sample in contact.
        last_sequence: sequence of the last sample in contact.
        samples: samples used.
        forces: how many of them hold a force.
        rejected: samples not used.
        tissue_changes: changes of the tissue detected.
        model_mismatch: whether the contact law failed to describe the sensors at some time.
        estimate: the last one in contact.
        peak_force: largest measured force [N].
        peak_displacement: largest measured penetration [mm].
        peak_speed: largest filtered speed [mm/s].
        energy_in: work on the tissue while the penetration grew [N mm].
        energy_loss: work that did not come back, the area of the force-displacement loop [N mm].
        squared_error: sum of squared differences of measured and predicted force [N^2].
        position_m: tip at the first sample in contact [m]; NaN where no pose is known.
        position_frame_id: frame of the position; empty where no pose is known.
    """

    number: int
    start_ns: int
    end_ns: int
    first_sequence: int
    last_sequence: int
    estimate: Estimate
    samples: int = 0
    forces: int = 0
    rejected: int = 0
    tissue_changes: int = 0
    model_mismatch: bool = False
    peak_force: float = 0.0
    peak_displacement: float = 0.0
    peak_speed: float = 0.0
    energy_in: float = 0.0
    energy_loss: float = 0.0
    squared_error: float = 0.0
    position_m: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    position_frame_id: str = ""

    @property
    def parameters(self) -> NDArray[np.float64]:
        """K, B, n, p at the end, shape (4,)."""
        return self.estimate.parameters

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the parameters at the end, shape (4, 4)."""
        return self.estimate.covariance

    @property
    def identifiability(self) -> NDArray[np.float64]:
        """How much the data said about each parameter, shape (4,)."""
        return self.estimate.identifiability

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample in contact [s]."""
        return (self.end_ns - self.start_ns) * 1e-9

    @property
    def force_rmse(self) -> float:
        """Root mean square of measured minus predicted force [N]; NaN without a used force."""
        return math.sqrt(self.squared_error / self.forces) if self.forces else math.nan


class ContactTracker:
    """Cuts the stream of estimates into contacts.

    The estimate's contact flag is that of one filtered sample and flickers when the tool hovers at
    the surface; a contact counts once it has lasted, and ends once it has been away for a while.

    Attributes:
        minimum_duration_ns: shorter touches are not reported.
        release_ns: the tool must be away so long for the contact to be over.
        current: the contact that goes on; None in free motion. It may still be too short to count.
        contacts: number of contacts that counted.
    """

    def __init__(
        self, *, minimum_duration_ns: int = 50_000_000, release_ns: int = 20_000_000
    ) -> None:
        self.minimum_duration_ns = minimum_duration_ns
        self.release_ns = release_ns
        self.current: ContactSummary | None = None
        self.contacts = 0
        self._announced = False
        self._displacement = math.nan  # at the last force of the contact
        self._force = math.nan

    def update(
        self,
        stamp_ns: int,
        sequence: int,
        displacement_mm: float,
        force_n: float,
        estimate: Estimate,
    ) -> tuple[ContactSummary | None, ContactSummary | None]:
        """Take in the estimate after one sample.

        Args:
            stamp_ns: stamp of the sample [ns].
            sequence: its sequence.
            displacement_mm: measured displacement [mm]; NaN if the sample has none.
            force_n: measured force [N]; NaN if the sample has none.
            estimate: the estimate after it.

        Returns:
            The contact that counts from now on, and the contact that is over; None otherwise.
        """
        contact = self.current
        if estimate.rejected:
            if contact is not None:
                contact.rejected += 1
            return None, None
        if not estimate.contact:
            if contact is not None and stamp_ns - contact.end_ns >= self.release_ns:
                return None, self.finish()
            return None, None
        if contact is None:
            contact = self.current = ContactSummary(
                self.contacts + 1,
                stamp_ns,
                stamp_ns,
                sequence,
                sequence,
                estimate,
            )
            self._displacement = self._force = math.nan
        if not math.isnan(force_n):
            self._add_work(contact, estimate.displacement, force_n)
        self._collect(contact, stamp_ns, sequence, displacement_mm, force_n, estimate)
        if not self._announced and stamp_ns - contact.start_ns >= self.minimum_duration_ns:
            self._announced = True
            self.contacts += 1
            return contact, None
        return None, None

    def finish(self) -> ContactSummary | None:
        """End the contact now (stream over, time jump) and return it if it counted."""
        contact, self.current = self.current, None
        counted, self._announced = self._announced, False
        return contact if counted else None

    def _add_work(self, contact: ContactSummary, displacement: float, force: float) -> None:
        """Add the work since the last force."""
        # The filtered displacement: the noise of the measured one would count as work.
        advance = displacement - self._displacement
        if not math.isnan(advance):  # not the contact's first force
            work = 0.5 * (force + self._force) * advance
            contact.energy_loss += work
            if advance > 0.0:
                contact.energy_in += work
        self._displacement, self._force = displacement, force

    @staticmethod
    def _collect(
        contact: ContactSummary,
        stamp_ns: int,
        sequence: int,
        displacement_mm: float,
        force_n: float,
        estimate: Estimate,
    ) -> None:
        if stamp_ns > contact.end_ns:  # one that comes late is used in its place
            contact.end_ns, contact.last_sequence = stamp_ns, sequence
        contact.samples += 1
        contact.tissue_changes += estimate.change_detected
        contact.model_mismatch |= estimate.model_mismatch
        contact.estimate = estimate
        contact.peak_speed = max(contact.peak_speed, abs(estimate.velocity))
        if not math.isnan(displacement_mm):
            contact.peak_displacement = max(contact.peak_displacement, displacement_mm)
        if not math.isnan(force_n):
            contact.forces += 1
            contact.peak_force = max(contact.peak_force, force_n)
            error = force_n - estimate.force_predicted
            contact.squared_error += error * error
