"""The records in which the default filter keeps what it knows; one per question.

A kernel gets the records that it may touch, or where these are many the bank; who may write which
field stands in test/suite/test_who_writes.py. All of it is saved and restored with the estimator.
"""

from __future__ import annotations

import numpy as np

from hc_estimator.adaptation.difference_noise import NOISE
from hc_estimator.adaptation.motion_density import INDICES, MOTION
from hc_estimator.adaptation.noise_color import COLOR
from hc_estimator.adaptation.resolution import RESOLUTION
from hc_estimator.memory import Field, record_type
from hc_estimator.multiple_model.alarm_records import CHANGE, GATE
from hc_estimator.multiple_model.delay_records import DELAY, TERMS
from hc_estimator.multiple_model.hypotheses import FRESH, ROWS, STATES
from hc_estimator.multiple_model.place_records import PLACE
from hc_estimator.multiple_model.spline_records import MEMORIES, MOVING, SPLINE_FIT
from hc_estimator.multiple_model.zero_records import ZEROS
from hc_estimator.screening import CLOCK_FIELDS

ROW_COUNT = len(ROWS)
ALARM_DELAY = 8  # samples by which the cumulative sum of `model_error` lags

# One hypothesis.
ROW = record_type(
    (
        Field("index", np.int64, (), 0, ROW_COUNT - 1),  # place in `hypotheses.ROWS`
        Field("active", np.int64, (), 0, 1),
        Field("state", np.float64, (STATES,)),
        Field("covariance", np.float64, (STATES, STATES)),
        # Derivative of the state by the error of the delay in use; see `delay_sensitivity`.
        Field("by_delay", np.float64, (STATES,)),
        # What its innovations say of that error; see `delay_evidence`.
        Field("delay_score", np.float64),  # [1/s]
        Field("delay_information", np.float64, (), 0.0),  # [1/s^2]
        # Of a contact position that stays, at the row's start [mm]; 0: it moves, or is given.
        Field("position_deviation", np.float64, (), 0.0),
        # Variance of the force that the law misses [N^2].
        Field("model_error", np.float64, (), 0.0),
        Field("alarm_sum", np.float64, (), 0.0),
        # Squared innovation and its variance without sensor noise: force, displacement.
        Field("alarm_line", np.float64, (ALARM_DELAY, 4)),
        Field("alarm_position", np.int64, (), 0, ALARM_DELAY - 1),
        Field("alarm", np.int64, (), 0, 1),  # 1 if the alarm went off at this sample
        Field("contact_time", np.float64, (), 0.0),  # informative contact since the row's start [s]
        Field("recent_nis", np.float64, (), 0.0),  # short mean of the normalised innovation squared
        Field("score", np.float64, (), 0.0),  # mean squared error of delayed predictions [N^2]
        Field("claimed", np.float64, ()),  # what it would be by the row's own variance [N^2]
        Field("log_likelihood", np.float64, ()),  # forgetting sum
        Field("since", np.float64, ()),  # contact clock at its last seeding [s]
        Field("counts_from", np.float64, ()),  # contact clock from which on it may be chosen [s]
        Field("inconsistent_time", np.float64, ()),  # [s]
        Field("alarmed", np.int64, (), 0, 1),  # since the test of a change began
        # Squared deviations from what least squares say of damping; see `contradiction`.
        Field("contradiction", np.float64, (), 0.0),
        Field("change_lead", np.float64, ()),  # log likelihood ratio of the fresh row to this one
        # Of the present sample:
        Field("predicted_force", np.float64, ()),  # of the law at the predicted state [N]
        Field("innovation", np.float64, (2,)),  # displacement [mm], force [N]
        Field("innovation_variance", np.float64, (2,)),
        Field("explained", np.float64, ()),  # force variance that the state explains [N^2]
        Field("force_noise", np.float64, ()),  # force variance used, tempering included [N^2]
        Field("sensitivity", np.float64, (STATES,)),  # of the force per column of the factor [N]
        Field("whitened", np.float64, (STATES,)),  # see `delay_sensitivity`
        Field("sigma_force", np.float64, (STATES, 2)),  # at the sigma points [N]
        Field("factor", np.float64, (STATES, STATES)),  # Cholesky factor of the covariance
        Field("nis", np.float64, (2,)),  # displacement, force given displacement
        Field("untempered_nis", np.float64, ()),  # of both channels
        Field("evidence", np.float64, ()),  # log likelihood of the sample
    )
)

