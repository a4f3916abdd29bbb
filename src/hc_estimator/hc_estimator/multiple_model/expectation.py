"""Which force is expected of the next reading: that of the law, or the last one that was read?

A law that stands at the wrong zero, or has lost a surface that moves, foretells forces that are
worse than no law at all. What is known without one is that a force changes little from one reading
to the next: the forecast by persistence, against which forecasts are measured (Murphy, Monthly
Weather Review 120, 1992). So the last reading is what is expected where the law of the row in
charge

- says more than three times what was ever felt,
- has missed the force by more, of late, than the force has changed,
- has foretold nothing yet, because the row began anew,
- foretells a jump, and says itself that it does not know.

A force that hardly changes within a millisecond would be a better forecast than any law that
misfits a little. So the change is that over a step of slow readings, whatever the rate: a law that
errs more than that does not say how the force goes on. The parameters, and what is foretold from
them, are the law's all the same. (`hc bench accuracy possible`, arm.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import plausible
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "expect_last_force",
        "bool",
        True,
        "Expect the last force that was read while the law misses more than a force changes.",
    ),
)

STEP = 0.015  # over which the force changes, at least: of readings at 66 Hz [s]
LONGEST_STEP = 2.0  # steps, or periods, after which a reading says nothing of the next
MEMORY = 0.1  # time constant of the mean squares [s]
# Of what the force changes by in a step (RMS):
WORSE = 1.5  # what a law misses, from which on it is not believed
JUMP = 5.0  # from the last reading to what the law says, which only a sure law is believed
SURE = 0.2  # deviation of the force that a sure law claims
LARGEST = 5.0  # error or change that counts; a single one is an outlier
FAR = 10.0  # change that is no outlier only if the law says so too,
IN_A_ROW = 3  # or so many readings in a row do
AGREES = 0.5  # of a change that a law may miss that says so too
UNKNOWN = -1.0  # mean square of a row that has foretold nothing yet


@compiled
def reset(expected: Any) -> None:
    """No force was read so far."""
    expected.last_force = math.nan
    expected.held_force = math.nan
    expected.held_from = 0.0
    expected.change = UNKNOWN
    expected.far_readings = 0


@compiled
def force_of(settings: Any, bank: Any, row: Any, law: float) -> float:
    """Force [N] that is expected of a reading.

    Args:
        settings: settings record.
        bank: its records `expected` and `clock` are read.
        row: in charge.
        law: force that it expects [N].
    """
    expected, clock = bank.expected, bank.clock
    last = expected.last_force
    if settings.expect_last_force == 0 or math.isnan(last) or expected.change < 0.0:
        return law
    if clock.force_elapsed > LONGEST_STEP * max(STEP, clock.period):
        return law
    change = expected.change
    if plausible.is_beyond(settings, row, bank.tool, law, bank.sensor_noise[1]):
        return float(last)
    if row.missed < 0.0 or row.missed > WORSE * WORSE * change:
        return float(last)
    jump = (law - last) * (law - last)
    if row.explained > SURE * SURE * change and jump > JUMP * JUMP * change:
        return float(last)
    return law


@compiled
def learn(bank: Any, time: float) -> None:
    """Take what the rows missed of a force reading, and by how much the force has changed.

    Args:
        bank: rows and `expected` are changed; whether the sample was refused is not asked, for a
            law that knows nothing refuses what is right.
        time: of the reading [s].
    """
    clock, given, expected = bank.clock, bank.given, bank.expected
    if clock.present[1] == 0:
        return
    reading = clock.measurement[1]
    usual = max(expected.change, bank.sensor_noise[1])
    share = min(clock.force_elapsed / MEMORY, 1.0)
    for m in range(bank.rows.shape[0]):
        row = bank.rows[m]
        if row.active == 0:
            row.missed = UNKNOWN
            continue
        error = reading - row.predicted_force
        square = min(error * error, LARGEST * LARGEST * usual)
        row.missed = square if row.missed < 0.0 else row.missed + share * (square - row.missed)
    error = reading - bank.rows[given.row].predicted_force
    law_says = AGREES * AGREES
    latest = given.latest_force if given.extrapolated != 0.0 else reading
    step = latest - expected.last_force
    is_far = step * step > FAR * FAR * usual and error * error > law_says * step * step
    expected.far_readings = expected.far_readings + 1 if is_far else 0
    if 0 < expected.far_readings < IN_A_ROW:
        return
    expected.far_readings = 0
    expected.last_force = latest
    waited = time - expected.held_from
    begun = not math.isnan(expected.held_force) and waited > 0.0
    if begun and waited < STEP:
        return
    if begun and waited <= LONGEST_STEP * max(STEP, clock.period):
        change = reading - expected.held_force
        square = change * change
        if error * error > law_says * square and expected.change >= 0.0:
            square = min(square, LARGEST * LARGEST * usual)
        share = min(waited / MEMORY, 1.0) if expected.change >= 0.0 else 1.0
        expected.change += share * (square - expected.change)
    expected.held_force = reading
    expected.held_from = time


@compiled
def move(expected: Any, force: float) -> None:
    """The zero of the force has moved by so much [N]."""
    expected.last_force -= force
    expected.held_force -= force
