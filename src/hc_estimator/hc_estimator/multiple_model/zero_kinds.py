"""Which tissue and surface explain the points, be the zeros as they may?

Tissue that stays is asked first, then a surface that sinks or breathes beneath it, then a stiffness
that varies; each fit goes on over many samples (`search`). Where the row in charge says that the
surface moves, what it says at the zeros as they are is fitted before, and whoever explains the
points has to be likelier than that (`zero_rival`).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.adaptation import noise_color
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import (
    air_window,
    asked_kinds,
    spline,
    zero_rival,
)
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import search as searches
from hc_estimator.multiple_model.hypotheses import BREATHES, OWN, SURFACE
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.spline_fit import CONSISTENT
from hc_estimator.multiple_model.spline_records import MOVES, SINKS, STAYS, VARIES
from hc_estimator.multiple_model.zero_records import (
    IDLE,
    KIND_IN_AIR,
    OF_FORCE,
    OF_KIND,
    OF_RIVAL,
)

NEARLY = 3.0  # squares left, in those of the noise, up to which a fit may explain next to all
LEAST_SHARE = 0.01  # of what the row in charge misses, that such a fit leaves
LEAST_TIME = 2.0  # that the points must span [s]
LEAST_TIME_VARYING = 6.0  # the same where the tissue or the surface does not stay [s]
LARGEST_SURFACE = 2.0  # of a surface that breathes, for which a force zero is asked [mm]
KINDS = np.array([STAYS, SINKS, MOVES, VARIES])


@compiled
def begin(settings: Any, bank: Any) -> None:
    """Begin to ask, with the zeros of zeros.possible unknown; zeros.stage is IDLE if none can be.

    The smallest squares left over those of the noise will be in zeros.misfit.
    """
    history, zeros = bank.search.history, bank.zeros
    row = bank.rows[bank.judge.chosen]
    zeros.first = histories.of_place(history)
    last = history.points[(history.count - 1) % POINTS].time
    zeros.span = last - history.points[zeros.first % POINTS].time
    zeros.near = spline.first_in_reach(history, zeros.first, history.count)
    if BREATHES[row.index]:
        zeros.first = zeros.near  # all kinds are compared with what it says
    # Rows begin anew at the given surface: from one that is far from it they would take seconds.
    breathes = not SURFACE[row.index] or abs(row.state[OWN]) < LARGEST_SURFACE
    # Where no row explains the force, none in charge is right about the surface.
    breathes = breathes and (BREATHES[row.index] or row.model_error > 0.0)
    zeros.breathes = 1 if breathes and zeros.possible & OF_FORCE != 0 else 0
    zeros.air_zero = 0.0
    zeros.air_deviation = math.inf
    if zeros.possible & OF_FORCE != 0:
        noise, place = bank.sensor_noise[1], bank.air.place_variance
        of_means = noise_color.of_means(bank.color[1], bank.noise[1], noise)
        air = air_window.zero_of(bank.air.window, noise, of_means, place)
        zeros.air_zero = air[0]
        zeros.air_deviation = air[1]
    zeros.misfit = math.inf
    asked_kinds.begin(zeros.asked, history.version)
    zeros.rival = -math.inf
    zeros.in_charge = zero_rival.kind_in_charge(bank)
    zeros.kind = 0
    if zeros.span >= LEAST_TIME and zero_rival.begin(settings, bank, zeros.first):
        zeros.stage = OF_RIVAL
    else:
        _begin_next(settings, bank)


@compiled
def _begin_next(settings: Any, bank: Any) -> None:
    """Begin with zeros.kind, or the next that may be; IDLE if there is none."""
    zeros, history, fit = bank.zeros, bank.search.history, bank.fit
    clock = bank.tool.contact_clock
    zeros.stage = IDLE
    while zeros.kind < KINDS.size:
        kind = KINDS[zeros.kind]
        if zeros.rival > -math.inf and asked_kinds.is_ruled_out(zeros.asked, zeros.kind, clock):
            zeros.misfit = min(zeros.misfit, zeros.asked.left[zeros.kind])
            zeros.kind += 1
            continue
        least = LEAST_TIME if kind == STAYS else LEAST_TIME_VARYING
        if zeros.span >= least and (kind != MOVES or zeros.breathes != 0):
            spline.free_all(settings, fit)
            if zeros.possible & OF_FORCE == 0:
                fit.held[spline.FORCE_ZERO] = 1
            fit.air_zero = zeros.air_zero
            fit.air_zero_deviation = zeros.air_deviation
            first = zeros.near if kind & (VARIES + MOVES) != 0 else zeros.first
            if spline.lay_out(history, fit, first, history.count, kind):
                searches.begin_fit(settings, bank)
                zeros.stage = OF_KIND
                return
        zeros.kind += 1


@compiled
def take(settings: Any, bank: Any) -> bool:
    """Take the fit that is solved, and begin the next if it does not explain all but the noise.

    Returns:
        True if it does, and is likelier than what the row in charge says. zeros.stage is IDLE then,
        and where none does.
    """
    zeros, fit = bank.zeros, bank.fit
    if zeros.stage == OF_RIVAL:
        of_air = zeros.air_zero / zeros.air_deviation
        zeros.rival = zero_rival.evidence_of_surface(fit) - 0.5 * of_air * of_air
        _begin_next(settings, bank)
        return False
    explains = explains_all(bank)
    in_air = fit.values[spline.POSITION] < bank.air.window.mean[0]
    if zeros.stage == OF_KIND and zeros.air_deviation < math.inf and in_air:
        fit.air_zero_deviation = math.inf  # that was no air
        searches.begin_fit(settings, bank)
        zeros.stage = KIND_IN_AIR
        return False
    zeros.stage = IDLE
    left = fit.squares / fit.expected if fit.expected > 0.0 else math.inf
    asked_kinds.note(zeros.asked, zeros.kind, left, bank.tool.contact_clock)
    if not explains:
        zeros.kind += 1
        _begin_next(settings, bank)
        return False
    if zeros.rival == -math.inf or KINDS[zeros.kind] == zeros.in_charge:
        return True
    largest = histories.largest(bank.search.history, zeros.first)
    return bool(zeros.rival < zero_rival.evidence_of_zeros(fit, zeros.squares, largest))


@compiled
def explains_all(bank: Any) -> bool:
    """False if the fit leaves more than noise, or next to nothing else.

    How much that is beyond noise alone goes into what the fit claims to know of the zeros.
    """
    zeros, fit, noise = bank.zeros, bank.fit, bank.search.noise
    if not (math.isfinite(fit.squares) and fit.expected > 0.0):
        return False
    zeros.squares = fit.squares
    left = fit.squares / fit.expected
    zeros.misfit = min(zeros.misfit, left)
    zeros.inflation = left if left > CONSISTENT else 1.0
    missed = max(left - 1.0, 0.0) * noise[1] * noise[2]
    by_all = bank.rows[bank.judge.chosen].model_error
    nearly = fit.kind == STAYS or missed < LEAST_SHARE * by_all
    return bool(left < CONSISTENT or (left < NEARLY and nearly))
