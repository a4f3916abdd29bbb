"""Sudden turns of the tool: a ramp that begins, a hold, a reversal.

The motion model takes the tool to move smoothly. Where its velocity jumps, the force shows it
within a sample (through the damping), the displacement only some tens of samples later; in between
a filter answers with wrong damping, or with a change of the tissue that is none. In the tracking of
maneuvering targets (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and
Navigation, 2001, chapter 11) the answer is to go back to before the maneuver and to let the motion
go. Here:

- Every few samples, the rows are kept.
- A maneuver is suspected when the bank in `motion_density` starts the chosen member anew (the
  displacement shows it), and when the chosen row's alarm goes off (the force may show it).
- Then parameters and model errors are those of before, carried on to now, and the motion is known
  by its last reading only, its velocity within the speeds of the last seconds, and for some
  samples the parameters are considered, not updated, while the velocity is found anew.
- A tissue that changes is not mistaken for a maneuver: an alarm in contact begins the test of a
  change all the same. Nor is a law that does not fit: if the test finds no other tissue, and the
  displacement has shown no maneuver, there is a model error.
"""

from __future__ import annotations

from typing import Any

from hc_estimator.adaptation import density_correction, motion_density
from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix, copy_matrix, copy_vector
from hc_estimator.multiple_model import change as changes
from hc_estimator.multiple_model import delay_sensitivity
from hc_estimator.multiple_model import judge as judging
from hc_estimator.multiple_model.hypotheses import (
    ACCELERATION,
    DEPTH,
    FITTED,
    FRESH,
    SURFACE,
    VELOCITY,
)
from hc_estimator.multiple_model.kalman import (
    HOLD_NOTHING,
    predict,
    use_displacement,
)
from hc_estimator.multiple_model.model_error import is_in_air, raise_model_error
from hc_estimator.multiple_model.readings import displacement_before, since_displacement
from hc_estimator.multiple_model.records import KEPT
from hc_estimator.multiple_model.rows import clear_motion, free_rate
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "find_maneuvers",
        "bool",
        True,
        "Look for sudden turns of the tool, and go back to before them; otherwise the motion is "
        "taken to be smooth throughout.",
    ),
)

PERIOD = 8  # samples between two of them
BEFORE = 32.0  # samples before the displacement showed a maneuver that are not trusted
BEFORE_TIME = 0.05  # time before an alarm that is not trusted [s]
FEWEST_BEFORE = 12.0  # samples that this is at least
OLDEST_TIME = 0.55  # that one goes back at most [s]
HOLD_TIME = 0.03  # for which the parameters are considered only [s]
FEWEST_HELD = 10.0  # samples that this is at least
PAUSE_TIME = 0.15  # after a maneuver in which an alarm is no further one [s]
FEWEST_PAUSED = 40.0  # samples that this is at least
TURN_TIME = 0.05  # a maneuver takes at most about so long [s]
SPEED_MEMORY = 5.0  # time constant with which the largest speed is forgotten [s]
LEAST_READINGS = 100  # of the displacement before it can show a maneuver
MOVING = 3.0  # deviations of the velocity that are no noise
LONG_AGO = 1e9


@compiled
def reset(maneuver: Any) -> None:
    """No maneuver so far, and nothing is known of how the tool moves."""
    forget_rows(maneuver)
    maneuver.square_speed = 0.0
    maneuver.square_acceleration = 0.0
    maneuver.departed = LONG_AGO


@compiled
def forget_rows(maneuver: Any) -> None:
    """The rows have begun anew: there is nothing to go back to. How the tool moves is known."""
    maneuver.count = 0
    maneuver.waited = 0
    maneuver.since = LONG_AGO
    maneuver.since_member = 0
    maneuver.doubted = 0
    maneuver.density = 0.0
    maneuver.alarm_since = 0.0