# How the tool has moved of late.
TOOL = record_type(
    (
        Field("mean_square_velocity", np.float64, (), 0.0),
        Field("mean_square_acceleration", np.float64, ()),  # less its own variance
        Field("usual_velocity", np.float64),  # mean of the last seconds in contact [mm/s]
        Field("retreated", np.int64, (), 0, 1),  # 1 once the tool has moved out in contact
        Field("away_time", np.float64, (), 0.0),  # since contact was lost [s]
        Field("contact_clock", np.float64, (), 0.0),  # time in contact so far [s]
        Field("deepest", np.float64),  # largest displacement in contact of late [mm]
        Field("fastest", np.float64, (), 0.0),  # largest speed there [mm/s]
        # The same in the present stretch, and its time in contact so far [s]; see `plausible`.
        Field("latest_deepest", np.float64),
        Field("latest_fastest", np.float64, (), 0.0),
        Field("stretch_time", np.float64, (), 0.0),
        Field("largest_force", np.float64, (), 0.0),  # [N]
        Field("known_time", np.float64, (), 0.0),  # in contact in which these were learnt [s]
        Field("mean_square_force", np.float64, (), 0.0),  # of the last second in contact [N^2]
        Field("worthless_time", np.float64, (), 0.0),  # for which a model error exceeds it [s]
    )
)

SLOTS = 96  # snapshots of what the rows said; 80 reach back 0.4 s at 200 a second
SAID = 7  # ln K, ln B, n, p, own states (shrunk)

# Who predicts best.
JUDGE = record_type(
    (
        Field("chosen", np.int64, (), 0, ROW_COUNT - 1),
        Field("said", np.float64, (SLOTS, ROW_COUNT, SAID)),
        Field("said_at", np.float64, (SLOTS,)),  # contact clock [s]
        Field("said_variance", np.float64, (SLOTS,)),  # of the surest row's force then [N^2]
        Field("known", np.float64, (), 0.0),  # forgetting mean of its inverse [1/N^2]
        Field("pressed", np.int64, (), 0, 1),  # 1 if there surely was a force at the last sample
        Field("count", np.int64, (), 0),
        Field("waited", np.float64, (), 0.0),  # contact since the last snapshot [s]
        Field("weight", np.float64, (), 0.0),  # of the scores, grows to 1
        Field("steep_time", np.float64, (), 0.0),  # with a clear rate of ln K, forgetting [s]
        Field("square_rate", np.float64, (), 0.0),  # latest mean square of such a rate [1/s^2]
        Field("rise", np.float64, (), 0.0),  # of ln K in this contact, by such rates
        Field("stiffened", np.int64, (), 0, 1),  # 1 once it became stiffer within a contact
        # Row with a tissue that varies which was chosen last; 0: none.
        Field("varying", np.int64, (), 0, ROW_COUNT - 1),
        Field("varied_at", np.float64, ()),  # contact clock then [s]
        # Covariance of ln K, ln B, n and p that other rows leave open.
        Field("spread", np.float64, (4, 4)),
        # In contact for which constant tissue has not done, and has done [s].
        Field("needed_time", np.float64, (), 0.0),
        Field("unneeded_time", np.float64, (), 0.0),
        # Row that says what least squares say, and contact clock then [s]; 0: none does.
        Field("found", np.int64, (), 0, ROW_COUNT - 1),
        Field("found_at", np.float64),
    )
)

KEPT = 13  # states of every row
MEMBERS = len(INDICES)

