"""The record of what is known of the delay between the channels (`grid`, `delay`, `delay_fit`)."""

from __future__ import annotations

import numpy as np

from hc_estimator.memory import Field, record_type

TERMS = 7  # of a local polynomial, at most
RAW = 256  # readings of each channel, for the local parabolas
GRID = 80  # points of the grid: a window of half a second at 100 a second, and its margins
NEIGHBOURS = 4  # points of the grid to either side that a smoothed one is made of, at most
CANDIDATES = 15  # delays at steps of the grid, about zero
AT_ZEROS = CANDIDATES + 1  # slot of the law at the delay found, with the zeros in use
SLOTS = CANDIDATES + 2  # of laws: CANDIDATES itself is that of the delay found
WINDOWS = 24  # half seconds of innovations that are remembered
DELAY_POINTS = 240  # that are kept to fit the delay
TEMPERED = 128  # half seconds that they may be of

# Local polynomials through the readings about one time (`grid`).
GRID_POINT = record_type(
    (
        Field("displacement", np.float64),  # [mm]
        Field("velocity", np.float64),  # by a parabola [mm/s]
        Field("acceleration", np.float64),  # [mm/s^2]
        Field("force", np.float64),  # [N]
        Field("displacement_left", np.float64, (), 0.0),  # mean square that is left [mm^2]
        Field("force_left", np.float64, (), 0.0),  # [N^2]
        Field("cubic", np.float64),  # what a cubic adds to the velocity [mm/s]
        Field("degree", np.int64, (), 0, TERMS - 1),  # see `local_polynomial`
        Field("displacement_by_parabola", np.float64),  # [mm]
        Field("force_by_parabola", np.float64),  # [N]
    )
)

# The same by its neighbours (`smoothing`).
SMOOTHED = record_type(
    (
        Field("displacement", np.float64),  # [mm]
        Field("velocity", np.float64),  # by a parabola [mm/s]
        Field("velocity_by_cubic", np.float64),  # [mm/s]
        Field("force", np.float64),  # [N]
    )
)

# A point that is kept, as it would be with one of the candidate delays (`delay_points`).
OF_CANDIDATE = record_type(
    (
        Field("displacement", np.float64),  # [mm]
        Field("log_speed", np.float64),  # ln |velocity|
        Field("velocity", np.float64),  # [mm/s]
    )
)

KEPT_POINT = record_type(
    (
        Field("time", np.float64),  # [s]
        Field("window", np.int64, (), 0),  # that it is of
        Field("candidates", OF_CANDIDATE, (CANDIDATES,)),
        Field("forces", np.float64, (4,)),  # from a step of the grid before to two after [N]
        Field("force", np.float64),  # of them, for the delay that is tried [N]
        Field("velocity_noise", np.float64, (), 0.0),  # variance [mm^2/s^2]
        Field("force_noise", np.float64, (), 0.0),  # variance [N^2]
        Field("weight", np.float64, (), 0.0),  # by the law that is tried [1/N^2]
    )
)

# What was fitted last: each candidate by itself; one K; zeros beside it; one K, finally; all.
IDLE, FITTED_FIRST, FITTED_ONE, FITTED_ZEROS, FITTED_ALIKE, FITTED_ALL = range(6)

