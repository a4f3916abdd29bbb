"""Do the points tell of a contact position or a zero of the force that is off?

A first touch shows the zeros to some tenths of a millimetre, and not at all where the tool starts
in contact (`contact_onset`). But a power law begins at zero force and zero depth: one that has to
begin elsewhere leaves what no K, B, n and p explain. So does a force that is late. Least squares
with contact position, force zero and delay as further unknowns finds within seconds which of them
it is, on tissue that stays, beneath a surface that sinks or breathes (of which the force's zero
alone is asked), and where the stiffness varies (`spline_fit`; ours; `hc bench accuracy delay`: 0.6
mm of 3 mm makes K 50 % wrong; `together`: zeros off).

One fit has all three unknown, and `zero_choice` says which of them the points ask for; where
nothing shows which of two zeros it is, both are taken from the fit that has both. They move if that
fit leaves less than one without. The choice is among zeros as they were given, so that more points
can take back what fewer seemed to show; points that show less of them take back nothing. Until they
move, what they may be is in the covariance that is given out (`zero_average`). Where the tool was
seen in the air the force's zero is known from there, and what the force reads where it only seems
to be outside is as good as a point there. What is left open of the zeros in use goes with the
estimate, by how much K, B, n and p depend on them (Schmidt 1966; `zero_doubt` gives it out).

A law that does not fit real tissue would find zeros as well that make it fit better. So zeros move
only where the law then fits to within the noise of the sensors: where no law does, nothing is
concluded. Up to three times the noise is enough where that is a hundredth of what the row in charge
misses, and for tissue that stays: points may have velocities that are off by more than they say (a
pose of 100 Hz that shakes at 7 Hz), and what varies as it likes follows real tissue as near as that
(`palpation_scan` had a zero of 1.1 N so). What is said is as much less certain then (Birge's ratio,
Phys. Rev. 40, 1932).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector, copy_matrix, copy_vector
from hc_estimator.multiple_model import (
    asked_kinds,
    place_delay,
    spline,
    spline_descent,
    spline_start,
    zero_average,
    zero_kinds,
    zero_sensitivity,
)
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import search as searches
from hc_estimator.multiple_model.hypotheses import LOG_STIFFNESS, SURFACE_ROW, is_tried
from hc_estimator.multiple_model.rows import is_held
from hc_estimator.multiple_model.spline_records import MOVES, SINKS
from hc_estimator.multiple_model.zero_choice import (
    SIGNIFICANT,
    choose,
    cost_of_air,
    is_worth_it,
    speaks_against,
    wanders,
)
from hc_estimator.multiple_model.zero_records import (
    AS_THEY_ARE,
    BOTH,
    IDLE,
    NONE,
    OF_CHOICE,
    OF_FORCE,
    OF_POSITION,
)
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "find_zeros",
        "bool",
        True,
        "Look for a contact position and a force zero that are off, where the motion shows them.",
    ),
)

REFUTED = 6.0  # squares left, in those of the noise, at which zeros in use are taken back
FEWEST_WINDOWS = 4  # of the delay before a zero is looked for
EVERY = 1.0  # time in contact between two fits [s]
LASTING = 2.0  # time in contact for which a choice must stay the same [s]
LEAST_POSITION = 0.05  # [mm]
LEAST_ZERO = 0.005  # of the largest force
LARGEST_POSITION = 0.5  # of the largest depth
LARGEST_ZERO = 0.3  # of the largest force
LARGEST_DELAY = 0.005  # up to which the fit's tangents hold; a larger one is for `delay` [s]


@compiled
def reset(zeros: Any) -> None:
    """Neither zero was found to be off."""
    restart(zeros)
    zeros.unknown = NONE
    zeros.deviation = 0.0
    zeros.least = 0.0
    clear_vector(zeros.moved)
    zero_average.forget(zeros)


@compiled
def begin_at_place(zeros: Any, doubt: Any, deviation: float) -> None:
    """The contact begins where a fit to another place says (`another_place`), and that is given.

    Args:
        zeros: changed.
        doubt: what the position leaves open of ln K, ln B, n and p, shape (4, 4).
        deviation: of the position [mm].
    """
    reset(zeros)
    zeros.unknown = OF_POSITION
    zeros.off[0] = deviation
    copy_matrix(doubt, zeros.doubt)
    zeros.deviation = math.sqrt(zeros.doubt[0, 0])
    zeros.least = zeros.doubt[0, 0]


@compiled
def take_setting(settings: Any, zeros: Any) -> None:
    """Doubt nothing that is not looked for, or that the user knows better by now."""
    known = settings.contact_position_std > 0.0 and settings.force_zero_std > 0.0
    if zeros.unknown == NONE and (known or settings.find_zeros == 0):
        zero_average.forget(zeros)


@compiled
def restart(zeros: Any) -> None:
    """The time in contact begins anew, and nothing is waited for; zeros in use stay."""
    zeros.stage = IDLE
    zeros.candidate = NONE
    zeros.waiting = 0
    zeros.since = 0.0
    zeros.refuted_since = math.inf
    zeros.looked_at = -math.inf
    asked_kinds.forget(zeros.asked)


@compiled
def look(settings: Any, bank: Any) -> bool:
    """Begin to look for zeros that are off, if it is time to; `take` has what is found.

    Args:
        settings: settings record.
        bank: its records `zeros`, `fit` and `search` are changed.

    Returns:
        True if onset.shift says by how much zeros in use are to move.
    """
    history, zeros, clock = bank.history, bank.zeros, bank.tool.contact_clock
    if settings.find_zeros == 0 or bank.onset.doubted != 0 or not is_tried(settings, SURFACE_ROW):
        return False
    # A delay of many milliseconds must have been found before, or ruled out.
    if place_delay.may_be_late(settings, bank.place) and bank.delay.windows < FEWEST_WINDOWS:
        return False
    # A press in one direction leaves too much to K, B and n alone; and the fits all look for K.
    if bank.tool.retreated == 0 or is_held(settings, 0):
        return False
    if searches.is_busy(bank) or clock - zeros.looked_at < EVERY:
        return False
    if not histories.is_motion_known(history, histories.of_place(history)):
        return False
    zeros.looked_at = clock
    # In the air the force's zero was seen better than a tissue shows it.
    zeros.possible = BOTH
    if bank.onset.in_air != 0:
        zeros.possible = OF_POSITION
        zeros.unknown &= OF_POSITION
        zeros.moved[1] = 0.0
    searches.begin(bank)
    zero_kinds.begin(settings, bank)
    return bool(zeros.stage == IDLE and _explain_nothing(bank))


@compiled
def take(settings: Any, bank: Any) -> bool:
    """Take a fit of the search that is solved, and begin the next; as `look`.

    Args:
        settings: settings record.
        bank: its records `zeros`, `fit` and `onset` are changed.
    """
    zeros, stage = bank.zeros, bank.zeros.stage
    seen_in_air = bank.onset.in_air != 0 and zeros.possible & OF_FORCE != 0
    if settings.find_zeros == 0 or seen_in_air:  # since it began
        zeros.stage = IDLE
        zeros.looked_at = -math.inf
        return False
    if stage == OF_CHOICE:
        zeros.stage = IDLE
        return _take_choice(settings, bank)
    if stage == AS_THEY_ARE:
        zeros.stage = IDLE
        return _take_them(bank)
    if zero_kinds.take(settings, bank):
        return _choose(settings, bank)
    return bool(zeros.stage == IDLE and _explain_nothing(bank))


@compiled
def _choose(settings: Any, bank: Any) -> bool:
    """Choose which zeros are off, by the fit with all unknown; as `look`."""
    zeros, fit, history = bank.zeros, bank.fit, bank.search.history
    zeros.refuted_since = math.inf
    zero_sensitivity.note_covariance(zeros, fit)
    sinks = fit.kind == SINKS
    if fit.kind == MOVES:  # where the surface is, is for the spline to say
        zeros.possible &= OF_FORCE
        if zeros.unknown & OF_POSITION != 0:
            zeros.waiting = 0
            return False
    possible = zeros.possible
    if zeros.unknown == NONE:
        asked = possible & OF_FORCE if sinks else possible
        largest = histories.largest(history, histories.of_place(history))
        zero_average.doubt(settings, zeros, asked, largest, fit.kind == MOVES)
    unknown = choose(settings, zeros, possible, sinks)
    if unknown == NONE and zeros.unknown != NONE and not speaks_against(zeros, possible):
        unknown = zeros.unknown
    zeros.chosen = unknown
    zero_sensitivity.note_doubt(zeros, possible, zeros.doubt_of_fit)
    zeros.shown = zeros.doubt_of_fit[0, 0]
    if unknown != possible and (unknown != NONE or zeros.unknown != NONE):
        copy_vector(zeros.fit, zeros.change)
        copy_matrix(zeros.doubt_of_fit, zeros.doubt_of_both)
        _hold_others(fit, unknown, zeros.moved)
        spline_descent.begin(settings, fit)
        zeros.stage = OF_CHOICE
        return False
    return _wait(settings, bank)


@compiled
def _take_choice(settings: Any, bank: Any) -> bool:
    """Take the fit in which only the zeros that were chosen are unknown; as `look`."""
    zeros = bank.zeros
    if not zero_kinds.explains_all(bank):
        zeros.waiting = 0
        return False
    zero_sensitivity.note_covariance(zeros, bank.fit)
    zero_sensitivity.note_doubt(zeros, zeros.chosen, zeros.doubt_of_fit)
    zeros.shown = zeros.doubt_of_fit[0, 0]
    zero_sensitivity.average(zeros, zeros.chosen, zeros.possible)
    return _wait(settings, bank)


@compiled
def _wait(settings: Any, bank: Any) -> bool:
    """Use what was chosen once it has stayed the same for long enough; as `look`.

    Tissue that has just changed looks the same for as long as the change was not found.
    """
    zeros, unknown, clock = bank.zeros, bank.zeros.chosen, bank.zeros.looked_at
    sinks = bank.fit.kind == SINKS
    if sinks and zeros.unknown != NONE:
        zeros.position = 0.0  # where the surface is by now is for the rows that follow it
    possible = _is_possible(bank.search.history, zeros)
    if not is_worth_it(zeros, unknown, sinks) or not possible:
        zeros.waiting = 0
    elif zeros.waiting == 0 or zeros.candidate != unknown or wanders(zeros, unknown, sinks):
        zeros.waiting = 1
        zeros.candidate = unknown
        zeros.since = clock
        zeros.begun[0] = zeros.position
        zeros.begun[1] = zeros.force
        copy_matrix(zeros.covariance, zeros.begun_covariance)
    if zeros.waiting != 0 and clock - zeros.since >= LASTING:
        if zeros.unknown != NONE:
            _use(bank)
            return True
        _begin_as_they_are(settings, bank)
    elif zeros.unknown != NONE and zeros.unknown == unknown:
        zero_sensitivity.keep_doubt(zeros, zeros.shown)
    return False


@compiled
def _begin_as_they_are(settings: Any, bank: Any) -> None:
    """Fit once more with the zeros in use: does that leave more?

    Tangents at the fit tell what other zeros would cost, but not where the fit ended in a valley of
    its own, as it may where the damping is next to unknown.
    """
    fit, zeros = bank.fit, bank.zeros
    zeros.cost_of_chosen = zeros.squares + cost_of_air(fit)
    spline_start.begin(settings, bank.search.history, fit, bank.rows[bank.judge.chosen])
    for i in range(2):
        # Of a surface that sinks the position is unknown in any case.
        if zeros.possible >> i & 1 != 0 and not (fit.kind == SINKS and i == 0):
            fit.held[spline.POSITION + i] = 1
            fit.values[spline.POSITION + i] = 0.0
    spline_descent.begin(settings, fit)
    zeros.stage = AS_THEY_ARE


@compiled
def _take_them(bank: Any) -> bool:
    """Use what was chosen, unless the zeros in use explain as much; as `look`."""
    without = bank.fit.squares + cost_of_air(bank.fit)
    if without < bank.zeros.cost_of_chosen + SIGNIFICANT:
        bank.zeros.waiting = 0
        return False
    _use(bank)
    return True


@compiled
def _hold_others(fit: Any, unknown: int, moved: Any) -> None:
    """Hold the zeros that are not unknown as they were given."""
    for i in range(2):
        if unknown >> i & 1 == 0:
            fit.held[spline.POSITION + i] = 1
            fit.values[spline.POSITION + i] = -moved[i]


@compiled
def _is_possible(history: Any, zeros: Any) -> bool:
    """False for zeros that are too far off, or too little, to be moved."""
    deepest, largest = histories.largest(history, histories.of_place(history))
    if abs(zeros.delay) > LARGEST_DELAY:
        return False
    if (
        abs(zeros.position) > LARGEST_POSITION * deepest
        or abs(zeros.force) > LARGEST_ZERO * largest
    ):
        return False
    if zeros.unknown != NONE:
        return True
    return bool(abs(zeros.position) > LEAST_POSITION or abs(zeros.force) > LEAST_ZERO * largest)


@compiled
def _use(bank: Any) -> None:
    """Note by how much the zeros are to move, and what is then left open."""
    zeros, onset, unknown = bank.zeros, bank.onset, bank.zeros.chosen
    zeros.unknown = unknown
    zeros.waiting = 0
    clear_vector(zeros.off)
    onset.shift[0] = zeros.position
    onset.shift[1] = zeros.force
    for i in range(2):
        zeros.moved[i] += onset.shift[i]
    onset.position_deviation = 0.0
    if unknown & OF_POSITION != 0 and bank.fit.kind != SINKS:
        onset.position_deviation = math.sqrt(max(zeros.covariance[0, 0], 0.0))
    if onset.in_air == 0:
        onset.force_deviation = math.nan
    if unknown & OF_FORCE != 0:
        onset.force_deviation = math.sqrt(max(zeros.covariance[1, 1], 0.0))
    copy_matrix(zeros.doubt_of_fit, zeros.doubt)
    zeros.deviation = math.sqrt(zeros.doubt[0, 0])
    zeros.least = zeros.shown


@compiled
def _explain_nothing(bank: Any) -> bool:
    """Zeros that explain nothing for long any more go back to those given; as `look`."""
    zeros, onset, clock = bank.zeros, bank.onset, bank.zeros.looked_at
    zeros.waiting = 0
    if zeros.unknown == NONE or not zeros.misfit > REFUTED:
        zeros.refuted_since = math.inf
        return False
    zeros.refuted_since = min(zeros.refuted_since, clock)
    if clock - zeros.refuted_since < LASTING:
        return False
    row = bank.rows[bank.judge.chosen]
    for i in range(2):
        onset.shift[i] = -zeros.moved[i]
    for i in range(4):
        zeros.fit[i] = row.state[LOG_STIFFNESS + i]
    onset.position_deviation = 0.0
    if onset.in_air == 0:
        onset.force_deviation = math.nan
    reset(zeros)
    return True
