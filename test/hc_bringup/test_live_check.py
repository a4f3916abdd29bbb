"""What the doctor says of a node that cannot be judged yet."""

from types import SimpleNamespace

import numpy as np
import pytest

from hc_bringup import live_check
from hc_bringup.errors import UserError
from hc_bringup.finding import Finding
from hc_msgs_py.background import STARTING
from hc_msgs_py.wire_arrays import SamplesEncoder


@pytest.mark.parametrize(
    ("success", "message", "refused"),
    [
        (False, f"{STARTING}compiling the filters, 3 of 9 done", True),
        (False, "no publisher on indenter/sample", False),  # which the doctor is to judge
        (True, "ready", False),
    ],
)
def test_a_node_that_compiles_is_said_to_do_so(monkeypatch, success, message, refused):
    """Regression: "0 samples in 7 s: nothing to judge", of a node that took none yet."""

    class Client:
        def __init__(self, _graph, _kind, name):
            assert name == "/estimator/ready"

        def call(self, _request, **_options):
            return SimpleNamespace(success=success, message=message)

    monkeypatch.setattr(live_check, "Client", Client)
    if refused:
        expected = "/estimator is starting: compiling the filters, 3 of 9 done: ask again"
        with pytest.raises(UserError, match=expected):
            live_check._refuse_while_starting(None, "/estimator")
    else:
        live_check._refuse_while_starting(None, "/estimator")


def test_what_the_node_says_as_well_is_said_once():
    """Regression: a surface that is off was finding 1 of the node and finding 2 of the doctor."""
    off = "contact begins near {} mm, not at 0: tare at the surface (position.zero)"
    crowd = "2 publishers on /wrench (/a, /b): follows the first; stop the others"
    both = Finding(f"{live_check.NODE_SAYS}{crowd}; {off.format(3.9)}")
    alone = Finding(f"{live_check.NODE_SAYS}{off.format(3.9)}")
    own = Finding(off.format(4), {"position.zero": -4.0})
    kept = live_check.said_once([both, own])
    assert [f.what for f in kept] == [f"{live_check.NODE_SAYS}{crowd}", own.what]
    assert live_check.said_once([alone, own]) == [own]
    assert live_check.said_once([alone]) == [alone]


def test_samples_in_arrays_are_heard_too():
    """Regression: of `hc run` at 4 kHz the doctor heard no sample."""
    listens = {}

    class Node:
        def create_subscription(self, kind, topic, take, _qos, raw=False):
            listens[topic] = (kind.__name__, take, raw)

    samples = []
    graph = SimpleNamespace(node=Node())
    live_check._subscribe_samples(graph, "/indenter/samples", samples)
    live_check._subscribe_samples(graph, "/indenter/sample", samples)
    assert listens["/indenter/sample"][0] == "IndenterSample"
    kind, take, raw = listens["/indenter/samples"]
    assert (kind, raw) == ("IndenterSamples", True)
    stamps = 1_700_000_000_000_000_000 + np.arange(3) * 250_000
    take(SamplesEncoder().encode(stamps, 7, [1.0, 2.0, np.nan], [0.1, np.nan, 0.3]))
    take(b"no message")
    assert [s.stamp_ns for s in samples] == stamps.tolist()
    assert [s.sequence for s in samples] == [7, 8, 9]
    np.testing.assert_allclose([s.displacement_mm for s in samples], [1.0, 2.0, np.nan])
    np.testing.assert_array_equal([s.force_n for s in samples], [0.1, np.nan, 0.3])
