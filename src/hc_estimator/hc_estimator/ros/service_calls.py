"""What the estimator node's services do: reset, tare, find the surface, save and load."""

from __future__ import annotations

from collections.abc import Callable

from hc_estimator import Estimator
from hc_estimator.ros.compilation import Compilation
from hc_estimator.ros.inputs import Input
from hc_estimator.ros.services import NotPossibleError, add_service
from hc_estimator.ros.state_keeper import StateKeeper, try_out
from hc_estimator.ros.zero_setting import ZeroSetting
from hc_estimator.stream.session import EstimationSession
from hc_estimator.stream.state_file import SavedState
from hc_estimator.stream.vocabulary import Cause
from hc_msgs_py.background import STARTING


class ServiceCalls:
    """The part of the node that answers its services; the rest of it makes what they need."""

    _session: EstimationSession | None
    _input: Input | None
    _wants_input: bool
    _cannot_listen: str
    _starts_by_itself: bool
    _compilation: Compilation
    _keeper: StateKeeper
    _zeros: ZeroSetting

    _new_estimator: Callable[[], Estimator]
    _take_settings: Callable[[SavedState], None]

    def _add_services(self) -> None:
        add_service(self, "reset", self._reset)
        add_service(self, "tare", self._start_tare)
        add_service(self, "find_surface", self._start_finding_surface)
        add_service(self, "save", lambda: self._keeper.save(self._active_session()))
        add_service(self, "load", self._load)

    def _active_session(self) -> EstimationSession:
        if self._session is None or not self._wants_input:
            raise NotPossibleError(self._inactive())
        if self._input is None:
            raise NotPossibleError(self._cannot_listen)
        return self._session

    def _inactive(self) -> str:
        """Say why there is no input."""
        if self._starts_by_itself:
            return f"{STARTING}{self._compilation.progress}"
        return self._cannot_listen or "the estimator is not active"

    def _reset(self) -> str:
        self._zeros.give_up("a reset came between")
        # A new estimator, so that settings that wait for a reset take effect.
        self._active_session().reset(Cause.RESET, self._new_estimator())
        return "started afresh"

    def _start_tare(self) -> str:
        self._active_session()
        return self._zeros.tare()

    def _start_finding_surface(self) -> str:
        self._active_session()
        return self._zeros.find_surface()

    def _load(self) -> str:
        session = self._active_session()
        state = self._keeper.load()
        try:
            try_out(state)
            self._take_settings(state)
            session.load(state.estimator, state.time_origin_ns)
        except ValueError as error:
            raise NotPossibleError(str(error)) from error
        if state.age_s < 0.0:
            return "goes on from a state saved before the clock was set back"
        return f"goes on from a state saved {state.age_s:.0f} s ago"
