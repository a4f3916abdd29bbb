"""Whatever a contact did to the default filter, its state is one that `restore` takes back.

A saved state is checked field by field (memory.py): a range too small, or a number that is none,
is seen by nobody until a node is started again. Regressions of 2026-11-26: the kind of the last
spline fit (33 of at most 31), and what noise takes from the damping of the delay's fit (below 0,
in every contact with a delay that is less than a millimetre deep), were refused.
"""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.contact.arrays import adhesive_force
from hc_estimator.memory import LARGEST_COUNT, LARGEST_NUMBER, fields_of
from hc_evaluation.accuracy.drawn_contact import TROUBLES, drawn_contact

FILTER = "self_tuning_ukf"
LOOKED_EVERY_S = 0.1
RESTORED_EVERY = 97  # looks: to write and read a state takes fifty times as long


def out_of_range(record, fields, largest, path=""):
    """Names of the fields, and what is wrong, by the same rules as `memory.from_plain`.

    Records within records are looked at all together, as arrays. Of whole numbers that have a
    largest value the largest that there was is noted.
    """
    found = []
    for field in fields:
        values, name = record[field.name], f"{path}{field.name}"
        nested = fields_of(field.kind)
        if nested is not None:
            found += out_of_range(values, nested, largest, f"{name}.")
            continue
        if not field.finite:
            values = values[np.isfinite(values)]
            if not values.size:
                continue
        whole = field.kind is np.int64
        most = LARGEST_COUNT if whole else LARGEST_NUMBER
        low = -most if field.low is None else field.low
        high = most if field.high is None else field.high
        least, greatest = values.min(), values.max()
        if not (least >= low and greatest <= high):  # nor is NaN
            found.append(f"{name}: {least:g} to {greatest:g}, not {low:g} to {high:g}")
        if whole and field.high is not None:
            largest[name] = max(largest.get(name, 0), int(greatest))
    return found


CONTACTS = [((name,), 4 + i) for i, name in enumerate(TROUBLES)]
CONTACTS += [
    ((), 3),
    (("delay",), 84),
    (("gaps", "delay"), 50),
    (("lumps", "sinking"), 1002),
    (tuple(TROUBLES), 7),
]


@pytest.fixture(scope="module")
def looked_at():
    """Of each contact the states that are out of range, and of all the largest whole numbers."""
    faults, largest = {}, {}
    other = hc.create_estimator(FILTER)
    for troubles, seed in CONTACTS:
        contact = drawn_contact(troubles, seed)
        estimator = hc.create_estimator(FILTER)
        channels = contact.time_s, contact.displacement_mm, contact.force_n
        until_s = np.arange(contact.time_s[0], contact.time_s[-1], LOOKED_EVERY_S)[1:]
        edges = np.searchsorted(contact.time_s, until_s)
        for k, (begin, end) in enumerate(zip(np.append(0, edges[:-1]), edges, strict=True)):
            estimator.run(*(channel[begin:end] for channel in channels))
            record, fields = estimator._memory, estimator._fields
            for fault in out_of_range(record, fields, largest):
                faults.setdefault((troubles, seed, fault.split(":")[0]), f"{until_s[k]}: {fault}")
            if k % RESTORED_EVERY == RESTORED_EVERY - 1:
                state = estimator.state()
                other.restore(state)
                if other.state() != state:
                    faults[troubles, seed, "restored"] = f"{until_s[k]}: another state"
    return faults, largest


def test_every_state_of_a_contact_with_troubles_can_be_restored(looked_at):
    faults, _ = looked_at
    assert faults == {}


def test_the_contacts_lead_through_what_may_leave_its_range(looked_at):
    """Else the test above would say nothing."""
    _, largest = looked_at
    assert largest["fit.kind"] > 31
    assert largest["moving.stage"] > 5
    assert largest["history.every"] > 1
    assert largest["delay.varies"] == 1
    assert largest["judge.found"] > 2
    assert largest["change.testing"] == largest["zeros.waiting"] == largest["delay.clear"] == 1