# By how much is the force late?
DELAY = record_type(
    (
        Field("delay", np.float64),  # in use [s]
        Field("deviation", np.float64, (), 0.0, finite=False),  # of it; NaN: not known [s]
        Field("doubt", np.float64, (), 0.0),  # variance of its error that the estimate owes [s^2]
        Field("raw_time", np.float64, (2, RAW)),  # rings, displacement and force [s]
        Field("raw_value", np.float64, (2, RAW)),  # [mm], [N]
        Field("raw_count", np.int64, (2,), 0),
        Field("raw_first", np.int64, (2,), 0),  # number of the first that is not taken out
        Field("grid", GRID_POINT, (GRID,)),  # a ring
        Field("grid_count", np.int64, (), 0),
        Field("grid_step", np.float64),  # [s]
        Field("grid_width", np.float64),  # of the parabolas [s]
        Field("grid_next", np.float64),  # time of the next point [s]
        Field("reach", np.int64, (), 0, CANDIDATES // 2),  # candidates to either side of zero
        Field("neighbours", np.int64, (), 0, NEIGHBOURS),  # points that smooth one, either side
        Field("points", np.int64, (), 0, GRID),  # of a window
        Field("first", np.int64, (), 0),  # grid_count at its first point
        Field("windows", np.int64, (), 0),  # so far
        Field("fit", np.float64, (3,)),  # K, B, n that go with the delay
        # Within one window:
        Field("smooth", SMOOTHED, (GRID,)),  # its points, slots as in `grid`
        Field("quintic", np.float64),  # velocity of one point by a quintic [mm/s]
        Field("wide", np.float64, (2,)),  # velocity and acceleration of one point by a wide cubic
        Field("in_contact", np.int64, (GRID,), 0, 1),
        Field("fitted_to", np.float64, (2, 6)),  # displacement and force; see `local_polynomial`
        # Sums over readings: powers of the time, those times the reading and its square.
        Field("powers", np.float64, (2 * TERMS - 1,)),
        Field("readings", np.float64, (TERMS + 1,)),
        Field("normal_of_powers", np.float64, (TERMS, TERMS)),  # factored
        Field("reduced", np.float64, (TERMS,)),
        Field("polynomial", np.float64, (TERMS,)),
        Field("kept_points", KEPT_POINT, (DELAY_POINTS,)),  # a ring
        # Variances of depth and force, smoothed and as in `grid`; of the velocity by a parabola, by
        # a cubic, and as in `grid`.
        Field("depth_noise", np.float64, (2,), 0.0),
        Field("force_noise", np.float64, (2,), 0.0),
        Field("velocity_noise", np.float64, (3,), 0.0),
        Field("kept", np.int64, (), 0),  # points so far
        Field("kept_from", np.int64, (), 0),  # grid_count from which on it is this tissue
        # The fit to them; see `delay_fit`.
        Field("fitted", np.int64, (), 0),  # points at the last fit
        Field("stage", np.int64, (), 0, FITTED_ALL),  # of a fit that goes on
        Field("many_ways", np.int64, (), 0, 1),  # 1 if one K may have zeros of its own
        Field("ways", np.int64, (), 0),  # that the tool has gone
        Field("moves", np.int64, (), 0, 1),  # 1 if the surface moves
        Field("varied", np.int64, (), 0, 1),  # varies, before it
        Field("best", np.int64, (), 0, CANDIDATES - 1),  # and chosen
        Field("without", np.float64, (), finite=False),  # squares that are left without zeros
        Field("without_at", np.int64, (), 0, CANDIDATES - 1),
        # From candidate to candidate: side that is next (0: neither), how far, from which.
        Field("side", np.int64, (), -1, 1),
        Field("away", np.int64, (), 0),
        Field("begun_at", np.int64, (), 0, CANDIDATES - 1),
        Field("steps", np.int64, (), 0),  # of each, at most
        Field("anew", np.int64, (), 0, 1),  # 1 if it begins with the law of the one before
        Field("added", np.int64, (), 0),  # points in the sums of a step
        Field("clear", np.int64, (), 0, 1),  # 1 if it said a delay clearly
        Field("fits", np.int64, (), 0, 1),  # 1 if the best of it leaves no more than noise
        Field("varies", np.int64, (), 0, 1),  # 1 if each window has a K of its own
        Field("zeros", np.int64, (), 0, 1),  # 1 if surface and zero of the force are unknown
        Field("chosen", np.int64, (), 0, CANDIDATES - 1),  # candidate that leaves least
        Field("found", np.float64),  # delay [s]
        Field("found_deviation", np.float64, (), 0.0),  # of it; 0: not known [s]
        Field("found_of", np.int64, (), 0),  # by how many points
        # K, B / K, n, p, position [mm] and speed [mm/s] of the surface, zero of the force over K.
        Field("law", np.float64, (SLOTS, 7)),
        Field("kept_law", np.float64, (SLOTS, 7)),
        Field("surface_time", np.float64),  # at which it has that position [s]
        Field("left", np.float64, (SLOTS,), finite=False),  # weighted squares left
        Field("score", np.float64, (SLOTS,)),  # derivative of half of them [1/s]
        Field("information", np.float64, (SLOTS,), 0.0),  # on the delay [1/s^2]
        Field("bend", np.float64, (SLOTS,), 0.0),  # of the squares, by the delay [1/s^2]
        Field("noise_share", np.float64, (SLOTS,), 0.0),  # of what shows B
        Field("place", np.float64),  # of the delay, in candidates
        # Within one fit:
        Field("squares", np.float64),  # of the last law tried
        # Of the velocity, from what is known of b, n and p (times a logarithm, of either sign).
        Field("noise_taken", np.float64, (3,)),
        Field("trial", np.float64, (7,)),
        Field("direction", np.float64, (6,)),
        Field("normal", np.float64, (7, 7)),
        Field("slope", np.float64, (7,)),
        Field("column", np.float64, (7,)),
        Field("sums_of_k", np.float64, (9,)),  # of the points with one K
        Field("moments", np.float64, (10, 7)),
        Field("window_left", np.float64, (TEMPERED,), finite=False),  # weighted squares of each
        Field("window_points", np.int64, (TEMPERED,), 0),
        Field("window_added", np.int64, (), 0),  # the one that is being added up
        Field("window_before", np.float64),  # squares of those before
        Field("fine", np.float64, (2,)),  # delay and its deviation [s]
        # Delay [s] and its variance [s^2] by the filter's innovations of each half second.
        Field("evidence", np.float64, (WINDOWS, 2)),
        Field("evidence_count", np.int64, (), 0),
    )
)
