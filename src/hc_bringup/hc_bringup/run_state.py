"""The state of a run: what its display shows while it goes on, and what a summary is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from hc_bringup.silence import is_silent
from hc_bringup.statistics import EstimateStatistics
from hc_estimator.stream.readings import SUSPECT
from hc_msgs_py.diagnostics import Level, number_said
from hc_msgs_py.topics import NODE_ESTIMATOR

RUNNING, DONE = "running", "done"
"""Phases of a run in which it waits for nobody."""
MUTE_S = 1.5
"""A node tells of itself once a second: one that has not for so long is stopped, or cannot."""
MUTE = "the estimator says nothing: it is stopped (Ctrl-Z?), or the machine is too busy"
_UNHEARD = (int(Level.ERROR), int(Level.STALE))
_LEFT_OUT = {"skipped": "skipped", "alone": "pairing_unpaired"}
"""Reasons, and the estimator's counters in /diagnostics."""


@dataclass
class RunState:
    """What the live display shows, and what a summary is made of.

    Attributes:
        phase: what the run is doing now, in words.
        elapsed_s: time since the source was started.
        duration_s: how long it shall last; 0 for no end.
        cpu_percent: processor use of each node since the source was started, in percent of a core.
        silent_s: time since the last estimate, as it was when the run was ended; NaN before the
            first one, and where the source ended by itself.
        mute_s: time since the estimator said anything of itself, as it was when the run was ended;
            NaN before it has.
        samples: how many samples the source says that it has published; None if it did not say.
        messages: how many messages the source says that it has published; None if it did not say.
        revived: how each node ended that was started again, a line each.
        problems: what nodes call an error in their diagnostics now, by name.
        failures: what makes the run a failure although it went on to its end.
        diagnostics: what each node said last of itself, by name.
        dropped: messages that the recorder did not get, by the bag that it said it made.
        truth: the rig's true K, B, n, p; None where nobody tells, or nobody asked for it.
        page: address of the live page with its token, once it is served.
        requests: what was asked for by keys, and of which estimator; the runner takes them out.
        answer: what became of the last of them.
        pids: process of each node that runs, by name.
        estimator: the node whose estimates these are, with its namespace.
        others: the same of further estimators of the run, in the order of its plan.
        estimating: whether the run has an estimator of its own.
    """

    statistics: EstimateStatistics
    duration_s: float
    phase: str = "starting"
    elapsed_s: float = 0.0
    cpu_percent: dict[str, float] = field(default_factory=dict)
    silent_s: float = math.nan
    mute_s: float = math.nan
    samples: int | None = None
    messages: int | None = None
    respawns: int = 0
    revived: list[str] = field(default_factory=list)
    problems: dict[str, str] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    diagnostics: dict[str, dict[str, str]] = field(default_factory=dict)
    dropped: dict[str, int] = field(default_factory=dict)
    truth: list[float] | None = None
    page: str = ""
    requests: list[tuple[str, str]] = field(default_factory=list)
    answer: str = ""
    pids: dict[str, int] = field(default_factory=dict)
    estimator: str = NODE_ESTIMATOR
    others: list[RunState] = field(default_factory=list)
    estimating: bool = True

    def add_other(self, estimator: str, statistics: EstimateStatistics) -> None:
        """Let the run have one more estimator; what the nodes say is common to all.

        Args:
            estimator: its name, with its namespace.
            statistics: of its estimates.
        """
        self.others.append(
            RunState(
                statistics,
                self.duration_s,
                problems=self.problems,
                diagnostics=self.diagnostics,
                estimator=estimator,
            )
        )

    def after_the_source(self, said: dict[str, str]) -> dict[str, str]:
        """Return what nodes call an error when the source has ended.

        Of an estimator that is nothing new: it says then that no sample comes.

        Args:
            said: what they call so now, by name.
        """
        known = self.problems.keys() | (said.keys() - set(self.estimators))
        return {name: problem for name, problem in said.items() if name in known}

    @property
    def estimators(self) -> list[str]:
        """Names of all estimators, in the order of the plan."""
        return [self.estimator, *(other.estimator for other in self.others)]

    @property
    def silent(self) -> bool:
        """Whether estimates came and come no more, or came no more when the run was ended."""
        return is_silent(self.silent_s)

    @property
    def suspicions(self) -> dict[str, str]:
        """What the estimator doubts of its readings: a sentence by check and channel."""
        said = self.diagnostics.get(self.estimator, {})
        return {
            name.removeprefix(SUSPECT): sentence
            for name, sentence in said.items()
            if name.startswith(SUSPECT)
        }

    @property
    def left_out(self) -> dict[str, int]:
        """Samples that the estimator left out, by the reason that its counters name."""
        said = self.diagnostics.get(self.estimator, {})
        counts = {name: int(number_said(said, key)) for name, key in _LEFT_OUT.items()}
        return {name: count for name, count in counts.items() if count}

    @property
    def unseen(self) -> int:
        """Estimates that were made and did not come here: the terminal stood still, or the machine.

        By what the estimator said last; it counts anew when it is started again.
        """
        made = int(number_said(self.diagnostics.get(self.estimator, {}), "estimates"))
        heard = self.statistics.estimates
        return max(0, made - heard) if heard else 0  # or somebody else hears them

    @property
    def silent_reason(self) -> str:
        """What the estimator says of its silence; empty as long as it says nothing.

        Before the first estimate a warning of it is about nothing else.
        """
        if self.silent and self.mute_s > MUTE_S:
            return MUTE
        said = self.diagnostics.get(self.estimator, {})
        level = int(said.get("level", 0))
        waits = not self.statistics.estimates and level == int(Level.WARN)
        return said.get("message", "") if waits or level in _UNHEARD else ""
