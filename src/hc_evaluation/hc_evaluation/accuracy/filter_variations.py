"""Settings of the default filter that depart from it: for `ablation` and `defaults`.

The one place to keep up to date with the filter: a mechanism that is added gets a line in
`MECHANISMS` that switches it off, a setting whose value was chosen two in `VARIATIONS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hc_estimator.estimate import Hypothesis
from hc_estimator.multiple_model.hypotheses import (
    FRESH,
    REFINES,
    RESERVE,
    ROWS,
    STEADY_SURFACE_ROW,
    ZERO_STEP,
    without,
)


def _without(hypothesis: Hypothesis) -> Mapping[str, Any]:
    return {"without_hypotheses": without(hypothesis)}


_BOTH_AT_ONCE = [m for m in range(len(ROWS)) if RESERVE[m] and not REFINES[m]]
_REFINED = [m for m in range(len(ROWS)) if REFINES[m]]

# Name of the mechanism, and the settings that switch it off. The first row is the filter itself.
MECHANISMS: tuple[tuple[str, Mapping[str, Any]], ...] = (
    ("nothing", {}),
    ("least squares over remembered points", _without(Hypothesis.CONSTANT_FITTED)),
    ("stiffness that follows a trend", _without(Hypothesis.STIFFNESS_TREND)),
    ("layers that vary", _without(Hypothesis.ALL_DRIFT)),
    ("surfaces that move", _without(Hypothesis.SURFACE_MOVES)),
    ("surface at a steady speed", {"without_hypotheses": 2**STEADY_SURFACE_ROW}),
    ("two things at once", {"without_hypotheses": sum(2**m for m in _BOTH_AT_ONCE)}),
    ("a lump in an organ that breathes", {"without_hypotheses": 2 ** _BOTH_AT_ONCE[-1]}),
    ("damping that goes its own way", {"without_hypotheses": sum(2**m for m in _REFINED)}),
    ("what other hypotheses leave open", {"mixture_covariance": False}),
    ("no force beyond what was felt", {"possible_forces": False}),
    ("changes of the tissue", {"without_hypotheses": 2**FRESH}),
    ("a force zero that steps", {"without_hypotheses": 2**ZERO_STEP}),
    ("turns of the tool", {"find_maneuvers": False}),
    ("delay of the channels", {"channel_delay": 0.0}),
    ("delay by the innovations", {"delay_by_innovations": False}),
    ("zeros that are off", {"find_zeros": False}),
    ("least squares for what moves", {"fit_movement": False}),
    ("another place at a new contact", {"find_places": False}),
    ("the contact that is over held against what drifts", {"review_contact": False}),
    ("motion adaptation", {"motion_adaptation": False}),
    ("noise adaptation", {"noise_adaptation": "fixed", "force_noise_std": 0.03}),
    ("tempering of the linearisation", {"coherence_share": 0.0}),
    ("outlier gate", {"outlier_limit": 0}),
)

# Settings varied one at a time.
VARIATIONS: tuple[tuple[str, Mapping[str, Any]], ...] = (
    ("defaults", {}),
    ("noise given, wrong by 3", {"noise_adaptation": "fixed", "force_noise_std": 0.03}),
    ("coherence_share x 2", {"coherence_share": 0.7}),
    ("coherence_share / 2", {"coherence_share": 0.175}),
    ("noise_memory x 3", {"noise_memory": 3000.0}),
    ("noise_memory / 3", {"noise_memory": 333.0}),
    ("noise_short_memory x 2", {"noise_short_memory": 80.0}),
    ("noise_jump_ratio x 2", {"noise_jump_ratio": 7.0}),
    ("initial_stiffness x 10", {"initial_stiffness": 10.0}),
    ("initial_stiffness / 10", {"initial_stiffness": 0.1}),
    ("jerk_density x 100", {"jerk_density": 1e7}),
    ("jerk_density / 100", {"jerk_density": 1e3}),
)
