"""The 1 kHz path from a sample to an estimate leaves nothing behind, sample after sample."""

import gc
import tracemalloc

import numpy as np
import pytest

import hc_estimator as hc

SAMPLES = 10_000
WARM = 500
ROOM = 4096  # bytes: what the interpreter and the test itself move about


def grown(step, columns):
    """Bytes that stay allocated, and objects that the collector has to watch, over all samples."""
    first, others = columns[:WARM], columns[WARM:]
    for column in first:
        step(*column)
    gc.collect()
    objects = len(gc.get_objects())
    gc.disable()
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for column in others:
            estimate = step(*column)
        estimate = None  # noqa: F841 - the last one goes as well
        after, highest = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
        gc.enable()
    return after - before, highest - before, len(gc.get_objects()) - objects


@pytest.mark.parametrize(
    "filter_name",
    ["ukf", *(pytest.param(name, marks=pytest.mark.slow) for name in ("ekf", "self_tuning_ukf"))],
)
def test_ten_thousand_steps_leave_nothing(filter_name, recording):
    """Neither memory nor cyclic garbage grows; one estimate at a time is alive."""
    columns = np.stack(recording(seconds=(WARM + SAMPLES) / 1000.0), axis=1).tolist()
    step = hc.create_estimator(filter_name).step
    kept, highest, objects = grown(step, columns)
    assert kept < ROOM
    assert highest < 2 * ROOM
    assert objects < 50


def test_ten_thousand_steps_of_an_array_leave_nothing(recording):
    time, depth, force = recording(seconds=(WARM + SAMPLES) / 1000.0)
    columns = [
        (t, np.array([d, d]), np.array([f, f])) for t, d, f in zip(time, depth, force, strict=True)
    ]
    kept, highest, objects = grown(hc.EstimatorArray("ekf", 2).step, columns)
    assert kept < ROOM
    assert highest < 2 * ROOM
    assert objects < 50


def test_the_measure_sees_what_grows(recording):
    """The same with a list that keeps every estimate: it must show."""
    columns = np.stack(recording(seconds=2.0), axis=1).tolist()
    estimator, kept = hc.create_estimator("ekf"), []
    grows, highest, _objects = grown(lambda *c: kept.append(estimator.step(*c)), columns)
    assert grows > 100 * (2000 - WARM)
    assert highest >= grows
