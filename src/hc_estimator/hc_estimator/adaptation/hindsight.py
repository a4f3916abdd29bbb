"""What the parameters make of the samples felt before: where a recursive filter needs hindsight.

Three times, by least squares over the remembered samples (`history`, `history_fit`):

- At the start. The filter's own first steps are slow on purpose: as long as it knows too little
  for its linearisation to hold, it counts samples as if they were noisy (`linearisation`). A fit to
  all samples so far has no such trouble. Until the filter has come to know the tissue, the
  fit is what is told, with its own covariance, wherever it explains the samples clearly better;
  and for the first seconds after that (`probation`) where it explains them very much better, as
  with a contact law that does not fit. The filter goes on undisturbed.
- With a contact law that does not fit. The filter is then drawn along by the latest misfit, and
  pays for a tenth of a newton now with newtons in another depth or direction of motion. While
  there is a model error, the estimate is held against the samples, and where it explains them
  clearly worse than the fit, the fit takes its place: mean, covariance and model error.
- After an alarm. If one set of parameters explains the samples before and since alike, the
  newcomer in `contest` only bends to the misfit of the moment: it is the same tissue.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.adaptation import force_estimate, history, history_fit, linearisation
from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import has_lagged_velocity
from hc_estimator.linear_algebra import copy_matrix, copy_vector
from hc_estimator.report import (
    FORCE_PREDICTED,
    FORCE_RECONSTRUCTED,
    INNOVATION,
    MODEL_MISMATCH,
    write_row,
)
from hc_estimator.screening import ACCEPTED, OUTLIER
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    *history.SPECIFICATIONS,
    ParameterSpecification(
        "refit_ratio",
        "float",
        1.3,
        "Where the contact law does not fit: RMS misfit of the estimate over the remembered "
        "samples, relative to that of the least-squares fit, from which on the fit replaces it.",
        minimum=1.0,
        maximum=1e6,
    ),
)

FEWEST_FIRST = 10  # remembered samples that make a fit at the start
FEWEST = 32  # intervals that make a fit under a model error
LATEST = 8  # intervals that would show another tissue first
FEWEST_SINCE = 6  # intervals since an alarm that say whether it is the same tissue
TEMPERED = 2.0  # force noise over the sensor's, from which on the filter does not know the tissue
# A fit that leaves more than this share of the RMS force says nothing (two tissues, relaxation),
# unless that is no more than the noise, given by a factor of its variance.
LARGEST_MISFIT = 0.2
SMALL_MISFIT = 4.0
FITS = 2.0  # mean squared misfit over the noise, up to which only noise is left
CLEARLY = 9.0  # gain in the sum of squares over the noise (a likelihood ratio), if so
ALIKE = 2.0  # RMS misfit since the alarm over that before, up to which it is the same tissue
# RMS misfit of a filter that has just come to know the tissue, relative to the fit's: beyond it, it
# has come to know something else.
EARLY_RATIO = 4.0
TOUCHING = 0.5  # share of the RMS force so far that is a contact worth the name
STALE = 16  # remembered samples after which the fit is made anew in any case
CHECKS = 16.0  # per time in contact so far; not more often than the history interval

FIELDS = (
    *history.FIELDS,
    *history_fit.FIELDS,
    *force_estimate.FIELDS,
    ("told", np.int64, ()),  # 1 while the fit is told in place of the filter's parameters
    ("told_parameters", np.float64, (4,)),  # ln K, ln B, n, p
    ("told_covariance", np.float64, (4, 4)),
    ("told_misfit", np.float64, ()),  # mean square that the fit leaves over the noise, at least 1
    ("told_repeats", np.float64, ()),  # samples over which what the fit leaves stays the same
    ("unfit", np.int64, ()),  # 1 if no parameters at all explain what was felt before it was known
    ("known", np.int64, ()),  # 1 once the filter has known the tissue
)
SCRATCH = (
    *history_fit.SCRATCH,
    *force_estimate.SCRATCH,
    ("told_before", np.float64, (4,)),
    ("fit_with_turns", np.float64, (4,)),
)


@compiled
def restart(memory: Any) -> None:
    """Nothing was felt of this tissue yet."""
    history.restart(memory)
    history_fit.restart(memory)
    force_estimate.restart(memory)
    memory.told = 0
    memory.unfit = 0
    memory.known = 0


@compiled
def hold(settings: Any, memory: Any) -> None:
    """Hold the estimate against what was felt; without a contest, after a remembered sample."""
    memory.history_before = memory.history_count
    if memory.known == 0 and memory.measurement_noise[1] < TEMPERED * memory.sensor_noise[1]:
        # At the edge of contact every law is nearly linear: that says nothing of the tissue.
        square = history_fit.mean_square_force(memory, history.oldest(memory))
        memory.known = 1 if memory.measurement[1] ** 2 > TOUCHING**2 * square else 0
    misfits = memory.model_error[0] > 0.0
    settled = memory.known != 0 and memory.contact_time[0] > settings.probation
    if misfits or settled:
        memory.told = 0
        memory.unfit = 0
    fewest = history.samples(settings, memory, FEWEST) if misfits else FEWEST_FIRST
    if (not misfits and settled) or memory.history_count < fewest:
        memory.fit_misfit = 0.0
        return
    if has_lagged_velocity(settings.contact_model):
        return
    due = memory.history_count * history.spacing(memory) / CHECKS
    if memory.history_held < min(due, 0.99 * settings.history_interval):
        return
    memory.history_held = 0.0
    memory.told = 0
    if _better_fit(settings, memory):
        if misfits:
            _adopt(settings, memory)
        else:
            _tell(settings, memory)


@compiled
def _better_fit(settings: Any, memory: Any) -> bool:
    """True if there is a fit that explains the samples clearly better than the estimate."""
    first, noise = history.oldest(memory), memory.sensor_noise[1]
    misfits = memory.model_error[0] > 0.0
    count = memory.history_count - first
    own = history_fit.misfit(settings, memory, memory.state[3:7], first)
    explained = LARGEST_MISFIT**2 * history_fit.mean_square_force(memory, first)
    explained = max(explained, 0.0 if misfits else SMALL_MISFIT * noise)
    if own < explained:
        memory.unfit = 0
    # More samples can only add to the least sum of squares: most fits need not be made.
    bound = memory.fit_misfit * min(memory.fit_count, history.POINTS)
    enough = settings.refit_ratio**2 * bound if misfits else bound + CLEARLY * noise
    if own * count < enough and memory.history_count - memory.fit_count < STALE:
        return False
    fitted = memory.fit_count > 0
    if not (fitted and history_fit.misfit(settings, memory, memory.fit, first) < own):
        copy_vector(memory.state[3:7], memory.fit)
    memory.fit_count = memory.history_count
    memory.fit_misfit = 0.0
    least = _improve_fit(settings, memory, first)
    memory.unfit = 0 if misfits or least < explained else 1
    if not least < explained:
        return False
    memory.fit_misfit = least
    if memory.known != 0 and not misfits:
        better = own > EARLY_RATIO**2 * least
    elif misfits or least > FITS * noise:
        better = own > settings.refit_ratio**2 * least
    else:
        better = (own - least) * count > CLEARLY * noise
    if not better:
        return False
    # Another tissue, begun just now, would show in the latest samples.
    since = max(memory.history_count - history.samples(settings, memory, LATEST), first)
    latest = history_fit.misfit(settings, memory, memory.fit, since)
    return bool(latest < ALIKE**2 * least)


@compiled
def _repeats(settings: Any, memory: Any) -> float:
    """Remembered samples over which what a fit leaves stays the same.

    It may come from errors of the motion, and those last as long as the motion does.
    """
    alike = linearisation.coherence_time(settings, memory) / history.spacing(memory)
    return max(1.0, alike)


@compiled
def _improve_fit(settings: Any, memory: Any, first: int) -> float:
    """Improve the fit; mean square that it leaves, infinite if it broke down.

    The samples of a turn are left out if the law fits the others far better.
    """
    noise = memory.sensor_noise[1] + memory.model_error[0]
    memory.leave_turns = 0
    if not history_fit.improve(settings, memory, 1.0 / noise):
        return math.inf
    least = history_fit.misfit(settings, memory, memory.fit, first)
    if memory.history_turns == 0 or memory.model_error[0] > 0.0 or least < SMALL_MISFIT * noise:
        return least
    copy_vector(memory.fit, memory.fit_with_turns)
    memory.leave_turns = 1
    if history_fit.improve(settings, memory, 1.0 / noise):
        without = history_fit.misfit(settings, memory, memory.fit, first)
        if EARLY_RATIO**2 * without < least:
            if without > FITS * noise:  # what is left must not speak louder than the prior
                weight = 1.0 / (without * _repeats(settings, memory))
                if history_fit.improve(settings, memory, weight):
                    without = history_fit.misfit(settings, memory, memory.fit, first)
            return without
    memory.leave_turns = 0
    copy_vector(memory.fit_with_turns, memory.fit)
    return least


@compiled
def _tell(settings: Any, memory: Any) -> None:
    """Tell the fit in place of the filter's parameters."""
    memory.told_repeats = _repeats(settings, memory)
    memory.told_misfit = max(1.0, memory.fit_misfit / memory.sensor_noise[1])
    noise = memory.told_repeats * memory.told_misfit * memory.sensor_noise[1]
    if not history_fit.find_covariance(settings, memory, noise):
        return
    if not history_fit.widen_covariance(settings, memory, noise):
        return
    copy_vector(memory.fit, memory.told_parameters)
    copy_matrix(memory.fit_covariance, memory.told_covariance)
    memory.told = 1


