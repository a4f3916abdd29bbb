"""A mass and a drag between sensor and tissue, in a recording: named, with cost, and taken off."""

import json
import re

import numpy as np
import pytest
import yaml
from presses_from_air import presses
from recordings_less import loaded, write_bag, write_table

from hc_bringup.cli import main
from hc_bringup.commands.doctor import _of_one_message, _of_samples, apply
from hc_bringup.diagnosis import diagnose
from hc_bringup.finding import Finding
from hc_bringup.robot_files import write_files
from hc_bringup.robot_streams import Stream
from hc_estimator.stream.sensor_setup import SensorProposal, SetupProposal
from hc_estimator.stream.tool_motion import MOVING_MASS, ToolMotion

K = 0.4
BOTH = {"force.moving_mass": 0.3, "force.damping": 0.01}


@pytest.fixture
def table(tmp_path):
    return write_table(tmp_path / "moved.csv", presses())


def test_the_doctor_names_both_and_what_they_cost(table, capsys):
    """K was a sixth of what it is, and a misfit was all that was said."""
    assert main(["doctor", str(table), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    mass, drag = told["findings"][:2]
    assert "kg move between sensor and tissue" in mass["what"]
    assert "something drags on the tool" in drag["what"]
    settings = mass["settings"] | drag["settings"]
    assert settings["input.force.moving_mass"] == pytest.approx(0.3, rel=0.05)
    assert settings["input.force.damping"] == pytest.approx(0.01, rel=0.03)
    before = float(re.search(r"K was ([0-9.]+)", drag["cost"])[1])
    assert abs(before / K - 1.0) > 0.5
    assert told["parameters"]["stiffness"] == pytest.approx(K, rel=0.01)
    typed = [f"{name.removeprefix('input.')}={value}" for name, value in settings.items()]
    less, as_it_stands = loaded(table, *typed), loaded(table)
    mass_kg = settings["input.force.moving_mass"]
    assert less.findings.notes[-1].startswith(f"what moving the tool takes ({mass_kg:g} kg and ")
    motion = ToolMotion(settings["input.force.moving_mass"], settings["input.force.damping"])
    np.testing.assert_array_equal(
        less.force_n,
        motion.of_many(as_it_stands.stamps, as_it_stands.displacement_mm, as_it_stands.force_n),
    )
    assert np.count_nonzero(np.isnan(less.force_n)) < 50
    assert less.counted_once == ()  # no gaps


def test_a_zero_that_is_off_is_that_of_a_tool_at_rest():
    found = diagnose(*presses(zero_n=0.4))
    settings = {}
    for finding in found.findings:
        apply(settings, finding.settings)
    assert settings["force.zero"] == pytest.approx(0.4, abs=0.005)
    assert found.estimated.parameters[0] == pytest.approx(K, rel=0.01)


@pytest.mark.slow
def test_a_delay_comes_first():
    """By the motion of another time the mass was 0.08 of 0.3 kg, and K 2 % off and sure."""
    time_s, place, force = presses()
    late = np.roll(force, 20)[50:-50]
    found = diagnose(time_s[50:-50], place[50:-50], late)
    first, *others = (finding.settings for finding in found.findings if finding.settings)
    assert first == {"force.time_offset": pytest.approx(-0.02, abs=5e-4)}
    settings = {}
    for other in others:
        apply(settings, other)
    assert settings["force.moving_mass"] == pytest.approx(0.3, rel=0.05)
    assert settings["force.damping"] == pytest.approx(0.01, rel=0.03)
    assert found.estimated.parameters[0] == pytest.approx(K, rel=0.01)


def test_a_scale_takes_them_along_and_more_is_added():
    present = {**BOTH, "force.scale": 1.0, "position.scale": 1.0}
    apply(present, {"force.scale": 2.0})
    assert (present["force.moving_mass"], present["force.damping"]) == (0.6, 0.02)
    apply(present, {"position.scale": 10.0})
    assert (present["force.moving_mass"], present["force.damping"]) == (0.06, 0.002)
    apply(present, {"force.moving_mass": 0.02})
    assert present["force.moving_mass"] == pytest.approx(0.08)


def test_of_effort_and_of_samples_it_is_said_where_it_belongs():
    for name, of_effort in (("force.moving_mass", "mass"), ("force.damping", "damping")):
        finding = Finding(f"take that off ({name})", {name: 0.3, "force.zero": 0.1})
        other = _of_one_message(finding)
        assert other.settings == {f"effort.{of_effort}": 0.3, "force.zero": 0.1}
        assert other.what == f"take that off (effort.{of_effort})"
        other = _of_samples(finding)
        assert other.settings == {}
        assert other.what.endswith("of samples that is taken off where they are made")
    zero = Finding("tare", {"force.zero": 0.1})
    assert _of_samples(zero) is zero


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("force.moving_mass=-0.1", "is not a number from 0 to 100 kg"),
        ("force.damping=nan", "is not a number"),
        ("force.damping=5", "takes 394 N, and the force changes by 8.25"),
        ("force.moving_mass=90", "are signs and units right?"),
    ],
)
def test_what_cannot_be_is_one_line(table, capsys, setting, says):
    assert main(["estimate", str(table), "--input", setting]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert says in error


def test_what_the_node_took_off_already_is_said(tmp_path):
    path = tmp_path / "run"
    write_bag(path, MOVING_MASS.name, 0.2, presses())
    notes = loaded(path, "force.moving_mass=0.1", "force.damping=0.01").findings.notes
    assert "its samples are recorded less 0.2 kg already: 0.3 in all" in notes
    assert sum("already" in note for note in notes) == 1


@pytest.mark.parametrize("kind", ["wrench", "effort"])
def test_setup_writes_them_down(tmp_path, kind):
    time_s = np.arange(100) * 1e-2
    force = SensorProposal("z", (0.0, 0.0, 1.0), 1, "", 2.3, 0.01, 0.03, 1000.0)
    joint = SensorProposal("", (), 1, "j", 250.0, 0.04, 0.02, 100.0)
    mechanics = {"moving_mass": 0.3, "damping": 0.01, "dry_friction": 0.2, "presliding": 0.05}
    found = SetupProposal(force, joint, time_s, np.zeros(100), np.ones(100), (), np.nan, mechanics)
    streams = (Stream("/ft", kind, 1e3, "ft"), Stream("/joints", "joint", 100.0, ""))
    for given, name in ((found, "arm.yaml"), (found._replace(mechanics={}), "bare.yaml")):
        write_files(tmp_path / name, *streams, given, {})
        text = (tmp_path / name).read_text()
        told = yaml.safe_load(text)["estimator"]["ros__parameters"]["input"]
        written = told["force"] if kind == "wrench" else told["effort"]
        expected = mechanics if kind == "wrench" else {"mass": 0.3, **mechanics}
        for setting, value in expected.items():
            if kind == "effort" and setting in ("moving_mass", "presliding"):
                continue
            assert written.get(setting) == (value if given is found else None)
