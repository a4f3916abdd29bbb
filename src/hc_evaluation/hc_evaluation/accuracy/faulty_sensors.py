"""Sensors that nobody watches: readings that are lost or uneven, zeros that are moved or move.

Contacts of `drawn_contact` in which the tool begins in the air and comes back to it about every
eight seconds, read by ordinary sensors (100 Hz to 1 kHz, 0.5 to 20 um, 1 to 50 mN). A fault changes
the readings and never the tissue: whatever is called a change or a misfit then is none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hc_evaluation.accuracy.drawn_contact import Acquisition, Draw, DrawnContact, drawn_contact
from hc_evaluation.accuracy.scenarios import log_uniform

FloatArray = NDArray[np.float64]
Mask = NDArray[np.bool_]

ACQUISITION = Acquisition(
    duration_s=60.0,
    rates_hz=(100.0, 125.0, 200.0, 250.0, 500.0, 1000.0),
    displacement_noise_mm=(0.0005, 0.02),
    force_noise_n=(0.001, 0.05),
    visits=True,
)
SHAKEN = replace(ACQUISITION, shaken=0.3)
LEARNING_S = 8.0  # of contact, before which nothing is asked and no zero is moved
LAST_S = 10.0  # of the contact, in which no zero is moved
BURST_S = (0.05, 0.3)
BURSTS_SHARE = 0.1  # of the time, in the mean
NOTHING = "nothing"
SHAKES = "stamps that shake by 30 %"


@dataclass(frozen=True)
class FaultyReadings:
    """Readings of faulty sensors.

    Attributes:
        contact: the readings beside the truth; NaN where one is lost and the other is not.
        moved_s: when a zero moved in a way that nothing announces; None: none did.
    """

    contact: DrawnContact
    moved_s: float | None = None


Fault = Callable[[Draw, DrawnContact], FaultyReadings]


def first_touch_s(contact: DrawnContact) -> float:
    """When the tool touches the tissue for the first time [s].

    Raises:
        ValueError: it never does.
    """
    touching = contact.acting_n > 0.0
    if not np.any(touching):
        raise ValueError("the tool never touches the tissue")
    return float(contact.time_s[np.argmax(touching)])


def _sign(draw: Draw) -> float:
    return float(draw.choice([-1.0, 1.0]))


def _with_readings(contact: DrawnContact, place: Mask, force: Mask) -> FaultyReadings:
    """The readings that came; a row without either did not come."""
    came = place | force
    return FaultyReadings(
        replace(
            contact,
            time_s=contact.time_s[came],
            displacement_mm=np.where(place, contact.displacement_mm, np.nan)[came],
            force_n=np.where(force, contact.force_n, np.nan)[came],
            parameters=contact.parameters[came],
            acting_n=contact.acting_n[came],
        )
    )


def _lost(share: float) -> Fault:
    """Either channel loses a share of its readings, each of them on its own."""

    def fault(draw: Draw, contact: DrawnContact) -> FaultyReadings:
        place, force = draw.random((2, contact.time_s.size)) >= share
        return _with_readings(contact, place, force)

    return fault


def _every_fourth_lost(draw: Draw, contact: DrawnContact) -> FaultyReadings:
    number = np.arange(contact.time_s.size)
    place, force = draw.choice(4, 2, replace=False)
    return _with_readings(contact, number % 4 != place, number % 4 != force)


def _bursts_lost(draw: Draw, contact: DrawnContact) -> FaultyReadings:
    came = np.ones(contact.time_s.size, np.bool_)
    between_s = 0.5 * sum(BURST_S) * (1.0 / BURSTS_SHARE - 1.0)
    ends = 0.0
    while ends < contact.time_s[-1]:
        begins = ends + float(draw.exponential(between_s))
        ends = begins + float(draw.uniform(*BURST_S))
        came &= (contact.time_s < begins) | (contact.time_s >= ends)
    return _with_readings(contact, came, came)


def _with_zero(
    contact: DrawnContact, zero_n: FloatArray | float, moved_s: float | None = None
) -> FaultyReadings:
    return FaultyReadings(replace(contact, force_n=contact.force_n + zero_n), moved_s)


def _later_visits(contact: DrawnContact) -> FloatArray:
    """Visits to the air in which a zero may be moved, shape (visits, 2)."""
    begins = contact.visits_s[:, 0]
    late = begins >= first_touch_s(contact) + LEARNING_S
    visits: FloatArray = contact.visits_s[late & (begins <= contact.time_s[-1] - LAST_S)]
    return visits


def _tared_once_in_air(draw: Draw, contact: DrawnContact) -> FaultyReadings:
    moment = draw.uniform(*draw.choice(_later_visits(contact)))
    zero = _sign(draw) * log_uniform(draw, 0.05, 0.5)
    return _with_zero(contact, np.where(contact.time_s >= moment, zero, 0.0))


def _tared_at_every_visit(draw: Draw, contact: DrawnContact) -> FaultyReadings:
    zero = np.zeros(contact.time_s.size)
    for visit in contact.visits_s[1:]:
        now = _sign(draw) * log_uniform(draw, 0.03, 0.3)
        zero[contact.time_s >= draw.uniform(*visit)] = now
    return _with_zero(contact, zero)


def _any_moment(draw: Draw, contact: DrawnContact, where: Mask) -> int:
    """Index of a sample at which a zero may be moved."""
    time = contact.time_s
    late = (time >= first_touch_s(contact) + LEARNING_S) & (time <= time[-1] - LAST_S)
    return int(draw.choice(np.flatnonzero(late & where)))


def _tared_in_tissue(draw: Draw, contact: DrawnContact) -> FaultyReadings:
    """What presses at that moment is the new zero."""
    moment = _any_moment(draw, contact, contact.acting_n > 0.0)
    zero = np.where(np.arange(contact.time_s.size) >= moment, -contact.acting_n[moment], 0.0)
    return _with_zero(contact, zero, float(contact.time_s[moment]))


def _encoder_zeroed(draw: Draw, contact: DrawnContact) -> FaultyReadings:
    moment = _any_moment(draw, contact, np.ones(contact.time_s.size, np.bool_))
    step_mm = _sign(draw) * log_uniform(draw, 0.1, 1.0)
    place = contact.displacement_mm.copy()
    place[moment:] += step_mm
    return FaultyReadings(replace(contact, displacement_mm=place), float(contact.time_s[moment]))


def _warms_up(draw: Draw, contact: DrawnContact) -> FaultyReadings:
    zero = _sign(draw) * log_uniform(draw, 0.01, 0.1)
    return _with_zero(contact, -zero * np.expm1(-contact.time_s / log_uniform(draw, 30.0, 120.0)))


def _drifts(draw: Draw, contact: DrawnContact) -> FaultyReadings:
    return _with_zero(contact, _sign(draw) * log_uniform(draw, 2e-4, 5e-3) * contact.time_s)


def _untared_by_noise(draw: Draw, contact: DrawnContact) -> FaultyReadings:
    return _with_zero(contact, _sign(draw) * draw.uniform(2.0, 10.0) * contact.force_noise_n)


def _untared(draw: Draw, contact: DrawnContact) -> FaultyReadings:
    return _with_zero(contact, _sign(draw) * log_uniform(draw, 0.05, 0.5))


def _none(draw: Draw, contact: DrawnContact) -> FaultyReadings:
    del draw
    return FaultyReadings(contact)


LOST: dict[str, Fault] = {
    "10 % lost": _lost(0.1),
    "25 % lost": _lost(0.25),
    "50 % lost": _lost(0.5),
    "every fourth lost": _every_fourth_lost,
}
"""By name: which readings of either channel come."""
UNEVEN: dict[str, Fault] = {"bursts lost": _bursts_lost, SHAKES: _none}
"""By name: what leaves both channels with stamps that are not even."""
ZEROS: dict[str, Fault] = {
    "tared in the air, once": _tared_once_in_air,
    "tared in the air, at every visit": _tared_at_every_visit,
    "tared in the tissue": _tared_in_tissue,
    "encoder zeroed": _encoder_zeroed,
    "warms up": _warms_up,
    "drifts": _drifts,
    "untared, 2 to 10 deviations": _untared_by_noise,
    "untared, 0.05 to 0.5 N": _untared,
}
"""By name: what a zero does."""


def faulty_readings(name: str, seed: int) -> FaultyReadings:
    """The contact that a seed draws, as faulty sensors read it.

    Args:
        name: `NOTHING`, or of `LOST`, `UNEVEN` or `ZEROS`.
        seed: of everything; tissue, motion and noise are the same for all names.

    Raises:
        KeyError: no such fault.
    """
    faults = {NOTHING: _none, **LOST, **UNEVEN, **ZEROS}
    fault = faults[name]
    contact = drawn_contact((), seed, acquisition=SHAKEN if name == SHAKES else ACQUISITION)
    return fault(np.random.default_rng([seed, 783, list(faults).index(name)]), contact)
