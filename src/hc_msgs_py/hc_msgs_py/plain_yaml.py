"""YAML of others as plain data: safe to read whatever it holds.

PyYAML's safe_load runs no code, but a few hundred bytes can make it need minutes and gigabytes
(anchors that multiply, "billion laughs"), and deep brackets, numbers of ten thousand digits, dates
and tags end in errors of many kinds. Here a text is first gone through event by event, which takes
no memory, and then read; every way it can be wrong is one kind of error with one line.
"""

from __future__ import annotations

import errno
import os
import select
import stat
from pathlib import Path
from typing import Any, Final

import yaml

LARGEST_BYTES: Final = 16 * 1024 * 1024
MOST_VALUES: Final = 1_000_000
"""With every alias counted as what it stands for."""
DEEPEST: Final = 64
LONGEST_REASON: Final = 200
PIPE_WAIT_S: Final = 3.0
"""For what a pipe brings; whoever makes a file with a command is quicker."""

MERGE: Final = "tag:yaml.org,2002:merge"
_Base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_REFUSED: Final = ("binary", "timestamp", "omap", "pairs", "set")


class PlainYamlError(ValueError):
    """A text is no YAML that can be read as plain data; one line that says why."""


class _PlainLoader(_Base):  # type: ignore[misc]
    """Reads lists, mappings, texts, numbers, booleans and null; a date is a text.

    A key that stands twice is refused: PyYAML would take the last one, and what stands under the
    first one would be ignored without a word.
    """

    def flatten_mapping(self, node: Any) -> None:
        """Put what a mapping merges (<<) among its pairs; before, it has its own alone."""
        if not hasattr(node, "has_own_keys"):
            node.has_own_keys = True
            _refuse_twice(node)
        super().flatten_mapping(node)


def _refuse_twice(mapping: Any) -> None:
    seen = set()
    for key, _ in mapping.value:
        if isinstance(key, yaml.ScalarNode) and key.tag != MERGE:
            if (key.tag, key.value) in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"{key.value} stands there twice", key.start_mark
                )
            seen.add((key.tag, key.value))


_PlainLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if not tag.endswith(":timestamp")]
    for first, resolvers in _Base.yaml_implicit_resolvers.items()
}


def _refuse(_loader: Any, node: Any) -> Any:
    raise yaml.constructor.ConstructorError(
        None, None, f"a value of type {node.tag} is not plain data", node.start_mark
    )


for _name in _REFUSED:
    _PlainLoader.add_constructor(f"tag:yaml.org,2002:{_name}", _refuse)


def read_plain_yaml(path: Path) -> Any:
    """Return what a YAML file holds, as load_plain_yaml().

    Raises:
        OSError: if it cannot be read, or is a pipe that brings nothing.
        PlainYamlError: if it is too long, not UTF-8, or not such YAML.
    """
    content = _content(path)
    if len(content) > LARGEST_BYTES:
        raise PlainYamlError(f"it is longer than {LARGEST_BYTES} bytes")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise PlainYamlError("it is not a text file in UTF-8") from None
    return load_plain_yaml(text)


def _content(path: Path) -> bytes:
    """Return up to a byte more than is allowed; a pipe is waited for, and not for ever."""
    if not stat.S_ISFIFO(os.stat(path).st_mode):
        with open(path, "rb") as file:
            return file.read(LARGEST_BYTES + 1)
    content = b""
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb", 0) as pipe:
        while len(content) <= LARGEST_BYTES:
            if not select.select([pipe], [], [], PIPE_WAIT_S)[0]:
                reason = f"it is a pipe that nobody wrote to for {PIPE_WAIT_S:g} s: give a file"
                raise TimeoutError(errno.ETIMEDOUT, reason)
            block = pipe.read(1 << 16)
            if not block:
                break
            content += block
    return content


def load_plain_yaml(text: str) -> Any:
    """Return the value of a YAML text: lists, dictionaries, texts, numbers, booleans, None.

    Raises:
        PlainYamlError: if it is not such YAML, too deep, or too large once its aliases are
            replaced by what they stand for.
    """
    if len(text) > LARGEST_BYTES:
        raise PlainYamlError(f"it is longer than {LARGEST_BYTES} characters")
    try:
        _measure(text)
        return yaml.load(text, Loader=_PlainLoader)
    except PlainYamlError:
        raise
    except yaml.YAMLError as error:
        raise PlainYamlError(_one_line(error)) from None
    # What PyYAML's constructors let through: too many digits, a tag on something it does not fit.
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
        raise PlainYamlError(_one_line(error) or type(error).__name__) from None


def _measure(text: str) -> None:
    """Go through the events of a text and refuse what would be too deep or too large."""
    weights: dict[str, int] = {}  # of anchors
    unfinished: set[str] = set()
    stack: list[tuple[str | None, int]] = []  # anchor and weight of what is open
    total = 0

    def add(weight: int) -> None:
        nonlocal total
        total += weight
        if stack:
            anchor, before = stack[-1]
            stack[-1] = (anchor, before + weight)
        if total > MOST_VALUES:
            raise PlainYamlError(f"it holds more than {MOST_VALUES} values (aliases counted)")

    for event in yaml.parse(text, Loader=_Base):
        if isinstance(event, yaml.AliasEvent):
            name = str(event.anchor)
            if name in unfinished:
                raise PlainYamlError(f"&{name[:40]} contains itself")
            add(weights.get(name, 1))
        elif isinstance(event, yaml.ScalarEvent):
            if event.anchor is not None:
                weights[event.anchor] = 1
            add(1)
        elif isinstance(event, yaml.CollectionStartEvent):
            if event.anchor is not None:
                unfinished.add(event.anchor)
            stack.append((event.anchor, 1))
            if len(stack) > DEEPEST:
                raise PlainYamlError(f"it is nested deeper than {DEEPEST}")
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, weight = stack.pop()
            if anchor is not None:
                weights[anchor] = weight
                unfinished.discard(anchor)
            if stack:  # its parts were counted in the total already
                outer, before = stack[-1]
                stack[-1] = (outer, before + weight)


def _one_line(error: BaseException) -> str:
    line = " ".join(str(error).split())
    return "".join(c if c.isprintable() else "?" for c in line)[:LONGEST_REASON]
