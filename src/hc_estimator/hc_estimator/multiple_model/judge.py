"""How well does each hypothesis predict? The choice among them is made in `choice`.

What each row said 0.05 to 0.4 s ago is held against the force of now, in time in contact: a row
that only follows the present cannot hide there, and one horizon alone would be fooled where it
equals the period of the motion. The own states are carried on, shrunk by their significance.

A row that stays inconsistent is seeded anew from the chosen one, and waits before it counts again,
for its copied past looks good. (Static multiple-model estimation: Magill, IEEE Trans. AC 10, 1965;
the choice by delayed predictions is ours, see `hc bench accuracy ablation`.)
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix, copy_vector
from hc_estimator.multiple_model import reserve, spread
from hc_estimator.multiple_model.choice import (
    CONSISTENT,
    MEMORY,
    REFUTED,
    REFUTED_AFTER,
    choose,
    seed_behind,
    stands_by,
    steadiest_nis,
    trusted_motion,
)
from hc_estimator.multiple_model.hypotheses import (
    BIASED,
    COUNTS,
    DEPTH,
    DRIVES,
    EXPONENT,
    FITTED,
    FRESH,
    LOG_DAMPING,
    LOG_STIFFNESS,
    OWN,
    SURFACE,
    VARIES,
    VELOCITY,
    VELOCITY_EXPONENT,
)
from hc_estimator.multiple_model.kalman import force_of
from hc_estimator.multiple_model.records import SLOTS
from hc_estimator.multiple_model.rows import seed

HORIZONS = np.array([0.05, 0.1, 0.2, 0.4])  # [s] in contact
PERIOD = 0.005  # between two snapshots, at least [s]
LARGEST_SHARE = 0.3  # of one snapshot in the scores: after a pause one is not all
LARGEST_GAIN = 0.1  # of one snapshot in the scores, however much more it is known than before
SMALLEST_VARIANCE = 1e-30  # of a force [N^2]
FIRST_WEIGHT = 0.3  # of the scores, before they count
LIKELIHOOD_TIME = 1.0  # time constant of the log likelihoods [s]
SURE = 5.0  # deviations of the force sensor beyond which there is a force
PRESSED = 0.1  # of the largest force: more than a zero that moved [-]
STEEP = 4.0  # deviations of a rate of ln K that is clearly none
STIFFER = 0.3  # rise of ln K within a contact that is no relaxation
STEEP_MEMORY = 10.0  # time in contact for which one is remembered [s]
WORSE = 4.0  # mean square over the chosen row's from which on a misfitting row is seeded anew
SEEDED_AFTER = 0.5  # time that a row may stay so [s]


@compiled
def reset(judge: Any) -> None:
    """Nobody has said anything."""
    judge.chosen = 0
    judge.count = 0
    judge.waited = 0.0
    judge.weight = 0.0
    judge.known = 0.0
    judge.pressed = 0
    judge.varying = 0
    judge.stiffened = 0
    judge.steep_time = 0.0
    judge.rise = 0.0
    judge.square_rate = 0.0
    clear_matrix(judge.spread)
    judge.found = 0
    judge.needed_time = 0.0
    judge.unneeded_time = 0.0


@compiled
def _shrunk(row: Any, i: int) -> float:
    """An own state times the share of it that is no chance."""
    if BIASED[row.index]:  # what is off there is no rate, and no other row's
        return 0.0
    value = row.state[OWN + i]
    square = value * value
    variance = row.covariance[OWN + i, OWN + i]
    return value * square / (square + variance) if square > 0.0 else 0.0


@compiled
def _surest(judge: Any, rows: Any) -> float:
    """Smallest variance [N^2] that a row gave its prediction of this sample's force."""
    least = math.inf
    for m in range(FRESH):
        variance = rows[m].innovation_variance[1]
        if rows[m].active != 0 and variance > 0.0 and not stands_by(judge, m):
            least = min(least, variance)
    return max(least, SMALLEST_VARIANCE) if least < math.inf else 1.0


@compiled
def _write(judge: Any, rows: Any, slot: int) -> None:
    """Write what every row says now into a snapshot."""
    for m in range(rows.shape[0]):
        said, row = judge.said[slot, m], rows[m]
        said[0] = row.state[LOG_STIFFNESS]
        said[1] = row.state[LOG_DAMPING]
        said[2] = row.state[EXPONENT]
        said[3] = row.state[VELOCITY_EXPONENT]
        if SURFACE[m]:
            said[4] = row.state[OWN]
            said[5] = row.state[OWN + 1]
        else:
            said[4] = _shrunk(row, 0)
            said[5] = _shrunk(row, 1)
        said[6] = _shrunk(row, 2)


