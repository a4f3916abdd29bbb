"""What the panel shows of a run, as plain data, and what is wrong with it, in words."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from hc_bringup.silence import is_silent
from hc_bringup.terminal.keys import CHOICES

NO_SAMPLES: Final = "no samples come"
BEYOND_REASON_MM: Final = 50.0
"""A tool is never so deep in soft tissue: the contact position was never set."""
HISTORY: Final = 160
HYPOTHESES: Final = (
    "constant",
    "constant, fitted",
    "stiffness trend",
    "all drift",
    "changed",
    "surface moves",
)


@dataclass
class PanelHistory:
    """What the sparklines are made of: a value for each drawing, the oldest first."""

    parameters: tuple[deque[float], ...] = field(
        default_factory=lambda: tuple(deque(maxlen=HISTORY) for _ in range(4))
    )
    force: deque[float] = field(default_factory=lambda: deque(maxlen=HISTORY))
    depth: deque[float] = field(default_factory=lambda: deque(maxlen=HISTORY))


@dataclass(frozen=True)
class PanelView:
    """What the panel shows; NaN or empty where nothing is known.

    Attributes:
        phase: what the run does.
        elapsed_s: since the source was started.
        duration_s: how long it shall last; 0 for no end.
        with_estimates: whether they are heard here; if not, nothing of them is shown.
        rate_hz: estimates a second.
        silent_s: since the last estimate; NaN before the first one.
        silent_reason: what the estimator says of that.
        lost: samples lost, in words.
        refused: samples refused.
        latency_s: median and 99 % of the latency; None in a replay.
        parameters: K, B, n, p.
        deviations: their standard deviations.
        known: how much the data said about each.
        truth: the true ones; None where nobody knows.
        force_n: measured.
        depth_mm: filtered.
        force_error_n: one step ahead, RMS over the last thousand samples in contact.
        contact: whether the tool touches; None before the first estimate.
        mismatch: whether the law does not fit.
        explanation: why, as far as that can be told.
        hypothesis: number of the one that leads; None where there is no estimate.
        several_hypotheses: whether there is more than one.
        changes: of the tissue.
        filter: name.
        scenario: of the rig; empty without one.
        bag: name of the bag; empty without one.
        bag_bytes: size.
        bag_dropped: messages lost on the way to it.
        processor: use of each node, in percent of a core.
        problems: what nodes call an error, by name.
        suspicions: what the estimator doubts of its readings, in sentences.
        respawns: nodes started again.
        answer: what became of the last key.
        others: what further estimators of the run say, one line each.
        keys: name and meaning of each.
        keys_for: which of the estimators they are for, from 0.
        estimators: names of those of the run.
        history: for the sparklines.
    """

    phase: str
    elapsed_s: float = 0.0
    duration_s: float = 0.0
    with_estimates: bool = True
    rate_hz: float = 0.0
    silent_s: float = math.nan
    silent_reason: str = ""
    lost: str = "0"
    refused: int = 0
    latency_s: tuple[float, float] | None = None
    parameters: Sequence[float] = (math.nan,) * 4
    deviations: Sequence[float] = (math.nan,) * 4
    known: Sequence[float] = (math.nan,) * 4
    truth: Sequence[float] | None = None
    force_n: float = math.nan
    depth_mm: float = math.nan
    force_error_n: float = math.nan
    contact: bool | None = None
    mismatch: bool = False
    explanation: str = ""
    hypothesis: int | None = None
    several_hypotheses: bool = False
    changes: int = 0
    filter: str = ""
    scenario: str = ""
    bag: str = ""
    bag_bytes: float = math.nan
    bag_dropped: int = 0
    processor: Mapping[str, float] = field(default_factory=dict)
    problems: Mapping[str, str] = field(default_factory=dict)
    suspicions: tuple[str, ...] = ()
    respawns: int = 0
    answer: str = ""
    others: tuple[str, ...] = ()
    keys: Sequence[tuple[str, str]] = ()
    keys_for: int = 0
    estimators: Sequence[str] = ()
    history: PanelHistory = field(default_factory=PanelHistory)

    @property
    def silent(self) -> bool:
        """Whether estimates came and come no more, or came no more when the run was ended."""
        return is_silent(self.silent_s)

    @property
    def waits(self) -> bool:
        """Whether the run goes on and no estimate has come yet."""
        return self.phase == "running" and self.contact is None and is_silent(self.elapsed_s)

    def state(self) -> tuple[str, str]:
        """Return the state in a few words, and how good it is: good, idle, warn or bad."""
        if not self.with_estimates:
            return f"{self.phase}, estimates go to the subscribers", "idle"
        if self.silent:
            reason = self.silent_reason or NO_SAMPLES
            return f"silent for {self.silent_s:.1f} s: {reason}", "bad"
        if self.waits:
            reason = self.silent_reason or "does anybody publish samples?"
            return f"no estimate yet: {reason}", "bad"
        if self.contact is None:
            return self.phase, "idle"
        if self.mismatch and self.contact:
            return "in contact, but the law does not fit", "warn"
        return ("in contact", "good") if self.contact else ("in the air", "idle")

    def choice(self) -> str:
        """Say which of several estimators the keys are for, and how to choose another one."""
        if len(self.estimators) < 2 or not self.keys:
            return ""
        there = enumerate(zip(CHOICES, self.estimators, strict=False))
        others = [f"[{key}] {name}" for i, (key, name) in there if i != self.keys_for]
        chosen = self.estimators[self.keys_for]
        return f"the keys are for {chosen}; for another one: {', '.join(others)}"

    def warnings(self) -> list[str]:
        """Return what the user should do something about, a line each."""
        lines = [f"{name}: {problem}" for name, problem in self.problems.items()]
        lines += self.suspicions
        if self.mismatch and self.contact and not self.silent and self.explanation:
            lines.append(f"the law does not fit: {self.explanation}")
        if abs(self.depth_mm) > BEYOND_REASON_MM:
            lines.append(
                f"depth {self.depth_mm:.0f} mm is beyond reason: was nothing tared? "
                "Lift the tool just off the surface and press t"
            )
        if self.bag_dropped:
            lines.append(f"{self.bag_dropped} messages did not get into the bag")
        if self.respawns:
            lines.append(f"nodes that died and were started again: {self.respawns}")
        return lines
