"""The interface of the estimators: every filter on every state space behaves alike."""

import json
import math

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator import Rejection, screening

COMBINATIONS = [(f, s) for f in hc.available_filters() for s in hc.available_state_spaces(f)]


@pytest.fixture(params=COMBINATIONS, ids=lambda c: "-".join(c))
def estimator(request):
    filter_name, state_space = request.param
    return hc.create_estimator(filter_name, state_space=state_space)


def rows(series):
    return series._rows


def test_step_and_run_give_the_same_bits(estimator, recording):
    time, d, force = recording(0.5)
    d[100], force[200], time[300] = np.nan, 1e9, time[299]
    series = estimator.run(time, d, force)
    estimator.reset()
    steps = [estimator.step(*sample) for sample in zip(time, d, force, strict=True)]
    assert rows(series).tobytes() == np.array([rows(s) for s in steps]).tobytes()
    assert len(series) == time.size
    assert steps[100].rejected is Rejection.NOT_FINITE
    assert steps[200].rejected is Rejection.OUT_OF_RANGE
    assert steps[300].rejected is Rejection.TIME_REPEATED
    assert series.covariance.shape == (time.size, 4, 4)
    assert series.parameters_std.shape == (time.size, 4)


def test_estimate_and_series_have_the_same_names(estimator, recording):
    series = estimator.run(*recording(0.05))
    one = series[-1]
    names = {n for n in dir(type(one)) if not n.startswith("_")}
    of_series = {n for n in dir(type(series)) if not n.startswith("_")}
    assert of_series - {"columns", "to_dataframe"} == names
    for name in names:
        np.testing.assert_array_equal(getattr(series, name)[-1], getattr(one, name))


def test_state_survives_json_and_continues_to_the_bit(estimator, recording):
    time, d, force = recording(0.4)
    whole = estimator.run(time, d, force)
    estimator.reset()
    estimator.run(time[:150], d[:150], force[:150])
    saved = json.loads(json.dumps(estimator.state()))
    fresh = hc.create_estimator(estimator.filter, state_space=estimator.state_space)
    fresh.run(time[:7], d[:7] + 1.0, force[:7])  # whatever it knew before is gone
    fresh.restore(saved)
    rest = fresh.run(time[150:], d[150:], force[150:])
    assert rows(whole)[150:].tobytes() == rows(rest).tobytes()


def test_damaged_state_is_refused_and_changes_nothing(estimator, recording):
    time, d, force = recording(0.1)
    estimator.run(time, d, force)
    before = json.dumps(estimator.state())
    broken = json.loads(before)
    del broken["memory"][next(reversed(broken["memory"]))]
    with pytest.raises(ValueError, match="damaged"):
        estimator.restore(broken)
    with pytest.raises(ValueError, match="filter = 'other'"):
        estimator.restore(json.loads(before) | {"filter": "other"})
    assert json.dumps(estimator.state()) == before


def test_reconfigure_is_atomic(estimator):
    before = json.dumps(estimator.state())
    with pytest.raises(ValueError, match=r"force_limit = -1.*0\.001 to 1e\+06 N"):
        estimator.reconfigure(displacement_limit=5.0, force_limit=-1)
    with pytest.raises(ValueError, match="no_such = 1"):
        estimator.reconfigure(displacement_limit=5.0, no_such=1)
    with pytest.raises(ValueError, match=r"initial_stiffness = 2\.0 cannot change"):
        estimator.reconfigure(displacement_limit=5.0, initial_stiffness=2.0)
    assert json.dumps(estimator.state()) == before
    estimator.reconfigure(displacement_limit=5.0)
    assert estimator.configuration["displacement_limit"] == 5.0
    assert estimator.step(0.0, 6.0, 0.0).rejected is Rejection.OUT_OF_RANGE


def test_configuration_makes_an_equal_estimator(estimator, recording):
    time, d, force = recording(0.1)
    estimator.reconfigure(force_limit=500.0)
    twin = hc.create_estimator(
        estimator.filter,
        state_space=estimator.state_space,
        contact_model=estimator.contact_model,
        **estimator.configuration,
    )
    assert twin.configuration == estimator.configuration
    first, second = estimator.run(time, d, force), twin.run(time, d, force)
    assert rows(first).tobytes() == rows(second).tobytes()


