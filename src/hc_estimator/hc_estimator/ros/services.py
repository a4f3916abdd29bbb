"""The node's services (std_srvs/Trigger: reset, tare, find_surface, save, load), the kept state.

Thin: each asks one thing of the node and answers with a line.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rclpy.node import Node
from std_srvs.srv import Trigger

from hc_estimator.online.session import EstimationSession
from hc_estimator.online.state_file import RUNNING, SAVED, SavedState, StateFolder


class NotPossibleError(Exception):
    """Why a service cannot do what it was asked for, in one line."""


def add_service(node: Node, name: str, act: Callable[[], str]) -> None:
    """Offer a Trigger service.

    Args:
        node: the node.
        name: name below the node, "reset" say.
        act: does it and returns what was done; may raise NotPossibleError.
    """

    def answer(_request: Any, response: Any) -> Any:
        try:
            response.message = act()
            response.success = True
        except NotPossibleError as error:
            response.message = str(error)
            response.success = False
        return response

    node.create_service(Trigger, f"~/{name}", answer)


class StateKeeper:
    """Saves and loads the state in the folder that the node was given, if it was given one."""

    def __init__(self, folder: str) -> None:
        """Use a folder; an empty name switches everything off.

        Raises:
            OSError: if the folder cannot be made.
        """
        self._folder = StateFolder(Path(folder)) if folder else None
        self._next_s = 0.0

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

    def keep(self, session: EstimationSession, now_s: float, period_s: float) -> None:
        """Keep the state for a restart, if it is time to.

        Raises:
            OSError: if it cannot be written.
        """
        if self._folder is None or period_s == 0.0 or session.time_origin_ns is None:
            return
        if now_s >= self._next_s:
            self._next_s = now_s + period_s
            self._folder.save(RUNNING, session)

    def kept(self, maximum_age_s: float) -> SavedState | None:
        """Return the state of a node that died a short time ago, or None.

        Raises:
            ValueError: if there is one that cannot be read.
            OSError: the same.
        """
        if self._folder is None or not self._folder.exists(RUNNING):
            return None
        state = self._folder.load(RUNNING)
        return state if state.age_s <= maximum_age_s else None

    def forget_kept(self) -> None:
        """Remove the kept state: the node ends as it should."""
        if self._folder is not None:
            self._folder.remove(RUNNING)

    def _given(self) -> StateFolder:
        if self._folder is None:
            raise NotPossibleError("no folder was given: set parameter state.folder at start")
        return self._folder
