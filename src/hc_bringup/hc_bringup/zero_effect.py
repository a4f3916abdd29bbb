"""What a zero that is off would make of K: for a person who cannot know how exact zeros must be.

A filter takes contact position and force zero for exact where neither a touch nor the motion
contradicts them. Another zero bends the power law that fits the same forces; here the law through
the same two points, the largest depth and half of it (as in the filter's own
`multiple_model.zero_doubt`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_msgs_py.units import METRE_IN_MM

POSITION_MM: Final = 0.1
ZERO_SHARE: Final = 0.01  # of the force at the largest depth
SETTINGS: Final = ("contact_position_std", "force_zero_std")


class ZeroEffect(NamedTuple):
    """By what share K would be another with a zero off; NaN where that is not known.

    Attributes:
        by_position: with a contact position that is `POSITION_MM` deeper.
        by_force_zero: with a force zero of `ZERO_SHARE` of the force at the largest depth.
    """

    by_position: float
    by_force_zero: float

    @property
    def known(self) -> bool:
        """Whether there is anything to say."""
        return math.isfinite(self.by_position) and math.isfinite(self.by_force_zero)

    @property
    def words(self) -> str:
        """What zeros that are off would do; empty where that is not known."""
        if not self.known:
            return ""
        return (
            "contact position and force zero are taken for exact: "
            f"{POSITION_MM:g} mm off makes K {_percent(self.by_position)} wrong, "
            f"{100 * ZERO_SHARE:g} % of the largest force {_percent(self.by_force_zero)}"
        )

    @property
    def sentence(self) -> str:
        """The same as a sentence that also says what to do."""
        words = self.words
        how = f"how well you know them is said by {' and '.join(SETTINGS)}"
        return f"{words[0].upper()}{words[1:]}; {how}." if words else ""


UNKNOWN: Final = ZeroEffect(math.nan, math.nan)


def _percent(share: float) -> str:
    return f"{100 * abs(share):.2g} %" if abs(share) < 1.0 else f"{100 * abs(share):.0f} %"


def zero_effect(depth_mm: float, exponent: float, *, fixed: bool = False) -> ZeroEffect:
    """By what share K would be another, with each zero off.

    Args:
        depth_mm: largest depth that was felt.
        exponent: n of the law that was found.
        fixed: whether the law has this n in any case; then only the point at that depth counts.

    Returns:
        Unknown where the depth is too small to say so.
    """
    half = 0.5 * depth_mm
    if not (half > 2.0 * POSITION_MM and math.isfinite(depth_mm) and math.isfinite(exponent)):
        return UNKNOWN
    ratio = 2.0**exponent  # of the two forces; the one at half the depth is 1
    left, left_half = ratio * (1.0 - ZERO_SHARE), 1.0 - ZERO_SHARE * ratio
    if not left_half > 0.0:
        return UNKNOWN  # such a zero is all that was felt there
    moved = bent = exponent
    if not fixed:
        moved *= math.log(2.0) / math.log((depth_mm - POSITION_MM) / (half - POSITION_MM))
        bent = math.log(left / left_half) / math.log(2.0)
    by_position = exponent * math.log(depth_mm) - moved * math.log(depth_mm - POSITION_MM)
    by_zero = math.log(left / ratio) + (exponent - bent) * math.log(depth_mm)
    return ZeroEffect(_share(by_position), _share(by_zero))


def _share(logarithm: float) -> float:
    return math.expm1(logarithm) if logarithm < 700.0 else math.nan


def effect_where_exact(
    settings: Mapping[str, Any],
    depth_mm: float,
    exponent: float,
    exponent_std: float,
    zeros: tuple[float, float],
    stiffness: tuple[float, float],
) -> ZeroEffect:
    """The same for an estimate; unknown where its zeros are not taken for exact.

    Nor is there anything to say where K is known to less than that in any case: it is so where the
    filter itself doubts its zeros.

    Args:
        settings: of the estimator by name; one that cannot be told how well the zeros are known
            takes them for exact. Where they are empty nothing is known of it.
        depth_mm: largest depth that was felt.
        exponent: n of the estimate.
        exponent_std: its standard deviation; 0 of a law that has this n in any case.
        zeros: contact position and force zero that the estimator found; 0 or NaN if it found none.
        stiffness: K and its standard deviation.
    """
    found = any(zero != 0.0 and not math.isnan(zero) for zero in zeros)
    if not settings or found or any(settings.get(name, 0.0) for name in SETTINGS):
        return UNKNOWN
    effect = zero_effect(depth_mm, exponent, fixed=exponent_std == 0.0)
    share = max(abs(effect.by_position), abs(effect.by_force_zero))
    return UNKNOWN if stiffness[1] > share * abs(stiffness[0]) else effect


def effect_in(settings: Mapping[str, Any], estimates: NDArray[Any]) -> ZeroEffect:
    """The same for a recording.

    Args:
        settings: as for `effect_where_exact`, at the end of the recording.
        estimates: records of hc_msgs/HuntCrossleyEstimate without header, (N,).
    """
    if not len(estimates):
        return UNKNOWN
    last = estimates[-1]
    same = estimates["configuration_revision"] == last["configuration_revision"]
    touching = same & estimates["contact"].astype(bool) & (estimates["rejected"] == 0)
    depths = estimates["displacement"][touching]
    return effect_where_exact(
        settings,
        float(np.nanmax(depths, initial=0.0)) * METRE_IN_MM,
        float(last["displacement_exponent"]),
        float(last["displacement_exponent_std"]),
        (float(last["contact_position"]), float(last["force_zero"])),
        (float(last["stiffness"]), float(last["stiffness_std"])),
    )


class DeepestTouch:
    """How deep a stream of estimates has been under the settings in force, for the same of it."""

    def __init__(self) -> None:
        self._depth_mm = 0.0
        self._revision = 0
        self._settings: Mapping[str, Any] = {}
        self._settings_revision = 0

    def configure(self, settings: Mapping[str, Any], revision: int) -> None:
        """Take in the settings of a revision by name."""
        self._settings, self._settings_revision = settings, revision

    def add(self, depth_mm: float, revision: int) -> None:
        """Take in the depth of an estimate in contact that was used.

        What was felt under other settings may have been felt with other zeros.
        """
        if revision != self._revision:
            self._revision, self._depth_mm = revision, 0.0
        if depth_mm > self._depth_mm:
            self._depth_mm = depth_mm

    def effect(self, estimate: Any) -> ZeroEffect:
        """As `effect_where_exact`; unknown where the settings of the estimate are.

        Args:
            estimate: the latest (hc_msgs/HuntCrossleyEstimate), or None.
        """
        if estimate is None or not (
            estimate.configuration_revision == self._revision == self._settings_revision
        ):
            return UNKNOWN
        return effect_where_exact(
            self._settings,
            self._depth_mm,
            estimate.displacement_exponent,
            estimate.displacement_exponent_std,
            (estimate.contact_position, estimate.force_zero),
            (estimate.stiffness, estimate.stiffness_std),
        )
