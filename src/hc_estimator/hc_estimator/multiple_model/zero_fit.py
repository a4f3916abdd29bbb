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

from hc_estimator.adaptation import noise_color
from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector, copy_matrix, copy_vector
from hc_estimator.multiple_model import (
    air_window,
    place_delay,
    spline,
    spline_start,
    zero_average,
    zero_rival,
    zero_sensitivity,
)
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model.hypotheses import (
    BREATHES,
    LOG_STIFFNESS,
    OWN,
    SURFACE,
    SURFACE_ROW,
    is_tried,
)
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import is_held
from hc_estimator.multiple_model.spline_fit import CONSISTENT, solve_least_squares
from hc_estimator.multiple_model.spline_records import MOVES, SINKS, STAYS, VARIES
from hc_estimator.multiple_model.zero_choice import (
    SIGNIFICANT,
    choose,
    cost_of_air,
    is_worth_it,
    speaks_against,
    wanders,
)
from hc_estimator.multiple_model.zero_records import BOTH, NONE, OF_FORCE, OF_POSITION
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "find_zeros",
        "bool",
        True,
        "Look for a contact position and a force zero that are off, where the motion shows them.",
    ),
)

NEARLY = 3.0  # squares left, in those of the noise, up to which a fit may explain next to all
LEAST_SHARE = 0.01  # of what the row in charge misses, that such a fit leaves
REFUTED = 6.0  # the same, at which zeros that were found are taken back
FEWEST_WINDOWS = 4  # of the delay before a zero is looked for
EVERY = 1.0  # time in contact between two fits [s]
LEAST_TIME = 2.0  # that they must span [s]
LEAST_TIME_VARYING = 6.0  # the same where the tissue or the surface does not stay [s]
LASTING = 2.0  # time in contact for which a choice must stay the same [s]
LEAST_POSITION = 0.05  # [mm]
LEAST_ZERO = 0.005  # of the largest force
LARGEST_POSITION = 0.5  # of the largest depth
LARGEST_ZERO = 0.3  # of the largest force
LARGEST_SURFACE = 2.0  # of a surface that breathes, for which a force zero is asked [mm]
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
    zeros.candidate = NONE
    zeros.waiting = 0
    zeros.since = 0.0
    zeros.refuted_since = math.inf
    zeros.looked_at = -math.inf


