"""YAML of others: plain data, or one line; never long, never large, never a traceback."""

import os
import random
import threading
import time
import tracemalloc
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from hc_msgs_py.plain_yaml import PlainYamlError, load_plain_yaml, read_plain_yaml

LAUGHS = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 12)
)
MERGES = "a0: &a0 {k: 1}\n" + "".join(
    f"a{k}: &a{k} {{<<: [*a{k - 1}, *a{k - 1}], b{k}: {{<<: *a{k - 1}}}}}\n" for k in range(1, 40)
)

plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.text(st.characters(codec="utf-8", exclude_categories=("C",))),
    lambda inner: (
        st.lists(inner, max_size=5)
        | st.dictionaries(st.text("abcdef_", min_size=1), inner, max_size=5)
    ),
    max_leaves=20,
)


@given(plain)
def test_plain_data_comes_back(value: Any) -> None:
    assert load_plain_yaml(yaml.safe_dump(value)) == value


def test_aliases_stand_for_their_values() -> None:
    shared = {"depth": 1}
    text = yaml.safe_dump([shared, shared])
    assert "*" in text
    assert load_plain_yaml(text) == [shared, shared]


def test_what_a_mapping_merges_it_may_say_otherwise() -> None:
    text = "x: &x {a: 1}\nb: &b {<<: *x, a: 2}\nc: [{<<: *b}, {<<: [*b, *x], a: 4}]\n"
    assert load_plain_yaml(text) == {"x": {"a": 1}, "b": {"a": 2}, "c": [{"a": 2}, {"a": 4}]}


def test_a_date_is_a_text() -> None:
    assert load_plain_yaml("[2001-12-14, 2001-12-14t21:59:43.10-05:00]") == [
        "2001-12-14",
        "2001-12-14t21:59:43.10-05:00",
    ]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (LAUGHS, "more than 1000000 values"),
        (MERGES, "more than 1000000 values"),
        ("[" * 3000, "nested deeper than 64"),
        ("[" * 300_000, "nested deeper than 64"),
        ("{a: " * 3000, "nested deeper than 64"),
        ("- " * 3000 + "x", "nested deeper than 64"),
        ("x: " + "9" * 10_000, "digits"),
        ("&a [*a]", "contains itself"),
        ("!!timestamp 2001-12-14", "not plain data"),
        ("!!binary aGVsbG8=", "not plain data"),
        ("!!set {a, b}", "not plain data"),
        ("!!python/object/apply:os.system [ls]", "could not determine a constructor"),
        ("!!bool maybe", ""),
        ("!!int ''", ""),
        ("!!float x", ""),
        ("a: b: c", "mapping values are not allowed"),
        ("a: 1\n--- \nb: 2", "expected a single document"),
        ("\0", ""),
        ("\ud800", ""),
        ("{[1]: 2}", "unhashable"),
        ("a: 1\nb: {c: 1, d: 2, c: 3}", "c stands there twice"),
        ("x" * (16 * 1024 * 1024 + 1), "longer than"),
    ],
)
def test_what_is_not_plain_is_one_short_line(text: str, reason: str) -> None:
    begin = time.process_time()
    with pytest.raises(PlainYamlError) as caught:
        load_plain_yaml(text)
    line = str(caught.value)
    assert reason in line
    assert 0 < len(line) <= 200
    assert line.isprintable()
    assert time.process_time() - begin < 20.0


def test_a_bomb_takes_no_memory() -> None:
    tracemalloc.start()
    with pytest.raises(PlainYamlError):
        load_plain_yaml(LAUGHS)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5_000_000


def test_files(tmp_path: Path) -> None:
    path = tmp_path / "file.yaml"
    path.write_bytes("\ufeffa: ä".encode())
    assert read_plain_yaml(path) == {"a": "ä"}
    path.write_bytes(b"a: \xff")
    with pytest.raises(PlainYamlError, match="not a text file in UTF-8"):
        read_plain_yaml(path)
    with open(path, "wb") as file:
        file.truncate(10**12)  # a sparse file of a terabyte
    with pytest.raises(PlainYamlError, match="longer than"):
        read_plain_yaml(path)


def refusal(text: str) -> str:
    """Read a text; return what was said against it."""
    try:
        load_plain_yaml(text)
    except PlainYamlError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("count", [300, pytest.param(20_000, marks=pytest.mark.slow)])
def test_mutated_files_are_data_or_one_line(count: int) -> None:
    """The shipped configuration, broken at random."""
    rng = random.Random(1)
    root = Path(__file__).resolve().parents[2]
    texts = [path.read_text() for path in sorted((root / "config").glob("*.yaml"))] + [LAUGHS]
    pieces = ["[", "{", "]", "}", "&a", "*a", "!!", "!!int", "<<:", "\t", "\n", ":", "-", "? ", "|"]
    pieces += ["1e999", "9" * 5000, "2001-01-01", "\x00", "\u2028", "''", '"', "%", "---\n", "~"]
    for _ in range(count):
        text = rng.choice(texts)
        for _ in range(rng.randint(1, 6)):
            at = rng.randrange(len(text) + 1)
            text = text[:at] + rng.choice(pieces) * rng.choice((1, 1, 2, 50)) + text[at:]
        assert refusal(text).isprintable()


def test_a_pipe_is_read_to_its_end(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    text = "a: " + "x" * 300_000  # more than a pipe holds
    writer = threading.Thread(target=pipe.write_text, args=(text,), daemon=True)
    writer.start()
    assert read_plain_yaml(pipe) == {"a": "x" * 300_000}
    writer.join(5.0)


def test_a_pipe_that_nobody_writes_to_ends_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: `hc param load NODE PIPE` waited for good without a word."""
    monkeypatch.setattr("hc_msgs_py.plain_yaml.PIPE_WAIT_S", 0.2)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(OSError, match="it is a pipe that nobody wrote to") as caught:
        read_plain_yaml(pipe)
    assert caught.value.strerror == "it is a pipe that nobody wrote to for 0.2 s: give a file"
