"""States as bytes: what comes out is what `state()` says, or a ValueError."""

import json

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.contact.arrays import hunt_crossley_force
from hc_estimator.packed_state import freeze, unpacked

FILTERS = ["ukf", "rls", "sir_pf", "rbpf", "self_tuning_ukf"]


TIME = np.arange(90) * 1e-3
DEPTH = 2.0 + np.sin(20.0 * TIME)
FORCE = hunt_crossley_force(DEPTH, 20.0 * np.cos(20.0 * TIME), np.array([0.2, 0.008, 1.8, 1.0]))


def contact(filter_name):
    """An estimator that has seen 60 samples."""
    estimator = hc.create_estimator(filter_name)
    estimator.run(TIME[:60], DEPTH[:60], FORCE[:60])
    return estimator


@pytest.mark.parametrize("filter_name", FILTERS)
def test_what_is_unpacked_is_the_state_to_the_last_bit(filter_name):
    estimator = contact(filter_name)
    expected = json.dumps(estimator.state())
    frozen = freeze(estimator)
    # What goes on meanwhile does not change what was frozen.
    estimator.run(TIME[60:], DEPTH[60:], FORCE[60:])
    assert json.dumps(estimator.state()) != expected
    plain = unpacked(json.loads(json.dumps(frozen.packed())))
    assert json.dumps(plain, sort_keys=True) == json.dumps(json.loads(expected), sort_keys=True)
    other = hc.create_estimator(filter_name)
    other.restore(plain)
    assert json.dumps(other.state()) == expected


def test_a_state_that_is_not_packed_stays_as_it_is():
    state = contact("ukf").state()
    assert unpacked(state) == state


@pytest.mark.parametrize(
    ("part", "name", "value", "message"),
    [
        ("memory", "packed", "no base64!", "damaged"),
        ("memory", "packed", "AAAA", "cannot unpack"),
        ("memory", "packed", "", "holds 0 memories"),
        ("memory", "packed", 5, "cannot unpack"),
        ("memory", "layout", "0123456789abcdef", "laid out otherwise"),
        ("particles", "shape", [3, 3], "cannot unpack"),
        ("particles", "packed", "AA==", "cannot unpack"),
    ],
)
def test_a_damaged_one_is_refused(part, name, value, message):
    packed = freeze(contact("sir_pf")).packed()
    packed[part][name] = value
    with pytest.raises(ValueError, match=message):
        unpacked(packed)


def test_one_of_another_filter_is_refused():
    packed = freeze(contact("ukf")).packed()
    for other in ("self_tuning_ukf", "nobody", ["ukf"]):
        with pytest.raises(ValueError, match="cannot unpack"):
            unpacked({**packed, "filter": other})


def test_numbers_that_make_no_sense_are_seen_when_the_state_is_taken():
    estimator = contact("ukf")
    frozen = freeze(estimator)
    frozen.memory["covariance"][0, 0, 0] = -1.0
    before = json.dumps(estimator.state())
    with pytest.raises(ValueError, match="covariance"):
        estimator.restore(unpacked(frozen.packed()))
    assert json.dumps(estimator.state()) == before
    assert np.isfinite(estimator._memory["covariance"]).all()
