"""hc setup puts right what the diagnosis found one after another."""

from types import SimpleNamespace

import numpy as np
import pytest

from hc_bringup import diagnosis
from hc_bringup.commands import setup
from hc_bringup.diagnosis import Diagnosis, Finding
from hc_bringup.guided_setup import Recorded
from hc_estimator.stream import sensor_setup


class Found:
    """A proposal that remembers what was done with it."""

    def __init__(self):
        sensor = SimpleNamespace(
            zero_std=np.nan,
            zero=0.0,
            noise=0.01,
            sign=1,
            rate_hz=100.0,
            joint="",
            axis="z",
            held=False,
        )
        self.force = self.position = sensor
        self.time_s = self.displacement_mm = self.force_n = np.arange(10.0)
        self.notes = ()
        self.done = []

    def rescaled(self, force, position):
        self.done.append((force, position))
        return self

    def corrected(self, force, position):
        self.done.append((force, position))
        return self

    def _replace(self, **changed):
        self.done.append(changed)
        return self


def judged(monkeypatch, *findings):
    """What was done with a proposal for the sake of findings, and the time offsets."""
    found = Found()
    monkeypatch.setattr(diagnosis, "diagnose", lambda *_, **__: Diagnosis(findings, None, (), 1.0))
    monkeypatch.setattr(sensor_setup, "propose", lambda *_, **__: found)
    stream = SimpleNamespace(name="/x", kind="wrench")
    recorded = Recorded(stream, stream, (), rest_s=None, turned_deg=0.0)
    _, offsets = setup._judge(recorded, (1.0, 1.0))
    return found.done, offsets


def test_corrections_of_one_setting_add_up(monkeypatch):
    """Regression: of two corrections of a zero only the second was written down."""
    findings = (
        Finding("the force is off", {"force.zero": 0.5}),
        Finding("its unit is wrong", {"force.scale": 0.001}),
        Finding("it is off by a little", {"force.zero": 0.02}),
        Finding("it is late", {"force.time_offset": -0.01}),
        Finding("the surface is off", {"position.zero": 2.0}),
        Finding("and again", {"position.zero": -0.25}),
        Finding("at all places it is late", {"channel_delay": -0.006}),
    )
    done, offsets = judged(monkeypatch, *findings)
    assert offsets == {"force": -0.01, "channel_delay": -0.006}
    given, scales, zeros = done
    assert given == (1.0, 1.0)
    assert scales == (0.001, 1.0)
    assert zeros == pytest.approx((0.5 * 0.001 + 0.02, 1.75))


def test_a_range_that_ends_is_allowed_for_by_a_limit_in_the_file(monkeypatch, capsys):
    ends = Finding("the force stays at 3 N, its largest value", {"force_limit": 2.97})
    (_given, _scales, _zeros, changed), _offsets = judged(monkeypatch, ends)
    assert changed == {"force_limit": 2.97}
    assert "its largest value (allowed for)" in capsys.readouterr().out