# A row as it was.
KEPT_ROW = record_type(
    (
        Field("state", np.float64, (STATES,)),
        Field("covariance", np.float64, (STATES, STATES)),
        Field("by_delay", np.float64, (STATES,)),
        Field("active", np.int64, (), 0, 1),
        Field("position_deviation", np.float64, (), 0.0),
        Field("model_error", np.float64, (), 0.0),
        Field("score", np.float64),
        Field("log_likelihood", np.float64),
        Field("recent_nis", np.float64),
        Field("inconsistent_time", np.float64),
    )
)
# Did the tool turn suddenly?
MANEUVER = record_type(
    (
        Field("rows", KEPT_ROW, (KEPT, FRESH)),  # ring
        Field("time", np.float64, (KEPT,)),  # [s]
        Field("contact_clock", np.float64, (KEPT,)),  # [s]
        Field("chosen", np.int64, (KEPT,), 0, ROW_COUNT - 1),  # row that was chosen
        Field("member", np.int64, (KEPT,), 0, MEMBERS - 1),  # chosen in the bank
        Field("count", np.int64, (), 0),  # kept so far
        Field("waited", np.int64, (), 0),  # samples since the last of them
        Field("since", np.float64),  # samples since the last maneuver
        Field("since_member", np.int64, (), 0, MEMBERS - 1),  # chosen before it
        Field("doubted", np.int64, (), 0, 1),  # 1 while only the force has shown it
        Field("density", np.float64),  # jerk density of the maneuver [mm^2/s^5]
        Field("alarm_since", np.float64),  # samples since the chosen row's alarm sum was zero
        Field("square_speed", np.float64),  # largest of the last seconds [mm^2/s^2]
        Field("square_acceleration", np.float64),  # largest of the last seconds [mm^2/s^4]
        Field("departed", np.float64),  # time since the tool departed from rest [s]
    )
)

POINTS = 512  # remembered samples

# One of what was felt before (`history`).
POINT = record_type(
    (
        Field("depth", np.float64),  # [mm]
        Field("velocity", np.float64),  # by a parabola [mm/s]
        # By a quintic through its neighbours [mm/s]; 1 where the motion is one.
        Field("quintic", np.float64),
        Field("by_quintic", np.int64, (), 0, 1),
        Field("force", np.float64),  # [N]
        Field("weight", np.float64),  # in the fit [1/N^2]
        Field("cubic", np.float64),  # what a cubic adds to the velocity [mm/s]
        # Velocity [mm/s] and acceleration [mm/s^2] for the fits that look for zeros.
        Field("motion_velocity", np.float64),
        Field("motion_acceleration", np.float64),
        Field("source", np.int64, (), 0, 3),  # of these; see `history.WIDE`
        Field("time", np.float64),  # of the displacement [s]
        Field("degree", np.int64, (), 0, TERMS - 1),  # see `local_polynomial`
        Field("memory", np.float64, (MEMORIES,)),  # what the memories of the force held then [N]
    )
)

# What was felt before, and the least-squares fit to it.
HISTORY = record_type(
    (
        Field("points", POINT, (POINTS,)),  # a ring
        Field("realigned", np.float64),  # by how much the delay was corrected beneath them [s]
        Field("memory", np.float64, (MEMORIES,)),  # the same now
        Field("last_force", np.float64),  # that went into them [N]
        Field("version", np.int64, (), 0),  # raised where the tissue is another from now on
        Field("count", np.int64, (), 0),  # remembered since the start or the last change
        Field("first", np.int64, (), 0),  # that counts, if it is still there
        # The first of the present contact, and of the place that it is with (`another_place`).
        Field("contact", np.int64, (), 0),
        Field("begun", np.int64, (), 0),
        Field("every", np.int64, (), 1, 1000),  # so many points of the grid make one of them
        Field("waited", np.int64, (), 0),  # points of the grid since the last of them
        Field("unfitted", np.int64, (), 0),  # points of the grid since the last fit
        Field("fit", np.float64, (4,)),  # ln K, ln B, n, p
        Field("left", np.float64, (), 0.0),  # variance of the force that it misses [N^2]
        Field("fitted", np.int64, (), 0, 1),  # 1 once there is one
        Field("held", np.int64, (4,), 0, 1),  # 1: only noise would say more than the prior
        # Within one fit:
        # Of velocities by what they are from (`history.OF_FIT` and after): deviation [mm/s], and
        # variance by the share of the point in the information [mm^2/s^2].
        Field("velocity_std", np.float64, (5,), 0.0),
        Field("velocity_noise", np.float64, (5,), 0.0),
        Field("half_width", np.float64, (), 0.0),  # of the parabolas [s]
        Field("trembles", np.int64, (), 0, 1),  # 1: velocities are the quintics'
        Field("cubic_share", np.float64, (), 0.0, 1.0),  # of what a cubic adds to the velocity
        Field("next", np.float64, (4,)),
        Field("slope", np.float64, (4,)),
        Field("gradient", np.float64, (6,)),
        Field("above", np.float64, (6,)),  # the same at a velocity one deviation higher
        Field("below", np.float64, (6,)),
        Field("seen", np.float64, (4, 4)),  # information of the points, weights of one
        Field("pull", np.float64, (4,)),  # and their part of the slope
        Field("information", np.float64, (4, 4)),
        Field("damped", np.float64, (4, 4)),
        Field("factor", np.float64, (4, 4)),
        Field("covariance", np.float64, (4, 4)),
        Field("direction", np.float64, (4, 4)),  # eigenvectors of its share
        Field("false", np.float64, (4, 4)),  # information that is noise of the velocity
    )
)

