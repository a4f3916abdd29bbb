"""What a row's innovations say beyond the sensors' noise: an alarm, and a model error.

A one-sided cumulative sum (Page, Biometrika 41, 1954) of the normalised innovations squared of
both channels raises the alarm. Both are needed: a filter that trusts the force pulls velocity and
displacement along with a wrong contact law, and the misfit then shows in the displacement. The
sum runs a few samples late, so that it can use the noise of the very latest differences: a sensor
that turns noisier raises no alarm.

A row whose alarm is no change of the tissue gains a model-error variance (not in the air, where a
law says nothing, and what surprises is the tool). Each alarm enlarges it, and an integral feedback
holds the mean normalised innovation squared at 2 from then on, until the law fits again. When the
noise rises by a factor, so does the covariance of the parameters (covariance inflation): that is
what a regression on all samples with the larger noise would have had (conjugate
normal-inverse-gamma model).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.adaptation import difference_noise
from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix
from hc_estimator.multiple_model.hypotheses import COUNTS, LOG_STIFFNESS
from hc_estimator.multiple_model.kalman import depth_of
from hc_estimator.multiple_model.records import ALARM_DELAY
from hc_estimator.multiple_model.rows import prior_deviation

DRIFT = 5.0  # what the sum subtracts from each sample's normalised innovation squared (mean 2)
THRESHOLD = 45.0  # with that drift it is passed once in some 1e8 samples of white innovations
TEMPERED_DRIFT = 10.0  # while tempering hides the force
MISFIT_DRIFT = 5.0  # added as the model error dominates: its innovations are no longer white
LARGEST_TERM = 16.0  # of one channel
FEEDBACK_TIME = 1.5  # with which the model error follows the innovations [s]
RAISE = 0.6  # share of the force noise that an alarm adds
SMALLEST_SHARE = 0.35  # of the sensor noise; less is no model error
LARGEST_MODEL_ERROR = 1e12  # [N^2]; no force is so wrong, but a displacement may never be explained
LARGEST_FEEDBACK = 8.0  # mean squared innovation that the feedback counts at most
LARGEST_NIS = 50.0  # that the likelihood counts at most
RECENT_TIME = 0.1  # time constant of recent_nis [s]
A_FORCE = 4.0  # deviations of a force that is there
TEMPERED = 2.0  # force noise over the sensor's from which on the force is hardly used


@compiled
def set_model_error(settings: Any, row: Any, variance: float, sensor_noise: float) -> None:
    """Give a row a new model-error variance [N^2]; what is uncertain grows with the noise."""
    variance = min(variance, LARGEST_MODEL_ERROR)
    before = sensor_noise + row.model_error
    after = sensor_noise + variance
    row.model_error = variance
    if after <= before:
        return
    covariance = row.covariance
    for i in range(4):
        k = LOG_STIFFNESS + i
        value, prior = covariance[k, k], prior_deviation(settings, i) ** 2
        if value <= 0.0:
            continue
        scale = math.sqrt(min(after / before, max(1.0, prior / value)))
        for j in range(COUNTS[row.index]):
            covariance[k, j] *= scale
        for j in range(COUNTS[row.index]):
            covariance[j, k] *= scale


@compiled
def raise_model_error(settings: Any, row: Any, sensor_noise: float) -> None:
    """Answer an alarm that is no change of the tissue."""
    noise = sensor_noise + row.model_error
    set_model_error(settings, row, row.model_error + RAISE * noise, sensor_noise)


@compiled
def is_in_air(row: Any, clock: Any, sensor_noise: Any) -> bool:
    """True if a row expects no force and there is none: what surprises it is the motion.

    Args:
        row: after its update.
        clock: record of the sample.
        sensor_noise: variances in use, shape (2,).
    """
    if depth_of(row) > 0.0 or row.predicted_force > 0.0:
        return False
    if clock.present[1] == 0:
        return True
    return bool(abs(clock.measurement[1]) <= A_FORCE * math.sqrt(sensor_noise[1]))


@compiled
def forget_misfit(row: Any) -> None:
    """What did not fit has been found, and is no error of the law."""
    row.model_error = 0.0
    row.alarm_sum = 0.0
    clear_matrix(row.alarm_line)


@compiled
def latest_noise(sensor_noise: Any, noise: Any) -> tuple[float, float]:
    """Variances [mm^2], [N^2] in use, or those of the latest differences where they are larger.

    Args:
        sensor_noise: variances in use, shape (2,).
        noise: records of the two channels.
    """
    if noise[0].count > 0 and noise[1].count > 0:
        return (
            max(sensor_noise[0], difference_noise.latest(noise[0])),
            max(sensor_noise[1], difference_noise.latest(noise[1])),
        )
    return sensor_noise[0], sensor_noise[1]


@compiled
def learn(
    settings: Any, row: Any, sensor_noise: Any, latest: tuple[float, float], clock: Any
) -> None:
    """Take the innovations of a row after its update; row.alarm is 1 if the alarm goes off.

    Args:
        settings: settings record.
        row: changed.
        sensor_noise: variances in use, shape (2,).
        latest: as `latest_noise` has them.
        clock: record of the sample.
    """
    elapsed = clock.force_elapsed
    both = clock.present[0] != 0 and clock.present[1] != 0
    plain = row.explained + sensor_noise[1] + row.model_error  # without tempering
    square = row.innovation[1] * row.innovation[1]
    if clock.present[1] != 0:
        force_nis = square / plain
        row.evidence = -0.5 * (math.log(plain) + min(force_nis, LARGEST_NIS))
    else:
        force_nis = 0.0
        row.evidence = 0.0
    if clock.present[0] != 0:
        nis = min(row.nis[0], LARGEST_NIS)
        row.evidence -= 0.5 * (math.log(row.innovation_variance[0]) + nis)
    else:
        row.nis[0] = 0.0
    row.untempered_nis = row.nis[0] + force_nis
    row.alarm = 0
    expected = float(clock.present[0] + clock.present[1])
    share = min(1.0, clock.elapsed / RECENT_TIME)
    recent = 2.0 * min(row.untempered_nis, 1e4) / expected
    row.recent_nis += share * (recent - row.recent_nis)
    if clock.present[1] == 0:
        return
    tempered = row.force_noise >= TEMPERED * (sensor_noise[1] + row.model_error)
    if depth_of(row) > 0.0 and row.predicted_force > 0.0:
        if not tempered:
            row.contact_time += elapsed
        _follow(settings, row, recent, sensor_noise[1], elapsed)
    _sum_up(row, square, sensor_noise, latest, tempered, both)


@compiled
def _follow(settings: Any, row: Any, nis: float, sensor_noise: float, elapsed: float) -> None:
    """Let the model error follow a normalised innovation squared (mean 2)."""
    if row.model_error == 0.0:
        return
    excess = min(0.5 * nis, LARGEST_FEEDBACK) - 1.0
    variance = (sensor_noise + row.model_error) * math.exp(elapsed / FEEDBACK_TIME * excess)
    variance -= sensor_noise
    if variance < SMALLEST_SHARE * sensor_noise:
        variance = 0.0
    set_model_error(settings, row, variance, sensor_noise)


@compiled
def _sum_up(
    row: Any,
    square: float,
    sensor_noise: Any,
    latest: tuple[float, float],
    tempered: bool,
    both: bool,
) -> None:
    """Advance the delayed cumulative sum."""
    line = row.alarm_line[row.alarm_position]
    term = min(line[0] / (line[1] + latest[1]), LARGEST_TERM)
    term += min(line[2] / (line[3] + latest[0]), LARGEST_TERM)
    line[0] = square
    line[1] = row.explained + row.force_noise - sensor_noise[1]
    line[2] = 0.0
    line[3] = 0.0
    if both:
        line[2] = row.innovation[0] * row.innovation[0]
        line[3] = row.innovation_variance[0] - sensor_noise[0]
    row.alarm_position = (row.alarm_position + 1) % ALARM_DELAY
    drift = TEMPERED_DRIFT if tempered else DRIFT
    drift += MISFIT_DRIFT * row.model_error / (sensor_noise[1] + row.model_error)
    row.alarm_sum = max(row.alarm_sum + term - drift, 0.0)
    if row.alarm_sum > THRESHOLD:
        row.alarm_sum = 0.0
        row.alarm = 1
        row.alarmed = 1
