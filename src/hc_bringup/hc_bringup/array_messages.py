"""Arrays of samples and of estimates for a run whose rig is fast: one message for several.

What a message costs hardly depends on what is in it, so from some kHz on samples travel together
(hc_msgs/IndenterSamples), and so do their estimates (hc_msgs/HuntCrossleyEstimates), which every
reader of the suite takes as it takes those of one sample each.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from hc_bringup.commands.run import file_parameters, with_parameters
from hc_estimator.ros.node_settings import LARGEST_BACKLOG
from hc_msgs_py.topics import ESTIMATE, ESTIMATES, SAMPLE, SAMPLES
from hc_sim_rig.scenario import load_scenario
from hc_sim_rig.schema import ScenarioError

FAST_HZ: Final = 2000.0
"""Samples a second from which they travel together unless told otherwise."""
MESSAGES_HZ: Final = 1000.0
"""Messages a second then: the first sample of a message waits as long for the last."""
BACKLOG_S: Final = 1.0
"""Of samples that may wait, as at 1 kHz: a stall of the estimator loses none of the next ones."""
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
    rate_hz = _rate_hz(settings)
    together = settings.get("samples_per_message")
    if together is None:
        together = max(1, round(rate_hz / MESSAGES_HZ)) if rate_hz >= FAST_HZ else 1
        if together > 1:
            plan = with_parameters(plan, "indenter", {"samples_per_message": together})
    if together == 1:
        return plan
    renamed = {SAMPLE: SAMPLES}
    if estimator is not None:
        settings = file_parameters(estimator) | dict(estimator.parameters)
        added: dict[str, Any] = estimator_settings(settings)
        if rate_hz >= FAST_HZ and "input.maximum_backlog" not in settings:
            backlog = min(LARGEST_BACKLOG, round(rate_hz * BACKLOG_S))
            added["input.maximum_backlog"] = backlog
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


def _rate_hz(settings: Mapping[str, Any]) -> float:
    """Return the samples a second that a rig could send in arrays; 0 where it sends each alone.

    Args:
        settings: parameters of the rig. What it will refuse itself counts as slow here.
    """
    if any(settings.get(name, usual) != usual for name, usual in _DEFAULTS.items()):
        return 0.0
    try:
        return float(load_scenario(str(settings.get("scenario", "multisine"))).rate_hz)
    except (ScenarioError, OSError):
        return 0.0
