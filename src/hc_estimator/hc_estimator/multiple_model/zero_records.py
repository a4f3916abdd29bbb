"""The record of zeros that are off (`zero_fit`)."""

from __future__ import annotations

import numpy as np

from hc_estimator.memory import Field, record_type
from hc_estimator.multiple_model.spline_records import ASKED

# A choice of unknowns is the sum of these.
NONE, OF_POSITION, OF_FORCE, OF_DELAY = 0, 1, 2, 4
BOTH = OF_POSITION + OF_FORCE
ALL = BOTH + OF_DELAY

# Of a search for zeros: what is being fitted. Tissue and surface of `zero_rival`; a kind of
# `zero_kinds`, and that without what seemed to be air; the choice; the zeros as they are.
IDLE, OF_RIVAL, OF_KIND, KIND_IN_AIR, OF_CHOICE, AS_THEY_ARE = range(6)

# See `zero_fit`.
ZEROS = record_type(
    (
        Field("unknown", np.int64, (), 0, 3),  # which zeros in use were found: 1 position, 2 force
        Field("moved", np.float64, (2,)),  # by how much they were moved for it [mm], [N]
        # Covariance of ln K, ln B, n and p that those owe to what is not known of the zeros.
        Field("doubt", np.float64, (4, 4)),
        # By how much those that are taken for exact may be off, as far as the points give reason to
        # think so: root mean squares of position [mm] and force [N].
        Field("off", np.float64, (2,), 0.0),
        Field("deviation", np.float64, (), 0.0),  # of ln K by that, when they were found
        # Least variance of ln K by those in use, be they all that is off, of any fit since then.
        Field("least", np.float64, (), 0.0),
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
        Field("square", np.float64, (2, 2)),  # mean squares of zeros that may be off
        Field("cost", np.float64, (8,), finite=False),  # of each choice of unknowns
        Field("inflation", np.float64, (), 0.0),  # of the covariance of the last fit
        Field("squares", np.float64, (), 0.0),  # least squares that the last fit left
        Field("misfit", np.float64, (), finite=False),  # least squares left over the noise's
        # Of a search that goes on (`zero_kinds`):
        Field("stage", np.int64, (), 0, AS_THEY_ARE),
        Field("possible", np.int64, (), 0, 3),  # zeros that may be off
        Field("kind", np.int64, (), 0, 4),  # number of the one that is fitted
        Field("asked", ASKED),
        Field("first", np.int64, (), 0),  # number of the oldest point
        Field("near", np.int64, (), 0),  # and of the oldest over which knots are close enough
        Field("span", np.float64),  # time over all of them [s]
        Field("breathes", np.int64, (), 0, 1),  # 1 if the surface may
        # Zero of the force by what it reads in the air [N], and its deviation [N].
        Field("air_zero", np.float64),
        Field("air_deviation", np.float64, (), 0.0, finite=False),
        Field("rival", np.float64, (), finite=False),  # log evidence of the row in charge
        Field("in_charge", np.int64, (), -1, 63),  # and the kind that says the same
        Field("chosen", np.int64, (), 0, 3),  # zeros that the points ask for
        Field("shown", np.float64),  # variance of ln K by these
        Field("cost_of_chosen", np.float64, (), finite=False),  # squares that they leave
    )
)
