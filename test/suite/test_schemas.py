"""The JSON schemas for editors take every file of config/, and refuse what the programs refuse."""

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from hc_msgs_py.specification import ParameterSpecification
from hc_sim_rig import ScenarioError, load_scenario

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "docs" / "reference"
PARAMETERS = json.loads((REFERENCE / "parameters.schema.json").read_text())
SCENARIO = json.loads((REFERENCE / "scenario.schema.json").read_text())
PARAMETER_FILES = sorted(
    path for path in (ROOT / "config").glob("**/*.yaml") if "ros__parameters" in path.read_text()
)
SCENARIO_FILES = sorted((ROOT / "config" / "scenarios").glob("*.yaml"))
TYPES = {
    "object": dict,
    "array": list,
    "string": str,
    "boolean": bool,
    "integer": int,
    "number": (int, float),
    "null": type(None),
}


def wrong(value: Any, schema: dict[str, Any], where: str = "") -> Iterator[str]:
    """What a value breaks, of the keywords that the suite's schemas use."""
    known = {"$schema", "title", "description", "default", "type", "properties", "required"}
    known |= {"patternProperties", "additionalProperties", "anyOf", "const", "enum", "items"}
    known |= {"minimum", "maximum", "exclusiveMinimum"}
    assert schema.keys() <= known
    if "anyOf" in schema and all([*wrong(value, option)] for option in schema["anyOf"]):
        yield f"{where}: {value!r} is none of the variants"
    if "const" in schema and value != schema["const"]:
        yield f"{where}: {value!r} is not {schema['const']!r}"
    kind = schema.get("type")
    flag = isinstance(value, bool) and kind != "boolean"
    if kind is not None and (flag or not isinstance(value, TYPES[kind])):
        yield f"{where}: {value!r} is no {kind}"
        return
    if "enum" in schema and value not in schema["enum"]:
        yield f"{where}: {value!r} is not one of {schema['enum']}"
    if isinstance(value, (int, float)):
        low = schema.get("minimum", -math.inf)
        above = schema.get("exclusiveMinimum", -math.inf)
        if not low <= value <= schema.get("maximum", math.inf) or value <= above:
            yield f"{where}: {value!r} is out of range"
    if isinstance(value, list):
        for entry in value:
            yield from wrong(entry, schema.get("items", {}), f"{where}[]")
    if isinstance(value, dict):
        yield from (
            f"{where}: no {name}" for name in schema.get("required", ()) if name not in value
        )
        for name, entry in value.items():
            if name in schema.get("properties", {}):
                yield from wrong(entry, schema["properties"][name], f"{where}.{name}")
            elif schema.get("additionalProperties", True) is False and name != "use_sim_time":
                yield f"{where}: {name} is unknown"


def test_there_are_files_to_check() -> None:
    assert len(PARAMETER_FILES) >= 4
    assert len(SCENARIO_FILES) >= 10


@pytest.mark.parametrize("path", PARAMETER_FILES, ids=lambda p: p.name)
def test_every_parameter_file_of_ours_is_allowed(path: Path) -> None:
    assert not [*wrong(yaml.safe_load(path.read_text()), PARAMETERS)]


@pytest.mark.parametrize("path", SCENARIO_FILES, ids=lambda p: p.stem)
def test_every_scenario_of_ours_is_allowed(path: Path) -> None:
    assert not [*wrong(yaml.safe_load(path.read_text()), SCENARIO)]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"filtre": "ukf"}, "filtre is unknown"),
        ({"filter": "ufk"}, "'ufk' is not one of"),
        ({"input": {"silence_timeout": 0.0}}, "0.0 is out of range"),
        ({"input.silence_timeout": "long"}, "'long' is no number"),
        ({"input": {"force": {"zerro": 1.0}}}, "zerro is unknown"),
    ],
)
def test_a_slip_in_a_parameter_file_is_seen(given: dict[str, Any], told: str) -> None:
    problems = [*wrong({"estimator": {"ros__parameters": given}}, PARAMETERS)]
    assert any(told in problem for problem in problems)


@pytest.mark.parametrize(
    ("section", "key", "value"),
    [(None, "rate_hz", 0.5), (None, "duration_s", 0.0), ("tissue", "kind", "wood")],
)
def test_what_a_scenario_refuses_its_schema_refuses(
    section: str | None, key: str, value: object, tmp_path: Path
) -> None:
    data = yaml.safe_load((ROOT / "config" / "scenarios" / "multisine.yaml").read_text())
    (data if section is None else data[section])[key] = value
    path = tmp_path / "broken.yaml"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(ScenarioError):
        load_scenario(path)
    assert [*wrong(data, SCENARIO)]


@pytest.mark.parametrize(
    ("kind", "limits", "good", "bad"),
    [
        ("float", {"minimum": 0.0, "maximum": 2.0}, [0, 2.0, 1.5], [-0.1, 2.1, "1", True, None]),
        ("float", {"above": 0.0}, [1e-9, 1e300], [0.0, -1.0, math.nan, math.inf]),
        ("int", {"minimum": 1, "maximum": 3}, [1, 3], [0, 4, 1.5, "2", 10**400]),
        ("bool", {}, [True, False], [1, "true", None]),
        ("str", {"choices": ("a", "b")}, ["a"], ["c", 1]),
        ("str", {}, ["", "anything"], [1, None]),
        ("auto", {"minimum": 0.0, "maximum": 1.0}, ["auto", 0.5, "0.5"], ["often", 2.0, True]),
        ("numbers", {}, [[], [1, 2.5]], ["12", [True], ["1"], 3]),
        ("texts", {}, [[], ["a"]], ["a", [1]]),
    ],
)
def test_one_validator_for_all_kinds(
    kind: Any, limits: dict[str, Any], good: list[Any], bad: list[Any]
) -> None:
    specification = ParameterSpecification("x", kind, None, "what it does", unit="mm", **limits)
    for value in good:
        specification.checked(value)
    for value in bad:
        with pytest.raises(ValueError, match="parameter x = ") as caught:
            specification.checked(value)
        assert str(caught.value).endswith(f" is not {specification.allowed}")
