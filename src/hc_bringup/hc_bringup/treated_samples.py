"""A recording under treatment: its samples as far as they were put right, and what they give."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_bringup.force_error import settled
from hc_bringup.robot_mechanics import MOTION
from hc_bringup.terminal.numbers import rounded
from hc_estimator import Rejection, create_estimator
from hc_estimator.kinds import DEFAULT_FILTER
from hc_estimator.stream.arrival_clock import ARRIVAL
from hc_estimator.stream.arrival_stamps import find_even_times
from hc_estimator.stream.dry_friction import DryFriction
from hc_estimator.stream.friction_checks import CLEAR, find_friction, find_presliding
from hc_estimator.stream.in_pieces import run_in_pieces
from hc_estimator.stream.readings import Check, Suspicion, robust_range, usable, whole
from hc_estimator.stream.repeats import once_each
from hc_estimator.stream.sensor_setup import SURFACE_SHARE
from hc_estimator.stream.together import of_two_readings, together
from hc_estimator.stream.tool_motion import ToolMotion
from hc_estimator.stream.tool_motion_checks import FoundMotion, find_tool_motion
from hc_evaluation.clock_rates import ClockRates
from hc_evaluation.play import behind_play
from hc_msgs_py.units import NANOSECONDS

FloatArray = NDArray[np.float64]
OF_MOTION = dict(zip((Check.INERTIA, Check.DAMPING), MOTION, strict=True))
"""What takes off what moving the tool takes."""
FORCE_LIMIT = "force_limit"
"""The estimator's setting beyond which a force is refused [N]."""


@dataclass(frozen=True)
class Estimated:
    """What the estimator made of a recording.

    Attributes:
        parameters: K, B, n, p, shape (4,).
        deviations: their standard deviations, shape (4,).
        covariance: shape (4, 4).
        identifiability: how much of each is known from the data, shape (4,).
        force_noise_std: deviation of the force from the law [N].
        mismatch: share of the samples in which the law did not fit.
        rejected: refused samples by reason.
        nis: mean normalised innovation squared of what is settled, ideally 2.
        delay_s: by how much the force is late in the end [s].
        delay_std_s: its standard deviation [s].
        changed_s: when a change of the tissue was detected [s].
    """

    parameters: FloatArray
    deviations: FloatArray
    covariance: FloatArray
    identifiability: FloatArray
    force_noise_std: float
    mismatch: float
    rejected: dict[str, int]
    nis: float
    delay_s: float
    delay_std_s: float
    changed_s: tuple[float, ...] = ()