@compiled
def keep(bank: Any, time: float) -> None:
    """Keep the rows after an accepted sample [s] if it is time to, and no test of a change runs."""
    maneuver, rows, motion = bank.maneuver, bank.rows, bank.motion
    chosen, elapsed = rows[bank.judge.chosen], bank.clock.elapsed
    square = chosen.state[VELOCITY] ** 2 - MOVING**2 * chosen.covariance[VELOCITY, VELOCITY]
    forgotten = maneuver.square_speed * (1.0 - min(elapsed / SPEED_MEMORY, 1.0))
    maneuver.square_speed = max(forgotten, square)
    maneuver.since += 1.0
    member = maneuver.since_member
    if motion.age[member] < motion_density.SETTLED[member]:
        maneuver.doubted = 0
    maneuver.alarm_since = 0.0 if chosen.alarm_sum == 0.0 else maneuver.alarm_since + 1.0
    if bank.change.testing != 0:
        return
    maneuver.waited += 1
    if maneuver.waited < PERIOD:
        return
    maneuver.waited = 0
    slot = maneuver.count % KEPT
    for m in range(FRESH):
        _copy(rows[m], maneuver.rows[slot, m])
    maneuver.time[slot] = time
    maneuver.contact_clock[slot] = bank.tool.contact_clock
    maneuver.chosen[slot] = chosen.index
    maneuver.member[slot] = motion.chosen
    maneuver.count += 1


@compiled
def _copy(row: Any, kept: Any) -> None:
    """Copy what is kept of a row that takes part; and back, with both the other way round."""
    kept.active = row.active
    if row.active == 0:
        return
    copy_vector(row.state, kept.state)
    copy_matrix(row.covariance, kept.covariance)
    copy_vector(row.by_delay, kept.by_delay)
    kept.position_deviation = row.position_deviation
    kept.model_error = row.model_error
    kept.score = row.score
    kept.log_likelihood = row.log_likelihood
    kept.recent_nis = row.recent_nis
    kept.inconsistent_time = row.inconsistent_time


@compiled
def _find(maneuver: Any, time: float, elapsed: float, samples: float) -> int:
    """Slot of the youngest that is so many samples old; -1 if there is none."""
    for back in range(1, min(maneuver.count, KEPT) + 1):
        slot = (maneuver.count - back) % KEPT
        age = time - maneuver.time[slot]
        if age > (samples - 0.5) * elapsed:
            return slot if age <= OLDEST_TIME else -1
    return -1


@compiled
def _shown(bank: Any, chosen: Any, time: float) -> int:
    """Slot before a maneuver that the displacement shows; -1 if it shows none."""
    maneuver, motion = bank.maneuver, bank.motion
    if chosen.contact_time == 0.0 or motion.density <= 0.0:
        return -1
    if min(motion.count, bank.noise[0].count) < LEAST_READINGS:
        return -1
    slot = _find(maneuver, time, bank.clock.period, BEFORE)
    if slot >= 0:
        m = maneuver.member[slot]
        if motion.chosen > m and motion.age[m] < motion_density.SETTLED[m]:
            return slot
    return -1


@compiled
def answer(settings: Any, bank: Any, time: float, alarm: bool) -> bool:
    """Go back to before a maneuver, if there was one.

    Args:
        settings: settings record.
        bank: rows, maneuver and change are changed.
        time: of the sample [s].
        alarm: of the chosen row.

    Returns:
        True if the alarms of this sample are answered.
    """
    maneuver, change = bank.maneuver, bank.change
    chosen, elapsed = bank.rows[bank.judge.chosen], bank.clock.period
    if settings.find_maneuvers == 0 or chosen.model_error > 0.0 or elapsed <= 0.0:
        return False
    slot = _shown(bank, chosen, time)
    if slot >= 0:
        if change.testing != 0:
            if change.time > time - maneuver.time[slot]:
                return False  # the alarm was there before
            changes.end_test(change, bank.rows)
        if maneuver.since >= BEFORE:
            _go_back(bank, slot, time)
        maneuver.count = 0
        maneuver.doubted = 0
        return True
    pause = max(PAUSE_TIME / elapsed, FEWEST_PAUSED)
    if not alarm or change.testing != 0 or maneuver.since <= pause:
        return False
    before_alarm = max(min(BEFORE_TIME / elapsed, BEFORE), FEWEST_BEFORE)
    slot = _find(maneuver, time, elapsed, maneuver.alarm_since + before_alarm)
    if slot < 0:
        return False
    if not is_in_air(chosen, bank.clock, bank.sensor_noise):
        changes.begin_test(settings, bank, since_displacement(bank, time))
        maneuver.doubted = 1
    _go_back(bank, slot, time)
    return True


