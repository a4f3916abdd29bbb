"""What is given out of a sample: by which row, what that expected, and what it made of it."""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import readings
from hc_estimator.multiple_model.hypotheses import FRESH
from hc_estimator.multiple_model.kalman import force_of_row
from hc_estimator.screening import ACCEPTED


@compiled
def given_row(bank: Any) -> int:
    """Index of the row whose estimate is given out."""
    if bank.change.leads != 0:
        return FRESH
    return bank.judge.chosen  # type: ignore[no-any-return]


@compiled
def foretell(settings: Any, bank: Any) -> None:
    """Note the force that the row in charge expects of the sample's own reading."""
    row = bank.rows[given_row(bank)]
    bank.given.row = row.index
    bank.given.predicted_force = force_of_row(settings, row, bank.given.extrapolated)
    bank.given.reconstructed_force = bank.given.predicted_force
    bank.given.innovation[0] = math.nan
    bank.given.innovation[1] = math.nan
    bank.given.nis = 0.0


@compiled
def give_refused(bank: Any) -> None:
    """Note what the row in charge expected of a displacement that is refused; the force waits."""
    given = bank.given
    innovation, variance = readings.innovation_of(bank, bank.rows[given.row], 0)
    given.innovation[0] = innovation
    given.nis = innovation * innovation / variance


@compiled
def give(settings: Any, bank: Any, decision: int) -> None:
    """Note what the row in charge made of the readings that were used.

    The force is its mean given law and sensor, each weighed by what is known of its error; an error
    of the linearisation that repeats itself counts once for the force of this moment.
    """
    clock, given, row = bank.clock, bank.given, bank.rows[bank.given.row]
    if clock.present[0] != 0:
        given.innovation[0] = row.innovation[0]
        given.nis += row.nis[0]
    if clock.present[1] == 0:
        return
    # The innovation of both readings together is against the state before either.
    given.innovation[1] = clock.measurement[1] - row.predicted_force
    given.nis += row.nis[1]
    unsure = row.explained + row.model_error
    share = unsure / (unsure + bank.sensor_noise[1]) if decision == ACCEPTED else 0.0
    if given.extrapolated == 0.0:
        law = clock.measurement[1] - row.innovation[1]
        given.reconstructed_force = law + share * row.innovation[1]
    else:
        law = given.predicted_force
        given.reconstructed_force = law + share * (given.latest_force - law)
