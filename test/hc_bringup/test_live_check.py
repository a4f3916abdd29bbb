"""What the doctor says of a node that cannot be judged yet."""

from types import SimpleNamespace

import pytest

from hc_bringup import live_check
from hc_bringup.diagnosis import Finding
from hc_bringup.errors import UserError
from hc_msgs_py.background import STARTING


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