@compiled
def look(settings: Any, bank: Any) -> bool:
    """Look for zeros that are off; True if onset.shift says by how much they are to move.

    Args:
        settings: settings record.
        bank: its records `zeros`, `fit` and `onset` are changed, and the weights of its points.
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
    if clock - zeros.looked_at < EVERY:
        return False
    first = histories.of_place(history)
    if not histories.is_motion_known(history, first):
        return False
    zeros.looked_at = clock
    fit = bank.fit
    # In the air the force's zero was seen better than a tissue shows it.
    possible = BOTH
    if bank.onset.in_air != 0:
        possible = OF_POSITION
        zeros.unknown &= OF_POSITION
        zeros.moved[1] = 0.0
    if not _fit_any(settings, bank, possible):
        zeros.waiting = 0
        return _review(bank, clock)
    zeros.refuted_since = math.inf
    zero_sensitivity.note_covariance(zeros, fit)
    sinks = fit.kind == SINKS
    if fit.kind == MOVES:  # where the surface is, is for the spline to say
        possible &= OF_FORCE
        if zeros.unknown & OF_POSITION != 0:
            zeros.waiting = 0
            return False
    if zeros.unknown == NONE:
        asked = possible & OF_FORCE if sinks else possible
        largest = histories.largest(history, first)
        zero_average.doubt(settings, zeros, asked, largest, fit.kind == MOVES)
    unknown = choose(settings, zeros, possible, sinks)
    if unknown == NONE and zeros.unknown != NONE and not speaks_against(zeros, possible):
        unknown = zeros.unknown
    zero_sensitivity.note_doubt(zeros, possible, zeros.doubt_of_fit)
    shown = zeros.doubt_of_fit[0, 0]
    if unknown != possible and (unknown != NONE or zeros.unknown != NONE):
        copy_vector(zeros.fit, zeros.change)
        copy_matrix(zeros.doubt_of_fit, zeros.doubt_of_both)
        _hold_others(fit, unknown, zeros.moved)
        if not _explains(settings, bank):
            zeros.waiting = 0
            return False
        zero_sensitivity.note_covariance(zeros, fit)
        zero_sensitivity.note_doubt(zeros, unknown, zeros.doubt_of_fit)
        shown = zeros.doubt_of_fit[0, 0]
        zero_sensitivity.average(zeros, unknown, possible)
    if sinks and zeros.unknown != NONE:
        zeros.position = 0.0  # where the surface is by now is for the rows that follow it
    if not is_worth_it(zeros, unknown, sinks) or not _is_possible(history, zeros, first):
        zeros.waiting = 0
    elif zeros.waiting == 0 or zeros.candidate != unknown or wanders(zeros, unknown, sinks):
        zeros.waiting = 1
        zeros.candidate = unknown
        zeros.since = clock
        zeros.begun[0] = zeros.position
        zeros.begun[1] = zeros.force
        copy_matrix(zeros.covariance, zeros.begun_covariance)
    # Tissue that has just changed looks the same for as long as the change was not found.
    if zeros.waiting != 0 and clock - zeros.since >= LASTING:
        if zeros.unknown != NONE or _explains_more(settings, bank, possible):
            _use(bank.onset, zeros, unknown, sinks, shown)
            return True
        zeros.waiting = 0
    if zeros.unknown != NONE and zeros.unknown == unknown:
        zero_sensitivity.keep_doubt(zeros, shown)
    return False


@compiled
def _fit_any(settings: Any, bank: Any, possible: int) -> bool:
    """Fit tissue that stays, on a surface that sinks or breathes, or that varies.

    False if none explains all, or if what the row in charge says of the surface, with the zeros as
    they are, is likelier (`zero_rival`).

    The smallest squares left over those of the noise are in zeros.misfit.
    """
    history, zeros, fit = bank.history, bank.zeros, bank.fit
    first = histories.of_place(history)
    last = history.points[(history.count - 1) % POINTS].time
    span = last - history.points[first % POINTS].time
    zeros.misfit = math.inf
    row = bank.rows[bank.judge.chosen]
    near = spline.first_in_reach(history, first, history.count)
    if BREATHES[row.index]:
        first = near  # all kinds are compared with what it says
    rival, largest = -math.inf, histories.largest(history, first)
    if span >= LEAST_TIME:
        rival = zero_rival.evidence_of_surface(settings, bank, first)
    # Rows begin anew at the given surface: from one that is far from it they would take seconds.
    breathes = not SURFACE[row.index] or abs(row.state[OWN]) < LARGEST_SURFACE
    # Where no row explains the force, none in charge is right about the surface.
    breathes = breathes and (BREATHES[row.index] or row.model_error > 0.0)
    breathes = breathes and possible & OF_FORCE != 0
    air = 0.0, math.inf
    if possible & OF_FORCE != 0:
        noise, place = bank.sensor_noise[1], bank.air.place_variance
        of_means = noise_color.of_means(bank.color[1], bank.noise[1], noise)
        air = air_window.zero_of(bank.air.window, noise, of_means, place)
    rival -= 0.5 * (air[0] / air[1]) ** 2
    for kind in (STAYS, SINKS, MOVES, VARIES):
        if kind == MOVES and not breathes:
            continue
        if span < (LEAST_TIME if kind == STAYS else LEAST_TIME_VARYING):
            continue
        spline.free_all(settings, fit)
        if possible & OF_FORCE == 0:
            fit.held[spline.FORCE_ZERO] = 1
        fit.air_zero, fit.air_zero_deviation = air
        begin = near if kind & (VARIES + MOVES) != 0 else first
        if not spline.lay_out(history, fit, begin, history.count, kind):
            continue
        spline_start.begin(settings, history, fit, row)
        explains = _explains(settings, bank)
        if air[1] < math.inf and fit.values[spline.POSITION] < bank.air.window.mean[0]:
            fit.air_zero_deviation = math.inf  # that was no air
            spline_start.begin(settings, history, fit, row)
            explains = _explains(settings, bank)
        if explains:
            if rival == -math.inf or kind == zero_rival.kind_in_charge(bank):
                return True
            return bool(rival < zero_rival.evidence_of_zeros(fit, zeros.squares, largest))
    return False


@compiled
def _explains(settings: Any, bank: Any) -> bool:
    """Fit from fit.values on; False if more than noise is left, or next to nothing else.

    How much that is beyond noise alone goes into what the fit claims to know of the zeros.
    """
    zeros, fit, noise = bank.zeros, bank.fit, histories.noise_of_points(bank)
    squares = solve_least_squares(settings, bank.history, fit, noise)
    if not (math.isfinite(squares) and fit.expected > 0.0):
        return False
    zeros.squares = squares
    left = squares / fit.expected
    zeros.misfit = min(zeros.misfit, left)
    zeros.inflation = left if left > CONSISTENT else 1.0
    missed = max(left - 1.0, 0.0) * noise[1] * noise[2]
    by_all = bank.rows[bank.judge.chosen].model_error
    nearly = fit.kind == STAYS or missed < LEAST_SHARE * by_all
    return bool(left < CONSISTENT or (left < NEARLY and nearly))


@compiled
def _explains_more(settings: Any, bank: Any, possible: int) -> bool:
    """True if the last fit leaves less than one with the zeros in use.

    Tangents at the fit tell what other zeros would cost, but not where the fit ended in a valley of
    its own, as it may where the damping is next to unknown.
    """
    fit, noise = bank.fit, histories.noise_of_points(bank)
    cost = bank.zeros.squares + cost_of_air(fit)
    spline_start.begin(settings, bank.history, fit, bank.rows[bank.judge.chosen])
    for i in range(2):
        # Of a surface that sinks the position is unknown in any case.
        if possible >> i & 1 != 0 and not (fit.kind == SINKS and i == 0):
            fit.held[spline.POSITION + i] = 1
            fit.values[spline.POSITION + i] = 0.0
    without = solve_least_squares(settings, bank.history, fit, noise)
    return not without + cost_of_air(fit) < cost + SIGNIFICANT


@compiled
def _hold_others(fit: Any, unknown: int, moved: Any) -> None:
    """Hold the zeros that are not unknown as they were given."""
    for i in range(2):
        if unknown >> i & 1 == 0:
            fit.held[spline.POSITION + i] = 1
            fit.values[spline.POSITION + i] = -moved[i]


@compiled
def _is_possible(history: Any, zeros: Any, first: int) -> bool:
    """False for zeros that are too far off, or too little, to be moved."""
    deepest, largest = histories.largest(history, first)
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
def _use(onset: Any, zeros: Any, unknown: int, sinks: bool, shown: float) -> None:
    """Note by how much the zeros are to move, and what is then left open.

    `shown` is the variance of ln K by these zeros, be they all that is off.
    """
    zeros.unknown = unknown
    zeros.waiting = 0
    clear_vector(zeros.off)
    onset.shift[0] = zeros.position
    onset.shift[1] = zeros.force
    for i in range(2):
        zeros.moved[i] += onset.shift[i]
    onset.position_deviation = 0.0
    if unknown & OF_POSITION != 0 and not sinks:
        onset.position_deviation = math.sqrt(max(zeros.covariance[0, 0], 0.0))
    if onset.in_air == 0:
        onset.force_deviation = math.nan
    if unknown & OF_FORCE != 0:
        onset.force_deviation = math.sqrt(max(zeros.covariance[1, 1], 0.0))
    copy_matrix(zeros.doubt_of_fit, zeros.doubt)
    zeros.deviation = math.sqrt(zeros.doubt[0, 0])
    zeros.least = shown


@compiled
def _review(bank: Any, clock: float) -> bool:
    """Zeros that explain nothing for long any more go back to those given."""
    zeros, onset = bank.zeros, bank.onset
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
