"""What a tool feels before its sensors are known, in newtons and millimetres."""

import numpy as np
import pytest

from hc_bringup.press_monitor import PressMonitor, resting


class Recorder:
    """Readings of a force and a position, as hc setup records them."""

    def __init__(self, is_joint=False):
        self.is_joint = is_joint
        self.forces = np.zeros((0, 3))
        self.places = np.zeros((0, 3))

    def since(self, forces, places):
        return self.forces[forces:], self.places[places:]

    def add(self, volts, thousandths):
        """Readings along z about a height, with some noise."""
        noise = 1e-3 * np.random.default_rng(len(self.forces)).standard_normal((len(volts), 3))
        self.forces = np.vstack([self.forces, noise + np.outer(volts, (0.0, 0.0, 1.0))])
        self.places = np.vstack([self.places, noise + np.outer(thousandths, (0.0, 0.0, 1.0))])


PRESSES = np.concatenate([np.zeros(30), np.ones(30), np.zeros(30), np.ones(30), np.zeros(30)])


@pytest.mark.parametrize(
    ("scales", "is_joint", "said"),
    [
        ((1.0, 1.0), False, "0.202 N (noise 0.0013), tool moved 400 mm, 2 presses"),
        ((25.0, 0.005), False, "force changed by 5.05 N (noise 0.032), tool moved 2 mm, 2 presses"),
        ((25.0, 0.005), True, "force changed by 5.05 N (noise 0.032), tool moved 2 mm, 2 presses"),
        ((1.0, 1.0), True, "(noise 0.0013), tool moved a joint by 0.4 m or rad, 2 presses"),
    ],
)
def test_volts_are_told_as_what_they_stand_for(scales, is_joint, said):
    """Regression: with --force-scale 25 the monitor went on to show volts as newtons."""
    recorder = Recorder(is_joint)
    recorder.add(np.zeros(50), np.zeros(50))
    monitor = PressMonitor(recorder, scales)
    recorder.add(0.2 * PRESSES, 400.0 * PRESSES)
    monitor.update()
    assert monitor.has_pressed
    assert said in " ".join(monitor.sentence.split())


def test_a_tool_at_rest_is_judged_by_what_its_readings_stand_for():
    recorder = Recorder()
    recorder.add(np.zeros(50), np.linspace(0.0, 20.0, 50))
    assert resting(recorder, (25.0, 0.005)) == ""
    assert resting(recorder) == "the tool moved by 19.2 mm meanwhile"
    recorder.add(np.linspace(0.0, 0.2, 50), np.zeros(50))
    assert resting(recorder, (25.0, 0.005)).startswith("the force changed by 4.")
