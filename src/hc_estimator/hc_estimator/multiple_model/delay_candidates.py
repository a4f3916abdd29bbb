"""The law at every candidate delay, fitted to the points that are kept.

With one K for all points and the zeros as given; where that leaves far more than noise, with a
surface that is elsewhere, sinks or rises, and a force zero; where that does as well, with a K and a
surface for each half second (`delay_fit`, `delay_equations`). These are some dozens of fits, which
go on one by one over the samples that follow (`search`). What they say of the delay is for `delay`.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector
from hc_estimator.multiple_model import delay_equations, delay_fit, delay_points
from hc_estimator.multiple_model.delay_fit import STEPS
from hc_estimator.multiple_model.delay_points import count_of
from hc_estimator.multiple_model.delay_records import (
    AT_ZEROS,
    CANDIDATES,
    FITTED_ALIKE,
    FITTED_ALL,
    FITTED_FIRST,
    FITTED_ONE,
    FITTED_ZEROS,
    IDLE,
)

LEAD = 8.0  # log likelihood ratio to what is in use, zeros or delay
ONE = 4.0  # squares that are left, over those of the noise, up to which one K is enough
ZEROS_FIT = 3.0  # the same, up to which a law may have zeros of its own
VARYING = 8.0  # the same, from which on half seconds with their own K are tried
LEAST_GAIN = 0.25  # of what one K leaves, that must be left by one for each half second
FIRST_EXPONENTS = (1.0, 1.5, 2.0, 2.5)
FIRST_STEPS = 6  # of a fit that begins anew
# Points in the sums of one step (`search`), from which on the next candidate waits: 0.3 ms.
MOST_ADDED = 4000


@compiled
def begin(settings: Any, finder: Any, many_ways: bool) -> None:
    """Begin to fit the law at every candidate to the points that are kept; `go_on` goes on.

    Args:
        settings: settings record.
        finder: changed.
        many_ways: True if the tool has gone so many that one K may have zeros of its own.
    """
    finder.many_ways = 1 if many_ways else 0
    finder.varied = finder.varies
    finder.varies = 0
    if finder.fits == 0:
        finder.varied = 0
        finder.zeros = 0
        finder.chosen = CANDIDATES // 2
        _begin_laws(settings, finder)
        _sweep(settings, finder, FIRST_STEPS, True, FITTED_FIRST)
        return
    if finder.zeros != 0:
        delay_equations.keep_surface(finder)
    finder.stage = FITTED_FIRST


@compiled
def go_on(settings: Any, finder: Any) -> bool:
    """Fit some candidates; True once all that is to be asked of the points was.

    Args:
        settings: settings record.
        finder: begun. In the end law and left of the candidates, what the slot CANDIDATES holds,
            varies, fits and zeros are set.
    """
    finder.added = 0
    while finder.stage != IDLE and finder.added < MOST_ADDED:
        _take_step(settings, finder)
    return bool(finder.stage == IDLE)


@compiled
def _take_step(settings: Any, finder: Any) -> None:
    """Fit a candidate, or judge what all of them say."""
    stage = finder.stage
    if finder.side != 0:
        _fit_next(settings, finder)
    elif stage == FITTED_FIRST:
        _begin_with_last(settings, finder)
    elif stage == FITTED_ONE:
        _ask_for_zeros(settings, finder)
    elif stage == FITTED_ZEROS:
        _judge_zeros(settings, finder)
    elif stage == FITTED_ALIKE:
        _ask_for_many(settings, finder)
    elif stage == FITTED_ALL:
        left = finder.left[CANDIDATES]
        fits = finder.varies != 0 or left < VARYING * count_of(finder)
        finder.fits = 1 if fits else 0
        finder.stage = IDLE


@compiled
def _begin_with_last(settings: Any, finder: Any) -> None:
    """Fit one K for all points; where half seconds had their own, if one is enough by now."""
    delay_equations.keep_laws(finder)
    finder.best = finder.chosen
    many_ways = finder.many_ways != 0
    if finder.varied != 0:
        _choose_zeros(finder, many_ways)
        delay_points.shift(finder, 0.0)
        best = finder.best
        delay_equations.weigh(finder, best)
        delay_fit.improve(settings, finder, best, best, best, FIRST_STEPS)
        delay_fit.find_zero(settings, finder)
        if finder.left[CANDIDATES] > ONE * count_of(finder):
            finder.stage = FITTED_ALIKE
            return
    finder.varied = 0
    _choose_zeros(finder, finder.zeros != 0 and many_ways)
    _sweep(settings, finder, STEPS, False, FITTED_ONE)


@compiled
def _ask_for_zeros(settings: Any, finder: Any) -> None:
    """Let the zeros be as they were given where the law does not fit, or else unknown."""
    finder.stage = FITTED_ALIKE
    if finder.zeros != 0:
        if not finder.left[CANDIDATES] < ZEROS_FIT * count_of(finder):
            _choose_zeros(finder, False)
            _sweep(settings, finder, FIRST_STEPS, False, FITTED_ALIKE)
    elif finder.many_ways != 0:
        finder.without = finder.left[CANDIDATES]
        finder.without_at = finder.chosen
        delay_equations.keep_laws(finder)
        _choose_zeros(finder, True)
        _sweep(settings, finder, FIRST_STEPS, False, FITTED_ZEROS)


@compiled
def _judge_zeros(settings: Any, finder: Any) -> None:
    """Let the zeros be unknown where that is far likelier, and the law then fits.

    Zeros take up what no law explains as well, and a delay with them: of a robot that gives way 4.5
    ms were found in step, with 4 to 8 times the squares of the noise left. Where zeros are what is
    wrong, 0.8 to 2.4 are.
    """
    count, after = count_of(finder), finder.left[CANDIDATES]
    finder.stage = FITTED_ALIKE
    likelier = 0.5 * (finder.without - after) > LEAD * max(after / count, 1.0)
    if not (likelier and after < ZEROS_FIT * count):
        delay_equations.take_back_laws(finder)
        finder.chosen = finder.without_at
        _choose_zeros(finder, False)
        _sweep(settings, finder, STEPS, False, FITTED_ALIKE)


@compiled
def _ask_for_many(settings: Any, finder: Any) -> None:
    """Let each half second have a K of its own where one leaves too much.

    A law that does not fit says nothing of zeros, and is far from what tissue is like.
    """
    alike, best = finder.left[CANDIDATES], finder.best
    finder.stage = FITTED_ALL
    if finder.varied == 0 and not alike > VARYING * count_of(finder):
        return
    delay_equations.take_back_laws(finder)
    finder.chosen = best
    _choose_zeros(finder, False)
    finder.varies = 1
    delay_points.shift(finder, 0.0)
    delay_fit.improve(settings, finder, best, best, best, FIRST_STEPS)
    delay_fit.find_zero(settings, finder)
    if not finder.left[CANDIDATES] < LEAST_GAIN * alike:
        finder.varies = 0
    _sweep(settings, finder, STEPS, False, FITTED_ALL)


@compiled
def _choose_zeros(finder: Any, unknown: bool) -> None:
    """Let the zeros be unknown, or as they were given."""
    if not unknown:
        delay_equations.forget_zeros(finder)
    elif finder.zeros == 0:
        delay_equations.keep_surface(finder)
    finder.zeros = 1 if unknown else 0


@compiled
def _begin_laws(settings: Any, finder: Any) -> None:
    """First law of no delay: with the usual damping and p, and the n that leaves least."""
    centre = CANDIDATES // 2
    law, trial, best = finder.law[centre], finder.trial, math.inf
    law[0], law[1] = 1.0, delay_fit.FIRST_DAMPING
    law[2], law[3] = settings.initial_displacement_exponent, settings.initial_velocity_exponent
    delay_equations.forget_zeros(finder)
    delay_points.shift(finder, 0.0)
    delay_equations.weigh(finder, centre)
    copy_vector(law, trial)
    for exponent in FIRST_EXPONENTS:
        trial[2] = exponent
        left = delay_equations.add_up(settings, finder, centre, trial)
        if left < best:
            best = left
            law[2] = exponent


@compiled
def _sweep(settings: Any, finder: Any, steps: int, anew: bool, stage: int) -> None:
    """Begin to improve the law of every candidate, outwards from the one that left least so far.

    Args:
        settings: settings record.
        finder: changed; chosen becomes the one that leaves least, and place is found beside it.
        steps: of each, at most.
        anew: True if a candidate begins with the law of the one next to it; else with that only
            where it leaves less than its own.
        stage: that is reached in the end.
    """
    first = finder.chosen
    delay_points.shift(finder, 0.0)
    delay_equations.weigh(finder, first)
    if finder.varies != 0:
        delay_equations.temper(settings, finder, first)
    delay_fit.improve(settings, finder, first, first, first, steps)
    finder.begun_at = first
    finder.steps = steps
    finder.anew = 1 if anew else 0
    finder.side = 1
    finder.away = 1
    finder.stage = stage


@compiled
def _fit_next(settings: Any, finder: Any) -> None:
    """Improve the law of the next candidate, or end with what is between them."""
    centre, side = CANDIDATES // 2, finder.side
    j = finder.begun_at + side * finder.away
    if abs(j - centre) > finder.reach:
        if side == 1:
            finder.side = -1
            finder.away = 1
        else:
            finder.side = 0
            delay_fit.find_zero(settings, finder)
        return
    anew = finder.anew != 0
    if anew:
        copy_vector(finder.law[j - side], finder.law[j])
    delay_fit.improve(settings, finder, j, j, j if anew else j - side, finder.steps)
    if delay_fit.least_near(finder, j) < delay_fit.least_near(finder, finder.chosen):
        finder.chosen = j
    finder.away += 1


@compiled
def note_law(settings: Any, finder: Any) -> None:
    """K, B and n at the zeros that are in use, to begin the rows with."""
    slot, zeros = CANDIDATES, finder.zeros != 0
    if zeros:
        slot, base = AT_ZEROS, delay_fit.candidate_below(finder)
        copy_vector(finder.law[CANDIDATES], finder.law[slot])
        delay_equations.forget_zeros_of(finder.law[slot])
        finder.zeros = 0
        delay_points.shift(finder, finder.place - base)
        delay_fit.improve(settings, finder, base, slot, slot, FIRST_STEPS)
        finder.zeros = 1
    law, fit = finder.law[slot], finder.fit
    fit[0], fit[1], fit[2] = law[0], law[0] * law[1], law[2]
