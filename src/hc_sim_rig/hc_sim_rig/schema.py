"""Checked dataclasses: each field carries its unit, range or choices, and says so when broken.

A scenario is a tree of such sections. The same checks run whether it comes from a YAML file or is
built in Python, and every error is one line with the name, the value and what is allowed.
"""

from __future__ import annotations

import dataclasses
import difflib
import types
import typing
from collections.abc import Mapping
from typing import Any, TypeVar, get_args, get_origin

import numpy as np

from hc_msgs_py.specification import ParameterSpecification

S = TypeVar("S", bound="Section")


class ScenarioError(ValueError):
    """A scenario that cannot be: one line that says what is wrong and what is allowed."""


def number(
    default: float | None = None,
    *,
    minimum: float = -1e9,
    maximum: float = 1e9,
    above: float | None = None,
    unit: str = "",
    about: str = "",
) -> Any:
    """Field for a finite number.

    Args:
        default: its value when a scenario does not name it; None makes the field required.
        minimum: smallest allowed value.
        maximum: largest allowed value.
        above: if given, the value must lie strictly above it.
        unit: unit, for error messages and the documentation.
        about: one phrase for the documentation.
    """
    return _field(
        ParameterSpecification(
            "", "float", default, about, minimum=minimum, maximum=maximum, above=above, unit=unit
        )
    )


def word(default: str | None, *choices: str, about: str = "") -> Any:
    """Field for one of several words."""
    return _field(ParameterSpecification("", "str", default, about, choices=choices))


def _field(specification: ParameterSpecification) -> Any:
    metadata = {"specification": specification}
    if specification.default is None:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=specification.default, metadata=metadata)


def specification_of(field: dataclasses.Field[Any]) -> ParameterSpecification | None:
    """What a field of a section may be; None for a section, a list or a plain text or flag."""
    given: ParameterSpecification | None = field.metadata.get("specification")
    if given is None:
        return None
    whole = given.kind == "float" and field.type in ("int", int)
    return dataclasses.replace(given, name=field.name, kind="int" if whole else given.kind)


def section(factory: Any = dataclasses.MISSING, about: str = "") -> Any:
    """Field for a section of its own; with a factory it may be left out."""
    if factory is dataclasses.MISSING:
        return dataclasses.field(metadata={"about": about})
    return dataclasses.field(default_factory=factory, metadata={"about": about})


@dataclasses.dataclass(frozen=True)
class Section:
    """Base of all sections: checks its values when made."""

    def __post_init__(self) -> None:
        """Check every field against its type and metadata.

        Raises:
            ScenarioError: if a value is of the wrong kind or out of range.
        """
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            specification = specification_of(field)
            if specification is not None:
                fraction = specification.kind == "int" and isinstance(value, (float, np.floating))
                if fraction or specification.accepted(value) is None:
                    raise ScenarioError(
                        f"{field.name} is {short(value)}, must be {specification.allowed}"
                    )
            elif field.type in ("bool", bool) and not isinstance(value, bool):
                raise ScenarioError(f"{field.name} is {value!r}, must be true or false")
            elif field.type in ("str", str) and not isinstance(value, str):
                raise ScenarioError(f"{field.name} is {value!r}, must be a text")


def build(kind: type[S], data: Any, path: str = "") -> S:
    """Make a section from what a YAML file holds.

    A class with PRESETS takes the values of the preset that the data names, unless the data give
    their own.

    Args:
        kind: the section's class.
        data: a mapping of its keys.
        path: where the section stands, for error messages (for example "tissue").

    Returns:
        The checked section.

    Raises:
        ScenarioError: names the first unknown key, missing key or impossible value.
    """
    here = path or "the scenario"
    if not isinstance(data, Mapping):
        raise ScenarioError(f"{here} is {short(data)}, must be a mapping of keys to values")
    hints = typing.get_type_hints(kind)
    fields = {field.name: field for field in dataclasses.fields(kind)}
    for key in data:
        if key not in fields:
            close = difflib.get_close_matches(str(key), fields, n=1)
            guess = f" (did you mean {close[0]}?)" if close else ""
            known = ", ".join(fields)
            raise ScenarioError(f"{here} has no key {str(key)!r}{guess}; known: {known}")
    name = data.get("preset")
    if isinstance(name, str):
        data = {**getattr(kind, "PRESETS", {}).get(name, {}), **data}
    values: dict[str, Any] = {}
    for key, field in fields.items():
        where = f"{path}.{key}" if path else key
        if key in data:
            values[key] = _convert(hints[key], data[key], where)
        elif field.default is dataclasses.MISSING and (
            field.default_factory is dataclasses.MISSING
        ):
            raise ScenarioError(f"{where} is missing in the scenario")
    try:
        return kind(**values)
    except ScenarioError as error:
        prefix = f"{path}." if path else ""
        raise ScenarioError(f"{prefix}{error}") from None


