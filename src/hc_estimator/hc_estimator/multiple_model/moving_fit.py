"""What do tissue and surface do, where constant tissue does not do?

Lumps on a surface that sinks or breathes are the hardest contact there is for recursive rows: they
begin with tangents that are wrong, keep what those taught, and on a horizon of some tenths of a
second a rate of the stiffness, a surface that sinks and one that breathes predict alike. Over ten
seconds they do not. So, once a second, least squares over the points ask which of them it is
(`spline_fit`): the calmest of those that are likely by their evidence, if it explains all but the
noise. A spline of ln K, with forty unknowns, explains a surface that sinks or breathes as well: so
those are asked before, beside a stiffness that drifts with as few as it. The row that says what is
found begins with the fit, and is chosen for a while unless another predicts better; one whose
surface stays only where the fit contradicts it, for it remembers more than the fit has seen. Where
it is tissue that relaxes, which no row says, the fit of one law to all that was felt is kept, and
its model error told. (Ours; `hc bench accuracy together`: lumps on a surface that breathes;
`misfit`: press_relaxing; `troubles`: sinking, breathing and lumps.)
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector
from hc_estimator.multiple_model import delay_sensitivity, moving_delay, spline, spline_start
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import judge as judging
from hc_estimator.multiple_model.choice import trusted_motion
from hc_estimator.multiple_model.hypotheses import (
    BREATHES,
    COUNTS,
    FRESH,
    LOG_STIFFNESS,
    OWN,
    ROWS,
    STATES,
    SURFACE,
    SURFACE_ROW,
    TREND_ROW,
    is_tried,
)
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import cut, is_held, limit, seed
from hc_estimator.multiple_model.spline_fit import CONSISTENT, solve_least_squares
from hc_estimator.multiple_model.spline_outcome import OUTCOME, note_outcome
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
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "fit_movement",
        "bool",
        True,
        "Ask least squares over splines what tissue and surface do, once constant tissue fails.",
    ),
)

EVERY = 1.0  # time in contact between two fits [s]
LEAST_TIME = 3.0  # that they must span [s]
FRESH_TIME = 0.25  # age of the latest of them, at most [s]
LEAST_LEFT = 0.7  # squares that the freest leaves, in those of the noise
# Real tissue that relaxes does not do so by the law to within the noise. It is believed if that
# explains most of what tissue that stays leaves, as well as any that varies or sinks; a surface
# that may move as it likes follows that, too, and much else.
# Share of the force that a tissue which relaxes has let go of. Where the force of now is no more
# than a sum of those before, which foretells anything for a while, it is zero or negative.
LEAST_RELEASED = 0.05
EXPLAINS = 0.1  # of the squares that tissue that stays leaves
FOLLOWED = 8.0  # times the squares that a surface leaves that may move
RELAXES_FOR = 5.0  # time in contact for which it is believed [s]
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


def _kind_of(m: int) -> int:
    """Which kind of fit says what a row says; -1 for a row that none begins."""
    row = ROWS[m]
    if not row.surface:
        return VARIES if m == TREND_ROW else -1
    kind = MOVES if BREATHES[m] else SINKS
    return kind + (VARIES if any(drives[0] > 0.0 for drives in row.drives) else STAYS)


KINDS_OF = np.array([_kind_of(m) for m in range(len(ROWS))])
# Where the outcome of a fit goes in the state of such a row; STATES: nowhere.
TARGETS = np.array(
    [
        [
            *range(LOG_STIFFNESS, LOG_STIFFNESS + 4),
            *((OWN, OWN + 1, OWN + 2) if row.surface else (STATES, STATES, OWN)),
        ]
        for row in ROWS
    ]
)
CONTRADICTS = 3.0  # deviations between a row and the fit from which it begins anew


@compiled
def reset(moving: Any) -> None:
    """Nothing is looked for."""
    moving.looked_at = -math.inf
    moving.stage = 0
    moving_delay.reset(moving)


@compiled
def look(settings: Any, bank: Any) -> None:
    """Ask what tissue and surface do, if it is time to: one fit a call, so that none takes long.

    Args:
        settings: settings record.
        bank: its records `moving`, `fit`, `judge` and `rows` are changed, and weights of points.
    """
    moving, judge, clock = bank.moving, bank.judge, bank.tool.contact_clock
    wanted = settings.fit_movement != 0 and bank.tool.retreated != 0 and judge.needed_time > 0.0
    wanted = wanted and not is_held(settings, 0)  # these fits all look for K
    if not wanted or bank.change.testing != 0:
        moving.stage = 0
    elif moving.stage > 0 and moving.last > bank.history.count:
        # Every second point was forgotten, and the others have new numbers: from the beginning.
        moving.stage = 0
        moving.looked_at = -math.inf
    elif moving.stage == 0:
        if clock - moving.looked_at >= EVERY and _are_enough(bank):
            moving.looked_at = clock
            moving.last = bank.history.count
            moving.stage = 1
    elif moving.stage <= ORDER.size:
        k = moving.stage - 1
        beyond = _fit_kind(settings, bank, k)
        # What no freer kind can explain better by enough is what is found.
        moving.stage = ORDER.size + 1 if beyond < 2.0 * LIKELIER[k] else moving.stage + 1
        for m in range(k + 1, ORDER.size):
            moving.evidence[m] = -math.inf
            moving.in_step[m] = -math.inf
            moving.left[m] = math.inf
    elif moving.stage > ORDER.size + 1:
        moving.stage = 0
        first = _oldest(bank.history, moving.last)
        moving_delay.ask(settings, bank, first, _largest(moving.in_step))
    else:
        moving.stage = 0
        judge.found = 0
        found = _likeliest(moving)
        if found == RELAXING or _relaxes(moving, found):
            judging.keep_to_fit(judge, bank.rows, clock, RELAXES_FOR)
        elif found >= 0:
            _begin_found(settings, bank, found)
        if found >= 0 and ORDER[found] & MOVES != 0:
            moving.moved_at = clock
        varies = found < 0 or ORDER[found] & (VARIES + MOVES) != 0
        if varies and math.isnan(settings.channel_delay):
            moving.stage = ORDER.size + 2
        else:
            moving.agreeing = 0


@compiled
def _are_enough(bank: Any) -> bool:
    """True if the points are many and span enough time, most have a velocity, and one is new."""
    history = bank.history
    first = _oldest(history, history.count)
    if not histories.is_motion_known(history, first):
        return False
    last = history.points[(history.count - 1) % POINTS].time
    if bank.clock.state_time - last > FRESH_TIME:
        return False  # a row knows better what the surface has done since
    return bool(last - history.points[first % POINTS].time >= LEAST_TIME)


@compiled
def _oldest(history: Any, last: int) -> int:
    """First of the points before `last` that is remembered until the last fit, and no older."""
    first = max(last - POINTS + ORDER.size + 1, history.begun)
    return spline.first_in_reach(history, first, last)


@compiled
def _fit_kind(settings: Any, bank: Any, k: int) -> float:
    """Fit a kind, and note its evidence; by how much a freer one can lower its squares."""
    fit, history, moving = bank.fit, bank.history, bank.moving
    moving.evidence[k] = -math.inf
    moving.in_step[k] = -math.inf
    moving.left[k] = math.inf
    if not _lay_out(settings, history, fit, ORDER[k], moving.last):
        return math.inf
    spline_start.begin(settings, history, fit, bank.rows[bank.judge.chosen])
    left = solve_least_squares(settings, history, fit, histories.noise_of_points(bank))
    copy_vector(fit.values, moving.values[k])
    moving.unknowns[k] = fit.unknowns
    if k == RELAXING and not spline.share_released(history, fit) > LEAST_RELEASED:
        return math.inf
    if math.isfinite(left) and fit.expected > 0.0:
        moving.left[k] = left / fit.expected
    if not left < CONSISTENT * fit.expected:
        return math.inf
    own_delay = moving_delay.cost_of_none(fit)
    moving.evidence[k] = log_evidence(fit, left)
    moving.in_step[k] = moving.evidence[k] - own_delay
    return left - LEAST_LEFT * fit.expected  # type: ignore[no-any-return]


@compiled
def _lay_out(settings: Any, history: Any, fit: Any, kind: int, last: int) -> bool:
    """Lay out a fit of a kind with the zeros as they are; False if points are too far apart."""
    if kind & BENDS != 0 and is_held(settings, 2):
        return False
    first = _oldest(history, last)
    return spline.lay_out_at_zeros(settings, history, fit, first, last, kind)


@compiled
def _relaxes(moving: Any, found: int) -> bool:
    """True if the tissue relaxes, though that does not explain it to within the noise."""
    left, relaxing = moving.left, moving.left[RELAXING]
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
def _largest(evidence: Any) -> float:
    """Largest logarithm of the evidence of any kind."""
    best = -math.inf
    for k in range(ORDER.size):
        best = max(best, evidence[k])
    return best


@compiled
def _likeliest(moving: Any) -> int:
    """Number of the calmest of the likely kinds; -1 if none explains all but the noise."""
    best = _largest(moving.evidence)
    if best == -math.inf:
        return -1
    found = 0
    while found < ORDER.size - 1 and not moving.evidence[found] >= best - LIKELIER[found]:
        found += 1
    return found


@compiled
def _begin_found(settings: Any, bank: Any, found: int) -> None:
    """Let the row that says the same as a kind begin with its fit."""
    fit, history, moving, judge = bank.fit, bank.history, bank.moving, bank.judge
    kind = ORDER[found]
    for m in range(FRESH):
        if KINDS_OF[m] != kind:
            continue
        if not is_tried(settings, m) or not _lay_out(settings, history, fit, kind, history.count):
            continue
        # The points that have come since are few: its knots are next to where they were.
        if fit.unknowns == moving.unknowns[found]:
            copy_vector(moving.values[found], fit.values)
        else:
            spline_start.begin(settings, history, fit, bank.rows[judge.chosen])
        left = solve_least_squares(settings, history, fit, histories.noise_of_points(bank))
        if not left < CONSISTENT * fit.expected:
            continue
        note_outcome(fit, moving, bank.clock.state_time)
        if SURFACE[m] or (left < fit.expected and _contradicts(moving, bank.rows[m])):
            judge.found = m
            judge.found_at = bank.tool.contact_clock
            _take(settings, bank, bank.rows[m], bank.tool.contact_clock)


@compiled
def begin_moving(settings: Any, bank: Any) -> None:
    """Begin with the last fit, of tissue that stays under a surface that moves."""
    judge, clock = bank.judge, bank.tool.contact_clock
    if is_tried(settings, SURFACE_ROW):
        note_outcome(bank.fit, bank.moving, bank.clock.state_time)
        judge.chosen = SURFACE_ROW
        judge.found = SURFACE_ROW
        judge.found_at = clock
        bank.moving.moved_at = clock
        _take(settings, bank, bank.rows[SURFACE_ROW], clock)


@compiled
def look_for_moving(settings: Any, bank: Any) -> None:
    """Begin with tissue that stays under a surface that moves, if that explains all by now.

    Until it is asked in its turn, what is beneath another zero would pass for another place.
    """
    fit, history = bank.fit, bank.history
    if not _lay_out(settings, history, fit, MOVES, history.count):
        return
    spline_start.begin(settings, history, fit, bank.rows[bank.judge.chosen])
    left = solve_least_squares(settings, history, fit, histories.noise_of_points(bank))
    if left < CONSISTENT * fit.expected:
        begin_moving(settings, bank)


@compiled
def _contradicts(moving: Any, row: Any) -> bool:
    """True if K or n of the fit is not what a row says that follows the stiffness."""
    for i in (0, 2):
        place = TARGETS[row.index, i]
        off = moving.outcome[i] - row.state[place]
        variance = moving.covariance[i, i] + row.covariance[place, place]
        if off * off > CONTRADICTS * CONTRADICTS * variance:
            return True
    return False


@compiled
def _take(settings: Any, bank: Any, row: Any, clock: float) -> None:
    """Begin a row with what was found."""
    moving, rows, judge = bank.moving, bank.rows, bank.judge
    chosen = rows[judge.chosen]
    score, likelihood = chosen.score, chosen.log_likelihood
    source = rows[trusted_motion(judge, rows)]
    if source.index != row.index:
        seed(source, row, clock, clock)
    row.active = 1
    row.since = clock
    row.counts_from = clock
    row.model_error = 0.0
    row.position_deviation = 0.0
    row.score = score
    row.log_likelihood = likelihood
    delay_sensitivity.clear(row, LOG_STIFFNESS, LOG_STIFFNESS + 4)
    delay_sensitivity.clear(row, OWN, STATES)
    targets = TARGETS[row.index]
    for i in range(OUTCOME):
        if _is_taken(settings, row, i):
            cut(row, targets[i])
    for i in range(OUTCOME):
        if not _is_taken(settings, row, i):
            continue
        row.state[targets[i]] = moving.outcome[i]
        for j in range(OUTCOME):
            if _is_taken(settings, row, j):
                row.covariance[targets[i], targets[j]] = moving.covariance[i, j]
    limit(settings, row)


@compiled
def _is_taken(settings: Any, row: Any, i: int) -> bool:
    """True if a row takes a number of the outcome: a state of its own that is not held fixed."""
    has_it = TARGETS[row.index, i] < COUNTS[row.index]
    return bool(has_it and (i >= 4 or not is_held(settings, i)))