@dataclass
class Samples:
    """A recording under treatment, and the settings that it has got so far.

    Attributes:
        time_s: stamps [s].
        displacement_mm: penetration [mm], as far as it was put right.
        force_n: contact force [N], as far as it was put right.
        surface_std_mm: how well the position is known that displacements count from [mm].
        channel_delay: as the default filter's setting [s].
        force_end_n: force from which on readings are left out, for the sensor's range ends there
            [N]; NaN where none are.
        left_out: channels of which readings were left out, and that have gaps for it.
        play_mm: of the position, which stands still in it where it was put behind one [mm].
    """

    time_s: FloatArray
    displacement_mm: FloatArray
    force_n: FloatArray
    surface_std_mm: float
    channel_delay: float | str = "auto"
    force_end_n: float = math.nan
    left_out: tuple[str, ...] = ()
    play_mm: float = 0.0
    _estimated: tuple[tuple[Any, ...], Estimated | None] | None = field(
        default=None, repr=False, compare=False
    )

    @property
    def known_delay_s(self) -> float:
        """By how much the force is late, as the estimator was told [s]; 0 where it looks for it."""
        return 0.0 if isinstance(self.channel_delay, str) else self.channel_delay

    def scale_force(self, factor: float) -> None:
        """Multiply the forces, and what counts in them."""
        self.force_n = self.force_n * factor
        self.force_end_n *= factor

    def take_force_zero(self, zero_n: float) -> None:
        """Let the forces count from a zero [N]."""
        self.force_n = self.force_n - zero_n
        self.force_end_n -= zero_n

    @property
    def limits(self) -> dict[str, Any]:
        """The estimator's setting that leaves out what is at the end of the sensor's range."""
        end = abs(self.force_end_n)
        return {} if math.isnan(end) else {FORCE_LIMIT: float(f"{end:.4g}")}

    def put_right(self, doubt: Suspicion) -> dict[str, Any]:
        """Put a fault right; return the settings that do so, none if no setting does."""
        if np.isnan(doubt.remedy):
            return self.put_at_even_times(doubt.channel) if doubt.check is Check.RATE else {}
        if doubt.check is Check.ZERO_STEP:
            during = (self.time_s >= doubt.since_s) & (self.time_s < doubt.until_s)
            shift = np.where(during, doubt.remedy, 0.0)
            if doubt.channel == "force":
                self.force_n = self.force_n - shift
            else:
                self.displacement_mm = self.displacement_mm - shift
            return {}
        settings: dict[str, Any] = {}
        if doubt.check is Check.SATURATION:
            self.force_end_n = doubt.remedy
            settings |= self.limits
        elif doubt.check is Check.RATE:
            self.count_once(doubt.channel)
            settings["force.held" if doubt.channel == "force" else "position.held"] = True
        elif doubt.check in (Check.SIGN, Check.UNITS):
            name = "sign" if doubt.check is Check.SIGN else "scale"
            value: float = int(doubt.remedy) if doubt.check is Check.SIGN else doubt.remedy
            if doubt.channel in ("displacement", "both"):
                self.displacement_mm = self.displacement_mm * doubt.remedy
                self.surface_std_mm *= abs(doubt.remedy)
                settings[f"position.{name}"] = value
            if doubt.channel in ("force", "both"):
                self.scale_force(doubt.remedy)
                settings[f"force.{name}"] = value
        elif doubt.check in OF_MOTION:
            settings |= self.take_motion(OF_MOTION[doubt.check], float(f"{doubt.remedy:.3g}"))
        elif doubt.check is Check.FRICTION:
            settings |= self.take_friction()
        elif doubt.check is Check.FORCE_ZERO:
            self.take_force_zero(doubt.remedy)
            settings["force.zero"] = rounded(doubt.remedy, 4)
        elif doubt.check is Check.POSITION_ZERO:
            self.displacement_mm = self.displacement_mm - doubt.remedy
            low, high = robust_range(self.displacement_mm[np.isfinite(self.displacement_mm)])
            # A glance at where the force begins: taken for exact, K would be wrong and sure.
            self.surface_std_mm = SURFACE_SHARE * (high - low)
            settings["position.zero"] = rounded(doubt.remedy, 3)
        return settings

    def tool_motion(self) -> FoundMotion | None:
        """Return what moving the tool takes of the force, as the air shows it."""
        displacement = usable("displacement", "mm", self.time_s, self.displacement_mm)
        return whole(
            find_tool_motion(displacement, usable("force", "N", self.time_s, self.force_n))
        )

    def take_motion(self, name: str, value: float) -> dict[str, Any]:
        """Take off what moving the tool takes by one of its settings; return that setting."""
        found = self.tool_motion()
        motion = ToolMotion()
        motion.configure({f"input.{name}": value})
        stamps_ns = np.round(self.time_s * NANOSECONDS).astype(np.int64)
        self.force_n = motion.of_many(stamps_ns, self.displacement_mm, self.force_n)
        settings: dict[str, Any] = {name: value}
        if found is not None and abs(found.zero_n) > CLEAR * found.zero_std_n:
            self.take_force_zero(found.zero_n)
            settings["force.zero"] = rounded(found.zero_n, 4)
        return settings

    def take_over(self, tried: Samples) -> None:
        """Be as a copy that was tried, with what was estimated of it."""
        self.__dict__.update(tried.__dict__)

    def take_play(self, play_mm: float) -> None:
        """Let the position be that behind a play [mm]."""
        self.play_mm = play_mm
        self.displacement_mm = behind_play(self.displacement_mm, play_mm)

    def take_friction(self) -> dict[str, Any]:
        """Take off the friction that the air shows; return the settings that do so."""
        readings = self.time_s, self.displacement_mm, self.force_n
        _, depth_mm, force_n = together(*readings)
        found = whole(find_friction(depth_mm, force_n))
        if found is None:
            return {}
        way_mm = float(f"{find_presliding(*readings, found):.2g}")
        friction = DryFriction(rounded(found.newtons, 4), way_mm)
        settings: dict[str, Any] = {
            "force.dry_friction": friction.newtons,
            "force.presliding": way_mm,
        }
        stamps_ns = np.round(self.time_s * NANOSECONDS).astype(np.int64)
        self.force_n = self.force_n - friction.of_many(stamps_ns, self.displacement_mm)
        self.left_out = ("force",)
        rows = ~(np.isnan(self.force_n) & np.isnan(self.displacement_mm))
        self.time_s, self.force_n = self.time_s[rows], self.force_n[rows]
        self.displacement_mm = self.displacement_mm[rows]
        if abs(found.zero_n) > CLEAR * found.deviation_n:
            self.take_force_zero(found.zero_n)
            settings["force.zero"] = rounded(found.zero_n, 4)
        return settings

    def count_once(self, channel: str) -> None:
        """Leave out the readings of a channel that only repeat the one before."""
        values = self.displacement_mm if channel == "displacement" else self.force_n
        left = once_each(np.round(self.time_s * NANOSECONDS).astype(np.int64), values)
        if channel == "displacement":
            self.displacement_mm = left
        else:
            self.force_n = left

    def put_at_even_times(self, channel: str) -> dict[str, Any]:
        """Give readings that are stamped on arrival the times at which they were taken.

        Returns:
            The setting that does so; none if their stamps may be those of measurement.
        """
        values = self.displacement_mm if channel == "displacement" else self.force_n
        there = np.flatnonzero(np.isfinite(values) & np.isfinite(self.time_s))
        stamps_ns = np.round(self.time_s[there] * NANOSECONDS).astype(np.int64)
        found = find_even_times(stamps_ns, values[there])
        if found is None:
            return {}
        own_s = self.time_s.copy()
        own_s[there] = found.stamps_ns / NANOSECONDS
        if channel == "displacement":
            self._put_at(own_s, self.time_s)
            return {"position.stamps": ARRIVAL}
        self._put_at(self.time_s, own_s)
        return {"force.stamps": ARRIVAL}

    def shift_force(self, seconds: float) -> None:
        """Stamp the forces so much later; each reading then stands at its own stamp."""
        self._put_at(self.time_s, self.time_s + seconds)

    def let_clocks_agree(self, rates: ClockRates) -> None:
        """Stamp the displacements as the clock of the forces goes."""
        self._put_at(rates.by_the_other(self.time_s), self.time_s)

    def _put_at(self, displacement_s: FloatArray, force_s: FloatArray) -> None:
        """Let each channel have times of its own [s], shape (n,) each."""
        has_depth, has_force = ~np.isnan(self.displacement_mm), ~np.isnan(self.force_n)
        nothing = np.full(len(self.time_s), np.nan)
        time_s = np.concatenate([displacement_s[has_depth], force_s[has_force]])
        order = np.argsort(time_s, kind="stable")
        self.displacement_mm = np.concatenate(
            [self.displacement_mm[has_depth], nothing[has_force]]
        )[order]
        self.force_n = np.concatenate([nothing[has_depth], self.force_n[has_force]])[order]
        self.time_s = time_s[order]

    def estimate(self) -> Estimated | None:
        """Run the default estimator; None if it was never in contact.

        Of readings and settings that it was asked for last it is not run again: all that puts
        something right makes arrays of its own.
        """
        readings = self.time_s, self.displacement_mm, self.force_n
        settings = self.surface_std_mm, self.channel_delay, self.limits
        if self._estimated is not None:
            (arrays, others), result = self._estimated
            same = all(a is b for a, b in zip(arrays, readings, strict=True))
            if same and others == settings:
                return result
        result = self._run()
        self._estimated = ((readings, settings), result)
        return result

    def _run(self) -> Estimated | None:
        estimator = create_estimator(
            DEFAULT_FILTER,
            missing_readings=True,
            contact_position_std=self.surface_std_mm,
            channel_delay=self.channel_delay,
            **self.limits,
        )
        series = run_in_pieces(estimator, self.time_s, self.displacement_mm, self.force_n)
        touched = series.contact & (series.rejected == 0)
        if not touched.any():
            return None
        counted = settled(self.time_s, touched)
        last = series[int(np.flatnonzero(touched)[-1])]
        codes, counts = np.unique(series.rejected[series.rejected != 0], return_counts=True)
        return Estimated(
            last.parameters.copy(),
            last.parameters_std.copy(),
            last.covariance.copy(),
            last.identifiability.copy(),
            last.force_noise_std,
            float(np.mean(series.model_mismatch[touched])),
            {Rejection(c).name.lower(): int(n) for c, n in zip(codes, counts, strict=True)},
            float(np.mean(of_two_readings(series.nis, series.innovation)[counted])),
            last.channel_delay,
            last.channel_delay_std,
            tuple(self.time_s[series.change_detected].tolist()),
        )
