"""The record of a contact that may be with another place (`another_place`, `place_fit`)."""

from __future__ import annotations

import numpy as np

from hc_estimator.memory import Field, record_type
from hc_estimator.multiple_model.hypotheses import ROWS
from hc_estimator.multiple_model.spline_records import LARGEST_SHIFT

SEVEN = 7  # ln K, ln B, n, p, contact position, delay, rate of ln K

PLACE = record_type(
    (
        Field("away", np.float64, (), 0.0),  # time since a force was felt [s]
        Field("known", np.int64, (), 0, 1),  # 1 if `before` is what was known in the air
        Field("unknown", np.int64, (), 0, 1),  # 1 if nothing that was known can be believed
        Field("before", np.float64, (SEVEN,)),
        Field("before_covariance", np.float64, (SEVEN, SEVEN)),
        Field("joint", np.int64, (), 0, 1),  # 1 if both are beside an unknown delay
        Field("testing", np.int64, (), 0, 1),  # 1 while it is asked of the present contact
        Field("is_other", np.int64, (), 0, 1),  # 1 once it is another place
        Field("row", np.int64, (), 0, len(ROWS) - 1),  # that was in charge in the air
        # 1 once the delay was known: until then what is late looks like another height.
        Field("in_step", np.int64, (), 0, 1),
        Field("doubted", np.int64, (), 0, 1),  # 1 once that has failed since then
        Field("called", np.int64, (), 0, 1),  # 1 once it was called another tissue
        Field("due", np.int64, (), 0),  # points of the contact at which it is asked next
        Field("ended", np.int64, (), 0),  # contacts so far
        Field("fitting", np.int64, (), 0),  # of which the law fitted so many at their end
        Field("fitting_in_a_row", np.int64, (), 0),  # the latest of them
        Field("late", np.int64, (), 0, 1),  # 1 while the delay is an unknown
        # Mean square of the rate of ln K, of tissue that varies; 0: it does not [1/s^2].
        Field("square_rate", np.float64, (), 0.0),
        Field("begin", np.float64, (), 0.0),  # of the points of a fit [s]
        Field("delay_doubt", np.float64, (), 0.0),  # variance of the one in use; 0: none is [s^2]
        Field("delay", np.float64),  # by the contacts that are over [s]
        Field("delay_precision", np.float64, (), 0.0),  # [1/s^2]
        Field("delay_contacts", np.int64, (), 0),  # so many
        Field("delay_learnt", np.int64, (), 0, 1),  # 1 if the newest point ended such a contact
        Field("delay_squares", np.float64, (), 0.0),  # of how they differ, over their variance
        Field("found", np.int64, (), 0),  # other places so far
        Field("contacts", np.int64, (), 0),  # that were asked about
        # What is open of ln K, ln B, n and p as it may be another place after all.
        Field("open", np.float64, (4, 4)),
        Field("level", np.int64, (), 0),  # of which so many at the height of the one before
        # Within one fit:
        Field("first", np.int64, (), 0),  # number of its first point
        Field("last", np.int64, (), 0),  # and of the one after the last
        Field("shift", np.int64, (), -LARGEST_SHIFT, LARGEST_SHIFT),  # of the motion by points
        Field("spacing", np.float64, (), 0.0),  # time between two points [s]
        Field("expected", np.float64, (), 0.0),  # squares where only noise is left
        Field("guess", np.float64, (SEVEN,)),
        Field("prior", np.float64, (SEVEN, SEVEN)),  # precision
        Field("values", np.float64, (SEVEN,)),
        # Of the fit at the old height and of that at another one, and then of the likelier.
        Field("outcome", np.float64, (SEVEN,)),
        Field("outcome_elsewhere", np.float64, (SEVEN,)),
        Field("covariance_elsewhere", np.float64, (SEVEN, SEVEN)),
        Field("conditional", np.float64, (4, 4)),  # covariance at that height
        Field("doubt", np.float64, (4, 4)),  # what the height leaves open
        Field("height_deviation", np.float64, (), 0.0),  # [mm]
        Field("is_level", np.int64, (), 0, 1),  # 1 if the height is the old one
        Field("next", np.float64, (SEVEN,)),
        Field("slope", np.float64, (SEVEN,)),
        Field("pull", np.float64, (SEVEN,)),
        Field("slopes", np.float64, (SEVEN,)),
        Field("gradient", np.float64, (6,)),
        Field("seen", np.float64, (SEVEN, SEVEN)),
        Field("information", np.float64, (SEVEN, SEVEN)),
        Field("factor", np.float64, (SEVEN, SEVEN)),
        Field("covariance", np.float64, (SEVEN, SEVEN)),
    )
)