@compiled
def _adopt(settings: Any, memory: Any) -> None:
    """Make the fit the estimate, its misfit the model error."""
    misfit = memory.fit_misfit - memory.sensor_noise[1]
    memory.model_error[0] = max(memory.model_error[0], misfit)
    noise = memory.sensor_noise[1] + memory.model_error[0]
    # Certain as the filter would be that had used all samples in between with this noise.
    share = min(1.0, memory.elapsed / history.spacing(memory))
    if not history_fit.find_covariance(settings, memory, share * noise):
        return
    state, covariance = memory.state, memory.covariance
    for i in range(4):
        state[3 + i] = memory.fit[i]
        for j in range(7):
            covariance[3 + i, j] = 0.0
            covariance[j, 3 + i] = 0.0
    for i in range(4):
        for j in range(4):
            covariance[3 + i, 3 + j] = memory.fit_covariance[i, j]


@compiled
def same_tissue(settings: Any, memory: Any) -> bool:
    """True if one fit explains the samples before and since the alarm of the contest alike."""
    since = memory.history_count - memory.history_before
    fewest = history.samples(settings, memory, FEWEST_SINCE)
    if memory.fit_misfit == 0.0 or since < fewest or since > history.POINTS // 2:
        return False
    if not history_fit.improve(settings, memory, 1.0 / memory.fit_misfit):
        return False
    later = history_fit.misfit(settings, memory, memory.fit, memory.history_before)
    return bool(later < ALIKE**2 * memory.fit_misfit)


