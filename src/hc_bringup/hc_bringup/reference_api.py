"""The page of the Python interface: what the packages export, from its docstrings.

Only what a package names in `__all__` is promised to those who import it; the rest may change.
"""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterator
from typing import Any, Final

MODULES: Final = ("hc_estimator", "hc_estimator.contact", "hc_sim_rig", "hc_sim_rig.bilateral")
_ANNOTATION: Final = re.compile(r"""(: |-> )(['"])(.*?)\2(?=[,)]| =|$)""")
_SECTION: Final = re.compile(r"^(Args|Returns|Raises|Yields|Attributes):$")


def api_page(written: str) -> str:
    """Every exported class and function, with signature and docstring.

    Args:
        written: the line that says how the page is made.
    """
    lines = ["# Python", "", written, ""]
    lines += [
        "Lengths are in mm, speeds in mm/s, forces in N, times in s, unless a name says else."
    ]
    lines += [""]
    for name in MODULES:
        module = importlib.import_module(name)
        lines += [f"## {name}", "", *_text(module)]
        for exported in module.__all__:
            lines += _object(exported, getattr(module, exported))
    return "\n".join(lines).rstrip() + "\n"


def _object(name: str, thing: Any) -> list[str]:
    """A class with its public members, or a function; a value has no docstring of its own."""
    if inspect.isclass(thing):
        lines = [f"### class {name}", "", *_text(thing)]
        for shown, member in _members(thing):
            lines += [f"**`{shown}`**", "", *_text(member)]
        return lines
    if callable(thing):
        return [f"### {name}", "", f"`{_call(name, thing)}`", "", *_text(thing)]
    value = repr(thing) if isinstance(thing, (str, tuple)) else f"a {type(thing).__name__}"
    return [f"### {name}", "", f"`{value}`", ""]


def _members(kind: type) -> Iterator[tuple[str, Any]]:
    """Public methods as they are called, and properties with their type."""
    for name, member in vars(kind).items():
        if name.startswith("_"):
            continue
        if isinstance(member, property):
            yield f"{name}: {member.fget.__annotations__.get('return', 'Any')}", member
            continue
        if isinstance(member, (classmethod, staticmethod)):
            member = member.__func__
        if inspect.isfunction(member) and member.__doc__:
            yield _call(name, member), member


def _call(name: str, thing: Any) -> str:
    signature = inspect.signature(thing)
    ours = [p for p in signature.parameters.values() if p.name not in ("self", "cls")]
    # A default that is an object prints an address; the parameter's name says enough.
    named = [p.replace(default="...") if " at 0x" in repr(p.default) else p for p in ours]
    # Annotations that are not evaluated print as strings; defaults that are strings stay so.
    return name + _ANNOTATION.sub(r"\1\3", str(signature.replace(parameters=named)))


def _text(thing: Any) -> list[str]:
    """A docstring as Markdown: its sections become lists."""
    lines: list[str] = []
    inside = False
    for line in inspect.cleandoc(thing.__doc__ or "").splitlines():
        if found := _SECTION.match(line):
            inside = True
            lines += ["", f"*{found[1]}:*", ""]
        elif inside and line.startswith("    ") and not line.startswith("     "):
            lines.append(f"- {_plain(line.strip())}")
        elif inside and line.strip():
            lines.append(f"  {_plain(line.strip())}")
        else:
            inside = inside and not line
            lines.append(_plain(line))
    return [*lines, ""]


def _plain(line: str) -> str:
    """Keep what Markdown would take for marks of its own, outside of code."""
    parts = line.split("`")
    parts[::2] = [re.sub(r"([*_<\[])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)
