"""The law at every candidate delay, fitted to the points that are kept.

With one K for all points and the zeros as given; where that leaves far more than noise, with a
surface that is elsewhere, sinks or rises, and a force zero; where that does as well, with a K and a
surface for each half second (`delay_fit`, `delay_equations`). What it says of the delay is for
`delay`.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector
from hc_estimator.multiple_model import delay_equations, delay_fit, delay_points
from hc_estimator.multiple_model.delay_fit import STEPS
from hc_estimator.multiple_model.delay_records import AT_ZEROS, CANDIDATES

LEAD = 8.0  # log likelihood ratio to what is in use, zeros or delay
ONE = 4.0  # squares that are left, over those of the noise, up to which one K is enough
ZEROS_FIT = 3.0  # the same, up to which a law may have zeros of its own
VARYING = 8.0  # the same, from which on half seconds with their own K are tried
LEAST_GAIN = 0.25  # of what one K leaves, that must be left by one for each half second
FIRST_EXPONENTS = (1.0, 1.5, 2.0, 2.5)
FIRST_STEPS = 6  # of a fit that begins anew


@compiled
def fit(settings: Any, finder: Any, count: int, many_ways: bool) -> None:
    """Fit the law at every candidate: with one K, or where that leaves too much with many.

    Args:
        settings: settings record.
        finder: law and left of the candidates, what the slot CANDIDATES holds, varies and zeros are
            set.
        count: number of points.
        many_ways: True if the tool has gone so many that one K may have zeros of its own.
    """
    varied = finder.varies
    finder.varies = 0
    if finder.fits == 0:
        varied = 0
        finder.zeros = 0
        finder.chosen = CANDIDATES // 2
        _begin(settings, finder)
        _improve(settings, finder, FIRST_STEPS, True)
    elif finder.zeros != 0:
        delay_equations.keep_surface(finder)
    delay_equations.keep_laws(finder)
    best = finder.chosen
    if varied != 0:  # has it one K by now?
        _choose_zeros(finder, many_ways)
        delay_points.shift(finder, 0.0)
        delay_equations.weigh(finder, best)
        delay_fit.improve(settings, finder, best, best, best, FIRST_STEPS)
        delay_fit.find_zero(settings, finder)
        varied = 1 if finder.left[CANDIDATES] > ONE * count else 0
    if varied == 0:
        _choose_zeros(finder, finder.zeros != 0 and many_ways)
        _improve(settings, finder, STEPS, False)
        if finder.zeros != 0 and not finder.left[CANDIDATES] < ZEROS_FIT * count:
            _choose_zeros(finder, False)
            _improve(settings, finder, FIRST_STEPS, False)
        elif finder.zeros == 0 and many_ways:
            _ask_for_zeros(settings, finder, count)
        varied = 1 if finder.left[CANDIDATES] > VARYING * count else 0
    alike = finder.left[CANDIDATES]
    if varied != 0:
        # A law that does not fit says nothing of zeros, and is far from what tissue is like.
        delay_equations.take_back_laws(finder)
        finder.chosen = best
        _choose_zeros(finder, False)
        finder.varies = 1
        delay_points.shift(finder, 0.0)
        delay_fit.improve(settings, finder, best, best, best, FIRST_STEPS)
        delay_fit.find_zero(settings, finder)
        if not finder.left[CANDIDATES] < LEAST_GAIN * alike:
            finder.varies = 0
        _improve(settings, finder, STEPS, False)
    fits = finder.varies != 0 or finder.left[CANDIDATES] < VARYING * count
    finder.fits = 1 if fits else 0


@compiled
def _ask_for_zeros(settings: Any, finder: Any, count: int) -> None:
    """Let the zeros be unknown where that is far likelier, and the law then fits.

    Zeros take up what no law explains as well, and a delay with them: of a robot that gives way 4.5
    ms were found in step, with 4 to 8 times the squares of the noise left. Where zeros are what is
    wrong, 0.8 to 2.4 are.
    """
    before, best = finder.left[CANDIDATES], finder.chosen
    delay_equations.keep_laws(finder)
    _choose_zeros(finder, True)
    _improve(settings, finder, FIRST_STEPS, False)
    after = finder.left[CANDIDATES]
    likelier = 0.5 * (before - after) > LEAD * max(after / count, 1.0)
    if not (likelier and after < ZEROS_FIT * count):
        delay_equations.take_back_laws(finder)
        finder.chosen = best
        _choose_zeros(finder, False)
        _improve(settings, finder, STEPS, False)


@compiled
def _choose_zeros(finder: Any, unknown: bool) -> None:
    """Let the zeros be unknown, or as they were given."""
    if not unknown:
        delay_equations.forget_zeros(finder)
    elif finder.zeros == 0:
        delay_equations.keep_surface(finder)
    finder.zeros = 1 if unknown else 0


@compiled
def _begin(settings: Any, finder: Any) -> None:
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
def _improve(settings: Any, finder: Any, steps: int, anew: bool) -> None:
    """Improve the law of every candidate, outwards from the one that left least so far.

    Args:
        settings: settings record.
        finder: changed; chosen becomes the one that leaves least, and place is found beside it.
        steps: of each, at most.
        anew: True if a candidate begins with the law of the one next to it; else with that only
            where it leaves less than its own.
    """
    centre, first = CANDIDATES // 2, finder.chosen
    delay_points.shift(finder, 0.0)
    delay_equations.weigh(finder, first)
    if finder.varies != 0:
        delay_equations.temper(settings, finder, first)
    delay_fit.improve(settings, finder, first, first, first, steps)
    finder.chosen = first
    for side in (1, -1):
        for away in range(1, 2 * finder.reach + 1):
            j = first + side * away
            if abs(j - centre) > finder.reach:
                break
            if anew:
                copy_vector(finder.law[j - side], finder.law[j])
            delay_fit.improve(settings, finder, j, j, j if anew else j - side, steps)
            if delay_fit.least_near(finder, j) < delay_fit.least_near(finder, finder.chosen):
                finder.chosen = j
    delay_fit.find_zero(settings, finder)


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
