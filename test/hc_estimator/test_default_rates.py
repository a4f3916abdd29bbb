"""Rates of ln K and n in the default filter: how they end in the air, and when they are let go."""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import kalman
from hc_estimator.multiple_model.hypotheses import (
    BIASED,
    COUNTS,
    DRIVES,
    LOG_STIFFNESS,
    OWN,
    OWN_WALKS,
    ROWS,
    SURFACE,
)
from hc_estimator.multiple_model.rows import TURNED_RATE, free_rate
from hc_evaluation.accuracy.scan import KINDS, random_scan
from hc_evaluation.accuracy.scenarios import simulate

WITH_RATES = [m for m in range(len(ROWS)) if COUNTS[m] > OWN and not (SURFACE[m] or BIASED[m])]
KNOWN = 1e-12


@pytest.fixture
def bank():
    """The bank of a fresh default filter, whose fields are attributes."""
    return hc.create_estimator("self_tuning_ukf")._memory.view(np.recarray)[0]


@pytest.mark.parametrize("m", WITH_RATES)
def test_in_the_air_a_rate_comes_to_rest(m, bank):
    """Regressions: in the air an exponent went on drifting for a second, and K grew fourfold."""
    row = bank.rows[m]
    row.covariance[:] = 0.0
    row.state[:] = 0.0
    row.state[OWN : COUNTS[m]] = 0.5
    for i in range(OWN, COUNTS[m]):
        row.covariance[i, i] = 1.0
    driven = [LOG_STIFFNESS + k for k in range(3) if np.any(DRIVES[m, :, k])]  # ln K, ln B, n
    row.covariance[driven, driven] = KNOWN  # what is held fixed has none
    for _ in range(1000):
        kalman.predict(row, 0.001, 0.0, True, True)
    left = 0.5 * np.exp(-1.0 / kalman.RATE_MEMORY)
    np.testing.assert_allclose(row.state[OWN : COUNTS[m]], left, rtol=1e-9)
    assert np.all(row.state[driven] == 0.0)  # what is not felt goes on nowhere, as far as is known
    assert np.all(np.diag(row.covariance)[driven] > 1e6 * KNOWN)  # but it may have
    for i in range(OWN, COUNTS[m]):  # its walk goes on: that of an Ornstein-Uhlenbeck process
        left = np.exp(-2.0 / kalman.RATE_MEMORY)
        settled = left + 0.5 * OWN_WALKS[m, i - OWN] * kalman.RATE_MEMORY * (1.0 - left)
        assert row.covariance[i, i] == pytest.approx(settled, rel=0.02)


@pytest.mark.parametrize("m", range(len(ROWS)))
def test_felt_tissue_keeps_its_rate_and_only_rates_are_let_go(m, bank):
    row = bank.rows[m]
    row.covariance[:] = 0.0
    row.state[:] = 0.0
    row.state[OWN] = 0.5 if COUNTS[m] > OWN else 0.0
    before = row.state[OWN]
    kalman.predict(row, 0.001, 0.0, True, False)
    assert row.state[OWN] == (before if m in WITH_RATES else row.state[OWN])
    free_rate(row)
    if m in WITH_RATES:
        assert row.covariance[OWN, OWN] == TURNED_RATE**2
    else:
        assert row.covariance[OWN, OWN] < TURNED_RATE**2


def test_a_stiffness_that_turns_sharply_at_a_low_rate_is_found_again():
    """Regression: 200 readings a second, two inclusions close together; K was off by a half."""
    kind = next(kind for kind in KINDS if kind.name == "200hz")
    contact = simulate(random_scan(kind, 100002), 100002)
    series = hc.create_estimator("self_tuning_ukf").run(
        contact.time_s, contact.displacement_mm, contact.force_n
    )
    late = contact.time_s > 1.5
    error = np.abs(np.log(series.parameters[late, 0] / contact.parameters[late, 0]))
    assert np.median(error) < 0.01
    assert np.quantile(error, 0.95) < 0.15
    assert np.nanmean(series.nis[late]) < 5.0
