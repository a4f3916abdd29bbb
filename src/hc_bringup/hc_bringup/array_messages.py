"""Arrays of samples and of estimates for a run whose rig is fast: one message for several.

What a message costs hardly depends on what is in it, so from some kHz on samples travel together
(hc_msgs/IndenterSamples), and so do their estimates (hc_msgs/HuntCrossleyEstimates), which every
reader of the suite takes as it takes those of one sample each.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from hc_bringup.commands.run import file_parameters, with_parameters
from hc_msgs_py.topics import ESTIMATE, ESTIMATES, SAMPLE, SAMPLES
from hc_sim_rig.scenario import load_scenario
from hc_sim_rig.schema import ScenarioError

FAST_HZ: Final = 2000.0
"""Samples a second from which they travel together unless told otherwise."""
MESSAGES_HZ: Final = 1000.0
"""Messages a second then: the first sample of a message waits as long for the last."""
_DEFAULTS: Final = {"time": "system", "side": "both"}
"""Settings of the rig without which it sends every sample by itself."""


def with_array_messages(plan: Any) -> Any:
    """Return a plan in which a fast rig sends arrays, and all others take and send them too.

    Args:
        plan: as it is, with what the user has set, which stays.
    """
    rig, estimator, recorder = map(plan.node, ("indenter", "estimator", "recorder"))
    if rig is None:
        return plan
    settings = file_parameters(rig) | dict(rig.parameters)
    together = settings.get("samples_per_message")
    if together is None:
        together = samples_together(settings)
        if together > 1:
            plan = with_parameters(plan, "indenter", {"samples_per_message": together})
    if together == 1:
        return plan
    renamed = {SAMPLE: SAMPLES}
    if estimator is not None:
        settings = file_parameters(estimator) | dict(estimator.parameters)
        added = estimator_settings(settings)
        plan = with_parameters(plan, "estimator", added)
        if (settings | added)["output.estimates"] == "arrays":
            renamed[ESTIMATE] = ESTIMATES
    if recorder is not None:
        settings = file_parameters(recorder) | dict(recorder.parameters)
        topics = [renamed.get(name, name) for name in settings.get("expected_topics", [])]
        plan = with_parameters(plan, "recorder", {"expected_topics": topics or [""]})
    return plan


def estimator_settings(settings: Mapping[str, Any]) -> dict[str, str]:
    """Return what an estimator needs beside its settings to take arrays, and to send them.

    Args:
        settings: what the user has set, which stays.
    """
    added = {}
    if settings.get("input.source", "sample") == "sample":
        added["input.source"] = "samples"
    if "output.estimates" not in settings:
        added["output.estimates"] = "arrays"
    return added


def samples_together(settings: Mapping[str, Any]) -> int:
    """Return how many samples a rig sends in a message where nobody said how many.

    Args:
        settings: parameters of the rig. What it will refuse itself counts as slow here.
    """
    if any(settings.get(name, usual) != usual for name, usual in _DEFAULTS.items()):
        return 1
    try:
        rate_hz = load_scenario(str(settings.get("scenario", "multisine"))).rate_hz
    except (ScenarioError, OSError):
        return 1
    return max(1, round(rate_hz / MESSAGES_HZ)) if rate_hz >= FAST_HZ else 1
