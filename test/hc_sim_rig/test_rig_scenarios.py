"""Scenario files: what ships is sound, and whatever is wrong in a file is named in one line."""

from __future__ import annotations

import copy
import dataclasses
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from hc_bringup import cli
from hc_sim_rig import Rig, Scenario, ScenarioError, available_scenarios, load_scenario
from hc_sim_rig.drives import ProcessNoise
from hc_sim_rig.scenario import SCENARIO_FOLDER
from hc_sim_rig.schema import build

ROOT = Path(__file__).resolve().parents[2]
ISSUE_NAMES = {
    "indentation",
    "multisine",
    "step_hold",
    "needle_insertion",
    "teleoperation",
    "palpation_scan",
    "tissue_change",
    "free_space_contact",
}


def data_of(name: str) -> dict:
    return yaml.safe_load((SCENARIO_FOLDER / f"{name}.yaml").read_text())


def test_all_scenarios_are_there_and_reachable_from_config() -> None:
    assert set(available_scenarios()) >= ISSUE_NAMES
    assert {path.stem for path in (ROOT / "config" / "scenarios").glob("*.yaml")} == set(
        available_scenarios()
    )


@pytest.mark.parametrize("name", available_scenarios())
def test_every_scenario_loads_and_says_where_it_comes_from(name: str) -> None:
    scenario = load_scenario(name)
    text = (SCENARIO_FOLDER / f"{name}.yaml").read_text()
    assert scenario.name == name
    assert scenario.description
    assert "# Origin: " in text.split("description:")[0]


@pytest.mark.parametrize("name", available_scenarios())
def test_every_scenario_has_its_picture_in_the_documentation(name: str) -> None:
    assert f"pictures/rig_{name}.png" in (ROOT / "docs" / "rig.md").read_text()
    assert (ROOT / "docs" / "pictures" / f"rig_{name}.png").is_file()


# What no shipped scenario may ask of a stage or an arm: the fastest is step_hold's 1000 mm/s^2.
LARGEST_ACCELERATION_MM_S2 = 1500.0
# Scenarios whose point is a tissue that lets go of the tool, or that stays dented behind it.
LETS_GO = {"relaxation", "teleoperation"}