# Points of one moment, and how much time there is for the fits that are asked of them (`search`).
SEARCH = record_type(
    (
        Field("history", HISTORY),
        Field("noise", np.float64, (3,), 0.0),  # see `history.noise_of_points`
        Field("time", np.float64),  # up to which the time has passed [s]
        Field("credit", np.float64, (), 0.0),  # of it that no step has used yet [s]
    )
)

HELD = 512  # readings: 60 ms at 7 kHz

# Readings of the channel that is ahead; see `held_readings`.
HELD_READINGS = record_type(
    (
        Field("time", np.float64, (HELD,)),  # ring [s]
        Field("value", np.float64, (HELD,)),
        Field("count", np.int64, (), 0),  # held so far
        Field("first", np.int64, (), 0),  # number of the oldest that is still waiting
        Field("used", np.int64, (), 0),  # number after the one used last in a pair; 0: none in step
        Field("suspect", np.float64, finite=False),  # time of one, see there [s]
    )
)

# Readings of the force beside the place of the tool; see `air_window`.
WINDOW = record_type(
    (
        Field("count", np.int64, (), 0),  # readings in it
        Field("mean", np.float64, (2,)),  # displacement [mm], force [N]
        Field("moment", np.float64, (3,)),  # sums of squares and products about them: dd, dF, FF
        Field("lowest", np.float64, (), finite=False),  # displacement [mm]
        Field("highest", np.float64, (), finite=False),
    )
)

# Where, and at which reading, does the force begin?
ONSET = record_type(
    (
        Field("zero", np.float64, (2,)),  # found, beyond those given: displacement [mm], force [N]
        # Of the force's zero [N]; NaN: not found.
        Field("force_deviation", np.float64, (), 0.0, finite=False),
        Field("position_deviation", np.float64, (), 0.0),  # of the contact position [mm]
        Field("shift", np.float64, (2,)),  # of the zeros at this sample
        Field("decided", np.int64, (), 0, 1),  # 1 after the first contact
        Field("doubted", np.int64, (), 0, 1),  # 1 once zeros that were found were given up for good
        Field("looked_back", np.int64, (), 0, 1),  # 1 once the readings of the start were taken
        Field("free", np.int64, (), 0, 1),  # 1 once the tool was seen without force
        Field("low", np.int64, (), 0),  # forces so far that are not surely felt
        Field("free_at", np.float64),  # displacement there, the last one [mm]
        Field("free_time", np.float64),  # [s]
        # Lowest place within the largest delay of that time, highest within that of `first_time`,
        # and the latter when they were looked for [mm], [s].
        Field("about", np.float64, (2,)),
        Field("about_time", np.float64, (), finite=False),
        # 1 once the tool was seen to come down in the air, 2 if it was seen between two contacts.
        Field("in_air", np.int64, (), 0, 2),
        Field("force_seen", np.int64, (), 0, 1),  # 1 once there was a force
        Field("touched", np.int64, (), 0, 1),  # 1 once it was gone again
        Field("contradictions", np.int64, (), 0),  # readings in a row against the contact position
        Field("first_time", np.float64),  # of the next [s]
        Field("first_force", np.float64),  # that was sure, since the last that was not; 0: none [N]
        # The window in which the force stays the same:
        Field("window", WINDOW),
        Field("highest_level", np.float64),  # largest mean of a window that was not in the air [N]
        Field("highest_at", np.float64),  # mean displacement of that one [mm]
        Field("lowest_level", np.float64),  # smallest [N]
        # Level to which the force comes down between two contacts, and variance of that mean [N],
        # [N^2]; 0: none yet.
        Field("floor", np.float64),
        Field("floor_variance", np.float64, (), 0.0),
        Field("floor_time", np.float64),  # of the latest [s]
        Field("upward", np.float64, (), 0.0),  # cumulative sums
        Field("downward", np.float64, (), 0.0),
        Field("fastest", np.float64),  # velocity [mm/s]
        # The same up to where the force began to leave it upwards:
        Field("inside", WINDOW),
        Field("air_slowing", np.float64, (), 0.0),  # from the largest velocity on [mm/s]
        Field("air_fastest", np.float64),
        Field("inside_at", np.float64),  # displacement there [mm]
        Field("inside_time", np.float64),  # [s]
        Field("inside_variance", np.float64, (), 0.0),  # of the force sensor there [N^2]
        Field("level_deviation", np.float64, (), 0.0),  # of the mean force [N]
        # Forces before the zero, as long as the tool was never seen free:
        Field("rise", WINDOW),
        Field("rise_lowest", np.float64),  # force [N]
        Field("rise_highest", np.float64),
    )
)

