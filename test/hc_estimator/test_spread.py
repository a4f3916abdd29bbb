"""What the hypotheses that were not chosen leave open of the parameters, against plain numpy."""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import spread
from hc_estimator.multiple_model.choice import REFUTED
from hc_estimator.multiple_model.hypotheses import (
    EXPONENT_ROW,
    FITTED,
    FRESH,
    LOG_STIFFNESS,
    TREND_ROW,
)

TISSUE = slice(LOG_STIFFNESS, LOG_STIFFNESS + 4)
CLOCK = 20.0


@pytest.fixture
def bank(parts):
    """The trend is chosen, the row in which n varies beside it, and constant tissue is refuted."""
    bank = parts[1]
    draw = np.random.default_rng(5)
    for m in range(FRESH):
        row = bank.rows[m]
        row.active = int(m in (0, TREND_ROW, EXPONENT_ROW))
        row.model_error, row.counts_from, row.since, row.recent_nis = 0.0, 0.0, 0.0, 2.0
        row.log_likelihood = 100.0
        root = 0.1 * draw.normal(size=(4, 4))
        row.covariance[TISSUE, TISSUE] = root @ root.T
        row.state[TISSUE] = draw.normal(size=4)
    bank.judge.chosen, bank.judge.varying = TREND_ROW, 0
    return bank


def mixture(bank, weights):
    """Covariance of a mixture about the chosen row, but for that row's own."""
    chosen = bank.rows[bank.judge.chosen]
    total = np.zeros((4, 4))
    for m, weight in weights.items():
        row = bank.rows[m]
        way = row.state[TISSUE] - chosen.state[TISSUE]
        total += weight * (np.outer(way, way) + row.covariance[TISSUE, TISSUE])
    return total / (1.0 + sum(weights.values()))


def found(bank, **settings):
    estimator = hc.create_estimator("self_tuning_ukf", **settings)
    spread.find(estimator._settings.view(np.recarray)[0], bank.judge, bank.rows, CLOCK)
    return np.array(bank.judge.spread)


@pytest.mark.parametrize("likelier", [-4.0, 0.0, 4.0])
def test_it_is_the_covariance_of_a_mixture(likelier, bank):
    bank.rows[EXPONENT_ROW].log_likelihood += likelier
    bank.rows[0].log_likelihood -= 7.0
    weights = {0: np.exp(-7.0), EXPONENT_ROW: np.exp(likelier - REFUTED)}
    np.testing.assert_allclose(found(bank), mixture(bank, weights), rtol=1e-12)
    assert np.linalg.eigvalsh(found(bank)).min() >= 0.0


def test_a_row_that_does_not_explain_stiffness_found_leaves_nothing_open(bank):
    bank.rows[0].active = 0
    row = bank.rows[EXPONENT_ROW]
    assert np.any(found(bank) != 0.0)
    for name, value in (("model_error", 1e-4), ("counts_from", CLOCK + 1.0), ("recent_nis", 9.0)):
        before, row[name] = row[name], value
        assert not np.any(found(bank))
        row[name] = before


def test_it_can_be_left_out(bank):
    assert not np.any(found(bank, mixture_covariance=False))


def test_where_the_chosen_row_does_not_fit_likelihoods_are_not_asked(bank):
    bank.rows[TREND_ROW].model_error = 1e-4
    assert not np.any(found(bank))


@pytest.mark.parametrize(("ago", "counts"), [(9.0, True), (11.0, False)])
def test_constant_tissue_does_not_forget_at_once_that_it_varied(ago, counts, bank):
    """Also where the law does not fit, which says nothing of what lies between two inclusions."""
    bank.judge.chosen, bank.judge.varying, bank.judge.varied_at = FITTED, TREND_ROW, CLOCK - ago
    bank.rows[FITTED].model_error = 1e-4
    way = bank.rows[TREND_ROW].state[TISSUE] - bank.rows[FITTED].state[TISSUE]
    np.testing.assert_allclose(found(bank), np.outer(way, way) if counts else 0.0, rtol=1e-12)


def test_what_is_open_is_in_the_covariance_that_is_given_out(plant):
    """Where n varies, a trend explains the force between two edges as well, at another n."""
    time = np.arange(9000) / 500.0
    d, v = plant.motion(time, ((1.2, 0.8, 0.0), (0.5, 2.5, 0.4)), 2.6)
    edges = [1.0 / (1.0 + np.exp(-(time - at) / 0.6)) for at in (4.0, 11.0)]
    stiffness, exponent = 0.3 * np.exp(0.7 * edges[0] - 0.5 * edges[1]), 1.6 + 0.2 * edges[0]
    force = plant.force(d, v, stiffness, 0.05 * stiffness, exponent, 1.0)
    estimator = hc.create_estimator("self_tuning_ukf")
    displacement, measured = plant.noisy(d, force, 1)
    opened = 0
    for k in range(0, time.size, 50):
        part = slice(k, k + 50)
        series = estimator.run(time[part], displacement[part], measured[part])
        memory = estimator._memory[0]
        row = memory["rows"][memory["judge"]["chosen"]]
        own = row["covariance"][LOG_STIFFNESS, LOG_STIFFNESS]
        said = (series.parameters_std[-1, 0] / series.parameters[-1, 0]) ** 2
        least = own + memory["judge"]["spread"][0, 0]
        assert said >= 0.999 * least
        opened += memory["judge"]["spread"][0, 0] > own
    assert opened > 5


def test_tissue_that_hardly_varies_is_known_as_well_as_ever(plant):
    time = np.arange(6000) / 500.0
    d, v = plant.motion(time)
    series = hc.create_estimator("self_tuning_ukf").run(
        time, *plant.noisy(d, plant.force(d, v, 0.3, 0.02, 1.8, 1.0), 4)
    )
    without = sum(2**m for m in range(FITTED + 1, FRESH))
    alone = hc.create_estimator("self_tuning_ukf", without_hypotheses=without).run(
        time, *plant.noisy(d, plant.force(d, v, 0.3, 0.02, 1.8, 1.0), 4)
    )
    late = time > 4.0
    ratio = series.parameters_std[late, 0] / alone.parameters_std[late, 0]
    assert np.quantile(ratio, 0.95) < 1.1
