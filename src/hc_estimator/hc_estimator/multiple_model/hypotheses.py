"""The hypotheses on the tissue, as rows of one table, from the calmest to the freest.

All share the motion model and the contact law. They differ in what the parameters may do between
two samples: nothing, walk, follow a rate that is a state of its own, or stay while the surface
moves. To add one, add a row here, before the last two; nothing else names the rows by number. What
it is reported as is one of `estimate.Hypothesis`, or a new one there.

Every row has the states [d, v, ln K, ln B, n, p, a] and up to three of its own. A state of its own
drives others at a constant rate; the first may also be the contact position. (A static bank: Bar-
Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, 11.6; the
rows are ours, each a line of `hc bench accuracy ablation`.)
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.estimate import Hypothesis
from hc_estimator.specification import ParameterSpecification

# States of a row.
DEPTH, VELOCITY, LOG_STIFFNESS, LOG_DAMPING, EXPONENT, VELOCITY_EXPONENT, ACCELERATION = range(7)
OWN = 7  # the first state of a row's own
STATES = 10  # at most
FIRST_PARAMETER, LAST_PARAMETER = LOG_STIFFNESS, ACCELERATION  # half-open
DRIVEN = 4  # what an own state can drive: ln K, ln B, n, the first own state


@dataclasses.dataclass(frozen=True)
class HypothesisRow:
    """What the parameters may do.

    Attributes:
        hypothesis: what is reported when this row is chosen.
        walks: variance that ln K, ln B, n and p gain per second of contact [1/s].
        own: number of states of its own.
        drives: rate at which each own state drives ln K, ln B, n and the first own state.
        own_walks: variance that each own state gains per second.
        own_variances: variance of each own state at the start.
        surface: True if the first own state is the contact position [mm], the second its rate.
        biased: True if the first own state is what the force's zero is off [N].
        waits: True if it takes no part until something has begun it: a fit, an alarm.
        reserve: True if it takes part only while constant tissue does not do; see `reserve`.
        refines: logarithm of the likelihood ratio over the first row with the same hypothesis from
            which on it is chosen in place of that, or where it predicts far better than all; NaN
            for rows that refine none.
    """

    hypothesis: Hypothesis
    walks: tuple[float, float, float, float]
    own: int = 0
    drives: tuple[tuple[float, float, float, float], ...] = ()
    own_walks: tuple[float, ...] = ()
    own_variances: tuple[float, ...] = ()
    surface: bool = False
    biased: bool = False
    waits: bool = False
    reserve: bool = False
    refines: float = math.nan


CALM = 3e-10  # keeps the covariance of a constant tissue from vanishing

# Walks and rates were chosen on simulated scans (single rows over seven random scans; see
# docs/accuracy.md): over a lump the rate of ln K wanders by about 0.1 / s within a second; with the
# damping tied to the stiffness but for a walk of its own both a damping that follows and one
# that does not are tracked; layers whose exponent varies need the rate of n as well. Breathing
# (1 mm, 0.25 Hz) changes the surface's velocity by a mm/s in half a second.
ROWS = (
    HypothesisRow(Hypothesis.CONSTANT, (CALM, CALM, CALM, CALM)),
    # The same, with parameters of a fit to what was felt; see `batch_fit`.
    HypothesisRow(Hypothesis.CONSTANT_FITTED, (CALM, CALM, CALM, CALM), waits=True),
    HypothesisRow(
        Hypothesis.STIFFNESS_TREND,
        (1e-5, 1e-3, 1e-8, 1e-8),
        own=1,
        drives=((1.0, 1.0, 0.0, 0.0),),
        own_walks=(2e-2,),
        own_variances=(1e-2,),
    ),
    # Sinks or rises at a speed that hardly changes, or is where it was not said to be.
    HypothesisRow(
        Hypothesis.SURFACE_MOVES,
        (CALM, CALM, CALM, CALM),
        own=2,
        drives=((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        own_walks=(0.0, 1e-4),
        own_variances=(1.0, 1e-2),
        surface=True,
    ),
    HypothesisRow(
        Hypothesis.ALL_DRIFT,
        (1e-5, 1e-3, 1e-8, 1e-8),
        own=2,
        drives=((1.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)),
        own_walks=(2e-2, 3e-4),
        own_variances=(1e-2, 1e-3),
    ),
    HypothesisRow(
        Hypothesis.SURFACE_MOVES,
        (CALM, CALM, CALM, CALM),
        own=2,
        drives=((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        own_walks=(0.0, 0.2),
        own_variances=(1.0, 2.0),
        surface=True,
    ),
    # Both at once: a lump on a surface that sinks, or under a zero that is off.
    HypothesisRow(
        Hypothesis.SURFACE_MOVES,
        (1e-5, 1e-3, 1e-8, 1e-8),
        own=3,
        drives=((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 0.0, 0.0)),
        own_walks=(0.0, 1e-4, 2e-2),
        own_variances=(1.0, 1e-2, 1e-2),
        surface=True,
        waits=True,
        reserve=True,
    ),
    # A lump in an organ that breathes.
    HypothesisRow(
        Hypothesis.SURFACE_MOVES,
        (1e-5, 1e-3, 1e-8, 1e-8),
        own=3,
        drives=((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 0.0, 0.0)),
        own_walks=(0.0, 5e-2, 2e-2),
        own_variances=(1.0, 1.0, 1e-2),
        surface=True,
        waits=True,
        reserve=True,
    ),
    # A damping that goes its own way has a rate of its own, and at the edge between two layers the
    # exponent is another one soon. In rows 2 and 4 these freedoms would make them less likely
    # everywhere else, and a surface that sinks or breathes would pass for tissue that varies.
    # An edge is over before the likelihood tells; what it costs is little where all drifts.
    HypothesisRow(
        Hypothesis.STIFFNESS_TREND,
        (1e-5, 1e-4, 1e-8, 1e-8),
        own=2,
        drives=((1.0, 1.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)),
        own_walks=(2e-2, 1e-2),
        own_variances=(1e-2, 1e-2),
        waits=True,
        reserve=True,
        refines=0.0,
    ),
    HypothesisRow(
        Hypothesis.ALL_DRIFT,
        (1e-5, 1e-4, 1e-8, 1e-8),
        own=3,
        drives=((1.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 1.0, 0.0, 0.0)),
        own_walks=(2e-2, 1e-3, 1e-2),
        own_variances=(1e-2, 1e-3, 1e-2),
        waits=True,
        reserve=True,
        refines=-5.0,
    ),
    # The tissue begun anew; see `change`. Always the last row but one.
    HypothesisRow(Hypothesis.CHANGED, (CALM, CALM, CALM, CALM), waits=True),
    # The tissue as it was, under another zero of the force; see `zero_step`. Always the last row.
    HypothesisRow(
        Hypothesis.CHANGED,
        (CALM, CALM, CALM, CALM),
        own=1,
        own_variances=(1.0,),
        biased=True,
        waits=True,
    ),
)
FRESH = len(ROWS) - 2
ZERO_STEP = len(ROWS) - 1
FITTED = 1

# The same as arrays, which compiled code sees as constants.
CODES = np.array([int(row.hypothesis) for row in ROWS])
COUNTS = np.array([OWN + row.own for row in ROWS])
WALKS = np.array([row.walks for row in ROWS])
SURFACE = np.array([row.surface for row in ROWS])
BIASED = np.array([row.biased for row in ROWS])
# Rows whose stiffness has a rate of its own, over a surface that stays.
VARIES = ~SURFACE & np.array([any(own[0] != 0.0 for own in row.drives) for row in ROWS])
WAITS = np.array([row.waits for row in ROWS])
RESERVE = np.array([row.reserve for row in ROWS])
REFINED_FROM = np.array([row.refines for row in ROWS])
REFINES = np.isfinite(REFINED_FROM)
# Of a row that refines another, that one; of others, themselves.
PLAIN = np.array([list(CODES).index(CODES[m]) if REFINES[m] else m for m in range(len(ROWS))])
TREND_ROW = next(m for m, row in enumerate(ROWS) if row.own == 1 and not row.biased)
EXPONENT_ROW = next(m for m, row in enumerate(ROWS) if row.hypothesis == Hypothesis.ALL_DRIFT)
STEADY_SURFACE_ROW = int(np.flatnonzero(SURFACE)[0])
# The freest of those that always take part: it says what is known at least.
SURFACE_ROW = int(np.flatnonzero(SURFACE & ~RESERVE)[-1])

SPECIFICATIONS = (
    ParameterSpecification(
        "without_hypotheses",
        "int",
        0,
        "Hypotheses that are not tried: the sum of 2^row over them. Row 0 always is.",
        minimum=0,
        maximum=2 ** len(ROWS) - 1,
        runtime=False,
    ),
)


def without(*hypotheses: Hypothesis) -> int:
    """Value of the setting `without_hypotheses` for rows that are not to be tried."""
    return sum(2**m for m, row in enumerate(ROWS) if row.hypothesis in hypotheses)


@compiled
def is_tried(settings: Any, m: int) -> bool:
    """True if a row may take part at all."""
    return bool(m == 0 or (settings.without_hypotheses >> m) & 1 == 0)


def _own_values(name: str, width: int) -> np.ndarray:
    values = np.zeros((len(ROWS), STATES - OWN, width))
    for m, row in enumerate(ROWS):
        for i, value in enumerate(getattr(row, name)):
            values[m, i] = value
    return values


DRIVES = _own_values("drives", DRIVEN)
OWN_WALKS = _own_values("own_walks", 1)[:, :, 0]
OWN_VARIANCES = _own_values("own_variances", 1)[:, :, 0]
# Surfaces that turn within seconds, unlike those that sink.
BREATHES = SURFACE & (OWN_WALKS[:, 1] > 1e-3)
