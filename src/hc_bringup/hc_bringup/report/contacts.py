"""Contacts of a run: one from each touch to its release, with what was known at its end.

The rules are those of the estimator node (hc_estimator.stream.contacts), over arrays: a contact
counts once it has lasted and ends once the tool has been away for a while. Depth and force can be
asked for too: a tool that rests on the surface touches it thousands of times.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.run_data import RunData
from hc_bringup.tip_path import TipPath
from hc_msgs_py.units import METRE_IN_MM

Array = NDArray[np.float64]

MINIMUM_DURATION_S: Final = 0.05
RELEASE_S: Final = 0.02
LONG_GAP_STEPS: Final = 3.0
"""So many usual steps without a sample, and the recording has a gap."""


@dataclass(frozen=True)
class ContactRules:
    """What counts as a contact.

    Attributes:
        minimum_duration_s: shorter touches do not count.
        release_s: the tool must be away so long for a contact to be over.
        minimum_depth_mm: touches that never get so deep do not count.
        minimum_force_n: touches that never press so hard do not count.
    """

    minimum_duration_s: float = MINIMUM_DURATION_S
    release_s: float = RELEASE_S
    minimum_depth_mm: float = 0.0
    minimum_force_n: float = 0.0


WORTH_A_ROW: Final = ContactRules(minimum_depth_mm=0.05)
"""Of a report, and of the end of a run: shallower touches are no contacts worth a row."""


@dataclass(frozen=True)
class Contact:
    """One contact; lengths mm, times s of the run, forces N, energies mJ.

    Attributes:
        number: counts from 1.
        first: row of its first sample.
        last: row of its last sample in contact.
        start_s: time of the first sample.
        end_s: time of the last one.
        samples: used.
        rejected: not used.
        parameters: K, B, n, p at its end, shape (4,).
        covariance: of these, shape (4, 4).
        identifiability: of these, shape (4,).
        peak_depth_mm: largest measured penetration; NaN if none was measured.
        peak_force_n: largest measured force; NaN if none was measured.
        peak_speed_mm_s: largest filtered speed.
        energy_in_mj: work on the tissue while the penetration grew.
        energy_loss_mj: work that did not come back.
        force_rmse_n: root mean square of measured minus predicted force.
        changes: changes of the tissue detected.
        mismatch_share: of the samples in which the contact law did not fit.
        surface_mm: displacement reading from which K, B, n and p count, as known at its end.
        surface_std_mm: its standard deviation; NaN where it is not estimated.
        position_mm: where the tip was at the middle of the contact, (2,), NaN where not known.
        travel_mm: how far it went sideways while in contact; 0 where not known.
    """

    number: int
    first: int
    last: int
    start_s: float
    end_s: float
    samples: int
    rejected: int
    parameters: Array
    covariance: Array
    identifiability: Array
    peak_depth_mm: float
    peak_force_n: float
    peak_speed_mm_s: float
    energy_in_mj: float
    energy_loss_mj: float
    force_rmse_n: float
    changes: int
    mismatch_share: float
    surface_mm: float
    surface_std_mm: float
    position_mm: Array
    travel_mm: float

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample."""
        return self.end_s - self.start_s

    @property
    def parameters_std(self) -> Array:
        """Standard deviations of the parameters, shape (4,)."""
        return np.sqrt(np.diag(self.covariance))


def find_contacts(data: RunData, rules: ContactRules | None = None) -> list[Contact]:
    """Return the contacts of a run that count by the rules, in their order."""
    rules = rules or ContactRules()
    touching = np.flatnonzero(data.contact & data.used)
    if not len(touching):
        return []
    new = np.flatnonzero(_released(data, touching, rules.release_s)) + 1
    contacts: list[Contact] = []
    for rows in np.split(touching, new):
        if data.time_s[rows[-1]] - data.time_s[rows[0]] < rules.minimum_duration_s:
            continue
        contact = _contact(data, rows, len(contacts) + 1)
        too_shallow = contact.peak_depth_mm < rules.minimum_depth_mm
        too_weak = contact.peak_force_n < rules.minimum_force_n
        if not (too_shallow or too_weak):
            contacts.append(contact)
    return contacts


