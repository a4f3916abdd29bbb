"""Several places of a tissue, or several tissues, pressed one after another in one recording.

Each has a surface and parameters of its own. An estimator that goes on from place to place has to
find out by the forces alone that both have changed; here it need not: what lies between two places
is known, by where the tip was sideways or by a pause in the air. At each place the surface is
looked for in the first approach, and the estimator begins anew.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_bringup.commands.doctor import apply
from hc_bringup.diagnosis import diagnose
from hc_bringup.errors import UserError
from hc_bringup.place_delay import TOUCHED, Delay, between_places, delay_at
from hc_bringup.recording_input import ZEROS
from hc_bringup.report.contacts import Contact
from hc_bringup.run_data import RunData, of_series, tip_path
from hc_bringup.tip_path import TipPath, TipSource
from hc_estimator import EstimateSeries, Estimator
from hc_estimator.stream.free_motion import free_motion
from hc_estimator.stream.in_pieces import run_in_pieces
from hc_estimator.stream.readings import whole
from hc_estimator.stream.sensor_setup import SURFACE_SHARE
from hc_estimator.stream.surface import CLEAR, find_surface, why_no_surface
from hc_estimator.stream.tare import TareResult
from hc_estimator.stream.together import together
from hc_estimator.stream.vocabulary import CHANNEL_DELAY
from hc_logger.recording import Recording

Array = NDArray[np.float64]


SITE: Final = "site [1]"
"""Column of tables: the number of the place, from 1."""
SURE_DELAY_S: Final = 5e-4
"""A delay that is known to this is taken; one that is not, each site looks for by itself."""


class Site(NamedTuple):
    """One place.

    Attributes:
        rows: of the recording, from the air before the first touch to the air behind the last.
        surface_mm: displacement at which its contact begins, 0 where it was not found.
        surface_std_mm: standard deviation of that.
        force_zero_n: force free of contact there.
    """

    rows: slice
    surface_mm: float
    surface_std_mm: float
    force_zero_n: float


class SitesRun(NamedTuple):
    """What all places of a recording gave.

    Attributes:
        data: the run, its zeros taken off place by place.
        recording: the same.
        sites: the places.
        estimator: that of the last place.
        series: estimates of all rows.
        delay: between the channels, as all places say together; None if it is open.
    """

    data: RunData
    recording: Recording
    sites: list[Site]
    estimator: Estimator
    series: EstimateSeries
    delay: Delay | None

    def columns(self, contacts: Sequence[Contact]) -> dict[str, list[float | int]]:
        """Return the columns that say of each contact which place it is of, and its surface."""
        lengths = [site.rows.stop - site.rows.start for site in self.sites]
        last = np.array([contact.last for contact in contacts], int)
        of = np.searchsorted(np.cumsum(lengths), last, side="right")
        found_mm, found_std_mm = (
            np.nan_to_num(column[last])
            for column in (self.series.contact_position, self.series.contact_position_std)
        )
        known_mm = np.array([site.surface_std_mm for site in self.sites])[of]
        surface_mm = np.array([site.surface_mm for site in self.sites])[of] + found_mm
        return {
            SITE: (of + 1).tolist(),
            "surface [mm]": surface_mm.tolist(),
            "surface_std [mm]": np.where(found_std_mm > 0.0, found_std_mm, known_mm).tolist(),
        }


def run_by_site(
    recording: Recording, tip: TipSource | None, make: Callable[[Recording], Estimator]
) -> SitesRun:
    """Find the places of a recording and estimate each by itself.

    Args:
        recording: displacement into the tissue and compression positive.
        tip: where the tip's position is; None: where usual.
        make: of an estimator, for a recording whose surface is known as well as it says.

    Raises:
        UserError: if the recording does not go from free motion into contact anywhere.
    """
    path = tip_path(recording, tip)
    sites = find_sites(recording, path)
    delay = common_delay(recording, sites)
    zeroed, estimator, series = estimate_sites(recording, sites, make, delay)
    data = dataclasses.replace(of_series(zeroed, estimator, series), tip=path)
    return SitesRun(data, zeroed, sites, estimator, series, delay)


def find_sites(recording: Recording, tip: TipPath | None) -> list[Site]:
    """Find the places that were pressed.

    Args:
        recording: displacement into the tissue and compression positive.
        tip: where the tip was, if that is known.

    Raises:
        UserError: if the recording does not go from free motion into contact anywhere.
    """
    pairs = together(recording.time_s, recording.displacement_mm, recording.force_n)
    first = find_surface(*pairs[1:])
    if first is None:
        raise UserError(f"--sites: {recording.path} {why_no_surface(*pairs[1:])}")
    noise_n = max(first.force_std_n, 1e-12)
    there = np.flatnonzero(~np.isnan(recording.force_n))
    pressed = recording.force_n[there] - first.force_n > CLEAR * noise_n
    cuts = [0, *between_places(recording.time_s, there[pressed], tip), len(recording.time_s)]
    peaks = [
        float(np.nanmax(recording.force_n[a:b], initial=-np.inf)) - first.force_n
        for a, b in itertools.pairwise(cuts)
    ]
    touched = [peak > TOUCHED * noise_n for peak in peaks]
    return [
        _site(recording, slice(a, b), first)
        for (a, b), is_place in zip(itertools.pairwise(cuts), touched, strict=True)
        if is_place
    ]


def _site(recording: Recording, rows: slice, elsewhere: TareResult) -> Site:
    """Return a place with its surface.

    Args:
        recording: as for `find_sites`.
        rows: of the place.
        elsewhere: what the first approach of the recording showed.
    """
    part = (recording.time_s[rows], recording.displacement_mm[rows], recording.force_n[rows])
    surface_mm, surface_std_mm, force_zero_n = _first_look(*part, elsewhere)
    # All presses of a place know its surface better than the beginning of the first.
    judged = diagnose(part[0], part[1] - surface_mm, part[2] - force_zero_n, surface_std_mm)
    moved: dict[str, float] = {}
    for finding in judged.findings:
        apply(moved, {name: by for name, by in finding.settings.items() if name in ZEROS})
    return Site(
        rows,
        surface_mm + moved.get("position.zero", 0.0),
        judged.surface_std_mm,
        force_zero_n + moved.get("force.zero", 0.0),
    )


def _first_look(
    time_s: Array, displacement_mm: Array, force_n: Array, elsewhere: TareResult
) -> tuple[float, float, float]:
    """Return surface, its deviation [mm] and force zero [N] of a place, as well as they show."""
    _time_s, depth, newtons = together(time_s, displacement_mm, force_n)
    found = find_surface(depth, newtons)
    if found is not None:
        return found.displacement_mm, found.displacement_std_mm, found.force_n
    stroke_mm = float(np.ptp(depth)) if len(depth) else 0.0
    free = whole(free_motion(depth, newtons))
    if free is not None:  # presses too weak for one approach alone, or pieces of approaches
        return free[1], SURFACE_SHARE * stroke_mm, free[0]
    return elsewhere.displacement_mm, stroke_mm, elsewhere.force_n


def common_delay(recording: Recording, sites: list[Site]) -> Delay | None:
    """Return the delay between the channels that the sites say together, None if it is open.

    A few presses of one site leave it open to some milliseconds, which make B and p unsure.

    Args:
        recording: as for `find_sites`.
        sites: what that found.
    """
    found = delay_at(
        (
            recording.time_s[site.rows],
            recording.displacement_mm[site.rows] - site.surface_mm,
            recording.force_n[site.rows] - site.force_zero_n,
        )
        for site in sites
    )
    return found if found is not None and found.deviation_s < SURE_DELAY_S else None


def estimate_sites(
    recording: Recording,
    sites: list[Site],
    make: Callable[[Recording], Estimator],
    delay: Delay | None = None,
) -> tuple[Recording, Estimator, EstimateSeries]:
    """Estimate each place with an estimator of its own.

    Args:
        recording: as for `find_sites`.
        sites: what that found.
        make: of an estimator, for a recording whose surface is known as well as it says.
        delay: between the channels, for an estimator that would look for it; None: it is open.

    Returns:
        The rows of all places with their zeros taken off, the last of the estimators, and the
        estimates of all rows.
    """
    parts, series = [], []
    for site in sites:
        part = dataclasses.replace(
            recording,
            time_s=recording.time_s[site.rows],
            stamps=recording.stamps[site.rows],
            sequence=recording.sequence[site.rows],
            displacement_mm=recording.displacement_mm[site.rows] - site.surface_mm,
            force_n=recording.force_n[site.rows] - site.force_zero_n,
            contact_position_std_mm=site.surface_std_mm,
        )
        estimator = make(part)
        if delay is not None and estimator.configuration.get(CHANNEL_DELAY) == "auto":
            estimator.reconfigure(**{CHANNEL_DELAY: delay.seconds})
        parts.append(part)
        series.append(
            run_in_pieces(estimator, part.time_s, part.displacement_mm, part.force_n).values
        )
    names = ("time_s", "stamps", "sequence", "displacement_mm", "force_n")
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in names
    }
    return (
        dataclasses.replace(recording, **joined),
        estimator,
        EstimateSeries(np.concatenate(series)),
    )
