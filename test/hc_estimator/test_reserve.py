"""Two things at once: a lump on a surface that sinks, and rows that wait until they are needed."""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import choice, reserve
from hc_estimator.multiple_model.hypotheses import (
    EXPONENT,
    EXPONENT_ROW,
    FITTED,
    FRESH,
    LOG_DAMPING,
    OWN,
    PLAIN,
    REFINES,
    RESERVE,
    STEADY_SURFACE_ROW,
    SURFACE,
    TREND_ROW,
)

IN_RESERVE = [m for m in range(FRESH) if RESERVE[m]]
RATE = 250.0


def contact(plant, lump, sinks):
    """Tissue with a lump along the way, on a surface that sinks; readings and the true K."""
    time = np.arange(round(20.0 * RATE)) / RATE
    d, v = plant.motion(time, ((1.0, 1.3, 0.0), (0.4, 3.6, 1.0)), 3.5)
    stiffness = 0.5 * (1.0 + lump * np.exp(-0.5 * ((time - 12.0) / 2.5) ** 2))
    depth, speed = d - sinks * time, v - sinks
    force = plant.force(depth, speed, stiffness, 0.02 * stiffness, 1.5, 1.0)
    return time, plant.noisy(d, force, 3, 0.002, 0.004), stiffness


def median_error(found, stiffness, time):
    late = time > 10.0
    return np.median(np.abs(found.parameters[late, 0] / stiffness[late] - 1.0))


def test_a_lump_on_a_sinking_surface_is_found(plant):
    time, readings, stiffness = contact(plant, 1.2, 0.05)
    found = hc.create_estimator("self_tuning_ukf").run(time, *readings)
    assert median_error(found, stiffness, time) < 0.03
    alone = sum(2**m for m in IN_RESERVE)
    without = hc.create_estimator("self_tuning_ukf", without_hypotheses=alone)
    assert median_error(without.run(time, *readings), stiffness, time) > 0.08


def test_constant_tissue_does_without(plant, records_of):
    time, readings, stiffness = contact(plant, 0.0, 0.0)
    estimator = hc.create_estimator("self_tuning_ukf")
    found = estimator.run(time, *readings)
    assert median_error(found, stiffness, time) < 0.003
    bank = records_of(estimator)[1]
    assert not any(bank.rows[m].active for m in IN_RESERVE)


def review(settings, bank, clock, times):
    """Review so many snapshots that are 5 ms apart, at a contact clock [s]."""
    bank.tool.contact_clock, bank.judge.waited = clock, 0.005
    for _ in range(times):
        reserve.review(settings, bank)


def test_the_reserve_is_called_and_sent_away(parts):
    settings, bank = parts
    judge, rows = bank.judge, bank.rows
    judge.chosen = TREND_ROW
    rows[TREND_ROW].state[EXPONENT] = 1.9
    rows[EXPONENT_ROW].state[EXPONENT] = 1.7
    review(settings, bank, 5.0, 59)
    assert not any(rows[m].active for m in IN_RESERVE)
    review(settings, bank, 5.0, 2)
    for m in IN_RESERVE:
        assert rows[m].active == 1
        source, variances = rows[PLAIN[m] if REFINES[m] else TREND_ROW], rows[m].covariance
        assert rows[m].state[EXPONENT] == source.state[EXPONENT]
        if REFINES[m]:  # begins from the row that it refines, and lets ln B go
            known = source.covariance
            assert variances[EXPONENT, EXPONENT] == known[EXPONENT, EXPONENT]
            more = known[LOG_DAMPING, LOG_DAMPING] + reserve.DAMPING_DEVIATION**2
            assert variances[LOG_DAMPING, LOG_DAMPING] == pytest.approx(more)
        else:
            assert variances[EXPONENT, EXPONENT] == pytest.approx(0.09)  # let go
        assert rows[m].covariance[OWN, OWN] > 0.0
        assert not choice.counts(rows[m], 5.0 + 0.9 * choice.WAIT)
        assert choice.counts(rows[m], 5.0 + 1.1 * choice.WAIT)
        assert choice.stands_by(judge, m)
    judge.chosen = FITTED
    review(settings, bank, 20.0, 1999)
    assert all(rows[m].active for m in IN_RESERVE)
    review(settings, bank, 20.0, 3)
    assert not any(rows[m].active for m in IN_RESERVE)


def test_it_begins_where_a_surface_was_found(parts):
    settings, bank = parts
    judge, rows = bank.judge, bank.rows
    judge.chosen = next(m for m in range(FRESH) if SURFACE[m])
    rows[judge.chosen].state[OWN] = -0.7
    review(settings, bank, 5.0, 61)
    assert all(rows[m].state[OWN] == -0.7 for m in IN_RESERVE if SURFACE[m])


@pytest.mark.parametrize("off", [STEADY_SURFACE_ROW, TREND_ROW, EXPONENT_ROW])
def test_only_what_refines_a_hypothesis_is_off_with_it(off, records_of):
    """Regression: without the surface at a steady speed no lump on one was tried either."""
    settings, bank = records_of(hc.create_estimator("self_tuning_ukf", without_hypotheses=2**off))
    bank.judge.chosen = FITTED
    bank.rows[FITTED].model_error = 1e-4
    review(settings, bank, 5.0, 200)
    called = [m for m in IN_RESERVE if bank.rows[m].active == 1]
    assert called == [m for m in IN_RESERVE if not REFINES[m] or PLAIN[m] != off]


def test_a_hypothesis_that_is_off_is_not_called(records_of):
    off = sum(2**m for m in IN_RESERVE)
    settings, bank = records_of(hc.create_estimator("self_tuning_ukf", without_hypotheses=off))
    bank.judge.chosen = 2
    review(settings, bank, 5.0, 200)
    assert not any(bank.rows[m].active for m in IN_RESERVE)
