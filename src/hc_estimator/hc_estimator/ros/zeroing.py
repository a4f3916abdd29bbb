"""Force zero and contact position from the samples: what ~/tare and ~/find_surface set going."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from rclpy.parameter import Parameter

from hc_estimator.ros.services import NotPossibleError
from hc_estimator.stream import dry_friction, frame_compliance
from hc_estimator.stream.press_watch import PressWatch
from hc_estimator.stream.surface import SurfaceFinder
from hc_estimator.stream.taken_off import FORCE_ZERO, POSITION_ZERO
from hc_estimator.stream.tare import Tare, TareResult

TARE, FIND_SURFACE = "tare", "find_surface"
ZEROS = (FORCE_ZERO, POSITION_ZERO)
TAKEN_OFF_ALWAYS = (*ZEROS, frame_compliance.SETTING.name)
TAKEN_OFF = (*TAKEN_OFF_ALWAYS, *(setting.name for setting in dry_friction.SETTINGS))
"""What is taken off the readings of a sample, and is recorded with the configuration; friction
where there is one."""
FORCED = "tare.force: true, or --force of the command, takes them all the same"
PATIENCE_S = 10.0
"""A tare that has got no sample for so long is given up: slow ones take what they take."""


class Refusal(NamedTuple):
    """Why no zeros were taken."""

    reason: str


class Zeroing:
    """Collects samples while a tare or a search for the surface is under way.

    Attributes:
        watch: knows whether the tool presses; to be given every sample.
        latest: name of the service that samples were wanted for last.
    """

    def __init__(self) -> None:
        self.watch = PressWatch()
        self._collector: Tare | SurfaceFinder | None = None
        self.latest = ""
        self._forced = self._pressed = False
        self._count = 0  # samples of a tare when it was looked at last
        self._deadline_s = 0.0

    @property
    def active(self) -> bool:
        """Whether samples are wanted."""
        return self._collector is not None

    def tare(self, samples: int, now_s: float, *, forced: bool) -> str:
        """Take the means of the next samples; returns what to tell the user.

        Raises:
            NotPossibleError: if the tool presses, unless it is forced.
        """
        if self._joins(TARE, forced):
            return "a tare is under way already; hc/events says when it is done"
        if pressing := "" if forced else self.watch.pressing:
            raise NotPossibleError(f"{pressing}: lift it free of contact first ({FORCED})")
        self._begin(TARE, forced)
        self._collector = Tare(samples)
        self._count, self._deadline_s = 0, now_s + PATIENCE_S
        return f"takes the mean of the next {samples} samples; hc/events says when it is done"

    def find_surface(self, *, forced: bool, least_noise_n: float = 0.0) -> str:
        """Find the surface in the next approach; returns what to tell the user.

        Args:
            forced: begin now, although the tool presses; else that waits until it was lifted.
            least_noise_n: error in motion of a force that is calculated, not measured [N].
        """
        if self._joins(FIND_SURFACE, forced):
            return "looks for the surface already: press; hc/events says where it was"
        pressing = "" if forced else self.watch.pressing
        self._begin(FIND_SURFACE, forced)
        self._pressed = bool(pressing)
        self._collector = SurfaceFinder(least_noise_n)
        if pressing:
            return (
                f"{pressing}: lift it free of contact, and press again; hc/events says where the "
                "surface was"
            )
        return "press from free motion into the tissue; hc/events says where the surface was"

    def cancel(self) -> str:
        """Want no more samples; returns which service had wanted some, or nothing."""
        active = self.under_way
        self._collector = None
        return active

    @property
    def under_way(self) -> str:
        """The service for which samples are taken; nothing if none is."""
        return self.latest if self.active else ""

    @property
    def waits_for_lift(self) -> bool:
        """Whether a search for the surface waits until the tool presses no more."""
        return self.active and self._pressed

    @property
    def feels(self) -> str:
        """What the service under way feels, in words; nothing if none is."""
        if self.waits_for_lift and (pressing := self.watch.pressing):
            return f"{pressing}: lift it free of contact"
        return "" if self._collector is None else self._collector.feels

    def add(self, displacement_mm: float, force_n: float) -> TareResult | Refusal | None:
        """Take in a sample; return what came of it with the last one that was wanted."""
        collector = self._collector
        assert collector is not None
        if self._pressed and self.watch.pressing:
            return None
        self._pressed = False
        found = collector.add(displacement_mm, force_n)
        if found is None:
            return None
        self._collector = None
        if isinstance(collector, Tare) and not self._forced and collector.unrest:
            return Refusal(f"{collector.unrest}; let it rest free of contact ({FORCED})")
        return found

    def overdue(self, now_s: float) -> str:
        """Give up a tare that does not get its samples; returns why, or nothing."""
        collector = self._collector
        if not isinstance(collector, Tare):
            return ""
        if collector.count > self._count:
            self._count, self._deadline_s = collector.count, now_s + PATIENCE_S
        if now_s < self._deadline_s:
            return ""
        self._collector = None
        return (
            f"only {collector.count} of {collector.wanted} samples came, and none for "
            f"{PATIENCE_S:g} s"
        )

    def _joins(self, name: str, forced: bool) -> bool:
        """Whether a request joins one of its kind; else it is to begin.

        A second client must not make the first one wait anew.
        """
        if self.under_way == name:
            self._forced = self._forced or forced
            self._pressed = self._pressed and not forced
            return True
        return False

    def _begin(self, name: str, forced: bool) -> None:
        self._forced, self.latest, self._pressed = forced, name, False

    @staticmethod
    def parameters(found: TareResult, values: Mapping[str, Any]) -> list[Parameter]:
        """Return the node's parameters with the new zeros.

        Args:
            found: in readings that came with the present zeros taken off.
            values: the present parameters.
        """
        # The force that is none from now on gave way to nothing, though it was taken off as if.
        moved_mm = values[frame_compliance.SETTING.name] * found.force_n
        means = (found.force_n, found.displacement_mm + moved_mm)
        return [
            Parameter(name, value=values[name] + mean)
            for name, mean in zip(ZEROS, means, strict=True)
        ]

    @staticmethod
    def describe(found: TareResult, zeros: list[Parameter]) -> str:
        """Return a line for the event."""
        return (
            f"force zero {zeros[0].value:.6g} N (deviation {found.force_std_n:.2g} N), contact at "
            f"{zeros[1].value:.6g} mm (deviation {found.displacement_std_mm:.2g} mm)"
        )
