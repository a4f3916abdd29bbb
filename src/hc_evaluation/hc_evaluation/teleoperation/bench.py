"""`hc bench teleoperation`: four ways to feed force back, over delay, with jitter and loss."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hc_estimator.kinds import DEFAULT_FILTER, available_filters
from hc_evaluation.teleoperation.scores import Scores, score
from hc_sim_rig.bilateral import METHODS, Bilateral, BilateralSeries, Feedback, Network, simulate

ROUND_TRIPS_MS = (0, 20, 100, 300, 1000)
SEEDS = 3

Progress = Callable[[str, int, int], None]


def run_case(
    method: str, round_trip_ms: float, filter: str | None, seed: int
) -> tuple[BilateralSeries, Scores]:
    """Simulate and judge one run with the settings of the measurements."""
    feedback = Feedback(method=method, filter=filter or DEFAULT_FILTER)
    network = Network(round_trip_ms=float(round_trip_ms))
    series = simulate(Bilateral(network=network, feedback=feedback), seed=seed)
    return series, score(series)


def variants(*, quick: bool) -> tuple[tuple[str, str | None], ...]:
    """Methods, the model-mediated one with each filter (the default one alone if quick)."""
    plain = tuple((method, None) for method in METHODS if method != "model_mediated")
    rest = () if quick else tuple(f for f in available_filters() if f != DEFAULT_FILTER)
    return plain + tuple(("model_mediated", name) for name in (DEFAULT_FILTER, *rest))


def run_teleoperation(
    *,
    quick: bool = False,
    round_trips_ms: Sequence[float] = ROUND_TRIPS_MS,
    chosen: Sequence[tuple[str, str | None]] | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Measure every method at every delay.

    Args:
        quick: one seed, and the default filter only.
        round_trips_ms: delays there and back.
        chosen: methods with their filter instead of all.
        progress: takes the method's name, what is done, how much there is.

    Returns:
        rows: one per method (and filter) and delay: medians over the seeds, the largest peak
        force, stable if every seed was; details: the same order, what the judgement rests on;
        seeds, seconds.
    """
    begin = time.monotonic()
    seeds = 1 if quick else SEEDS
    rows: list[dict[str, Any]] = []
    details: list[dict[str, Any]] = []
    for method, filter in variants(quick=quick) if chosen is None else chosen:
        name = method if filter is None else f"{method} {filter}"
        for k, round_trip in enumerate(round_trips_ms):
            results = [run_case(method, round_trip, filter, seed)[1] for seed in range(seeds)]
            row, detail = _summary(results)
            head = {"method": method, "filter": filter, "round_trip_ms": round_trip}
            rows.append({**head, **row})
            details.append({**head, **detail})
            if progress is not None:
                progress(name, k + 1, len(round_trips_ms))
    return {
        "rows": rows,
        "details": details,
        "seeds": seeds,
        "seconds": time.monotonic() - begin,
    }


def _summary(results: Sequence[Scores]) -> tuple[dict[str, Any], dict[str, Any]]:
    """A row and what it rests on, from the runs of all seeds."""

    def median(name: str) -> float:
        return float(np.median([getattr(result, name) for result in results]))

    row = {
        "stable": all(result.stable for result in results),
        "force_error_n": median("force_error_n"),
        "transparency": median("transparency"),
        "peak_force_n": float(np.max([result.peak_force_n for result in results])),
        "lump_contrast": median("lump_contrast"),
    }
    detail = {
        "first_press_contrast": median("first_press_contrast"),
        "stable_runs": sum(result.stable for result in results),
        "oscillation_mm": median("oscillation_mm"),
        "ringing_mm": median("ringing_mm"),
        "growth": median("growth"),
        "energy_to_hand_mj": median("energy_to_hand_mj"),
        "energy_made_mj": median("energy_made_mj"),
        "largest_update_n": max(result.largest_update_n for result in results),
        "lowest_tank_mj": min(result.lowest_tank_mj for result in results),
        "trusted_share": median("trusted_share"),
    }
    return row, detail