def test_rejections_keep_the_estimate(estimator, recording):
    time, d, force = recording(0.3)
    estimator.run(time, d, force)
    last = estimator.step(0.3, float(d[-1]), float(force[-1]))
    hostile = [
        ((math.nan, 1.0, 1.0), Rejection.NOT_FINITE),
        ((0.301, math.inf, 1.0), Rejection.NOT_FINITE),
        ((0.301, 1.0, -math.inf), Rejection.NOT_FINITE),
        ((0.3, 1.0, 1.0), Rejection.TIME_REPEATED),
        ((0.2, 1.0, 1.0), Rejection.TIME_BACKWARD),
        ((0.301, 1e9, 1.0), Rejection.OUT_OF_RANGE),
        ((0.301, -1e9, 1e9), Rejection.OUT_OF_RANGE),
    ]
    for sample, reason in hostile:
        estimate = estimator.step(*sample)
        assert estimate.rejected is reason
        np.testing.assert_array_equal(estimate.parameters, last.parameters)
        np.testing.assert_array_equal(estimate.covariance, last.covariance)
        assert math.isnan(estimate.nis)
        assert not estimate.change_detected
    assert estimator.step(0.301, float(d[-1]), float(force[-1])).rejected is Rejection.ACCEPTED


@pytest.mark.parametrize("value", ["much", math.nan, math.inf, True, None, [1.0]])
def test_values_of_the_wrong_kind_are_refused(value):
    with pytest.raises(ValueError, match=r"parameter force_limit = .* 0\.001 to 1e\+06 N"):
        hc.create_estimator("ukf", force_limit=value)


@pytest.mark.parametrize("kind", ["state_space", "contact_model"])
def test_unknown_names_are_refused_with_the_known_ones(kind):
    with pytest.raises(ValueError, match=f"{kind} = 'other' is not one of"):
        hc.create_estimator("ukf", **{kind: "other"})
    with pytest.raises(ValueError, match="filter = 3 is not one of self_tuning_ukf, ukf"):
        hc.create_estimator(3)


def test_run_refuses_arrays_that_do_not_fit():
    estimator = hc.create_estimator("ukf")
    with pytest.raises(ValueError, match="one-dimensional"):
        estimator.run([0.0, 0.1], [1.0], [1.0])
    assert len(estimator.run([], [], [])) == 0


@pytest.mark.parametrize(("filter_name", "state_space"), COMBINATIONS)
def test_specifications_are_complete(filter_name, state_space):
    names = set()
    for s in hc.parameter_specifications(filter_name, state_space):
        assert s.name not in names
        names.add(s.name)
        assert s.checked(s.default) == s.default
        assert s.description.endswith(".")
        assert s.description[0].isupper()
        if s.kind in ("int", "float"):
            assert s.minimum is not None
            assert s.maximum is not None
            for outside in (s.minimum - abs(s.minimum) - 1, s.maximum * 2 + 1):
                with pytest.raises(ValueError, match=s.name):
                    s.checked(outside)
        if s.kind == "str":
            assert s.default in s.choices


def test_rejection_codes_are_those_of_the_message():
    message = pytest.importorskip("hc_msgs.msg").HuntCrossleyEstimate
    for reason in Rejection:
        assert getattr(message, reason.name) == reason
        assert getattr(screening, reason.name) == reason


def test_every_setting_of_the_least_squares_does_something(recording):
    """Six of the state space did nothing: walks that it does not take, and p, which is 1."""
    time, d, force = recording(2.0)
    d[500], d[600], force[700], force[800] = 2e3, d[600] + 5.0, np.nan, force[800] + 30.0
    time[1000:] += 0.3
    time[1200:] += 0.8
    time[1300] -= 0.01
    time[1400:] -= 2.0
    both = {"missing_readings": True}

    def numbers(**settings):
        return rows(hc.create_estimator("rls", **settings).run(time, d, force)).tobytes()

    before = numbers(), numbers(**both)
    specifications = hc.parameter_specifications("rls")
    assert len(specifications) > 20
    for specification in specifications:
        name, default = specification.name, specification.default
        if name in ("reorder_window", *both):  # their own tests
            continue
        if specification.kind == "str":
            values = [choice for choice in specification.choices if choice != default]
        else:
            low, high = specification.minimum, specification.maximum
            values = [low, min(3 * default, high), max(type(default)(default / 3), low), high]
        found = {numbers(**{name: v}) for v in values} | {
            numbers(**{name: v}, **both) for v in values
        }
        assert found - set(before), name


def test_a_change_is_told_once(estimator, recording):
    """`rls` told one at every sample that followed, from its 73rd sample on."""
    time, d, force = recording(2.0)
    force[1000:] *= 20.0
    series = estimator.run(time, d, force)
    told = np.flatnonzero(series.change_detected & (series.rejected == 0))
    assert (np.diff(told) > 1).all()
    assert told.size < 20
    if estimator.filter in ("ukf", "rls"):
        assert series.change_detected.any()
