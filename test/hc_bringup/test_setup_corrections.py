"""hc setup puts right what the diagnosis found one after another."""

from types import SimpleNamespace

import numpy as np
import pytest

from hc_bringup import diagnosis
from hc_bringup.commands import setup
from hc_bringup.diagnosis import Diagnosis
from hc_bringup.errors import UserError
from hc_bringup.finding import Finding
from hc_bringup.guided_setup import Recorded
from hc_estimator.ros.node_settings import NODE_SETTINGS
from hc_estimator.stream import sensor_setup
from hc_estimator.stream.sanity import _units
from hc_estimator.stream.vector_readings import VectorReadings


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
            late_s=0.0,
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


def test_counts_are_refused_before_a_file_is_written_that_no_node_takes():
    """Regression: of an ATI's counts a zero of -1,499,357 N was written, and the run ended."""
    found = Found()
    found.force = SimpleNamespace(zero=-1.5e6)
    with pytest.raises(UserError, match=r"-1.5e\+06 N.*--force-scale takes the newtons.* 1e-6"):
        setup._refuse_counts(found)
    found.force, found.position = found.position, SimpleNamespace(zero=2e6)
    with pytest.raises(UserError, match="--position-scale takes the metres"):
        setup._refuse_counts(found)
    zeros = [NODE_SETTINGS[f"input.{name}.zero"] for name in ("force", "position")]
    limits = {(zero.minimum, zero.maximum) for zero in zeros}
    assert limits == {(-1e6, 1e6)}


def test_the_units_that_are_to_be_checked_are_named_as_options_of_setup(monkeypatch, capsys):
    depth = np.linspace(0.0, 7.0, 200)
    (suspicion,) = _units(depth, 2e6 * depth / 7.0, 1.0)
    judged(monkeypatch, Finding(suspicion.sentence))
    assert "check the units of both (--force-scale, --position-scale)" in capsys.readouterr().out


def test_a_unit_that_was_guessed_is_said_to_be_a_guess(monkeypatch, capsys):
    """Regression: of 6,200 counts per newton K came out six times too large, "(allowed for)"."""
    judged(monkeypatch, Finding("would be in millinewtons", {"force.scale": 0.001}))
    said = capsys.readouterr().out
    assert "would be in millinewtons (allowed for)\nthat unit is a guess" in said
    assert "begin again with --force-scale\n" in said
    judged(monkeypatch, Finding("it is late", {"force.time_offset": 0.01}))
    assert "guess" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("kind", "names", "joint", "said"),
    [
        ("effort", ("a1", "a2"), "a2", "radians and newton metres"),
        ("wrench", ("a1", "a2"), "a2", "radians, and K"),
        ("effort", ("slide",), "slide", ""),  # one axis of one's own
        ("wrench", ("x", "y", "z"), "", ""),
    ],
)
def test_a_joint_of_an_arm_may_turn_and_that_is_said(kind, names, joint, said):
    """Regression: torque over angle of an arm's joint was told as K, 100 % known."""
    readings = VectorReadings(np.zeros(1), np.zeros((1, len(names))), names)
    stream = SimpleNamespace(kind=kind)
    recorded = Recorded(stream, stream, (readings, readings), rest_s=None, turned_deg=0.0)
    line = setup._turning_joint(recorded, joint)
    assert said in line
    assert bool(line) == bool(said)


@pytest.mark.parametrize(
    ("stamps", "said"),
    [
        (np.zeros(500), "500 messages of /ft have 1 stamp: when each was measured"),
        (np.floor(np.arange(5000) / 500.0), "5000 messages of /ft have 10 stamps: "),
        (np.floor(np.arange(5000) / 4.0), ""),  # repeated until there is a new one
        (np.empty(0), ""),  # told elsewhere
    ],
)
def test_stamps_that_say_not_when_it_was_measured_are_told(stamps, said):
    """Regression: "no time in common: compare their clocks", of a driver that stamps nothing."""
    bad = VectorReadings(stamps, np.zeros((len(stamps), 3)), ("x", "y", "z"))
    good = VectorReadings(np.arange(5000.0), np.zeros((5000, 3)), ("x", "y", "z"))
    streams = [SimpleNamespace(name=name, topic=name, kind="wrench") for name in ("/ft", "/pose")]
    recorded = Recorded(*streams, (bad, good), rest_s=None, turned_deg=0.0)
    if not said:
        setup._check_stamps(recorded)
        return
    with pytest.raises(UserError, match=said):
        setup._check_stamps(recorded)
