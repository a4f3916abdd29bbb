"""What is known of the place that a tool was at, before it comes down again (`another_place`).

What the row in charge knew as the tool left. Beneath a tool that moves along tissue that varies it
may be another tissue by then without being another place; how much of one is what the row that
follows it says at the end of the air.
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix
from hc_estimator.multiple_model import spread
from hc_estimator.multiple_model.hypotheses import FITTED, LOG_STIFFNESS, SURFACE, VARIES
from hc_estimator.multiple_model.place_fit import POSITION
from hc_estimator.multiple_model.place_prior import OUT_TIME

UNKNOWN_DEVIATIONS = (3.0, 3.0, 1.0, 0.3)  # of ln K, ln B, n and p where nothing is known of them


@compiled
def _in_charge(bank: Any) -> int:
    """Row that says what the tissue may be at the next contact.

    Where constant tissue explains what lies between two inclusions that is not the row in charge.
    """
    judge, clock = bank.judge, bank.tool.contact_clock
    follows = judge.varying
    if judge.chosen > FITTED or not VARIES[follows] or not spread.varies(judge, clock):
        return judge.chosen  # type: ignore[no-any-return]
    row = bank.rows[follows]
    fits = row.active != 0 and row.model_error == 0.0
    return follows if fits else judge.chosen  # type: ignore[no-any-return]


@compiled
def _take_known(place: Any, row: Any) -> None:
    """Take what a row knows of K, B, n and p as what is known before the next contact."""
    for i in range(4):
        place.before[i] = row.state[LOG_STIFFNESS + i]
        for j in range(4):
            element = row.covariance[LOG_STIFFNESS + i, LOG_STIFFNESS + j]
            place.before_covariance[i, j] = element


@compiled
def note(settings: Any, bank: Any) -> None:
    """What is known of the place that the tool was at.

    Where the law did not fit most contacts that is nothing, for the first points of a contact are
    fitted by any law: of a whole contact it is asked then whether another height explains it.
    """
    place, row = bank.place, bank.rows[_in_charge(bank)]
    place.unknown = 1 if place.ended > 0 and 2 * place.fitting <= place.ended else 0
    place.known = 1 if not SURFACE[row.index] and bank.change.testing == 0 else 0
    place.row = row.index
    place.joint = 0
    clear_matrix(place.before_covariance)
    _take_known(place, row)
    place.square_rate = 0.0
    if VARIES[row.index] and spread.varies(bank.judge, bank.tool.contact_clock):
        place.square_rate = bank.judge.square_rate
    for i in range(4 if place.unknown != 0 else 0):
        place.before_covariance[i, i] += UNKNOWN_DEVIATIONS[i] ** 2
    place.before[POSITION] = 0.0
    deviation = max(bank.onset.position_deviation, settings.contact_position_std)
    place.before_covariance[POSITION, POSITION] = deviation * deviation


@compiled
def let_vary(bank: Any) -> None:
    """Tissue that varies may be another one by the time that the tool comes down again.

    How much it may have varied in the air is what the row that follows it says.
    """
    place, row = bank.place, bank.rows[bank.place.row]
    in_air = place.away > OUT_TIME and bank.tool.away_time > 0.0
    known = place.known != 0 and place.unknown == 0
    if in_air and known and row.active != 0 and place.square_rate > 0.0:
        _take_known(place, row)
