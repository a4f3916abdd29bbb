"""Rows that refine another hypothesis: a damping that goes its own way, an exponent at an edge.

Regression of 2026-11-27: where the damping did not follow the stiffness K was 2 % off at 95 % of
the samples and within three deviations in 94 % of them (`hc bench accuracy scan`, own_damping).
"""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model.hypotheses import PLAIN, REFINES, ROWS
from hc_evaluation.accuracy.scan import KINDS, START_S, random_scan
from hc_evaluation.accuracy.scenarios import simulate

REFINING = [m for m in range(len(ROWS)) if REFINES[m]]
ALL_REFINING = sum(2**m for m in REFINING)


def scan(name, seed):
    """Readings and truth of a drawn scan."""
    kind = next(kind for kind in KINDS if kind.name == name)
    return simulate(random_scan(kind, seed), seed)


def followed(contact, **settings):
    """Errors of ln K from START_S on, and the estimator afterwards."""
    estimator = hc.create_estimator("self_tuning_ukf", **settings)
    series = estimator.run(contact.time_s, contact.displacement_mm, contact.force_n)
    late = contact.time_s > START_S
    error = np.abs(np.log(series.parameters[late, 0] / contact.parameters[late, 0]))
    return error, estimator


@pytest.mark.parametrize(
    ("name", "share"),
    [pytest.param("own_damping", 0.8, marks=pytest.mark.slow), ("layers", 0.95)],
)
def test_tissue_that_varies_in_more_than_its_stiffness_is_followed_more_closely(name, share):
    contacts = [scan(name, seed) for seed in range(1002, 1006)]
    found = np.concatenate([followed(contact)[0] for contact in contacts])
    without = np.concatenate(
        [followed(contact, without_hypotheses=ALL_REFINING)[0] for contact in contacts]
    )
    assert np.median(found) < share * np.median(without)
    assert np.quantile(found, 0.95) < np.quantile(without, 0.95)


def test_constant_tissue_calls_none_of_them():
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 6.0, 0.002)
    depth = 2.0 + np.sin(5.0 * time) + 0.4 * np.sin(13.0 * time)
    speed = 5.0 * np.cos(5.0 * time) + 5.2 * np.cos(13.0 * time)
    force = 0.4 * depth**1.6 * (1.0 + 0.02 * speed)
    estimator = hc.create_estimator("self_tuning_ukf")
    estimator.run(
        time,
        depth + 0.003 * rng.standard_normal(time.size),
        force + 0.01 * rng.standard_normal(time.size),
    )
    rows = estimator.state()["memory"]["rows"]
    assert [rows[m]["active"] for m in REFINING] == [0] * len(REFINING)


@pytest.mark.parametrize("m", REFINING)
def test_what_refines_a_row_that_is_not_tried_is_not_tried_either(m):
    contact = scan("own_damping", 1001)
    _error, estimator = followed(contact, without_hypotheses=2 ** int(PLAIN[m]))
    rows = estimator.state()["memory"]["rows"]
    assert rows[m]["active"] == 0
    others = [i for i in REFINING if PLAIN[i] != PLAIN[m]]
    assert all(rows[i]["active"] == 1 for i in others)
