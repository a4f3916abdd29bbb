"""The records of what is asked after an alarm: of a reading that jumped, and of the tissue."""

from __future__ import annotations

import numpy as np

from hc_estimator.memory import Field, record_type
from hc_estimator.multiple_model.hypotheses import ROWS

# Is it another tissue?
CHANGE = record_type(
    (
        Field("testing", np.int64, (), 0, 1),
        Field("reference", np.int64, (), 0, len(ROWS) - 1),  # row whose alarm began the test
        Field("time", np.float64, ()),  # in contact since the alarm [s]
        Field("calm_time", np.float64, (), 0.0),  # for which that row has explained all [s]
        Field("leads", np.int64, (), 0, 1),  # 1 while the fresh row is given out
        Field("fitted", np.int64, (), 0, 1),  # 1 if the rows had fitted for long
        Field("trusted", np.int64, (), 0, 1),  # 1 if they also knew the damping
        Field("fitting_time", np.float64, (), 0.0),  # in contact without model error [s]
        Field("before", np.float64, (4,)),  # ln K, ln B, n, p of that row at the alarm
        Field("before_variance", np.float64, (4,), 0.0),
        Field("detected", np.int64, (), 0, 1),  # at the present sample
        # Of a force that jumped (`zero_step`):
        Field("jumped_at", np.float64, ()),  # stamp of the first reading after it [s]
        Field("jumped_from", np.float64, ()),  # what the law gave there [N]
        Field("swing", np.float64, (), 0.0),  # squared deviations that tell a zero from a tissue
        Field("swing_mean", np.float64, ()),  # of what a tissue would have made of the jump [N]
        Field("swing_weight", np.float64, (), 0.0),  # of the readings in that [1/N^2]
        Field("zero_lead", np.float64, ()),  # log likelihood ratio to the row in use
        Field("zero_leads", np.int64, (), 0, 1),  # 1 while another zero is the clearly likelier
    )
)

# Readings that were refused; see `outliers` and `jumps`.
GATE = record_type(
    (
        Field("refused_from", np.float64, (2,)),  # stamp of the first of those in a row [s]
        # Displacement that jumped or stands still, stamp [s]; NaN: it did not.
        Field("jumped_at", np.float64, finite=False),
        Field("stuck", np.int64, (), 0, 2),  # 1, 2 if it is the same number again and again
        Field("value", np.float64),  # that number [mm]
        Field("agreeing", np.int64, (), 0),  # forces in a row that agree with it
        Field("agrees_from", np.float64),  # stamp of the first of them [s]
        Field("agrees_force", np.float64),  # that one [N]
        Field("force_still", np.int64, (), 0, 1),  # 1 if the force stands still
        Field("force_value", np.float64),  # at that number [N]
        Field("still_from", np.float64),  # stamp from which on [s]
        # Of a displacement that may go on under another zero (`position_step`):
        Field("offset_count", np.int64, (), 0),  # readings since it jumped
        Field("offset_weight", np.float64, (), 0.0),  # of them [N^2/mm^2]
        Field("offset", np.float64),  # by how much they lie beside the tool, mean [mm]
        Field("place", np.float64),  # mean of the readings [mm]
        # Weighted moments about the means: beside the tool, of both, of the readings [N^2].
        Field("moment", np.float64, (3,)),
        Field("zero_before", np.float64, finite=False),  # before the last step [mm]; NaN: none
    )
)
