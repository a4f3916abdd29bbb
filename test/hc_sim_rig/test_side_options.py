"""What the status of a live side says of its link."""

from __future__ import annotations

from types import SimpleNamespace

from hc_msgs_py.diagnostics import Level, Status
from hc_sim_rig.ros.side_options import RefusalWatch


def test_a_status_says_what_is_refused_and_warns() -> None:
    """Somebody whose ports are wrong reads there why nothing comes."""
    link = SimpleNamespace(refused=0, why_refused="")
    watch = RefusalWatch(link)  # type: ignore[arg-type]
    good = Status(Level.OK, "follows", {"samples": 1})
    assert watch.reported_in(good) == good
    link.refused, link.why_refused = 3, "comes from 10.0.0.9:1, not from 10.0.0.2:47111"
    told = watch.reported_in(good)
    assert told.level == Level.WARN
    assert told.message == f"follows; 3 datagrams refused: {link.why_refused}"
    assert watch.reported_in(good) == good  # none since
    link.refused = 4
    assert watch.reported_in(Status(Level.ERROR, "no force", {})).level == Level.ERROR
