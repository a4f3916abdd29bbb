"""Friction of a cannula in a recording: it is named, with its cost, and taken off as is said."""

import json
import re

import numpy as np
import pytest
from recordings_less import loaded, write_bag, write_table

from hc_bringup.cli import main
from hc_bringup.commands.doctor import _of_one_message, apply
from hc_bringup.diagnosis import diagnose
from hc_bringup.finding import Finding
from hc_estimator.stream.dry_friction import DRY_FRICTION, DryFriction

FRICTION_N, PRESLIDING_MM = 0.3, 0.05
K = 0.4


def presses(seed=1, count=12000, rate_hz=1000.0, zero_n=0.0):
    """Through a cannula into a tissue and back: stamps [s], displacements [mm], forces [N]."""
    random = np.random.default_rng(seed)
    time_s = np.arange(count) / rate_hz
    place = -2.0 + np.minimum(time_s, 1.0) * (3.0 - 3.0 * np.cos(np.pi * time_s))
    place += np.minimum(time_s, 1.0) * 0.7 * np.sin(10.7 * time_s)
    depth, velocity = np.maximum(place, 0.0), np.gradient(place, time_s)
    force = np.maximum(0.0, depth**1.5 * (K + 0.01 * velocity))
    middle = place[0]
    for k, now in enumerate(place.tolist()):
        middle = min(max(middle, now - PRESLIDING_MM), now + PRESLIDING_MM)
        force[k] += FRICTION_N * (now - middle) / PRESLIDING_MM + zero_n
    noise = random.standard_normal((2, count)) * [[0.003], [0.01]]
    return time_s, place + noise[0], force + noise[1]


@pytest.fixture
def table(tmp_path):
    return write_table(tmp_path / "cannula.csv", presses())


def test_the_doctor_names_it_and_what_it_cost(table, capsys):
    """K was a fraction of what it is, said to be known to 100 %, and nothing named friction."""
    assert main(["doctor", str(table), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    first = told["findings"][0]
    assert "N between sensor and tissue (a cannula" in first["what"]
    settings = first["settings"]
    assert settings["input.force.dry_friction"] == pytest.approx(FRICTION_N, rel=0.05)
    assert settings["input.force.presliding"] == pytest.approx(PRESLIDING_MM, rel=0.4)
    before = float(re.search(r"K was ([0-9.]+)", first["cost"])[1])
    assert abs(before / K - 1.0) > 0.15
    assert told["parameters"]["stiffness"] == pytest.approx(K, rel=0.01)
    assert not any("zero" in finding["what"] for finding in told["findings"])
    typed = [f"{name.removeprefix('input.')}={value}" for name, value in settings.items()]
    less = loaded(table, *typed)
    taken_off = settings["input.force.dry_friction"]
    assert less.findings.notes[-1].startswith(f"dry friction of {taken_off:g} N taken off; ")
    assert less.counted_once == ("force",)  # gaps on purpose: no rate is doubted for them
    friction = DryFriction(*(settings[f"input.force.{n}"] for n in ("dry_friction", "presliding")))
    as_it_stands = loaded(table)
    np.testing.assert_array_equal(
        less.force_n,
        as_it_stands.force_n - friction.of_many(as_it_stands.stamps, as_it_stands.displacement_mm),
    )
    assert 0.02 < np.mean(np.isnan(less.force_n)) < 0.3


def test_a_zero_that_is_off_is_that_of_the_middle():
    """That of the way in alone was off by the friction."""
    found = diagnose(*presses(zero_n=1.5))
    settings = {}
    for finding in found.findings:
        apply(settings, finding.settings)
    assert settings["force.zero"] == pytest.approx(1.5, abs=0.02)
    assert found.estimated.parameters[0] == pytest.approx(K, rel=0.01)


def test_a_delay_beside_it_is_named_first():
    """Regression: beside the gaps that friction leaves none was looked for."""
    time_s, place, force = presses()
    late = np.concatenate([np.full(30, force[0]), force[:-30]])
    found = diagnose(time_s, place, late)
    first, second = (finding.settings for finding in found.findings[:2])
    assert first == {"force.time_offset": pytest.approx(-0.03, abs=1e-3)}
    assert second["force.dry_friction"] == pytest.approx(FRICTION_N, rel=0.05)
    assert found.estimated.parameters[0] == pytest.approx(K, rel=0.01)
    assert found.estimated.mismatch < 0.1


def test_what_is_left_of_it_is_added_and_the_way_is_not():
    present = {"force.dry_friction": 0.2, "force.presliding": 0.01, "force.scale": 1.0}
    apply(present, {"force.dry_friction": 0.1, "force.presliding": 0.05})
    assert present["force.dry_friction"] == pytest.approx(0.3)
    assert present["force.presliding"] == 0.05
    apply(present, {"force.scale": 1e-3})
    assert present["force.dry_friction"] == pytest.approx(3e-4)


def test_of_a_motors_effort_it_is_the_joints():
    finding = Finding(
        "take it off (force.dry_friction)",
        {"force.dry_friction": 0.3, "force.presliding": 0.02, "force.zero": 0.1},
    )
    of_effort = _of_one_message(finding)
    assert of_effort.settings == {"effort.dry_friction": 0.3, "force.zero": 0.1}
    assert of_effort.what == "take it off (effort.dry_friction)"


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (("force.dry_friction=-0.1",), "is not a number from 0 to 1000 N"),
        (("force.dry_friction=nan",), "is not a number"),
        (("force.dry_friction=2000",), "is not a number from 0 to 1000 N"),
        (("force.dry_friction=100",), "by which the force changes: is it in N"),
        (("force.dry_friction=0.1", "force.presliding=0"), "is not a number from 0.0001 to 100"),
        (("force.presliding=0.1",), "force.dry_friction, which is not given"),
    ],
)
def test_what_cannot_be_is_one_line(table, capsys, settings, says):
    words = [word for setting in settings for word in ("--input", setting)]
    assert main(["estimate", str(table), *words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert says in error


def test_what_the_node_took_off_already_is_said(tmp_path):
    path = tmp_path / "run"
    write_bag(path, DRY_FRICTION.name, 0.2, presses(count=2000))
    notes = loaded(path, "force.dry_friction=0.1").findings.notes
    assert "its samples are recorded less 0.2 N already: 0.3 N in all" in notes
