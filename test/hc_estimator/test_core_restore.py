"""Saved states: whatever stands in one, an estimator refuses it or goes on soundly."""

import copy
import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator import memory
from hc_estimator.filters.registry import FIELDS, FILTERS

COMBINATIONS = [(f, s) for f in hc.available_filters() for s in hc.available_state_spaces(f)]
NUMBERS = [0.0, -1.0, 1.0, 1e-308, 1e-30, 1e9, 1e30, -1e30, 1e149, 1e308, -1e308]
NUMBERS += [math.nan, math.inf, -math.inf, 10**400]
WHOLE = [-(10**9), -1, 0, 1, 2, 7, 50, 255, 256, 10**9, 2**53, 2**63, -(2**63), 10**30]
PYTEST = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
OTHERS = [None, True, "", "x", "1e5", "nan", [], {}, [[]], [1.0], {"a": 1}]


def assert_finite(series):
    """What every estimate promises, whatever was restored."""
    for name in ("parameters", "covariance", "parameters_std", "identifiability"):
        assert np.isfinite(getattr(series, name)).all(), name
    for name in ("force_reconstructed", "displacement", "velocity"):
        assert np.isfinite(getattr(series, name)).all(), name
    for name in ("force_noise_std", "displacement_noise_std", "process_noise_scale"):
        assert np.isfinite(getattr(series, name)).all(), name
    used = series.rejected == 0
    assert np.isfinite(series.force_predicted[used]).all()
    assert np.isfinite(series.nis[used]).all()


def paths(value, path=()):
    """Paths to everything inside of plain data, containers included."""
    if path:
        yield path
    if isinstance(value, dict):
        for name, part in value.items():
            yield from paths(part, (*path, name))
    elif isinstance(value, list):
        for i, part in enumerate(value):
            yield from paths(part, (*path, i))


def a_path(rng, value):
    """A random path, mostly into what was learnt; at every level each part is as likely."""
    part = str(rng.choice(["memory", "particles", "configuration", ""], p=[0.8, 0.1, 0.05, 0.05]))
    path = []
    if part in value:
        path, value = [part], value[part]
    while isinstance(value, (dict, list)) and value and (not path or rng.random() < 0.95):
        path.append(list(value)[rng.integers(len(value))] if isinstance(value, dict) else None)
        if path[-1] is None:
            path[-1] = int(rng.integers(len(value)))
        value = value[path[-1]]
    return path


def mutate(rng, plain):
    """Change one thing in the plain data of a state."""
    path = a_path(rng, plain)
    holder = plain
    for step in path[:-1]:
        holder = holder[step]
    old = holder[path[-1]]
    kind = rng.integers(16)  # mostly another number: what is not even one is refused at once
    if kind == 0 and isinstance(holder, dict):
        del holder[path[-1]]
    elif kind == 1:
        holder[path[-1]] = copy.deepcopy(OTHERS[rng.integers(len(OTHERS))])
    elif isinstance(old, list) and old and kind < 4:
        if kind == 2:
            old.pop()
        else:
            old.append(old[0])
    elif isinstance(old, list) and old:  # all numbers of an array alike
        number = NUMBERS[rng.integers(len(NUMBERS))]
        if isinstance(old[0], (int, float)):
            old[:] = [number] * len(old)
    elif isinstance(old, int) and not isinstance(old, bool):
        by = [WHOLE[rng.integers(len(WHOLE))], old + 1, old - 1, 2 * old]
        holder[path[-1]] = by[rng.integers(len(by))]
    elif isinstance(old, float):
        by = [NUMBERS[rng.integers(len(NUMBERS))], -old, old * 10.0 ** rng.integers(-20, 20)]
        by += [old * rng.uniform(0.0, 2.0), 0.0]
        holder[path[-1]] = by[rng.integers(len(by))]
    else:
        holder[path[-1]] = copy.deepcopy(OTHERS[rng.integers(len(OTHERS))])


def readings(count, start=0.0):
    rng = np.random.default_rng(1)
    time = start + np.arange(count) * 1e-3
    d = 2.0 + 2.5 * np.sin(5.0 * time) + 0.3 * np.sin(30.0 * time)
    force = 0.3 * np.maximum(d, 0.0) ** 1.7
    noise = rng.standard_normal((2, count))
    return time, d + 0.002 * noise[0], force + 0.01 * noise[1]


@pytest.fixture(scope="module")
def saved():
    """Some states of every filter: at the start, in the air, in contact, after a change."""
    result = []
    for filter_name, state_space in COMBINATIONS:
        estimator = hc.create_estimator(filter_name, state_space=state_space)
        time, d, force = readings(3000)
        force[2500:] *= 2.0
        done = 0
        for until in (0, 300, 1500, 2540, 3000):
            estimator.run(time[done:until], d[done:until], force[done:until])
            result.append(json.dumps(estimator.state()))
            done = until
    return result


def fuzz(states, count, seed):
    """Restore mutated states and run each for 200 samples; how many were refused and run."""
    rng = np.random.default_rng(seed)
    made = {}
    refused = ran = 0
    time, d, force = readings(200, 3.0)
    for _ in range(count):
        text = states[rng.integers(len(states))]
        plain = json.loads(text)
        kind = plain["filter"], plain["state_space"]
        if kind not in made:
            made[kind] = hc.create_estimator(kind[0], state_space=kind[1])
        estimator = made[kind]
        for _ in range(rng.integers(1, 4)):
            mutate(rng, plain)
        try:
            estimator.restore(plain)
        except ValueError:
            refused += 1
            continue
        ran += 1
        try:
            assert_finite(estimator.run(time, d, force))
        except AssertionError as error:
            changed = differences(json.loads(text), plain)
            raise AssertionError(f"{kind}: {error}; {changed}") from None
    return refused, ran


