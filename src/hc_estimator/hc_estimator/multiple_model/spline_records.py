"""The records of fits in which tissue or surface are splines over time (`spline_fit`)."""

from __future__ import annotations

import numpy as np

from hc_estimator.memory import Field, record_type

SPLINE = 44  # coefficients of the stiffness over ten seconds, at most
SECOND_SPLINE = 24  # of surface or exponent
SPLINE_FIRST = 7  # of the unknowns that is one
BAND = 3  # coefficients next to one another that the prior ties
UNKNOWNS = SPLINE_FIRST + SPLINE + SECOND_SPLINE
MEMORIES = 5  # of a tissue that relaxes
# A kind is the sum of what does not stay: stiffness; surface at a steady speed, or anyhow;
# exponent; force under a depth that stays; STEADY: the stiffness, at a rate that hardly changes.
STAYS, VARIES, SINKS, MOVES, BENDS, RELAXES, STEADY = 0, 1, 2, 4, 8, 16, 32
LARGEST_SHIFT = 32  # points by which a force may be late
KINDS = 9  # of what tissue and surface do
# Of a fit, step by step (`spline_descent`).
SOLVED, PASS_BEGINS, PASS_GOES_ON, PASS_ENDS = range(4)
LOCAL = SPLINE_FIRST + 2 * 4  # of which the force depends at one time

SPLINE_FIT = record_type(
    (
        Field("values", np.float64, (UNKNOWNS,)),
        Field("held", np.int64, (SPLINE_FIRST,), 0, 1),
        Field("fixed", np.int64, (SPLINE_FIRST,), 0, 1),  # held, or without a deviation
        Field("kind", np.int64, (), 0, 2 * STEADY - 1),
        Field("position_deviation", np.float64, (), 0.0, finite=False),  # of the prior [mm]
        # Zero of the force by what it reads in the air [N]; infinite: nothing.
        Field("air_zero", np.float64),
        Field("air_zero_deviation", np.float64, (), 0.0, finite=False),
        Field("delay_deviation", np.float64, (), 0.0),  # of the prior [s]
        # By how many points the force is late beside the delay, and how far they are apart [s].
        Field("shift", np.int64, (), -LARGEST_SHIFT, LARGEST_SHIFT),
        Field("spacing", np.float64, (), 0.0),
        Field("level", np.float64),  # ln K to begin with
        Field("begin", np.float64),  # time of the first point [s]
        Field("latest", np.float64),  # and of the last
        Field("first", np.int64, (), 0),  # number of that point
        Field("last", np.int64, (), 0),  # and of the one after the last
        # Of the stiffness, and of surface or exponent: time between two knots [s], and number of
        # intervals between them (0: no spline).
        Field("knot", np.float64, (2,)),
        Field("intervals", np.int64, (2,), 0, SPLINE - 3),
        Field("wandering", np.float64, (2,), 0.0),  # variance that their rates gain per second
        Field("unknowns", np.int64, (), 0, UNKNOWNS),  # unknowns in use
        Field("count", np.int64, (), 0),  # points that were used
        # Of the squares: what points cost that are noisier than the sensors (`point_error`).
        Field("log_missed", np.float64, (), 0.0),
        Field("expected", np.float64, (), 0.0),  # squares where only noise is left
        # What less is left of those because two positions were averaged.
        Field("averaged", np.float64, (), 0.0),
        Field("phase", np.int64, (), 0, PASS_ENDS),
        Field("passes", np.int64, (), 0),  # done
        Field("steps", np.int64, (), 0),  # of this pass
        Field("squares", np.float64, (), finite=False),  # that are left
        Field("before", np.float64, (), finite=False),  # by the last pass
        Field("cost", np.float64, (), finite=False),  # with what the prior adds
        Field("damping", np.float64, (), 0.0),  # of the next step
        Field("weight", np.float64, (), 0.0, 1.0),  # of the points' squares
        # Of one point:
        Field("basis", np.float64, (2, 4)),  # splines that are not zero there
        Field("basis_rate", np.float64, (2, 4)),  # their derivatives [1/s]
        Field("places", np.int64, (LOCAL,), 0, UNKNOWNS - 1),  # unknowns that its force depends on
        Field("slopes", np.float64, (LOCAL,)),  # derivatives by those
        Field("gradient", np.float64, (6,)),
        Field("guess", np.float64, (UNKNOWNS,)),
        Field("prior", np.float64, (UNKNOWNS, BAND)),  # precision about the guess, in diagonals
        Field("next", np.float64, (UNKNOWNS,)),
        Field("ahead", np.float64, (UNKNOWNS,)),  # a little way there
        Field("slope", np.float64, (UNKNOWNS,)),
        Field("pull", np.float64, (UNKNOWNS,)),
        Field("seen", np.float64, (UNKNOWNS, UNKNOWNS)),
        Field("information", np.float64, (UNKNOWNS, UNKNOWNS)),
        Field("factor", np.float64, (UNKNOWNS, UNKNOWNS)),
    )
)

# What the kinds of a search have left (`asked_kinds`).
ASKED = record_type(
    (
        Field("version", np.int64, (), -1),  # of the history
        Field("left", np.float64, (KINDS,), finite=False),  # squares, in those of the noise
        Field("at", np.float64, (KINDS,), finite=False),  # contact clock [s]
    )
)

# What tissue and surface do, by the last fit; see `moving_fit`.
MOVING = record_type(
    (
        Field("looked_at", np.float64, (), finite=False),  # contact clock of the last search [s]
        Field("stage", np.int64, (), 0, KINDS + 3),  # fit that goes on, see there; 0: none
        Field("found", np.int64, (), -1, KINDS - 1),  # kind that was found; -1: none
        Field("evidence", np.float64, (KINDS,), finite=False),  # logarithm, by kind
        # The same with nothing late, where a fit had a small delay of its own.
        Field("in_step", np.float64, (KINDS,), finite=False),
        Field("asked", ASKED),
        Field("values", np.float64, (KINDS, UNKNOWNS)),  # of each fit
        Field("unknowns", np.int64, (KINDS,), 0, UNKNOWNS),  # number of those in use
        Field("moved_at", np.float64, (), finite=False),  # contact clock: a surface moved [s]
        # Delay beside the one in use beneath such a surface, and how many fits in a row say so.
        Field("delay", np.float64),
        Field("delay_variance", np.float64, (), 0.0),
        Field("agreeing", np.int64, (), 0),
        Field("nearer", np.int64, (), 0),  # times that it was fitted with nearer points
        # ln K, ln B, n, p; position and speed of the surface; rate of ln K.
        Field("outcome", np.float64, (7,)),
        Field("covariance", np.float64, (7, 7)),
        Field("slopes", np.float64, (7, UNKNOWNS)),  # derivatives by the unknowns
    )
)