@compiled
def go_back(judge: Any, rows: Any, chosen: int, clock: float) -> None:
    """Take back what was said since the rows were as they are again.

    Args:
        judge: changed.
        rows: as they were, scores and likelihoods included.
        chosen: row that was chosen then.
        clock: contact clock then [s].
    """
    judge.chosen = chosen
    for back in range(1, min(judge.count, SLOTS) + 1):
        slot = (judge.count - back) % SLOTS
        if judge.said_at[slot] <= clock:
            return
        _write(judge, rows, slot)


@compiled
def _expected(settings: Any, said: Any, m: int, ahead: float, tool: Any) -> float:
    """Force [N] now by what a row said some time [s] ago; `tool` is the state of the motion."""
    depth, velocity = tool[DEPTH], tool[VELOCITY]
    if SURFACE[m]:
        depth -= said[4] + ahead * said[5]
        velocity -= said[5]
    k, b, n = said[0], said[1], said[2]
    for own in range(2 if SURFACE[m] else 0, COUNTS[m] - OWN):
        gone = ahead * said[4 + own]
        k += DRIVES[m, own, 0] * gone
        b += DRIVES[m, own, 1] * gone
        n += DRIVES[m, own, 2] * gone
    return force_of(settings, depth, velocity, k, b, n, said[3])


@compiled
def _score(settings: Any, bank: Any, share: float) -> None:
    """Hold what the rows said some time ago against the force of now.

    Each error counts by what the surest row claimed to know when it was said: what nobody could
    know yet says nothing about who is right by now.
    """
    judge, rows, clock = bank.judge, bank.rows, bank.tool.contact_clock
    force, noise = bank.clock.measurement[1], bank.sensor_noise[1]
    period = max(PERIOD, judge.waited)
    tool = rows[trusted_motion(judge, rows)].state
    known = 0.0
    for horizon in HORIZONS:
        back = max(round(horizon / period), 1)
        if back <= min(judge.count, SLOTS - 1):
            known += 1.0 / judge.said_variance[(judge.count - back) % SLOTS]
    if known == 0.0:
        return
    judge.known += share * (known - judge.known)
    gain = min(share * known / judge.known, max(share, LARGEST_GAIN))
    for m in range(rows.shape[0]):
        row = rows[m]
        if row.active == 0:
            continue
        total, weight = 0.0, 0.0
        for horizon in HORIZONS:
            back = max(round(horizon / period), 1)
            if back > min(judge.count, SLOTS - 1):
                break
            slot = (judge.count - back) % SLOTS
            said_at = judge.said_at[slot]
            if said_at <= row.since:
                break
            ahead = clock - said_at
            error = abs(force - _expected(settings, judge.said[slot, m], m, ahead, tool))
            # A row gone wild must not be so far off that its score never comes back.
            error = min(error, settings.force_limit)
            total += error * error / judge.said_variance[slot]
            weight += 1.0 / judge.said_variance[slot]
        if weight > 0.0:
            row.score += gain * (total / weight - row.score)
            claimed = row.innovation_variance[1] - row.model_error - noise
            row.claimed += gain * (claimed - row.claimed)


@compiled
def learn(settings: Any, bank: Any) -> None:
    """Take an accepted force in contact into scores and likelihoods, and choose.

    The record `judge` and the rows' scores are changed; rows that stay inconsistent begin anew.
    """
    judge, rows, tool, elapsed = bank.judge, bank.rows, bank.tool, bank.clock.force_elapsed
    for m in range(FRESH):
        row = rows[m]
        if row.active != 0:
            row.log_likelihood += row.evidence - row.log_likelihood * elapsed / LIKELIHOOD_TIME
    judge.waited += elapsed
    if judge.waited < PERIOD - 0.5 * elapsed:
        return
    clock = tool.contact_clock
    share = min(LARGEST_SHARE, judge.waited / MEMORY)
    judge.weight = min(1.0, judge.weight + share)
    _score(settings, bank, share)
    slot = judge.count % SLOTS
    judge.said_at[slot] = clock
    judge.said_variance[slot] = _surest(judge, rows)
    _write(judge, rows, slot)
    judge.count += 1
    force, noise = bank.clock.measurement[1], bank.sensor_noise[1]
    sure = max(SURE * math.sqrt(noise), PRESSED * tool.largest_force)
    judge.pressed = 1 if force > sure else 0
    if judge.weight > FIRST_WEIGHT:
        choose(settings, judge, rows, tool, clock)
        likelier = rows[judge.chosen].log_likelihood - rows[0].log_likelihood
        if judge.chosen > FITTED and likelier > REFUTED and clock > REFUTED_AFTER:
            judge.varying = judge.chosen
            judge.varied_at = clock
        _learn_rate(judge, rows[judge.chosen], likelier)
        _seed_anew(judge, rows, clock, judge.waited)
        reserve.review(settings, bank)
        spread.find(settings, judge, rows, clock)
    judge.waited = 0.0


