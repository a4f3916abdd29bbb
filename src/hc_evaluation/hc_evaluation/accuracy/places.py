"""Place by place: is each place's K true, and the force that its law says?

Contacts of `drawn_places`, asked at the end of each place's last contact. K is the force at a
millimetre over n powers of it: where the surface is, is the largest part of what is not known of
it. So the elastic force that is told at two thirds of the largest depth is asked as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hc_evaluation.accuracy.bench import Bench, Result, Row, target, worst
from hc_evaluation.accuracy.drawn_places import KINDS, DrawnPlaces, drawn_places
from hc_evaluation.accuracy.measure import Setup
from hc_evaluation.accuracy.troubles import LIKELY, NEGLIGIBLE, OFTEN

SHARE = 2.0 / 3.0  # of the largest depth
WITHIN = 3.0  # deviations
Figures = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class PlacesTask:
    """One run: estimator, what differs, and seed."""

    setup: Setup
    kind: str
    seed: int


def places_run(task: PlacesTask) -> Figures:
    """What stands at the end of each place, arrays of shape (places,)."""
    contact = drawn_places(task.kind, task.seed)
    series = task.setup.create().run(contact.time_s, contact.displacement_mm, contact.force_n)
    rows = [_at_end(contact, series, place) for place in range(int(contact.place[-1]) + 1)]
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


def _at_end(contact: DrawnPlaces, series: object, place: int) -> dict[str, float]:
    """Errors of a place where its last contact ends."""
    touching = np.flatnonzero((contact.place == place) & (contact.depth_mm > 0.0))
    end = int(touching[-1])
    estimate = np.asarray(series.parameters)[end]  # type: ignore[attr-defined]
    stated = np.asarray(series.parameters_std)[end]  # type: ignore[attr-defined]
    begin = float(np.asarray(series.contact_position)[end])  # type: ignore[attr-defined]
    flagged = np.asarray(series.model_mismatch, np.bool_)[touching]  # type: ignore[attr-defined]
    called = np.asarray(series.change_detected, np.bool_)  # type: ignore[attr-defined]
    truth = contact.parameters[end]
    depth = SHARE * float(np.max(contact.depth_mm[touching]))
    error = abs(float(np.log(estimate[0] / truth[0])))
    deviation = float(stated[0] / estimate[0])
    seen = max(depth + contact.surface_mm[end] - begin, 1e-6)
    force = estimate[0] * seen ** estimate[2] / (truth[0] * depth ** truth[2])
    believed = float(np.mean(flagged)) < OFTEN
    return {
        "K": error,
        "deviation": deviation,
        "within": float(error <= WITHIN * deviation),
        "force": abs(float(np.log(force))),
        "wrong": float(believed and not error <= LIKELY * deviation + NEGLIGIBLE),
        "mismatch": float(np.mean(flagged)),
        "changes": float(np.count_nonzero(called[contact.place == place])),
    }


def _row(kind: str, runs: list[Figures]) -> Row:
    places = {key: np.concatenate([run[key] for run in runs]) for key in runs[0]}
    return {
        "differs": kind,
        "places": float(places["K"].size),
        "force": float(np.median(places["force"])),
        "force_90": float(np.quantile(places["force"], 0.9)),
        "K": float(np.median(places["K"])),
        "K_90": float(np.quantile(places["K"], 0.9)),
        "deviation": float(np.median(places["deviation"])),
        "within": float(np.mean(places["within"])),
        "wrong": float(np.mean(places["wrong"])),
        "mismatch": float(np.mean(places["mismatch"])),
        "changes": float(np.sum(places["changes"])),
    }


def places(bench: Bench) -> Result:
    """Places that are all alike, that differ in one thing, and in all."""
    tasks = [
        PlacesTask(bench.setup, kind, bench.first_seed + seed)
        for kind in KINDS
        for seed in range(bench.seeds)
    ]
    runs = bench.by_seed(places_run, tasks)
    rows = [_row(kind, of_kind) for kind, of_kind in zip(KINDS, runs, strict=True)]
    alike, differing = rows[0], rows[1:]
    targets = [
        target("alike: K off at 9 of 10 places", alike["K_90"], high=0.01),
        target("alike: changes called", alike["changes"], high=0.0),
        target("force off, median", worst(r["force"] for r in differing), high=0.005),
        target("force off at 9 of 10 places", worst(r["force_90"] for r in differing), high=0.03),
        target(
            "K within 3 of its deviations", worst((r["within"] for r in rows), high=False), low=0.95
        ),
        target("places told wrong", worst(r["wrong"] for r in rows), high=0.02),
        target("misfit told", worst(r["mismatch"] for r in rows), high=0.05),
    ]
    return {"rows": rows, "targets": targets}