@compiled
def answer_at_once(settings: Any, bank: Any, time: float, log_speed: float) -> bool:
    """Answer an alarm between the displacement and the force of a sample.

    A fresh row has then the motion up to the sample before, and its displacement to come.

    Args:
        settings: settings record.
        bank: rows, maneuver and change are changed.
        time: of the sample [s].
        log_speed: see `levels`.

    Returns:
        True if the rows have gone back; their force is to be foreseen anew.
    """
    if not answer(settings, bank, time, True):
        return False
    clock, fresh = bank.clock, bank.rows[FRESH]
    if fresh.active != 0:
        if motion_density.is_settled(bank.motion):
            density = motion_density.jerk_density(settings, bank.motion)
            predict(fresh, clock.elapsed, density, False, True)
        if clock.present[0] != 0:
            reading, noise = clock.measurement[0], bank.sensor_noise[0]
            use_displacement(fresh, reading, clock.offset, noise, HOLD_NOTHING, log_speed)
    return True


@compiled
def audit(settings: Any, bank: Any, explained: bool) -> None:
    """At the end of a test that found no other tissue: was there a maneuver at all?

    If the displacement has shown none, the alarm was neither: then the contact law does not fit.

    Args:
        settings: settings record.
        bank: maneuver and rows are changed.
        explained: True if the alarm was that of something else.
    """
    if bank.maneuver.doubted != 0:
        bank.maneuver.doubted = 0
        if explained or changes.is_explained(bank.change):
            return
        raise_model_error(settings, bank.rows[bank.judge.chosen], bank.sensor_noise[1])


@compiled
def _go_back(bank: Any, slot: int, time: float) -> None:
    """Take parameters and model errors from a slot; the motion is the last reading.

    Args:
        bank: changed.
        slot: that is taken.
        time: of the sample in the displacement's time [s].
    """
    maneuver, motion = bank.maneuver, bank.motion
    reading, ahead = displacement_before(bank, time)
    chosen = maneuver.chosen[slot]
    velocity = bank.rows[chosen].state[VELOCITY]
    if motion.count > motion_density.FIRST_READINGS:
        velocity = motion_density.motion_of(motion, 1)
    kept = maneuver.rows[slot, chosen]
    square = max(maneuver.square_speed, (velocity - kept.state[VELOCITY]) ** 2)
    square += kept.covariance[VELOCITY, VELOCITY]
    acceleration = kept.covariance[ACCELERATION, ACCELERATION] + motion.density * TURN_TIME
    depth = reading + ahead * velocity
    variance = bank.sensor_noise[0] + ahead * ahead * square
    gone, away = max(time - maneuver.time[slot], 0.0), bank.tool.away_time > 0.0
    varied = chosen > FITTED and not SURFACE[chosen]
    for m in range(FRESH):
        row = bank.rows[m]
        _copy(maneuver.rows[slot, m], row)
        if row.active == 0:
            continue
        predict(row, gone, 0.0, True, away)  # a surface that moves has gone on since
        clear_motion(row)
        if varied:  # then what turned may be the rate, and not the tool
            free_rate(row)
        row.state[DEPTH] = depth
        row.covariance[DEPTH, DEPTH] = variance
        row.covariance[VELOCITY, DEPTH] = ahead * square
        row.covariance[DEPTH, VELOCITY] = ahead * square
        row.covariance[VELOCITY, VELOCITY] = square
        row.covariance[ACCELERATION, ACCELERATION] = acceleration
        row.alarm_sum = 0.0
        delay_sensitivity.forget_evidence(row)
        clear_matrix(row.alarm_line)
    clock = maneuver.contact_clock[slot]
    judging.go_back(bank.judge, bank.rows, maneuver.chosen[slot], clock)
    density_correction.forget_calm(motion)
    maneuver.density = 3.0 * square / TURN_TIME**3
    maneuver.since = 0.0
    maneuver.since_member = maneuver.member[slot]
    maneuver.waited = 0
    if bank.change.testing == 0:
        maneuver.count = 0


@compiled
def held_samples(elapsed: float) -> float:
    """Samples for which the parameters are considered only."""
    return max(HOLD_TIME / max(elapsed, 1e-9), FEWEST_HELD)


@compiled
def is_turning(maneuver: Any, row: Any, elapsed: float) -> bool:
    """True for the samples after a maneuver, but for rows under test."""
    return bool(row.index < FRESH and maneuver.since < held_samples(elapsed))


@compiled
def jerk_density(maneuver: Any, row: Any, elapsed: float, density: float) -> float:
    """Jerk density for a row [mm^2/s^5]: that of a maneuver while the tool turns."""
    if is_turning(maneuver, row, elapsed):
        return float(max(density, maneuver.density))
    return density