@compiled
def _learn_rate(judge: Any, row: Any, likelier: float) -> None:
    """Does the tissue vary along the way, by the row in charge, and has it become stiffer?

    Args:
        judge: changed.
        row: in charge.
        likelier: logarithm of its likelihood ratio to constant tissue.
    """
    judge.steep_time *= max(1.0 - judge.waited / STEEP_MEMORY, 0.0)
    if row.model_error > 0.0:  # then that does not explain it
        judge.steep_time = 0.0
    elif VARIES[row.index] and likelier > REFUTED:
        rate, variance = row.state[OWN], row.covariance[OWN, OWN]
        if rate * rate > STEEP * STEEP * variance:
            judge.steep_time += judge.waited
            judge.rise += max(rate, 0.0) * judge.waited
            judge.square_rate = rate * rate + variance


@compiled
def note_stiffened(judge: Any) -> None:
    """The tissue became stiffer within a contact: it varies, for none that relaxes does."""
    judge.stiffened = 1


@compiled
def end_contact(judge: Any) -> None:
    """The tool has left: has the tissue become stiffer meanwhile, by the rates of ln K?"""
    if judge.rise > STIFFER:
        note_stiffened(judge)
    judge.rise = 0.0


@compiled
def _seed_anew(judge: Any, rows: Any, clock: float, elapsed: float) -> None:
    """Give rows that stay far from consistent the state of the chosen one."""
    steadiest = steadiest_nis(judge, rows)
    chosen = rows[judge.chosen]
    for m in range(FRESH):
        row = rows[m]
        if m == judge.chosen or row.active == 0:
            continue
        misfits = row.model_error > 0.0 and row.score > WORSE * chosen.score
        if not (misfits or row.recent_nis > CONSISTENT * steadiest):
            row.inconsistent_time = 0.0
            continue
        row.inconsistent_time += elapsed
        if row.inconsistent_time > SEEDED_AFTER:
            seed_behind(chosen, row, clock)


@compiled
def keep_to_fit(judge: Any, rows: Any, clock: float, time: float) -> None:
    """Let no row but the fit to all that was felt be chosen for a time [s] in contact.

    For a tissue that relaxes: it lets go early, and pushes less the longer it is pressed. A surface
    that sinks and comes back with the tool foretells that as well, with twice the stiffness, and a
    row that drifts follows it with any parameters. The fit has a model error, and that is said.
    """
    if rows[FITTED].active == 0:
        return
    for m in range(FRESH):
        rows[m].counts_from = clock + time
    rows[FITTED].counts_from = clock
    judge.chosen = FITTED


@compiled
def go_on_with_fit(judge: Any, rows: Any, clock: float) -> None:
    """Choose the fit to all that was felt; the rows whose surface stays begin there anew."""
    fitted = rows[FITTED]
    for m in range(FRESH):
        row = rows[m]
        if row.active == 0 or SURFACE[m] or m == FITTED:
            continue
        seed(fitted, row, clock, clock)
        row.score = fitted.score
        row.log_likelihood = fitted.log_likelihood
    fitted.counts_from = min(fitted.counts_from, clock)
    judge.chosen = FITTED
    judge.varying = 0


@compiled
def give_to_all(judge: Any, rows: Any, source: int, clock: float) -> None:
    """A row that was under test is the tissue from now on: every row begins where it stands."""
    since = rows[source].since
    for m in range(FRESH):
        row = rows[m]
        if row.active == 0:
            continue
        seed(rows[source], row, since, clock)
        row.model_error = 0.0
        for slot in range(SLOTS):
            copy_vector(judge.said[slot, source], judge.said[slot, m])
    judge.chosen = 0
    judge.varying = 0
    clear_matrix(judge.spread)
    judge.found = 0
    judge.weight = 0.0
