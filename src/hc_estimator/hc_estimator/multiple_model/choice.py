"""The choice among the hypotheses: the calmest of those that predict as well as the best.

A row that claims to fit (no model error), yet is clearly less likely than another that does, is
refuted and out of the choice; so is one whose innovations are far from consistent. The likelihood
is not asked where the law does not fit: there it would choose the row that overfits the moment.
(Ours; see `hc bench accuracy ablation`.) What the rows are measured by is found in `judge`.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import contradiction, plausible
from hc_estimator.multiple_model.hypotheses import (
    FITTED,
    FRESH,
    OWN,
    PLAIN,
    REFINED_FROM,
    REFINES,
    RESERVE,
    STEADY_SURFACE_ROW,
    SURFACE,
)
from hc_estimator.multiple_model.rows import seed

MEMORY = 0.4  # time constant of the scores [s]
MARGIN = 1.15  # mean square over the best from which on a row predicts worse
FORGIVEN = 10.0  # mean square over the best up to which an old error counts
MISFIT_MARGIN = 3.0  # the same for a row that claims to fit, over one with a model error
FREE_MARGIN = 1.5  # the same for one that may drift, which can follow a misfit for a while
REFUTED = 5.0  # log likelihood ratio
LIKELIER = 2.0  # the same by which a row that refines another must be likelier than to stay
REFUTED_AFTER = 1.5  # time in contact before which nobody is refuted [s]
FLOOR = 15.0  # of the log likelihoods below the best: what was long ago is forgiven
CLAIM = 1.0  # mean square over what a row claims up to which its errors are its ignorance
LEARNING_NIS = 1.5  # recent_nis (mean 2) below which it is its ignorance that dominates
CONSISTENT = 2.5  # recent_nis over that of the best from which on a row is far from consistent
FAR_BETTER = 4.0  # ratio of mean squares above which nothing else counts
# Mean square of the others over a moving surface's before one is believed against a misfit: tissue
# that relaxes lets go early, and that looks like a surface that has sunk.
SURFACE_GAIN = 1.3
UNEXPLAINED = 4.0  # mean square that a moving surface costs as long as it explains nothing
UNKNOWN_POSITION = 0.5  # deviation of a surface from which on it may be anywhere [mm]
WAIT = 2.0  # time in contact after which a row seeded from the chosen one counts [s]
SEEDED_SCORE = 1.5  # mean square over the chosen row's that it begins with
FOUND_FOR = 2.5  # time in contact for which the answer of least squares holds [s]
STEADY_TIME = 4.0  # in contact that a surface at a steady speed has to explain, at least [s]


@compiled
def counts(row: Any, clock: float) -> bool:
    """True unless the row is still waiting after it was seeded anew."""
    return bool(row.active != 0 and clock >= row.counts_from)


@compiled
def seed_behind(chosen: Any, row: Any, clock: float) -> None:
    """Give a row the state of the chosen one; it waits, and its copied past counts less.

    Args:
        chosen: the row in charge.
        row: changed.
        clock: contact clock [s].
    """
    seed(chosen, row, clock, clock + WAIT)
    row.log_likelihood = chosen.log_likelihood - REFUTED
    row.score = SEEDED_SCORE * chosen.score


@compiled
def stands_by(judge: Any, m: int) -> bool:
    """True for rows by which nobody is measured until they are chosen.

    A surface at a steady speed passes for the flank of a lump for a moment, and would refute the
    row that follows the lump; one under a tissue that varies as well can follow anything. And what
    refines another row stands for that one.
    """
    return bool(REFINES[m] or ((m == STEADY_SURFACE_ROW or RESERVE[m]) and m != judge.chosen))


@compiled
def steadiest_nis(judge: Any, rows: Any) -> float:
    """Recent mean of the normalised innovation squared of the row in which it is smallest."""
    least = math.inf
    for m in range(FRESH):
        if rows[m].active != 0 and not stands_by(judge, m):
            least = min(least, rows[m].recent_nis)
    return max(least, 2.0)


@compiled
def trusted_motion(judge: Any, rows: Any) -> int:
    """Row whose motion of the tool is believed: the chosen one, unless it is far from consistent.

    A row that is led astray takes its velocity along, and all others would look wrong by that.
    """
    steadiest = judge.chosen
    if rows[steadiest].recent_nis <= CONSISTENT * steadiest_nis(judge, rows):
        return steadiest  # type: ignore[no-any-return]
    for m in range(FRESH):
        if rows[m].active != 0 and rows[m].recent_nis < rows[steadiest].recent_nis:
            steadiest = m
    return steadiest  # type: ignore[no-any-return]


@compiled
def _is_consistent(row: Any, clock: float, steadiest: float) -> bool:
    """True for a row that counts and whose innovations are not far from those of the best."""
    return bool(counts(row, clock) and row.recent_nis <= CONSISTENT * steadiest)


@compiled
def _is_asleep(judge: Any, row: Any) -> bool:
    """True for a row that does not fit, and expects no force where there surely is one."""
    return bool(row.model_error > 0.0 and judge.pressed != 0 and row.predicted_force <= 0.0)


@compiled
def _is_eligible(judge: Any, row: Any, clock: float, steadiest: float, likeliest: float) -> bool:
    """True if nothing speaks against the row but, perhaps, its predictions."""
    if not _is_consistent(row, clock, steadiest):
        return False
    if _is_asleep(judge, row):
        return False
    if row.model_error > 0.0 or _still_learns(row):
        return True
    return bool(row.log_likelihood >= likeliest - REFUTED)


@compiled
def explains(judge: Any, rows: Any, m: int, clock: float, steadiest: float) -> bool:
    """True for a row that may be true for all that was felt, whoever is chosen.

    Args:
        judge: record of the judge.
        rows: the hypotheses.
        m: index of the row.
        clock: contact clock [s].
        steadiest: what `steadiest_nis` says.
    """
    row = rows[m]
    if stands_by(judge, m) and not _is_steady(row, clock):
        return False
    return bool(row.model_error == 0.0 and _is_consistent(row, clock, steadiest))


@compiled
def _still_learns(row: Any) -> bool:
    """True if the row predicts no worse than it says itself, for it knows little yet.

    At the start each step is tempered; a freer row that follows at once predicts better, and says
    nothing against a tissue that is constant.
    """
    if row.active == 0 or row.model_error > 0.0 or row.recent_nis > LEARNING_NIS:
        return False
    return bool(row.score <= CLAIM * row.claimed)


@compiled
def _cost(row: Any) -> float:
    """Mean squared error of a row's predictions, as far as the choice goes.

    A surface that may move follows any misfit for some tenths of a second, and predicts the worse
    from then on. If what is left is still more than the noise, or if it cannot be said where the
    surface is, then it was not the surface that moved.
    """
    if not SURFACE[row.index]:
        return float(row.score)
    unknown = row.covariance[OWN, OWN] > UNKNOWN_POSITION * UNKNOWN_POSITION
    unexplained = unknown or row.model_error > 0.0
    return float(row.score * UNEXPLAINED) if unexplained else float(row.score)


@compiled
def _is_doubtful(judge: Any, row: Any, best_still: float) -> bool:
    """True for a surface that was not chosen yet, and predicts no better than one that stays."""
    if not SURFACE[row.index] or row.index == judge.chosen:
        return False
    return bool(SURFACE_GAIN * _cost(row) > best_still)


@compiled
def _is_steady(row: Any, clock: float) -> bool:
    """True if the row has gone on for long: for half a breath an organ sinks steadily, too."""
    return bool(clock - max(row.since, 0.0) >= STEADY_TIME)


@compiled
def choose(settings: Any, judge: Any, rows: Any, tool: Any, clock: float) -> None:
    """The calmest eligible row that predicts as well as the best, preferably without misfit."""
    steadiest, before = steadiest_nis(judge, rows), judge.chosen
    likeliest = -math.inf
    for m in range(FRESH if clock > REFUTED_AFTER else 0):
        if stands_by(judge, m):
            continue
        if rows[m].model_error == 0.0 and counts(rows[m], clock):
            likeliest = max(likeliest, rows[m].log_likelihood)
    for m in range(FRESH):
        rows[m].log_likelihood = max(rows[m].log_likelihood, likeliest - FLOOR)
    best, best_still, best_fitting = math.inf, math.inf, math.inf
    # Of a tissue that relaxes nothing is consistent at the first retreat, and a surface that sinks
    # explains one way there and one back, whatever is wrong.
    early = clock < STEADY_TIME
    learning = _still_learns(rows[0]) or _still_learns(rows[FITTED])
    learning = learning and _is_eligible(judge, rows[FITTED], clock, steadiest, likeliest)
    asked = FITTED + 1 if learning else FRESH
    for m in range(asked):
        if stands_by(judge, m):
            continue
        eligible, cost = _is_eligible(judge, rows[m], clock, steadiest, likeliest), _cost(rows[m])
        if eligible:
            best = min(best, cost)
        if not SURFACE[m] and (eligible or (early and counts(rows[m], clock))):
            best_still = min(best_still, cost)
    for m in range(FRESH):
        rows[m].score = min(rows[m].score, FORGIVEN * best)
    for m in range(asked):
        row = rows[m]
        if stands_by(judge, m):
            continue
        goes_on = SURFACE[m] and m == judge.chosen
        margin = MISFIT_MARGIN if m <= FITTED or goes_on else FREE_MARGIN
        fits = row.model_error == 0.0 and _cost(row) <= margin * best
        fits = fits and not _is_doubtful(judge, row, best_still)
        if fits and _is_eligible(judge, row, clock, steadiest, likeliest):
            best_fitting = min(best_fitting, _cost(row))
    must_fit = best_fitting < math.inf
    limit = MARGIN * (best_fitting if must_fit else best)
    for m in range(FRESH):
        row = rows[m]
        if REFINES[m] or (must_fit and row.model_error > 0.0):
            continue
        if early and not must_fit and _is_doubtful(judge, row, best_still):
            continue
        likelier = must_fit and row.log_likelihood >= likeliest + REFUTED
        if stands_by(judge, m) and not (likelier and _is_steady(row, clock)):
            continue
        if _cost(row) <= limit and _is_eligible(judge, row, clock, steadiest, likeliest):
            judge.chosen = m
            break
    _prefer_fitted(judge, rows, clock, steadiest, likeliest)
    _prefer_found(judge, rows, clock, best)
    _prefer_refined(judge, rows, clock, steadiest, before)
    _prefer_possible(settings, judge, rows, tool, clock)
    _prefer_far_better(judge, rows, clock)


@compiled
def _prefer_fitted(judge: Any, rows: Any, clock: float, steadiest: float, likeliest: float) -> None:
    """Least squares, where they say another damping than the recursive row of constant tissue."""
    fitted = rows[FITTED]
    if judge.chosen != 0 or not contradiction.refutes(rows[0]) or fitted.model_error > 0.0:
        return
    if _is_eligible(judge, fitted, clock, steadiest, likeliest):
        judge.chosen = FITTED


@compiled
def _prefer_found(judge: Any, rows: Any, clock: float, best: float) -> None:
    """The row that says what least squares over the last seconds say (`moving_fit`)."""
    found = judge.found
    if found == 0 or clock - judge.found_at > FOUND_FOR:
        return
    row = rows[found]
    if row.active != 0 and row.model_error == 0.0 and _cost(row) <= FREE_MARGIN * best:
        judge.chosen = found


@compiled
def _prefer_refined(judge: Any, rows: Any, clock: float, steadiest: float, before: int) -> None:
    """A row that refines the chosen one, as long as its likelihood speaks for it."""
    plain = rows[judge.chosen]
    for m in range(FRESH):
        row = rows[m]
        if not REFINES[m] or PLAIN[m] != plain.index or row.model_error > 0.0:
            continue
        needed = REFINED_FROM[m] + (0.0 if m == before else LIKELIER)
        likely = row.log_likelihood >= plain.log_likelihood + needed
        as_good = likely and _cost(row) <= MARGIN * _cost(plain)
        if as_good and _is_consistent(row, clock, steadiest):
            judge.chosen = m


@compiled
def _prefer_possible(settings: Any, judge: Any, rows: Any, tool: Any, clock: float) -> None:
    """Another row, if the law of the chosen one foretells far more than was ever felt.

    At a zero that is millimetres off, a row explains a force at next to no depth with a stiffness
    that no tissue has (`hc bench accuracy possible`, arm).
    """
    chosen = rows[judge.chosen]
    if settings.possible_forces == 0 or plausible.foretells_possible(settings, chosen, tool):
        return
    least = FAR_BETTER * _cost(chosen)
    for m in range(FRESH):
        row = rows[m]
        better = counts(row, clock) and _cost(row) < least
        if better and plausible.foretells_possible(settings, row, tool):
            least = _cost(row)
            judge.chosen = m


@compiled
def _prefer_far_better(judge: Any, rows: Any, clock: float) -> None:
    """Choose a row that predicts far better after all, whatever else speaks against it.

    Rows that know next to nothing are always consistent, however badly they predict; and a surface
    that may breathe expects more error than one that only sinks makes, which costs it likelihood.
    """
    best = math.inf
    for m in range(FRESH):
        if _is_scored(rows[m], clock):
            best = min(best, _cost(rows[m]))
    better = 1.0 if _is_asleep(judge, rows[judge.chosen]) else FAR_BETTER
    if better * best >= _cost(rows[judge.chosen]):
        return
    for m in range(FRESH):
        if _is_scored(rows[m], clock) and _cost(rows[m]) <= MARGIN * best:
            judge.chosen = m
            return


@compiled
def _is_scored(row: Any, clock: float) -> bool:
    """True if the score of a row that counts is its own by now."""
    known = counts(row, clock) and clock - row.since > MEMORY and row.score > 0.0
    if row.index == STEADY_SURFACE_ROW or RESERVE[row.index]:
        known = known and _is_steady(row, clock)
    return bool(known)
