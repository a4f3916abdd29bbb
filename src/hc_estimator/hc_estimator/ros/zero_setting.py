"""~/tare and ~/find_surface: zeros are taken from the samples and become parameters."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.parameter import Parameter

from hc_estimator.ros.inputs import Input
from hc_estimator.ros.settings import Settings
from hc_estimator.ros.settings_meaning import effort_settings
from hc_estimator.ros.zeroing import FIND_SURFACE, ZEROS, Refusal, Zeroing
from hc_estimator.stream.effort_filters import error_in_motion
from hc_estimator.stream.normal_finder import FAIR_DEG, POOR_DEG, Normal, NormalFinder
from hc_estimator.stream.session import EstimationSession
from hc_estimator.stream.tare import TareResult
from hc_estimator.stream.together import Together
from hc_estimator.stream.vocabulary import CONTACT_POSITION_STD, EventKind


class ZeroSetting:
    """Watches the samples of the node, and sets its zeros when somebody has asked for it."""

    def __init__(
        self,
        node: Node,
        settings: Settings,
        session: Callable[[], EstimationSession | None],
        source: Callable[[], Input | None],
    ) -> None:
        """Prepare; nothing is looked for.

        Args:
            node: has the parameters.
            settings: their values.
            session: returns the session of now, which reports what happened.
            source: returns the input of now.
        """
        self._node, self._settings = node, settings
        self._session, self._source = session, source
        self._zeroing = Zeroing()
        self._together = Together()

    @property
    def active(self) -> bool:
        """Whether zeros are looked for."""
        return self._zeroing.active

    @property
    def feels(self) -> str:
        """What is felt meanwhile, in words; nothing if none are looked for."""
        return self._zeroing.feels

    def tare(self) -> str:
        """Begin a tare; returns what to tell the user.

        Raises:
            NotPossibleError: with the reason.
        """
        values = self._settings.values
        before = self._zeroing.under_way
        answer_text = self._zeroing.tare(
            values["tare.samples"], time.monotonic(), forced=values["tare.force"]
        )
        self._tell_superseded(before)
        return answer_text

    def find_surface(self) -> str:
        """Begin to look for the surface, once the tool presses no more; returns what to tell."""
        values = self._settings.values
        least_n = 0.0
        if values["input.source"] == "effort":
            least_n = error_in_motion(effort_settings(values))
        before = self._zeroing.under_way
        answer_text = self._zeroing.find_surface(forced=values["tare.force"], least_noise_n=least_n)
        self._tell_superseded(before)
        joined = before == FIND_SURFACE  # the search goes on, with what it has seen
        if not (joined or self._zeroing.waits_for_lift):
            self._begin_finder()
        return answer_text

    def _begin_finder(self) -> None:
        """Look for the normal as well, where it is to be found."""
        values, source = self._settings.values, self._source()
        wanted = values["input.contact.frame"], values["input.contact.normal_from"]
        if source is not None and wanted == ("surface", "find_surface"):
            source.normal_finder = NormalFinder()

    def add(self, stamp_ns: int, displacement_mm: float, force_n: float) -> None:
        """Take in a sample, and set the zeros with the last one that was wanted.

        A force without a displacement at its stamp counts once there is one after it.
        """
        for displacement, force in self._together.add(stamp_ns, displacement_mm, force_n):
            self._zeroing.watch.add(displacement, force)
            if not self._zeroing.active:
                continue
            waited = self._zeroing.waits_for_lift
            outcome = self._zeroing.add(displacement, force)
            if waited and not self._zeroing.waits_for_lift:
                self._begin_finder()
            if isinstance(outcome, Refusal):
                self._report(EventKind.TARE_REFUSED, outcome.reason)
            elif outcome is not None:
                self._take(outcome)
                return  # the rest was read with the zeros of before

    def look(self) -> None:
        """Give up a tare that does not get its samples."""
        overdue = self._zeroing.overdue(time.monotonic())
        if overdue:
            self._report(EventKind.TARE_REFUSED, overdue)

    def give_up(self, reason: str) -> None:
        """Look for nothing any more, and say why if something was looked for."""
        given_up = self._zeroing.cancel()
        if given_up:
            self._end_of_finder()
            self._report(EventKind.TARE_REFUSED, f"{given_up} given up: {reason}")

    def _tell_superseded(self, before: str) -> None:
        """Say that what was under way gave way to another service."""
        now = self._zeroing.under_way
        if before and before != now:
            self._end_of_finder()
            self._report(EventKind.TARE_REFUSED, f"{before} given up: {now} was asked for")

    def forget(self) -> None:
        """Forget the samples: a sensor is read otherwise."""
        self._zeroing.watch.forget()
        self._together.forget()

    def _report(self, kind: EventKind, reason: str) -> None:
        session = self._session()
        if session is not None:
            session.report(kind, reason)

    def _take(self, found: TareResult) -> None:
        """Subtract what was found from now on, and start afresh.

        Args:
            found: the zeros, in readings that came with the present ones taken off.
        """
        zeros = self._zeroing.parameters(found, self._settings.values)
        also: list[Parameter] = []
        about_normal = ""
        finder = self._end_of_finder()
        if finder is not None:
            normal = finder.normal(found.force_n, found.force_std_n)
            tip = finder.tip_at(found.displacement_mm)
            if normal is None or normal.is_poor or tip is None:
                self._report(EventKind.TARE_REFUSED, _doubt(normal))
                return
            sign = float(self._settings.values["input.force.sign"])
            x, y, z = normal.direction
            normal = normal._replace(direction=(sign * x, sign * y, sign * z))
            about_normal = _describe(normal)
            also = [
                Parameter("input.contact.normal", value=list(normal.direction)),
                Parameter("input.contact.point", value=list(tip)),
            ]
            # The force is read along the new normal from now on: what it is free of contact there.
            # The surface's point takes the place of the position's zero.
            newtons = float(self._settings.values["input.force.scale"]) * normal.free_n
            zeros = [Parameter(ZEROS[0], value=newtons), Parameter(ZEROS[1], value=0.0)]
        known = self._contact_position_std(found)
        answer = self._node.set_parameters_atomically([*zeros, *also, *known])
        if answer.successful:
            self._report(EventKind.TARED, self._zeroing.describe(found, zeros) + about_normal)
        else:
            self._report(EventKind.TARE_REFUSED, answer.reason)

    def _end_of_finder(self) -> NormalFinder | None:
        """Return who looked for the normal, if the surface was looked for."""
        source = self._source()
        if source is None:
            return None
        finder, source.normal_finder = source.normal_finder, None
        return finder if self._zeroing.latest == FIND_SURFACE else None

    def _contact_position_std(self, found: TareResult) -> list[Parameter]:
        """Return how well the surface was found, for a filter that considers it."""
        considered = CONTACT_POSITION_STD in self._settings.estimator_values()
        if self._zeroing.latest != FIND_SURFACE or not considered:
            return []
        return [Parameter(CONTACT_POSITION_STD, value=found.displacement_std_mm)]


def _describe(normal: Normal) -> str:
    """Return what the event says of a normal."""
    x, y, z = normal.direction
    known = f"known to {normal.deviation_deg:.2g} degrees"
    if normal.deviation_deg > FAIR_DEG:
        known += ", which is poor: press deeper, straight on, and without turning the tool"
    return f", normal ({x:.3f}, {y:.3f}, {z:.3f}) {known}"


def _doubt(normal: Normal | None) -> str:
    """Return why a normal is not used, and what to do."""
    if normal is None or not normal.is_poor:
        return (
            "no zeros taken: the forces do not show where the tissue pushes from, or the search "
            "began inside of it; press from free motion, and deeper"
        )
    return (
        f"no zeros taken: the normal would be known to {normal.deviation_deg:.2g} degrees only "
        f"({POOR_DEG:g} at most); press deeper, straight on, and without turning the tool"
    )
