"""Why the law does not fit: faults that were put in are named; a good fit gets no excuse."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hc_bringup.explanation import BackgroundExplainer, RecentMotion, explain

TIME = np.arange(0.0, 6.0, 0.002)
PHASE = 2.0 * np.pi * TIME
DEPTH = 2.0 + 0.9 * np.sin(1.1 * PHASE) + 0.4 * np.sin(2.7 * PHASE)
SPEED = np.gradient(DEPTH, TIME)


def law(depth: Any, speed: Any, stiffness: Any = 0.3) -> Any:
    deep = np.maximum(depth, 0.0)
    return np.maximum(0.0, deep**1.5 * (stiffness + 0.005 * speed))


def noisy(values: Any, deviation: float) -> Any:
    return values + deviation * np.random.default_rng(2).standard_normal(len(values))


def test_a_good_fit_is_not_explained_away() -> None:
    assert explain(TIME, noisy(DEPTH, 0.002), noisy(law(DEPTH, SPEED), 0.005)) == ""


@pytest.mark.parametrize("delay_s", [-0.04, -0.02, 0.02, 0.04])
def test_delay(delay_s: float) -> None:
    force = np.interp(TIME - delay_s, TIME, law(DEPTH, SPEED))
    said = explain(TIME, DEPTH, noisy(force, 0.005))
    order = "after" if delay_s > 0.0 else "before"
    assert f"{1e3 * abs(delay_s):.0f} ms {order} the displacement" in said


def test_surface() -> None:
    said = explain(TIME, DEPTH + 0.6, noisy(law(DEPTH, SPEED), 0.002))
    assert "contact begins at" in said


def test_relaxation() -> None:
    depth = np.clip(4.0 * TIME, 0.0, 2.0)
    force = law(depth, np.gradient(depth, TIME)) * (0.6 + 0.4 * np.exp(-np.maximum(TIME - 0.5, 0)))
    assert "it relaxes" in explain(TIME, depth, force)


def test_tissue_that_varies() -> None:
    stiffness = 0.3 * (1.0 + 2.0 * np.exp(-(((TIME - 3.0) / 0.8) ** 2)))
    said = explain(TIME, DEPTH, noisy(law(DEPTH, SPEED, stiffness), 0.005))
    assert said == "the tissue is not the same along the way"


@pytest.mark.parametrize("span_s", [6.0, 8.0, 10.0])
@pytest.mark.parametrize("lifted_mm", [0.0, 0.5, 1.0])
def test_tissue_that_varies_is_said_of_presses_over_any_span(
    span_s: float, lifted_mm: float
) -> None:
    """Regression: a report looks at 10 s, whose windows had too few samples in contact."""
    time = np.arange(0.0, span_s, 0.002)
    depth = (1.0 + 0.5 * lifted_mm) * (1.0 - np.cos(2.0 * np.pi * time)) - lifted_mm
    deep = np.maximum(depth, 0.0)
    said = []
    for share in (0.0, 0.8):
        stiffness = 0.3 * np.exp(share * np.sin(np.pi * time / span_s))
        force = law(deep, np.gradient(depth, time), stiffness)
        said.append(explain(time, depth, noisy(force, 0.002)))
    assert said == ["", "the tissue is not the same along the way"]


def test_letting_go_is_part_of_the_law() -> None:
    force = np.maximum(0.0, DEPTH**1.5 * (0.3 + 0.06 * SPEED))
    assert np.mean(force == 0.0) > 0.2
    assert explain(TIME, DEPTH, noisy(force, 0.003)) == ""


@pytest.mark.parametrize(
    "spoil",
    [
        lambda t, d, f: (t[:10], d[:10], f[:10]),
        lambda t, d, f: (t, np.zeros_like(d), f),
        lambda t, d, f: (t, -d, f),
        lambda t, d, f: (np.zeros_like(t), d, f),
        lambda t, d, f: (t, d, np.zeros_like(f)),
    ],
)
def test_nothing_to_explain(spoil: Callable[..., Any]) -> None:
    assert explain(*spoil(TIME, DEPTH, law(DEPTH, SPEED))) == ""


def test_recent_motion_is_bounded_and_survives_anything() -> None:
    recent = RecentMotion(span_s=2.0)
    for number in range(20_000):
        recent.add(number * 1e-3, np.sin(number * 1e-2), np.nan if number % 7 == 0 else 1.0)
    assert 500 < len(recent._rows) <= 701
    recent.add(0.0, 1.0, 1.0)  # the source has started again
    recent.add(0.5, 1.0, 1.0)
    assert [row[0] for row in recent._rows] == [0.0, 0.5]
    assert recent.explain() == ""


def test_evidence_starts_anew_when_zeros_or_filter_change() -> None:
    """Regression: for six seconds after the surface was found, the advice was to find it."""
    motion, explainer = RecentMotion(), BackgroundExplainer()
    force = noisy(law(DEPTH, SPEED), 0.002)

    def told(seconds: float, wanted: bool) -> str:
        end = time.monotonic() + seconds
        while time.monotonic() < end and bool(explainer.explain(motion, True)) != wanted:
            time.sleep(0.05)
        return explainer.explain(motion, True)

    for row in zip(TIME, DEPTH + 0.6, force, strict=True):
        motion.add(*row, 1)
    assert "contact begins at" in told(20.0, True)
    for row in zip(TIME[:100] + 6.0, DEPTH[:100], force[:100], strict=True):
        motion.add(*row, 2)
    assert explainer.explain(motion, True) == ""
    for row in zip(TIME[100:] + 6.0, DEPTH[100:], force[100:], strict=True):
        motion.add(*row, 2)
    assert told(2.0, True) == ""