def _released(data: RunData, touching: NDArray[np.intp], release_s: float) -> NDArray[np.bool_]:
    """Return between which of the samples in contact (n,) the contact was over, (n - 1,).

    It takes a sample without contact, so long after, or a gap in the recording: samples that were
    refused say nothing, and those of a slow sensor come late. A clock that was set back ends it
    too: what comes then has no time since the touch before.
    """
    before, after = touching[:-1], touching[1:]
    away = np.flatnonzero(~data.contact & data.used)
    if len(away):
        latest = away[np.maximum(np.searchsorted(away, after) - 1, 0)]
        lifted = (latest > before) & (latest < after)
        lifted &= data.time_s[latest] - data.time_s[before] >= release_s
    else:
        lifted = np.zeros(len(before), bool)
    lifted |= data.time_s[after] < data.time_s[before]
    steps = np.diff(data.time_s)
    if not len(steps):
        return lifted
    gaps = np.append(0, np.cumsum(steps >= max(release_s, LONG_GAP_STEPS * np.median(steps))))
    missing: NDArray[np.bool_] = gaps[after] > gaps[before]
    return lifted | missing


def _contact(data: RunData, rows: NDArray[np.intp], number: int) -> Contact:
    first, last = int(rows[0]), int(rows[-1])
    estimates = data.estimates
    whole = slice(first, last + 1)
    measured = rows[~np.isnan(data.force_n[rows])]
    depth = estimates["displacement"][measured] * METRE_IN_MM  # filtered: noise would count as work
    force = data.force_n[measured]
    advance = np.diff(depth)
    work = 0.5 * (force[1:] + force[:-1]) * advance
    error = force - data.force_predicted_n[measured]
    position, travel = _place(data.tip, data.time_s[first], data.time_s[last])
    return Contact(
        number=number,
        first=first,
        last=last,
        start_s=float(data.time_s[first]),
        end_s=float(data.time_s[last]),
        samples=len(rows),
        rejected=int(np.count_nonzero(~data.used[whole])),
        parameters=data.parameters[last],
        covariance=data.covariance[last],
        identifiability=data.identifiability[last],
        peak_depth_mm=_largest(data.displacement_mm[rows]),
        peak_force_n=_largest(force),
        peak_speed_mm_s=float(np.max(np.abs(estimates["velocity"][rows])) * METRE_IN_MM),
        energy_in_mj=float(work[advance > 0.0].sum()),
        energy_loss_mj=float(work.sum()),
        force_rmse_n=float(np.sqrt(np.nanmean(error**2))) if np.isfinite(error).any() else np.nan,
        changes=int(np.count_nonzero(data.change_detected[rows])),
        mismatch_share=float(np.mean(data.model_mismatch[rows])),
        surface_mm=float(estimates["contact_position"][last]) * METRE_IN_MM,
        surface_std_mm=float(estimates["contact_position_std"][last]) * METRE_IN_MM,
        position_mm=position,
        travel_mm=travel,
    )


def _largest(values: Array) -> float:
    """Return the largest reading; NaN if there is none."""
    return float(np.fmax.reduce(values)) if len(values) else np.nan


def _place(tip: TipPath | None, start_s: float, end_s: float) -> tuple[Array, float]:
    """Return where the tip was at the middle of a contact, and how far it went."""
    if tip is None or end_s < tip.time_s[0] or start_s > tip.time_s[-1]:
        return np.full(2, np.nan), 0.0
    middle = 0.5 * (start_s + end_s)
    position = np.array([np.interp(middle, tip.time_s, axis) for axis in tip.position_mm.T])
    inside = (tip.time_s >= start_s) & (tip.time_s <= end_s)
    reached = tip.position_mm[inside]
    travel = float(np.max(np.ptp(reached, axis=0))) if len(reached) else 0.0
    return position, travel