@compiled
def note_told(memory: Any) -> bool:
    """Keep what was told before a sample, for `write`; True if it was the fit."""
    copy_vector(memory.told_parameters, memory.told_before)
    return memory.told != 0  # type: ignore[no-any-return]


@compiled
def write(
    settings: Any, memory: Any, rejected: int, row: NDArray[np.float64], told_before: bool
) -> None:
    """Fill a row as `report.write_row`, with the fit where it is told."""
    if memory.told != 0:
        _exchange(memory)
        write_row(settings, memory, rejected, row)
        _exchange(memory)
    else:
        write_row(settings, memory, rejected, row)
    if told_before and rejected in (ACCEPTED, OUTLIER):
        predicted = history_fit.force(settings, memory.predicted_state, memory.told_before)
        row[FORCE_PREDICTED] = predicted
        row[INNOVATION + 1] = memory.measurement[1] - predicted
        if rejected == ACCEPTED:
            force_estimate.find_told(settings, memory, memory.told_before, predicted)
        if force_estimate.is_doubted(memory):
            row[MODEL_MISMATCH] = 1.0
    if memory.unfit != 0:
        row[MODEL_MISMATCH] = 1.0
    if rejected == ACCEPTED:
        row[FORCE_RECONSTRUCTED] = memory.given_force


@compiled
def _exchange(memory: Any) -> None:
    """Swap the filter's parameters and their covariance with what is told."""
    for i in range(4):
        value = memory.state[3 + i]
        memory.state[3 + i] = memory.told_parameters[i]
        memory.told_parameters[i] = value
        for j in range(4):
            value = memory.covariance[3 + i, 3 + j]
            memory.covariance[3 + i, 3 + j] = memory.told_covariance[i, j]
            memory.told_covariance[i, j] = value
