"""The watch wakes timers and executor when the clock was set back, and then only."""

import pytest

from hc_msgs_py.clock_watch import ClockWatch


class Woken:
    """Stands for a timer and for the executor."""

    def __init__(self) -> None:
        self.count = 0

    def reset(self) -> None:
        self.count += 1

    def wake(self) -> None:
        self.count += 1


@pytest.mark.parametrize(
    ("step_s", "woken"), [(-3600.0, 1), (-1.0, 1), (-0.05, 1), (-0.001, 0), (0.0, 0), (3600.0, 0)]
)
def test_only_a_step_back_wakes(step_s: float, woken: int) -> None:
    wall, steady = [1e9], [5.0]
    executor, timer = Woken(), Woken()
    watch = ClockWatch(executor, lambda: [timer], wall=lambda: wall[0], steady=lambda: steady[0])
    for k in range(20):
        steady[0] += 0.1
        wall[0] += 0.1 + (step_s if k == 7 else 0.0)
        watch.look()
    assert (executor.count, timer.count, watch.steps_back) == (woken, woken, woken)
