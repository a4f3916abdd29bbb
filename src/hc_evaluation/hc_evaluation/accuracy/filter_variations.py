"""Settings of the default filter that depart from it: for `ablation` and `defaults`.

The one place to keep up to date with the filter: a mechanism that is added gets a line in
`MECHANISMS` that switches it off, a setting whose value was chosen two in `VARIATIONS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

# Name of the mechanism, and the settings that switch it off. The first row is the filter itself.
MECHANISMS: tuple[tuple[str, Mapping[str, Any]], ...] = (
    ("nothing", {}),
    ("turns of the tool", {"find_turns": False}),
    ("changes of the tissue", {"find_changes": False}),
    ("motion adaptation", {"motion_adaptation": False}),
    ("noise adaptation", {"noise_adaptation": "fixed", "force_noise_std": 0.03}),
    ("tempering of the linearisation", {"coherence_share": 0.0}),
    ("history and its fit", {"refit_ratio": 1e6, "history_interval": 10.0}),
    ("outlier gate", {"outlier_limit": 0}),
)

# Settings varied one at a time.
VARIATIONS: tuple[tuple[str, Mapping[str, object]], ...] = (
    ("defaults", {}),
    ("noise given, wrong by 3", {"noise_adaptation": "fixed", "force_noise_std": 0.03}),
    ("no motion adaptation", {"motion_adaptation": False}),
    ("no turns of the tool", {"find_turns": False}),
    ("no tempering", {"coherence_share": 0.0}),
    ("coherence_share x 2", {"coherence_share": 0.7}),
    ("coherence_share / 2", {"coherence_share": 0.175}),
    ("coherence_shortest x 2", {"coherence_shortest": 0.05}),
    ("coherence_shortest / 2", {"coherence_shortest": 0.0125}),
    ("coherence_longest x 3", {"coherence_longest": 0.84}),
    ("coherence_longest / 3", {"coherence_longest": 0.093}),
    ("alarm_threshold x 2", {"alarm_threshold": 90.0}),
    ("alarm_threshold / 2", {"alarm_threshold": 22.5}),
    ("alarm_drift 8", {"alarm_drift": 8.0}),
    ("alarm_drift 3.5", {"alarm_drift": 3.5}),
    ("model_error_time x 3", {"model_error_time": 4.5}),
    ("model_error_time / 3", {"model_error_time": 0.5}),
    ("probation x 2", {"probation": 4.0}),
    ("probation / 2", {"probation": 1.0}),
    ("contest_memory x 2", {"contest_memory": 1.0}),
    ("contest_memory / 2", {"contest_memory": 0.25}),
    ("no change found", {"find_changes": False}),
    ("no refit", {"refit_ratio": 1e6, "history_interval": 10.0}),
    ("refit_ratio 2", {"refit_ratio": 2.0}),
    ("refit_ratio 1.1", {"refit_ratio": 1.1}),
    ("history_interval x 2", {"history_interval": 0.04}),
    ("history_interval / 2", {"history_interval": 0.01}),
    (
        "walk 1e-8",
        dict.fromkeys(
            (
                "stiffness_log_walk",
                "damping_log_walk",
                "displacement_exponent_walk",
                "velocity_exponent_walk",
            ),
            1e-8,
        ),
    ),
    (
        "walk 1e-6",
        dict.fromkeys(
            (
                "stiffness_log_walk",
                "damping_log_walk",
                "displacement_exponent_walk",
                "velocity_exponent_walk",
            ),
            1e-6,
        ),
    ),
    ("noise_memory x 3", {"noise_memory": 3000.0}),
    ("noise_memory / 3", {"noise_memory": 333.0}),
    ("motion_memory x 3", {"motion_memory": 1200.0}),
    ("motion_memory / 3", {"motion_memory": 133.0}),
)