@pytest.mark.parametrize("name", available_scenarios())
def test_every_scenario_is_physically_possible(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.tissue.kind != "adhesive"
    truth = Rig(scenario).run().truth
    assert truth.force_n.min() >= 0.0
    assert np.all(truth.force_n[truth.displacement_mm <= 0.0] == 0.0)
    pressing = truth.displacement_mm > 0.0
    assert pressing.any()
    left = float(np.mean(truth.force_n[pressing] == 0.0))
    assert 0.0 < left < 0.1 if name in LETS_GO else left == 0.0
    if name == "teleoperation":  # paper C's process noise kicks the velocity at every sample
        quiet = dataclasses.replace(scenario.drive, process_noise=ProcessNoise())
        truth = Rig(dataclasses.replace(scenario, drive=quiet)).run().truth
    acceleration = np.diff(truth.velocity_mm_s) * scenario.rate_hz
    assert np.abs(acceleration).max() < LARGEST_ACCELERATION_MM_S2


def test_path_and_name_give_the_same_scenario(tmp_path: Path) -> None:
    copy_of = tmp_path / "mine.yaml"
    copy_of.write_text((SCENARIO_FOLDER / "multisine.yaml").read_text())
    mine = load_scenario(copy_of)
    assert mine.name == "mine"
    assert dataclasses.replace(mine, name="multisine") == load_scenario("multisine")


@pytest.mark.parametrize(
    ("path", "value", "needles"),
    [
        (("tisue",), {}, ["tisue", "tissue"]),
        (("tissue", "stifness"), 1.0, ["tissue", "stifness", "stiffness"]),
        (("tissue", "stiffness"), -1.0, ["tissue.stiffness", "-1", "from 0 to 1e+06"]),
        (("tissue", "stiffness"), "1e-1", ["tissue.stiffness", "1e-1", "number"]),
        (("tissue", "stiffness"), True, ["tissue.stiffness", "True"]),
        (("tissue", "stiffness"), float("nan"), ["tissue.stiffness", "nan"]),
        (("tissue", "stiffness"), 10**400, ["tissue.stiffness", "a number from 0"]),
        (("tissue", "kind"), "jelly", ["tissue.kind", "jelly", "hunt_crossley"]),
        (("tissue", "preset"), "jelly", ["tissue.preset", "jelly", "ecoflex_0030"]),
        (("tissue",), 3, ["tissue", "3", "mapping"]),
        (("rate_hz",), 0.0, ["rate_hz", "0", "20000"]),
        (("substeps",), 1.5, ["substeps", "1.5", "an integer"]),
        (("seed",), -1, ["seed", "-1"]),
        (("at_end",), "never", ["at_end", "never", "stop", "loop"]),
        (("duration_s",), 0, ["duration_s", "above 0 to 1e+06 s"]),
        (("drive", "motion", "components"), [], ["drive.motion", "components"]),
        (("drive", "motion", "components"), 3, ["drive.motion.components", "list"]),
        (
            ("drive", "motion", "components"),
            [{"amplitude": 1.0, "frequency_hz": 0.0}],
            ["drive.motion.components[0]", "frequency_hz"],
        ),
        (("drive", "dynamics"), "magic", ["drive.dynamics", "magic"]),
        (("drive", "process_noise"), {"enters": "velocity"}, ["process_noise", "servo"]),
        (("sensors", "force", "range_minimum"), 2e9, ["sensors.force.range_minimum"]),
        (("sensors", "force", "delay_s"), 0.3, ["sensors.force.delay_s", "0.3"]),
        (("sensors", "force", "dropouts"), {"reads": "zero"}, ["dropouts.reads", "zero"]),
        (("tissue", "inclusion"), {"centre_mm": 1.0, "width_mm": 1.0, "stiffness_factor": 2.0},
         ["inclusion", "lateral"]),
        (("tissue", "changes"), [{"time_s": 2.0, "duration_s": 2.0}, {"time_s": 3.0}],
         ["tissue.changes", "3 s", "2 s"]),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_in_one_line(
    path: tuple[str, ...], value: object, needles: list[str], tmp_path: Path
) -> None:
    data = copy.deepcopy(data_of("multisine"))
    place = data
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    file = tmp_path / "broken.yaml"
    file.write_text(yaml.safe_dump(data))
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file)
    message = str(caught.value)
    assert "\n" not in message
    for needle in ["broken.yaml", *needles]:
        assert needle in message


@pytest.mark.parametrize(
    ("text", "needle"),
    [
        ("a: [", "YAML"),
        ("- 1\n- 2\n", "mapping"),
        ("", "mapping"),
        ("description: only\n", "drive"),
    ],
)
def test_a_file_that_is_no_scenario_is_refused(text: str, needle: str, tmp_path: Path) -> None:
    file = tmp_path / "broken.yaml"
    file.write_text(text)
    with pytest.raises(ScenarioError, match=needle) as caught:
        load_scenario(file)
    assert "\n" not in str(caught.value)


HUGE = 10**400
"""No float64 holds it, and a line with its 400 digits helps nobody."""


@pytest.mark.parametrize(
    "motion",
    [
        {"kind": "waypoints", "points": [[0.0, HUGE]]},
        {"kind": "waypoints", "points": [[HUGE, 1.0]]},
        {"kind": "step_hold", "step_mm": 1.0, "velocity_mm_s": 10.0, "times_s": [0.0, HUGE]},
    ],
)
def test_a_whole_number_beyond_every_float_is_refused(motion: dict[str, object]) -> None:
    data = data_of("multisine")
    data["drive"] = {"kind": "stage", "motion": motion}
    with pytest.raises(ScenarioError, match=r"motion.(points|times_s) has .*must be") as caught:
        build(Scenario, data)
    assert len(str(caught.value)) < 120


@pytest.mark.parametrize(("start", "rupture"), [(0.0, 1e-320), (0.0, 1e-200), (5.0, 5.0000001)])
def test_a_layer_too_thin_for_a_stiffness_is_refused(start: float, rupture: float) -> None:
    data = data_of("needle_insertion")
    data["tissue"]["layers"] = [{"start_mm": start, "rupture_mm": rupture, "peak_n": 1.0}]
    with pytest.raises(ScenarioError, match=r"layers.*at least 1e-06 mm deeper") as caught:
        build(Scenario, data)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"multisin'.*multisine"):
        load_scenario("multisin")
    with pytest.raises(ScenarioError, match=r"nowhere\.yaml"):
        load_scenario(tmp_path / "nowhere.yaml")
    (tmp_path / "broken.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ScenarioError, match="broken"):
        load_scenario(tmp_path / "broken.yaml")


def test_a_loop_must_close(tmp_path: Path) -> None:
    data = data_of("multisine")
    data.update(at_end="loop", duration_s=9.9)
    with pytest.raises(ScenarioError, match=r"loop.*duration_s 9\.9"):
        build(Scenario, data)
    data["duration_s"] = 10.0
    assert build(Scenario, data).at_end == "loop"


def test_a_preset_fills_in_and_own_values_win() -> None:
    data = data_of("silicone_indentation")
    sensor = build(Scenario, data).sensors.force
    assert (sensor.resolution, sensor.range_maximum) == (0.003125, 17.0)
    data["sensors"]["force"]["range_maximum"] = 5.0
    sensor = build(Scenario, data).sensors.force
    assert (sensor.resolution, sensor.range_maximum) == (0.003125, 5.0)


JUNK = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-10, 10)
    | st.floats()
    | st.text(max_size=5)
    | st.sampled_from(["stage", "hunt_crossley", "teleoperation", "force", "gamma", "true"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["kind", "points", "shape", "stiffness", "components", "layers", "x"]),
            inner,
            max_size=4,
        )
    ),
    max_leaves=8,
)


