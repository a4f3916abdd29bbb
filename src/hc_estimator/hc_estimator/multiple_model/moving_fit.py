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

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import judge as judging
from hc_estimator.multiple_model import (
    moving_delay,
    moving_kinds,
    moving_rows,
    spline,
    spline_descent,
)
from hc_estimator.multiple_model import search as searches
from hc_estimator.multiple_model.moving_kinds import LIKELIER, ORDER, RELAXING
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import is_held
from hc_estimator.multiple_model.spline_fit import CONSISTENT
from hc_estimator.multiple_model.spline_records import BENDS, KINDS, MOVES, VARIES
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
RELAXES_FOR = 5.0  # time in contact for which it is believed [s]
# Stages of a search after those that fit a kind, which count from one.
IDLE, LATE, FOUND, AT_NEW_ZEROS = 0, KINDS + 1, KINDS + 2, KINDS + 3


@compiled
def reset(moving: Any) -> None:
    """Nothing is looked for."""
    moving.looked_at = -math.inf
    moving.stage = IDLE
    moving_kinds.reset(moving)
    moving_delay.reset(moving)


@compiled
def look(settings: Any, bank: Any) -> None:
    """Begin to ask what tissue and surface do, if it is time to; or end, if it is not any more.

    Args:
        settings: settings record.
        bank: its records `moving`, `fit` and `search` are changed.
    """
    moving, judge, clock = bank.moving, bank.judge, bank.tool.contact_clock
    wanted = settings.fit_movement != 0 and bank.tool.retreated != 0 and judge.needed_time > 0.0
    wanted = wanted and not is_held(settings, 0)  # these fits all look for K
    if not wanted or bank.change.testing != 0:
        if moving.stage != AT_NEW_ZEROS:
            moving.stage = IDLE
    elif not searches.is_busy(bank) and clock - moving.looked_at >= EVERY and _are_enough(bank):
        moving.looked_at = clock
        searches.begin(bank)
        moving_kinds.begin(bank)
        _begin_kind(settings, bank, 0)


@compiled
def take(settings: Any, bank: Any) -> None:
    """Take a fit of the search that is solved, and begin the next.

    Args:
        settings: settings record.
        bank: its records `moving`, `fit`, `judge` and `rows` are changed.
    """
    moving, fit, stage = bank.moving, bank.fit, bank.moving.stage
    if stage == AT_NEW_ZEROS:
        moving.stage = IDLE
        if fit.squares < CONSISTENT * fit.expected:
            moving_rows.begin_moving(settings, bank)
    elif stage == LATE:
        if moving_delay.take(settings, bank, moving_kinds.largest(moving.in_step)):
            _begin_found(settings, bank)
    elif stage == FOUND:
        moving.stage = IDLE
        if fit.squares < CONSISTENT * fit.expected:
            moving_rows.begin(settings, bank, ORDER[moving.found])
    else:
        k = stage - 1
        beyond = moving_kinds.note(bank, k)
        if beyond < 2.0 * LIKELIER[k]:
            _conclude(settings, bank)  # no freer kind can explain better by enough
        else:
            _begin_kind(settings, bank, k + 1)


@compiled
def _are_enough(bank: Any) -> bool:
    """True if the points are many and span enough time, most have a velocity, and one is new."""
    history = bank.history
    first = _oldest(history)
    if not histories.is_motion_known(history, first):
        return False
    last = history.points[(history.count - 1) % POINTS].time
    if bank.clock.state_time - last > FRESH_TIME:
        return False  # a row knows better what the surface has done since
    return bool(last - history.points[first % POINTS].time >= LEAST_TIME)


@compiled
def _oldest(history: Any) -> int:
    """First point of the present place over which knots are close enough."""
    return spline.first_in_reach(history, histories.of_place(history), history.count)


@compiled
def _begin_kind(settings: Any, bank: Any, k: int) -> None:
    """Begin to fit a kind, or the next that can be; conclude where there is none."""
    while k < ORDER.size:
        if moving_kinds.is_asked(bank, k) and _lay_out(settings, bank, ORDER[k]):
            searches.begin_fit(settings, bank)
            bank.moving.stage = k + 1
            return
        k += 1
    _conclude(settings, bank)


@compiled
def _lay_out(settings: Any, bank: Any, kind: int) -> bool:
    """Lay out a fit of a kind with the zeros as they are; False if points are too far apart."""
    if kind & BENDS != 0 and is_held(settings, 2):
        return False
    history = bank.search.history
    first, last = _oldest(history), history.count
    return spline.lay_out_at_zeros(settings, history, bank.fit, first, last, kind)


@compiled
def _conclude(settings: Any, bank: Any) -> None:
    """Choose the kind; what is late beneath a surface that moves is asked before it is used."""
    moving, judge, clock = bank.moving, bank.judge, bank.tool.contact_clock
    judge.found = 0
    found = moving_kinds.likeliest(moving)
    moving.found = found
    if found >= 0 and ORDER[found] & MOVES != 0:
        moving.moved_at = clock
    varies = found < 0 or ORDER[found] & (VARIES + MOVES) != 0
    if found == RELAXING or moving_kinds.relaxes(moving, found):
        judging.keep_to_fit(judge, bank.rows, clock, RELAXES_FOR)
        moving.found = -1
    if varies and math.isnan(settings.channel_delay):
        if moving_delay.begin(settings, bank, _oldest(bank.search.history)):
            moving.stage = LATE
            return
    elif not varies:
        moving.agreeing = 0
    _begin_found(settings, bank)


@compiled
def _begin_found(settings: Any, bank: Any) -> None:
    """Fit what was found once more, to the points that there are by now; end if no row says it."""
    moving, fit = bank.moving, bank.fit
    moving.stage = IDLE
    if moving.found < 0 or moving.agreeing >= moving_delay.LASTING:
        return
    kind = ORDER[moving.found]
    if not moving_rows.are_tried(settings, kind):
        return
    searches.begin(bank)
    if not _lay_out(settings, bank, kind):
        return
    searches.begin_fit(settings, bank)
    # The points that have come since are few: its knots are next to where they were.
    if fit.unknowns == moving.unknowns[moving.found]:
        copy_vector(moving.values[moving.found], fit.values)
        spline_descent.begin(settings, fit)
    moving.stage = FOUND


@compiled
def look_for_moving(settings: Any, bank: Any) -> None:
    """Ask at once for tissue that stays under a surface that moves.

    Until it is asked in its turn, what is beneath another zero would pass for another place.
    """
    searches.begin(bank)
    if _lay_out(settings, bank, MOVES):
        searches.begin_fit(settings, bank)
        bank.moving.stage = AT_NEW_ZEROS