def json_schema(kind: type[Section]) -> dict[str, Any]:
    """What `build` takes for a section, as a JSON schema (draft 2020-12), for editors."""
    hints = typing.get_type_hints(kind)
    properties, required = {}, []
    for field in dataclasses.fields(kind):
        specification = specification_of(field)
        if specification is not None:
            schema = specification.json_schema()
            if type(None) in get_args(hints[field.name]):
                schema = {"anyOf": [schema, {"type": "null"}]}
        else:
            schema = _schema_of_type(hints[field.name])
            about = field.metadata.get("about")
            schema |= {"description": about} if about else {}
        properties[field.name] = schema
        if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            required.append(field.name)
    whole: dict[str, Any] = {
        "type": "object",
        "properties": properties,
        "additionalProperties": False,
    }
    if not hasattr(kind, "PRESETS"):  # a preset gives what is not named
        whole["required"] = required
    return whole


def _schema_of_type(hint: Any) -> dict[str, Any]:
    """The same of a field without a specification: sections, lists, texts and flags."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return {"anyOf": [_schema_of_type(option) for option in arguments if _possible(option)]}
    if origin is tuple:
        return {"type": "array", "items": _schema_of_type(arguments[0])}
    if isinstance(hint, type) and issubclass(hint, Section):
        return json_schema(hint)
    names = {str: "string", bool: "boolean", int: "integer", float: "number", dict: "object"}
    names |= {type(None): "null"}
    return {"type": names[hint]} if hint in names else {}


def _possible(kind: Any) -> bool:
    """Whether there is any: no tissue of another package where none is installed."""
    fields = dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else ()
    named = [field.metadata["specification"] for field in fields if field.name == "kind"]
    return not named or bool(named[0].choices)


def _convert(hint: Any, value: Any, where: str) -> Any:
    """Turn plain YAML data into what a field's type asks for; scalars are checked later."""
    origin = get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        options = [option for option in get_args(hint) if option is not type(None)]
        if value is None and type(None) in get_args(hint):
            return None
        sections = [o for o in options if isinstance(o, type) and issubclass(o, Section)]
        if sections:
            return _convert_variant(sections, value, where)
        return value
    if origin is tuple:
        if not isinstance(value, (list, tuple)):
            raise ScenarioError(f"{where} is {short(value)}, must be a list")
        inner = get_args(hint)[0]
        return tuple(_convert(inner, entry, f"{where}[{i}]") for i, entry in enumerate(value))
    if isinstance(hint, type) and issubclass(hint, Section):
        return build(hint, value, where)
    if origin is dict and not isinstance(value, dict):
        raise ScenarioError(f"{where} is {short(value)}, must be a mapping of keys to values")
    if hint is float and isinstance(value, str):
        raise ScenarioError(f"{where} is {value!r}, must be a number (in YAML 1.0e-3, 1.0e+6)")
    return value


def _convert_variant(kinds: list[type[Section]], value: Any, where: str) -> Section:
    """Pick among several sections by the key that tells them apart (`kind`)."""
    if not isinstance(value, Mapping):
        raise ScenarioError(f"{where} is {short(value)}, must be a mapping of keys to values")
    if len(kinds) == 1:
        return build(kinds[0], value, where)
    by_name = {
        name: kind
        for kind in kinds
        for field in dataclasses.fields(kind)
        if field.name == "kind"
        for name in field.metadata["specification"].choices
    }
    name = value.get("kind")
    if not isinstance(name, str) or name not in by_name:
        raise ScenarioError(f"{where}.kind is {name!r}, must be one of {', '.join(by_name)}")
    return build(by_name[name], value, where)


def short(value: Any) -> str:
    """A value as an error says it, cut off where it is long."""
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