STEPPED = 5  # readings in the air on end that are another zero (`air_zero`)
# What does the force read in the air by now?
AIR = record_type(
    (
        Field("outside", np.float64, (), 0.0),  # time since the tool left [s]
        Field("travelled", np.int64, (), 0, 1),  # 1 once the force stayed the same on the way there
        Field("known_at", np.float64, (), finite=False),  # time at which the zero was seen [s]
        Field("confirmed", np.int64, (), 0, 1),  # 1 once it was seen to be what it was said to be
        # Mean square of what it was off in contact [N^2], and of how many visits.
        Field("wander", np.float64, (), 0.0),
        Field("visits", np.int64, (), 0),
        # Of readings outside, in stretches that were judged:
        Field("seen", np.int64, (), 0),
        Field("seen_time", np.float64, (), 0.0),  # that they span [s]
        Field("sum", np.float64),  # of their forces [N]
        # In the present stretch:
        Field("time", np.float64, (), 0.0),  # that they span [s]
        Field("place_variance", np.float64, (), 0.0),  # of the latest [mm^2]
        Field("window", WINDOW),
        Field("away", np.int64, (), -STEPPED, STEPPED),  # readings on end that are above or below
    )
)

# What is given out of a sample, by the row that was chosen before it.
GIVEN = record_type(
    (
        Field("row", np.int64, (), 0, ROW_COUNT - 1),
        Field("extrapolated", np.float64),  # by how much later the sample's own force belongs [s]
        Field("predicted_force", np.float64),  # [N]
        Field("latest_force", np.float64),  # the sample's own reading [N]
        Field("reconstructed_force", np.float64),  # [N]
        # Displacement [mm], force [N]; NaN where a reading is missing.
        Field("innovation", np.float64, (2,), finite=False),
        Field("nis", np.float64),
    )
)

BANK: tuple[Field, ...] = (
    Field("clock", record_type(CLOCK_FIELDS)),
    Field("calibrated", np.int64, (), 0, 1),  # 1 once the sensors' noise is known
    Field("guessed", np.int64, (), 0, 1),  # 1 once a contact has set the first guess of K
    Field("contact_readings", np.int64, (), 0, 3),  # readings in a row with a force, up to three
    Field("motion_anew", np.int64, (), 0, 1),  # 1 if the motion starts anew at the next sample
    Field("color", COLOR, (2,)),
    Field("resolution", RESOLUTION, (2,)),
    Field("sensor_noise", np.float64, (2,), 0.0),  # variances in use [mm^2], [N^2]
    Field("noise", NOISE, (2,)),
    Field("motion", MOTION),
    Field("tool", TOOL),
    Field("rows", ROW, (ROW_COUNT,)),
    Field("judge", JUDGE),
    Field("change", CHANGE),
    Field("maneuver", MANEUVER),
    Field("history", HISTORY),
    Field("search", SEARCH),
    Field("fit", SPLINE_FIT),
    Field("moving", MOVING),
    Field("zeros", ZEROS),
    Field("delay", DELAY),
    Field("held", HELD_READINGS),
    Field("gate", GATE),
    Field("given", GIVEN),
    Field("onset", ONSET),
    Field("air", AIR),
    Field("place", PLACE),
)
