"""A kind that left far more than noise is not asked each second, while another explains all."""

import math

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import asked_kinds, moving_kinds
from hc_estimator.multiple_model.moving_kinds import ORDER, RELAXING
from hc_estimator.multiple_model.spline_records import MOVES, STAYS
from hc_evaluation.accuracy.scenarios import simulate
from hc_evaluation.accuracy.together import contact_of

MOVING = int(np.flatnonzero(ORDER == MOVES)[0])


@pytest.fixture
def asked(parts):
    """What the kinds of a search have left; nothing yet."""
    record = parts[1].moving.asked
    asked_kinds.begin(record, 3)
    return record


def test_a_kind_that_is_far_off_is_asked_again_after_some_seconds(asked):
    assert not asked_kinds.is_ruled_out(asked, 4, 1.0)
    asked_kinds.note(asked, 4, 50.0, 1.0)
    asked_kinds.note(asked, 5, 1.1, 1.0)
    asked_kinds.note(asked, 6, math.nan, 1.0)  # broke down
    asked_kinds.begin(asked, 3)
    assert [asked_kinds.is_ruled_out(asked, k, 2.0) for k in (4, 5, 6)] == [True, False, True]
    assert not asked_kinds.is_ruled_out(asked, 4, 1.0 + asked_kinds.ASKED_EVERY)


@pytest.mark.parametrize("new", ["tissue", "place"])
def test_of_another_tissue_nothing_was_asked(asked, new):
    asked_kinds.note(asked, 4, 50.0, 1.0)
    if new == "place":  # the rows begin anew with the same history
        asked_kinds.forget(asked)
        asked_kinds.begin(asked, 3)
    else:
        asked_kinds.begin(asked, 4)
    assert not asked_kinds.is_ruled_out(asked, 4, 2.0)


def test_where_nothing_explains_the_points_all_are_asked(parts):
    bank = parts[1]
    moving_kinds.begin(bank)
    for k in range(ORDER.size):
        asked_kinds.note(bank.moving.asked, k, 50.0, bank.tool.contact_clock)
    bank.moving.found = -1
    assert all(moving_kinds.is_asked(bank, k) for k in range(ORDER.size))
    bank.moving.found = MOVING
    # Tissue that relaxes explains no noise, and is believed beside tissue that stays.
    assert [k for k in range(ORDER.size) if moving_kinds.is_asked(bank, k)] == [0, RELAXING]


def test_in_an_organ_that_breathes_most_seconds_ask_few(records_of):
    """Two thirds of all steps went to kinds that a second ago left hundreds of times the noise."""
    contact = simulate(contact_of("breathing, lumps", 100003), 100003)
    estimator = hc.create_estimator("self_tuning_ukf")
    _, bank = records_of(estimator)
    asked_at, before = [[] for _ in ORDER], np.full(ORDER.size, -np.inf)
    for row in np.stack((contact.time_s, contact.displacement_mm, contact.force_n), 1):
        estimator.step(*row.tolist())
        now = np.array(bank.moving.asked.at)
        for k in np.flatnonzero(now != before):
            if np.isfinite(now[k]):
                asked_at[k].append(float(now[k]))
        before = now
    assert ORDER[0] == STAYS
    searches = len(asked_at[0])
    assert searches >= 4
    # As long as nothing was found all of them are, once a second.
    assert len(asked_at[MOVING]) < 0.6 * searches
    assert min(np.diff(asked_at[MOVING])[-3:]) >= asked_kinds.ASKED_EVERY
    assert len(asked_at[-1]) == searches  # what explains the points
