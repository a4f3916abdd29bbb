"""Zeros that a sample sets hold from the next one on, also where many samples come in one message.

Regression of 2026-11-26: what came in the same batch had the zeros of before taken off, and the
estimator, begun anew for the new ones, took the rest of it for another tissue.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from hc_estimator.ros import inputs
from hc_estimator.ros.sample_flow import FEWEST_TOGETHER, NEVER_TOGETHER, SampleFlow
from hc_msgs_py.wire import SampleEncoder
from hc_msgs_py.wire_arrays import SamplesEncoder

START = 1_700_000_000_000_000_000
TAKEN_AT = 7
ZERO_N = 0.5


class Channel:
    """Stands for a topic: what is given to it goes to the input."""

    def __init__(self, *_, **more):
        self.take_many = more.get("take_many")
        self.maximum_backlog = 0


class Receiver:
    """Takes samples, and sets a zero with one of them if it is asked for zeros."""

    def __init__(self, wanted):
        self.source, self.active, self.forces, self.batches = None, wanted, [], 0

    def fewest_together(self):
        return NEVER_TOGETHER if self.active else FEWEST_TOGETHER

    def on_sample(self, stamp_ns, sequence, displacement_mm, force_n):
        self.forces.append(force_n)
        if self.active and sequence == TAKEN_AT:
            self.active = False
            self.source.configure(SETTINGS | {"input.force.zero": ZERO_N})

    def on_samples(self, batch):
        self.batches += 1
        self.forces += batch.forces_n.tolist()

    def on_skip(self, number):
        raise AssertionError(number)

    on_frame = on_failure = on_skip


SETTINGS = {
    "input.force.zero": 0.0,
    "input.position.zero": 0.0,
    "input.position.frame_compliance": 0.0,
    "input.maximum_backlog": 1000,
}


@pytest.fixture(params=["sample", "samples"])
def feed(request, monkeypatch):
    """Gives one batch of samples with a force of 0.5 N to an input; returns its receiver."""
    monkeypatch.setattr(inputs, "Channel", Channel)
    monkeypatch.setattr(Receiver, "on_frame", lambda *_: None)

    def give(wanted, count=40):
        receiver = Receiver(wanted)
        kind = inputs.ArrayInput if request.param == "samples" else inputs.SampleInput
        source = receiver.source = kind(None, receiver, SETTINGS)
        stamps = [START + 1_000_000 * k for k in range(count)]
        if request.param == "samples":
            depths, forces = np.full(count, 1.0), np.full(count, ZERO_N)
            source._take(SamplesEncoder("tip").encode(stamps, 0, depths, forces))
        else:
            encoder = SampleEncoder()
            encoder.set_frame("tip")
            source._take(encoder.encode(stamps[0] - 1_000_000, 0, 1.0, ZERO_N))
            receiver.forces.clear()
            several = [encoder.encode(at, k, 1.0, ZERO_N) for k, at in enumerate(stamps)]
            source._channel.take_many([bytes(data) for data in several])
        return receiver

    return give


def test_a_zero_that_a_sample_sets_holds_for_the_rest_of_its_batch(feed):
    receiver = feed(wanted=True)
    assert receiver.batches == 0
    assert receiver.forces == [ZERO_N] * (TAKEN_AT + 1) + [0.0] * (40 - TAKEN_AT - 1)


def test_without_zeros_to_take_a_batch_is_one(feed):
    receiver = feed(wanted=False)
    assert receiver.batches == 1
    assert receiver.forces == [ZERO_N] * 40


@pytest.mark.parametrize(("looking", "on_trial"), [(True, False), (False, True), (False, False)])
def test_the_node_asks_for_single_samples_where_the_next_may_be_read_otherwise(looking, on_trial):
    node = SimpleNamespace(
        _zeros=SimpleNamespace(active=looking),
        _keeper=SimpleNamespace(on_trial=on_trial),
        _outputs=SimpleNamespace(form="each"),
    )
    expected = NEVER_TOGETHER if looking or on_trial else FEWEST_TOGETHER
    assert SampleFlow.fewest_together(node) == expected
