"""The record of zeros that are off, and of the fit that looks for them (`zero_fit`)."""

from __future__ import annotations

import numpy as np

from hc_estimator.memory import Field, record_type

# A choice of unknowns is the sum of these.
NONE, OF_POSITION, OF_FORCE, OF_DELAY = 0, 1, 2, 4
BOTH = OF_POSITION + OF_FORCE
ALL = BOTH + OF_DELAY

SPLINE = 24  # coefficients of the stiffness over ten seconds, at most
SPLINE_FIRST = 7  # of the unknowns that is one
UNKNOWNS = SPLINE_FIRST + SPLINE

# Zeros that are off, and the fit that looks for them; see `zero_fit` and `spline_fit`.
ZEROS = record_type(
    (
        Field("unknown", np.int64, (), 0, 3),  # which zeros in use were found: 1 position, 2 force
        # Covariance of ln K, ln B, n and p that those owe to what is not known of the zeros.
        Field("doubt", np.float64, (4, 4)),
        Field("deviation", np.float64, (), 0.0),  # of ln K by that, when they were found
        # The same by the last fit, and by one with both zeros unknown.
        Field("doubt_of_fit", np.float64, (4, 4)),
        Field("doubt_of_both", np.float64, (4, 4)),
        Field("waiting", np.int64, (), 0, 1),  # 1 while others have not lasted yet
        Field("candidate", np.int64, (), 0, 3),  # which
        Field("since", np.float64),  # contact clock at which they became so [s]
        Field("begun", np.float64, (2,)),  # what they were then [mm], [N]
        Field("begun_covariance", np.float64, (3, 3)),
        # Contact clock at which nothing explained the points any more, and of the last fit [s].
        Field("refuted_since", np.float64, (), finite=False),
        Field("looked_at", np.float64, (), finite=False),
        # Of the last fit: ln K (now), ln B, n, p; and by how much the zeros in use are off.
        Field("fit", np.float64, (4,)),
        Field("position", np.float64),  # [mm]
        Field("force", np.float64),  # [N]
        Field("delay", np.float64),  # [s]
        Field("covariance", np.float64, (3, 3)),  # of these three
        Field("columns", np.float64, (4, 3)),  # of ln K, ln B, n and p with them
        Field("slopes_by", np.float64, (4, 2)),  # derivatives by contact position and force zero
        Field("change", np.float64, (4,)),
        Field("cost", np.float64, (8,), finite=False),  # of each choice of unknowns
        Field("weight", np.float64, (), 0.0, 1.0),  # of the points' squares
        Field("misfit", np.float64, (), finite=False),  # least squares left over the noise's
        # Within one fit:
        Field("values", np.float64, (UNKNOWNS,)),
        Field("held", np.int64, (UNKNOWNS,), 0, 1),
        Field("kind", np.int64, (), 0, 2),  # what the tissue does
        Field("level", np.float64),  # ln K to begin with
        Field("begin", np.float64),  # time of the first point [s]
        Field("latest", np.float64),  # and of the last
        Field("knot", np.float64),  # time between two knots [s]
        Field("intervals", np.int64, (), 0, SPLINE - 3),  # between knots; 0: one stiffness
        Field("count", np.int64, (), 0),  # points that were used
        Field("expected", np.float64, (), 0.0),  # squares where only noise is left
        Field("basis", np.float64, (4,)),
        Field("gradient", np.float64, (6,)),
        Field("slopes", np.float64, (SPLINE_FIRST + 4,)),
        Field("next", np.float64, (UNKNOWNS,)),
        Field("slope", np.float64, (UNKNOWNS,)),
        Field("pull", np.float64, (UNKNOWNS,)),
        Field("seen", np.float64, (UNKNOWNS, UNKNOWNS)),
        Field("information", np.float64, (UNKNOWNS, UNKNOWNS)),
        Field("damped", np.float64, (UNKNOWNS, UNKNOWNS)),
        Field("factor", np.float64, (UNKNOWNS, UNKNOWNS)),
    )
)
