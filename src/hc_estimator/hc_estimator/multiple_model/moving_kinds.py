"""Which kind of tissue and surface is it, by the fits of `moving_fit`?

The calmest of those that are likely by their evidence, if it explains all but the noise; and tissue
that relaxes, if it explains most of what no kind explains.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector
from hc_estimator.multiple_model import asked_kinds, moving_delay, spline
from hc_estimator.multiple_model.spline_fit import CONSISTENT
from hc_estimator.multiple_model.spline_prior import log_evidence
from hc_estimator.multiple_model.spline_records import (
    BENDS,
    MOVES,
    RELAXES,
    SINKS,
    STAYS,
    STEADY,
    VARIES,
)

LEAST_LEFT = 0.7  # squares that the freest leaves, in those of the noise
# Real tissue that relaxes does not do so by the law to within the noise. It is believed if that
# explains most of what tissue that stays leaves, as well as any that varies or sinks; a surface
# that may move as it likes follows that, too, and much else.
# Share of the force that a tissue which relaxes has let go of. Where the force of now is no more
# than a sum of those before, which foretells anything for a while, it is zero or negative.
LEAST_RELEASED = 0.05
EXPLAINS = 0.1  # of the squares that tissue that stays leaves
FOLLOWED = 8.0  # times the squares that a surface leaves that may move
# Kinds from the calmest to the freest.
ORDER = np.array(
    [
        STAYS,
        RELAXES,
        VARIES + STEADY,
        SINKS,
        MOVES,
        VARIES,
        VARIES + BENDS,
        VARIES + SINKS,
        VARIES + MOVES,
    ]
)
RELAXING = int(np.flatnonzero(ORDER == RELAXES)[0])
# Log evidence by which a freer one is believed instead. A spline between its knots is off by more
# than the noise on the flank of a narrow lump, and a surface that moves would make up for it. A
# stiffness that drifts has as few unknowns as a surface that sinks, and is no calmer; nor is a
# surface that breathes calmer than a stiffness that varies.
LIKELIER = np.array([150.0, 10.0, 3.0, 10.0, 3.0, 150.0, 10.0, 10.0, 0.0])


@compiled
def reset(moving: Any) -> None:
    """No kind was ever fitted to this tissue."""
    moving.found = -1
    asked_kinds.forget(moving.asked)


@compiled
def begin(bank: Any) -> None:
    """Forget what speaks for the kinds; what they left is known until they are asked again."""
    moving = bank.moving
    asked_kinds.begin(moving.asked, bank.search.history.version)
    for k in range(ORDER.size):
        moving.evidence[k] = -math.inf
        moving.in_step[k] = -math.inf


@compiled
def is_asked(bank: Any, k: int) -> bool:
    """False for a kind that left far more than noise not long ago, while another explains all.

    Tissue that relaxes is believed by what it leaves beside tissue that stays, be that far or not:
    asked after four seconds it was found as much later.
    """
    moving, clock = bank.moving, bank.tool.contact_clock
    if k <= RELAXING:
        return True
    return not (moving.found >= 0 and asked_kinds.is_ruled_out(moving.asked, k, clock))


@compiled
def note(bank: Any, k: int) -> float:
    """Note the evidence of a kind that is solved; by how much a freer one can lower its squares."""
    fit, moving, left = bank.fit, bank.moving, bank.fit.squares
    copy_vector(fit.values, moving.values[k])
    moving.unknowns[k] = fit.unknowns
    sound = math.isfinite(left) and fit.expected > 0.0
    if k == RELAXING and not spline.share_released(bank.search.history, fit) > LEAST_RELEASED:
        sound = False
    share = left / fit.expected if sound else math.inf
    asked_kinds.note(moving.asked, k, share, bank.tool.contact_clock)
    if not share < CONSISTENT:
        return math.inf
    own_delay = moving_delay.cost_of_none(fit)
    moving.evidence[k] = log_evidence(fit, left)
    moving.in_step[k] = moving.evidence[k] - own_delay
    return left - LEAST_LEFT * fit.expected  # type: ignore[no-any-return]


@compiled
def relaxes(moving: Any, found: int) -> bool:
    """True if the tissue relaxes, though that does not explain it to within the noise."""
    left, relaxing = moving.asked.left, moving.asked.left[RELAXING]
    if found >= 0 and ORDER[found] & MOVES == 0:
        return False
    if not relaxing < EXPLAINS * left[0]:  # ORDER begins with tissue that stays
        return False
    for k in range(ORDER.size):
        most = FOLLOWED * max(left[k], LEAST_LEFT) if ORDER[k] & MOVES != 0 else left[k]
        if k != RELAXING and not relaxing <= most:
            return False
    return True


@compiled
def largest(evidence: Any) -> float:
    """Largest logarithm of the evidence of any kind."""
    best = -math.inf
    for k in range(ORDER.size):
        best = max(best, evidence[k])
    return best


@compiled
def likeliest(moving: Any) -> int:
    """Number of the calmest of the likely kinds; -1 if none explains all but the noise."""
    best = largest(moving.evidence)
    if best == -math.inf:
        return -1
    found = 0
    while found < ORDER.size - 1 and not moving.evidence[found] >= best - LIKELIER[found]:
        found += 1
    return found