def places(data: object, path: tuple = ()) -> list[tuple]:
    found = [path] if path else []
    items = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in items:
        found += places(value, (*path, key)) if isinstance(value, (dict, list)) else [(*path, key)]
    return found


@settings(max_examples=150)
@given(name=st.sampled_from(available_scenarios()), junk=JUNK, where=st.integers(0, 10**6))
def test_junk_anywhere_is_a_scenario_or_one_line(name: str, junk: object, where: int) -> None:
    data = data_of(name)
    every = places(data)
    path = every[where % len(every)]
    place = data
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = junk
    message = ""
    try:
        Rig(build(Scenario, data))
    except ScenarioError as error:
        message = str(error)
    assert "\n" not in message


def test_a_change_that_comes_too_late_to_happen_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Regression: a change at 15 s of a scenario of 10 s (the default) silently never happened."""
    path = tmp_path / "late.yaml"
    path.write_text(yaml.safe_dump(data_of("tissue_change") | {"duration_s": 20.0}))
    said = "scenario late: tissue.changes has changes at 20, 40 s, and it ends at 20 s (duration_s)"
    assert load_scenario(path).never_happens().startswith(said)
    for name in available_scenarios():
        assert not load_scenario(name).never_happens()
    assert cli.main(["simulate", str(path), "-o", str(tmp_path / "a.csv")]) == 0
    assert said in capsys.readouterr().err.replace("\n", " ")
    arguments = [str(path), "-o", str(tmp_path / "b.csv"), "--duration", "1"]
    assert cli.main(["simulate", *arguments]) == 0
    assert not capsys.readouterr().err


def test_what_loops_begins_anew_before_a_change_that_comes_later() -> None:
    data = data_of("multisine") | {"at_end": "loop", "duration_s": 10.0}
    for time_s, happens in ((5.0, True), (15.0, False)):
        data["tissue"]["changes"] = [{"time_s": time_s, "stiffness_factor": 2.0}]
        scenario = build(Scenario, data)
        assert ("begins anew at 10 s" in scenario.never_happens()) is not happens
        assert bool(np.ptp(Rig(scenario).run(20.0).truth.parameters[:, 0])) is happens