def test_a_force_that_stands_leaves_no_fit_without_numbers():
    """An unknown that no point shows has a pivot of 0; what was divided by it was none."""
    contact = drawn_contact(("coloured noise", "change", "gaps"), 10)
    estimator = hc.create_estimator(
        FILTER, jerk_density=1e-6, motion_adaptation=False, noise_adaptation="fixed"
    )
    force = np.full(contact.time_s.size, contact.force_n[contact.time_s.size // 3])
    for k in range(0, contact.time_s.size, 100):
        estimator.run(
            contact.time_s[k : k + 100], contact.displacement_mm[k : k + 100], force[k : k + 100]
        )
        assert out_of_range(estimator._memory, estimator._fields, {}) == []


def test_a_number_out_of_its_range_is_seen_here():
    estimator = hc.create_estimator(FILTER)
    assert out_of_range(estimator._memory, estimator._fields, {}) == []
    estimator._memory["fit"]["kind"] = 64
    estimator._memory["delay"]["score"][0, 3] = np.nan
    found = out_of_range(estimator._memory, estimator._fields, {})
    assert [fault.split(":")[0] for fault in found] == ["fit.kind", "delay.score"]
    with pytest.raises(ValueError, match=r"(kind|score) is not a"):
        hc.create_estimator(FILTER).restore(estimator.state())


@pytest.mark.parametrize(("before_hz", "after_hz", "seed"), [(1000, 100, 1), (4000, 250, 0)])
def test_a_rate_that_falls_lets_no_motion_run_away(before_hz, after_hz, seed):
    """Gains for the step of before drove the bank's quick members to 1e88 mm.

    They could not be chosen any more, the motion was too calm (mean NIS up to 42,000), and the
    state was refused at a restart.
    """
    random = np.random.default_rng(seed)
    slower = 3.0 + np.arange(1, 12 * after_hz) / after_hz
    time = np.concatenate([np.arange(0.0, 3.0, 1.0 / before_hz), slower])
    slow, fast = 2.0 * np.pi * 0.7, 2.0 * np.pi * 2.3
    depth = 3.0 + 1.6 * np.sin(slow * time) + 0.8 * np.sin(fast * time + 0.5)
    speed = 1.6 * slow * np.cos(slow * time) + 0.8 * fast * np.cos(fast * time + 0.5)
    force = adhesive_force(depth, speed, np.array((0.2, 0.0125, 1.8, 1.05))).clip(0.0)
    estimator = hc.create_estimator(FILTER)
    series = estimator.run(
        time,
        depth + 0.002 * random.standard_normal(time.size),
        force + 0.01 * random.standard_normal(time.size),
    )
    hc.create_estimator(FILTER).restore(estimator.state())
    assert np.mean(series.nis[-2 * after_hz :]) < 3.0
    assert estimator.state()["memory"]["motion"]["density"] > 6e4


def pieces_of(seed):
    """Streams that no contact is like: of six rates, depths and laws, with nonsense in between.

    Yields:
        Whether readings may be missing, and the samples of a piece.
    """
    rng = np.random.default_rng(seed)
    missing, begin = bool(rng.integers(2)), 0.0
    for _ in range(6):
        count, rate = int(rng.integers(50, 600)), float(rng.choice([50, 200, 1000, 4000]))
        time = begin + np.arange(count) / rate
        swing = np.sin(2 * np.pi * rng.uniform(0.1, 5.0) * time + rng.uniform(0.0, 6.0))
        d = 10 ** rng.uniform(-2.0, 1.0) * (rng.uniform(-1.0, 1.0) + swing)
        force = 10 ** rng.uniform(-3.0, 1.5) * np.maximum(d, 0.0) ** rng.uniform(0.8, 2.5)
        force *= 1.0 + 10 ** rng.uniform(-4.0, -1.0) * np.gradient(d, time)
        if rng.random() < 0.7:
            force = np.maximum(force, 0.0)
        d += rng.normal(0.0, 10 ** rng.uniform(-5.0, -1.0), count)
        force += rng.normal(0.0, 10 ** rng.uniform(-4.0, 0.0), count)
        nonsense = ((force, [np.nan, np.inf, 1e9, -1e3, 50.0]), (d, [np.nan, 1e3, -1e9, 7.0]))
        for channel, values in nonsense:
            where = rng.random(count) < 0.02 * rng.integers(0, 2)
            channel[where] = rng.choice(values, where.sum())
        if missing and rng.random() < 0.5:
            d[np.arange(count) % 3 != 0] = np.nan
        if rng.random() < 0.2:
            time -= rng.uniform(0.0, 3.0)
        yield missing, (time, d, force)
        begin = time[-1] + rng.choice([1e-3, 0.05, 0.7, 10.0])


@pytest.mark.parametrize(
    ("model", "seed"), [("adhesive", 61), ("adhesive", 73), ("hunt_crossley", 96)]
)
def test_every_state_of_a_stream_of_nonsense_can_be_restored(model, seed):
    """Regressions of 2026-11-27: rows that foretold 1e130 N, and a damping that nothing shows."""
    estimator = None
    for missing, channels in pieces_of(seed):
        if estimator is None:
            kind = {"contact_model": model, "missing_readings": missing}
            estimator = hc.create_estimator(FILTER, **kind)
        for sample in zip(*channels, strict=True):
            estimator.step(*sample)
            assert out_of_range(estimator._memory, estimator._fields, {}) == []
