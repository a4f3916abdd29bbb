"""~/find_surface that finds the normal too: the zeros that become parameters, and who joins it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hc_estimator.ros.zero_setting import ZeroSetting
from hc_estimator.stream.contact_frame import unit_vector
from hc_estimator.stream.normal_finder import NormalFinder
from hc_estimator.stream.vocabulary import EventKind

NORMAL = np.array(unit_vector((0.3, -0.2, 1.0)))
OFFSET = np.array((0.8, 0.3, -0.4))  # of the sensor, in the base frame [N]
STIFFNESS, TOUCHED_AT = 0.4, 6.0


class Searching:
    """A node whose tool goes down along a normal that it does not know, sensor not zeroed."""

    def __init__(self, sign=1, scale=1.0):
        self.sign, self.scale, self.set, self.events = sign, scale, {}, []
        self.values = {
            "input.source": "sensors",
            "input.contact.frame": "surface",
            "input.contact.normal_from": "find_surface",
            "input.force.sign": sign,
            "input.force.scale": scale,
            "input.force.zero": 0.25,
            "input.position.zero": 0.0,
            "input.position.frame_compliance": 0.0,
            "tare.force": False,
            "tare.samples": 100,
        }
        settings = SimpleNamespace(values=self.values, estimator_values=dict)
        self.input = SimpleNamespace(normal_finder=None)
        session = SimpleNamespace(report=lambda kind, reason: self.events.append((kind, reason)))
        self.zeros = ZeroSetting(self, settings, lambda: session, lambda: self.input)
        self.random = np.random.default_rng(2)

    def set_parameters_atomically(self, parameters):
        self.set = {p.name: p.value for p in parameters}
        return SimpleNamespace(successful=True, reason="")

    def go_down(self, begin_mm, end_mm, count=2000):
        """Readings as ros/sensors makes them, along the normal (0, 0, 1) of before."""
        for k, way in enumerate(np.linspace(begin_mm, end_mm, count)):
            pressed = STIFFNESS * max(way - TOUCHED_AT, 0.0) ** 1.5
            noise = 0.005 * self.random.standard_normal(3)
            push = (self.sign * pressed * NORMAL + OFFSET + noise) / self.scale
            tip = -1e-3 * way * NORMAL
            depth_mm = -1e3 * tip[2]
            force_n = self.sign * self.scale * push[2] - self.values["input.force.zero"]
            if (finder := self.input.normal_finder) is not None:
                finder.add_tip(depth_mm, tuple(tip))
                finder.add(tuple(push), force_n)
            self.zeros.add(10**6 * k, depth_mm, force_n)
            if self.set:
                return


@pytest.mark.parametrize(("sign", "scale"), [(1, 1.0), (-1, 2.0)])
def test_the_force_zero_is_that_along_the_normal_that_was_found(sign, scale):
    """It was that along the normal of before: a sensor's offset of 0.9 N left 0.3 N of force."""
    node = Searching(sign, scale)
    node.zeros.find_surface()
    node.go_down(0.0, 12.0)
    assert node.events[-1][0] is EventKind.TARED
    normal = np.array(node.set["input.contact.normal"])
    assert math.degrees(math.acos(min(float(normal @ NORMAL), 1.0))) < 1.0
    unloaded = sign * scale * float((OFFSET / scale) @ normal)  # as it will be read from now on
    assert node.set["input.force.zero"] == pytest.approx(unloaded, abs=0.005)
    assert abs(unloaded - sign * OFFSET[2]) > 0.1


def test_who_joins_a_search_for_the_surface_does_not_empty_it():
    """The forces free of contact were forgotten, and the search came to nothing for both."""
    node = Searching()
    node.zeros.find_surface()
    node.go_down(0.0, TOUCHED_AT)
    finder = node.input.normal_finder
    assert "already" in node.zeros.find_surface()
    assert node.input.normal_finder is finder
    node.go_down(TOUCHED_AT, 12.0)
    assert node.events[-1][0] is EventKind.TARED


@pytest.mark.parametrize("given_up", [True, False])
def test_a_search_that_is_over_collects_nothing_any_more(given_up):
    node = Searching()
    node.zeros.find_surface()
    assert isinstance(node.input.normal_finder, NormalFinder)
    if given_up:
        node.zeros.give_up("a reset came between")
    else:
        node.zeros.tare()
    assert node.input.normal_finder is None
