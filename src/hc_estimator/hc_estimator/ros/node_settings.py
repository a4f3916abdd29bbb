"""Settings of the node itself, as a table: how it takes its input, watches it and reports."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from hc_estimator.online.session import SessionSettings

CHOICE_NAMES = ("filter", "state_space", "contact_model")


@dataclasses.dataclass(frozen=True)
class NodeSetting:
    """One setting of the node; its type is that of the default."""

    name: str
    default: Any
    description: str
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    unit: str = ""
    read_only: bool = False

    def check(self, value: Any) -> None:
        """Refuse a word that is no choice and a number that is not finite or out of range.

        Raises:
            ValueError: names the parameter, its value and what is allowed.
        """
        if self.choices and value not in self.choices:
            raise ValueError(
                f"parameter {self.name} = {value!r} is not one of {', '.join(self.choices)}"
            )
        if isinstance(self.default, (int, float)) and not isinstance(self.default, bool):
            low = -math.inf if self.minimum is None else self.minimum
            high = math.inf if self.maximum is None else self.maximum
            if not (math.isfinite(value) and low <= value <= high):
                unit = f" {self.unit}" if self.unit else ""
                raise ValueError(
                    f"parameter {self.name} = {value!r} is not a number from {low:g} to "
                    f"{high:g}{unit}"
                )


def _table(*settings: NodeSetting) -> dict[str, NodeSetting]:
    return {s.name: s for s in settings}


NODE_SETTINGS = _table(
    NodeSetting(
        "carry_over",
        True,
        "A change of filter, state_space or contact_model keeps the parameters and their "
        "covariance; false starts afresh.",
    ),
    NodeSetting(
        "input.silence_timeout",
        SessionSettings.silence_timeout_s,
        "Without a sample for so long the input counts as silent.",
        minimum=0.01,
        maximum=3600.0,
        unit="s",
    ),
    NodeSetting(
        "input.maximum_gap",
        SessionSettings.maximum_gap_s,
        "Stamps further ahead than this are a time jump and start the estimator afresh.",
        minimum=0.01,
        maximum=1e6,
        unit="s",
    ),
    NodeSetting(
        "input.maximum_backlog",
        1000,
        "When more samples wait, the node skips to the latest ones and counts the skipped.",
        minimum=1,
        maximum=2000,
        unit="samples",
    ),
    NodeSetting(
        "input.rejection_burst",
        SessionSettings.rejection_burst,
        "So many samples refused in a row are an event and a warning.",
        minimum=1,
        maximum=1000000,
        unit="samples",
    ),
    NodeSetting(
        "input.frozen_samples",
        SessionSettings.frozen_samples,
        "So many equal readings in a row are an event and a warning.",
        minimum=2,
        maximum=1000000,
        unit="samples",
    ),
    NodeSetting(
        "contact.minimum_duration",
        SessionSettings.contact_minimum_s,
        "Shorter touches are not reported.",
        minimum=0.0,
        maximum=3600.0,
        unit="s",
    ),
    NodeSetting(
        "contact.release_time",
        SessionSettings.contact_release_s,
        "The tool must be away so long for a contact to be over.",
        minimum=0.0,
        maximum=3600.0,
        unit="s",
    ),
    NodeSetting(
        "expected_sample_publishers",
        1,
        "Publishers of the input that ~/ready waits for.",
        minimum=0,
        maximum=1000,
    ),
    NodeSetting(
        "expected_estimate_subscribers",
        0,
        "Subscribers of hc/estimate that ~/ready waits for.",
        minimum=0,
        maximum=1000,
    ),
    NodeSetting(
        "autostart",
        True,
        "Configure and activate at start; false leaves both to a lifecycle manager.",
        read_only=True,
    ),
)


def check_together(values: Mapping[str, Any]) -> None:
    """Refuse settings that are each allowed but not together.

    Raises:
        ValueError: names the settings and what is allowed.
    """
    if values["input.maximum_gap"] <= values["input.silence_timeout"]:
        raise ValueError(
            f"parameter input.maximum_gap = {values['input.maximum_gap']!r} must be larger than "
            f"input.silence_timeout = {values['input.silence_timeout']!r}"
        )


def session_settings(values: Mapping[str, Any]) -> SessionSettings:
    """Return the session's part of the settings."""
    return SessionSettings(
        silence_timeout_s=values["input.silence_timeout"],
        maximum_gap_s=values["input.maximum_gap"],
        rejection_burst=values["input.rejection_burst"],
        frozen_samples=values["input.frozen_samples"],
        contact_minimum_s=values["contact.minimum_duration"],
        contact_release_s=values["contact.release_time"],
    )