def differences(before, after):
    """What a mutation changed, for the message."""
    found = []
    for path in paths(before):
        old, new = before, after
        try:
            for step in path:
                old, new = old[step], new[step]
        except (KeyError, IndexError, TypeError):
            found.append(f"{path}: gone")
            continue
        if not isinstance(old, (dict, list)) and old != new:
            found.append(f"{path}: {old!r} -> {new!r}")
    return "; ".join(found[:6])


def test_mutated_states_are_refused_or_run_soundly(saved):
    refused, ran = fuzz(saved, 300, seed=1)
    assert refused > 50
    assert ran > 30


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_ten_thousand_mutated_states(saved):
    refused, ran = fuzz(saved, 10_000, seed=2)
    assert refused > 1000
    assert ran > 1000


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_mutated_states_stay_within_their_arrays(tmp_path):
    """Both once more, compiled with a check of every index: mostly the time to compile."""
    both = "refused_or_run_soundly or ten_thousand_mutated"
    result = subprocess.run(
        [*PYTEST, __file__, "-m", "slow or not slow", "-k", both, "--timeout", "3000"],
        env=os.environ | {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=3300,
    )
    assert result.returncode == 0, result.stdout[-3000:]
    assert "2 passed" in result.stdout


def nested_fields(fields):
    for field in fields:
        inner = memory.fields_of(field.kind)
        yield from [field] if inner is None else nested_fields(inner)


def test_every_whole_number_of_a_state_has_its_range():
    """An index that a damaged file holds must not reach the compiled code."""
    groups = [entry.memory or FIELDS for entry in FILTERS.values()]
    whole = [field for group in groups for field in nested_fields(group) if field.kind is np.int64]
    assert len(whole) > 50
    for field in whole:
        assert field.low is not None, field.name


def field_values(fields, value, path=()):
    """Every field of plain data with the path to its value."""
    for field in fields:
        inner = memory.fields_of(field.kind)
        here = value[field.name]
        if inner is None:
            yield field, (*path, field.name)
        elif field.shape:
            for i, part in enumerate(here):
                yield from field_values(inner, part, (*path, field.name, i))
        else:
            yield from field_values(inner, here, (*path, field.name))


@pytest.mark.parametrize("filter_name", ["self_tuning_ukf", "ukf"])
def test_every_number_out_of_its_range_is_refused(filter_name):
    """Each whole number beyond either end, each other number that is none, one at a time.

    By the part of the memory that holds it, and in every fortieth field by the whole estimator: a
    state of 21,000 numbers restored for each of them took 44 s.
    """
    estimator = hc.create_estimator(filter_name)
    estimator.run(*readings(400))
    before = json.dumps(estimator.state())
    plain = json.loads(before)
    fields = FILTERS[filter_name].memory or FIELDS
    parts = {field.name: (field,) for field in fields}
    seen = set()
    for count, (field, path) in enumerate(field_values(fields, plain["memory"])):
        if tuple(step for step in path if isinstance(step, str)) in seen:
            continue  # the first of many alike
        seen.add(tuple(step for step in path if isinstance(step, str)))
        whole = field.kind is np.int64
        bad = [field.low - 1, (field.high or memory.LARGEST_COUNT) * 2 + 1, 0.5] if whole else []
        bad += [math.nan, math.inf] if whole or field.finite else [1e200]
        # One of them in each field, and all in every fifth: the values are the kind's, not its own.
        for number in bad if count % 5 == 0 else bad[count % len(bad) :][:1]:
            holder = plain["memory"]
            for step in path[:-1]:
                holder = holder[step]
            good = holder[path[-1]]
            holder[path[-1]] = np.full(field.shape, number).tolist()
            part = parts[path[0]]
            with pytest.raises(ValueError, match=f"^{field.name} is not"):
                memory.from_plain(plain["memory"], part, np.zeros(1, memory.record_type(part))[0])
            if len(seen) % 40 == 0:
                with pytest.raises(ValueError, match=f"damaged state: {field.name} is not"):
                    estimator.restore(plain)
            holder[path[-1]] = good
    assert json.dumps(estimator.state()) == before  # nothing of it was taken
    estimator.restore(plain)


@pytest.mark.parametrize("damage", ["asymmetric", "indefinite", "negative"])
def test_a_matrix_that_is_no_covariance_is_refused(damage):
    estimator = hc.create_estimator("ukf")
    estimator.run(*readings(400))
    plain = estimator.state()
    matrix = np.array(plain["memory"]["covariance"])
    if damage == "asymmetric":
        matrix[3, 4] += 0.1 * math.sqrt(matrix[3, 3] * matrix[4, 4])
    elif damage == "indefinite":
        matrix[3, 4] = matrix[4, 3] = 1.01 * math.sqrt(matrix[3, 3] * matrix[4, 4])
    else:
        matrix[5] *= -1.0
        matrix[:, 5] *= -1.0
        matrix[5, 5] *= -1.0
    plain["memory"]["covariance"] = matrix.tolist()
    with pytest.raises(ValueError, match="covariance is no covariance"):
        estimator.restore(plain)
