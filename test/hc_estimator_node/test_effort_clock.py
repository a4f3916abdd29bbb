"""A joint whose clock is set back goes on at once.

Regression of 2026-11-26: none of its readings was used until the stamps were where they had been.
"""

from types import SimpleNamespace

import pytest

from hc_estimator.ros import effort
from hc_estimator.ros.node_settings import NODE_SETTINGS

SETTINGS = {name: setting.default for name, setting in NODE_SETTINGS.items()} | {
    "input.source": "effort",
    "input.publish_samples": False,
}


class Channel:
    """Stands for the topic of the joint."""

    def __init__(self, *_, **__):
        self.maximum_backlog = 0


def reading(stamp_ms, position_m):
    """A sensor_msgs/JointState as far as is read of it."""
    seconds, rest_ms = divmod(stamp_ms, 1000)
    stamp = SimpleNamespace(sec=seconds, nanosec=rest_ms * 1_000_000)
    return SimpleNamespace(
        header=SimpleNamespace(frame_id="", stamp=stamp),
        name=["a"],
        position=[position_m],
        velocity=[],
        effort=[1.0],
    )


@pytest.mark.parametrize("method", ["observer", "extended", "sir_pf"])
@pytest.mark.parametrize("back_ms", [500, 60_000])
def test_readings_are_used_again_after_the_clock_was_set_back(monkeypatch, method, back_ms):
    monkeypatch.setattr(effort, "Channel", Channel)
    used = []
    receiver = SimpleNamespace(
        on_sample=lambda stamp_ns, *_: used.append(stamp_ns // 1_000_000), on_failure=None
    )
    source = effort.EffortInput(None, receiver, SETTINGS | {"input.effort.method": method})
    start_ms = 1_000_000
    for k in range(200):
        source._take(reading(start_ms + 2 * k, 0.001))
    before = len(used)
    assert before > 150
    again_ms = start_ms + 400 - back_ms
    for k in range(100):
        source._take(reading(again_ms + 2 * k, 0.001))
    if back_ms < 1000:  # late messages
        assert len(used) == before
        return
    assert len(used) == before + 100
    assert used[-1] == again_ms + 198
