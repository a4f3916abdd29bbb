"""The states that the node saves and loads, and the one that it keeps for a restart."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from rclpy.parameter import Parameter

from hc_estimator.estimator import create_estimator
from hc_estimator.ros.node_settings import CHOICE_NAMES
from hc_estimator.ros.services import NotPossibleError
from hc_estimator.stream.session import EstimationSession
from hc_estimator.stream.state_file import (
    ON_TRIAL,
    RUNNING,
    SAVED,
    SavedState,
    StateFolder,
    freeze,
)

TRIAL_STEPS = 100
"""Steps that a copy of the estimator makes with a state before the node itself goes on from it."""
TRIAL_SAMPLES = 20
"""Samples of the stream after which a kept state has shown that it does no harm."""


class StateKeeper:
    """Saves and loads the state in the folder that the node was given, if it was given one.

    What is kept for a restart is written in a thread, for the disk may take its time.
    """

    def __init__(self, folder: str, settings: Callable[[], Mapping[str, Any]] = dict) -> None:
        """Use a folder; an empty name switches everything off.

        Args:
            folder: its name.
            settings: returns those of the node that a state kept for a restart is to bring along.

        Raises:
            OSError: if the folder cannot be made.
        """
        self._folder = StateFolder(Path(folder)) if folder else None
        self._settings = settings
        self._writer = ThreadPoolExecutor(1, "state")
        self._writing: Future[Any] | None = None
        self._next_s = 0.0
        self._trial_samples = 0
        self.on_trial = False

    def save(self, session: EstimationSession) -> str:
        """Save because somebody asked.

        Raises:
            NotPossibleError: with the reason.
        """
        try:
            return f"saved to {self._given().save(SAVED, session)}"
        except (ValueError, OSError) as error:
            raise NotPossibleError(str(error)) from error

    def load(self) -> SavedState:
        """Read what `save` wrote.

        Raises:
            NotPossibleError: with the reason.
        """
        folder = self._given()
        if not folder.exists(SAVED):
            raise NotPossibleError("nothing was saved yet: call ~/save first")
        try:
            return folder.load(SAVED)
        except (ValueError, OSError) as error:
            raise NotPossibleError(str(error)) from error

    def resume(
        self,
        maximum_age_s: float,
        take_settings: Callable[[SavedState], None],
        warn: Callable[[str], Any],
    ) -> SavedState | None:
        """Return what a node that died a short time ago had learnt, its settings taken over.

        A broken state must not keep a node from starting again and again.

        Args:
            maximum_age_s: what is older is left alone, and what is of a time still to come: the
                clock was set back, and nobody knows how old it is.
            take_settings: gives the node the settings of a state; may raise NotPossibleError.
            warn: told of a state that is not gone on from.
        """
        try:
            aside = self.set_aside()
            if aside is not None:
                warn(f"a state that ended a node that went on from it is now {aside}")
            kept = self.kept(maximum_age_s)
            if kept is not None:
                take_settings(kept)
            return kept
        except (NotPossibleError, ValueError, OSError) as error:
            warn(f"the kept state is not gone on from: {error}")
            self.set_aside()
            return None

    def keep(self, session: EstimationSession, now_s: float, period_s: float) -> None:
        """Keep the state for a restart, if it is time to.

        Raises:
            OSError: if it could not be written the last time.
        """
        if self._folder is None or period_s == 0.0 or session.time_origin_ns is None:
            return
        if self.on_trial or now_s < self._next_s:
            return
        if self._writing is not None:
            if not self._writing.done():
                return
            done, self._writing = self._writing, None
            done.result()
        self._next_s = now_s + period_s
        frozen = freeze(session, self._settings())
        self._writing = self._writer.submit(self._folder.write_frozen, RUNNING, frozen)

    def keep_last(self, session: EstimationSession | None, period_s: float) -> None:
        """Keep the state once more: the node ends in good order, and may be started again.

        A state on trial has done no harm so far and stays as it is.

        Raises:
            OSError: if it cannot be written; an older one is as it was.
        """
        if self._folder is None or period_s == 0.0:
            return
        self.finish()
        if self.on_trial:
            self.on_trial = False
            self._folder.end_trial()
        elif session is not None and session.time_origin_ns is not None:
            self._folder.write_frozen(RUNNING, freeze(session, self._settings()))

    def hasten(self) -> None:
        """Keep the state at the next opportunity: a revision that was told must not come twice."""
        self._next_s = 0.0

    # The state of a node that died.

    def set_aside(self) -> Path | None:
        """Set aside a state that a node went on from and did not survive.

        Returns:
            Where it is now; None if there is no such state.

        Raises:
            OSError: if it cannot be moved.
        """
        if self._folder is None:
            return None
        if self._folder.exists(RUNNING):  # written since, by a node that survived it
            self._folder.remove(ON_TRIAL)
        return self._folder.set_aside()

    def kept(self, maximum_age_s: float) -> SavedState | None:
        """Return the state of a node that died a short time ago, or None; it is on trial now.

        Raises:
            ValueError: if there is one that cannot be read, or with which an estimator cannot work.
            OSError: the same.
        """
        if self._folder is None or not self._folder.exists(RUNNING):
            return None
        self._folder.begin_trial()
        state = self._folder.load(ON_TRIAL)
        if not 0.0 <= state.age_s <= maximum_age_s:
            self._folder.remove(ON_TRIAL)
            return None
        try_out(state)
        return state

    def wait_for_samples(self) -> None:
        """The kept state was taken over; the trial goes on when the first sample comes."""
        if self._folder is not None:
            self._folder.end_trial()
            self.on_trial = True
            self._trial_samples = 0

    def on_sample(self) -> None:
        """Hear, while a state is on trial, that a sample is about to be used."""
        assert self._folder is not None
        self._trial_samples += 1
        try:
            if self._trial_samples == 1:
                self._folder.begin_trial()
            elif self._trial_samples > TRIAL_SAMPLES:
                self.on_trial = False
                self._folder.end_trial()
        except OSError:  # somebody took the file away: there is nothing to try
            self.on_trial = False

    def forget_kept(self) -> None:
        """Remove the kept state: the node ends as it should.

        Raises:
            OSError: if it cannot be removed.
        """
        if self._folder is None:
            return
        self.finish()
        self._folder.remove(RUNNING)
        self._folder.remove(ON_TRIAL)
        self.on_trial = False

    def finish(self) -> None:
        """Wait for what is being written."""
        if self._writing is not None:
            self._writing.exception()
            self._writing = None

    def _given(self) -> StateFolder:
        if self._folder is None:
            raise NotPossibleError(
                "no folder was given to keep states in: start with the parameter state.folder "
                "(hc run --param state.folder=DIR)"
            )
        return self._folder


def try_out(state: SavedState) -> None:
    """Let a copy of the estimator make some steps with a state.

    Raises:
        ValueError: if the state is damaged.
    """
    kept = state.estimator
    estimator = create_estimator(
        kept["filter"],
        state_space=kept["state_space"],
        contact_model=kept["contact_model"],
        **kept["configuration"],
    )
    estimator.restore(kept)
    known = estimator.step(float("nan"), 0.0, 0.0)  # is refused, and answers what is known
    memory = kept["memory"]
    time_s = float(memory.get("clock", memory)["last_time"])  # a bank has its clock apart
    for _ in range(TRIAL_STEPS):
        time_s += 1e-3
        estimator.step(time_s, known.displacement, known.force_reconstructed)


def parameters_of(state: SavedState) -> list[Parameter]:
    """Return the parameters of the node with which a state was saved."""
    wanted = {name: state.estimator[name] for name in CHOICE_NAMES}
    wanted |= state.estimator["configuration"] | state.settings
    return [Parameter(name, value=value) for name, value in wanted.items()]
