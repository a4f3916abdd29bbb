"""Writes the parameter tables of docs/estimators.md from the specifications.

`python -m hc_estimator.documentation docs/estimators.md` replaces what stands between the two
marks in the file; a test sees to it that nobody forgets.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from hc_estimator import screening
from hc_estimator.contact import registry as contact_registry
from hc_estimator.filters.registry import FILTERS
from hc_estimator.kinds import parameter_specifications
from hc_estimator.specification import ParameterSpecification, ParameterValue
from hc_estimator.state_space import registry as state_space_registry

BEGIN = "<!-- parameters: written by python -m hc_estimator.documentation -->"
END = "<!-- end of parameters -->"


def _value(value: ParameterValue | float | None) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:g}" if isinstance(value, (int, float)) else str(value)


def _range(specification: ParameterSpecification) -> str:
    if specification.kind == "bool":
        return "true, false"
    if specification.kind == "str":
        return ", ".join(specification.choices)
    return f"{_value(specification.minimum)} to {_value(specification.maximum)}"


def _table(
    specifications: Iterable[ParameterSpecification],
    used_by: dict[str, list[str]] | None = None,
    internal: Sequence[str] = (),
) -> list[str]:
    head = ["parameter", "unit", "default", "range", "effect"]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for s in specifications:
        effect = s.description
        if used_by is not None:
            effect += f" *({', '.join(used_by[s.name])})*"
        if not s.runtime:
            effect += " Fixed while running."
        if s.name in internal:
            effect += " No parameter of the node."
        unit = "" if s.unit == "1" else s.unit
        cells = [f"`{s.name}`", unit, _value(s.default), _range(s), effect]
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return [*lines, ""]


def _differing_defaults() -> list[str]:
    lines = ["| filter | state space | defaults of its own |", "|---|---|---|"]
    for name, entry in FILTERS.items():
        for space in entry.state_spaces:
            own = entry.defaults.get(space, {})
            known = {s.name for s in parameter_specifications(name, space)}
            pairs = [f"`{key}` {_value(own[key])}" for key in own if key in known]
            if pairs:
                lines.append(f"| {name} | {space} | {', '.join(pairs)} |")
    return [*lines, ""]


def _merged(
    first: ParameterSpecification, second: ParameterSpecification
) -> ParameterSpecification:
    """The one with more choices, saying which filters lack some of them."""
    if len(first.choices) == len(second.choices):
        return first
    more, less = sorted((first, second), key=lambda s: -len(s.choices))
    without = [
        name
        for name, entry in FILTERS.items()
        if any(s.name == less.name and s.choices == less.choices for s in entry.specifications)
    ]
    missing = ", ".join(choice for choice in more.choices if choice not in less.choices)
    note = f" {', '.join(without)} have no {missing}."
    return dataclasses.replace(more, description=more.description.removesuffix(note) + note)


def parameter_tables() -> str:
    """All parameters as Markdown tables, by where they come from."""
    used_by: dict[str, list[str]] = {}
    shared: dict[str, ParameterSpecification] = {}
    for name, entry in FILTERS.items():
        for s in entry.specifications:
            used_by.setdefault(s.name, []).append(name)
            shared[s.name] = _merged(shared.get(s.name, s), s)
    lines = ["### Samples that are refused or bridged (all filters)", ""]
    lines += _table(screening.SPECIFICATIONS)
    lines += ["### First guess and drift of the parameters (both state spaces)", ""]
    lines += _table(state_space_registry.COMMON_SPECIFICATIONS)
    common = set(state_space_registry.COMMON_SPECIFICATIONS)
    for space, specifications in state_space_registry.SPECIFICATIONS.items():
        lines += [f"### State space `{space}`", ""]
        lines += _table(s for s in specifications if s not in common)
    for model, specifications in contact_registry.SPECIFICATIONS.items():
        lines += [f"### Contact model `{model}`", ""]
        lines += _table(specifications)
    lines += ["### Shared by several filters", ""]
    lines += _table((s for s in shared.values() if len(used_by[s.name]) > 1), used_by)
    for name in FILTERS:
        own = [s for s in shared.values() if used_by[s.name] == [name]]
        if own:
            lines += [f"### Filter `{name}`", ""]
            lines += _table(own, internal=FILTERS[name].internal)
    lines += ["### Where defaults differ", ""]
    lines += ["A filter's own defaults replace those of the tables above.", ""]
    lines += _differing_defaults()
    return "\n".join(lines).rstrip() + "\n"


def with_tables(text: str) -> str:
    """The page with the part between the marks written anew.

    Raises:
        ValueError: the page lacks one of the marks.
    """
    if BEGIN not in text or END not in text:
        raise ValueError(f"the page needs the lines {BEGIN} and {END}")
    before, rest = text.split(BEGIN, 1)
    after = rest.split(END, 1)[1]
    return f"{before}{BEGIN}\n\n{parameter_tables()}\n{END}{after}"


def main() -> None:
    """Rewrite the tables in the file named on the command line."""
    if len(sys.argv) != 2:
        sys.exit("usage: python -m hc_estimator.documentation docs/estimators.md")
    page = Path(sys.argv[1])
    page.write_text(with_tables(page.read_text()))


if __name__ == "__main__":
    main()
