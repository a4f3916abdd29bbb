"""What files and messages of others are called does nothing to a terminal."""

from __future__ import annotations

import io
import sys

import pytest

from hc_bringup import cli
from hc_bringup.plain_stream import drawing_on, make_plain
from hc_msgs_py.plain_text import in_one_line, visible


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[2J", "\\u001b[2J"),
        ("a\x07\x9b31m\x7f\r", "a\\u0007\\u009b31m\\u007f\\u000d"),
        ("gpj.\u202evsc", "gpj.\\u202evsc"),
        ("a\tb\nK = 1 ± 2 µm, ünï 漢 ▁█", "a\tb\nK = 1 ± 2 µm, ünï 漢 ▁█"),
    ],
)
def test_control_characters_are_shown_and_all_others_stay(text: str, shown: str) -> None:
    assert visible(text) == shown


def test_a_name_stays_in_its_line() -> None:
    assert in_one_line("/a\nProblem: none\x1b") == "/a\\u000aProblem: none\\u001b"


def test_who_draws_on_purpose_can() -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
    make_plain(stream)
    make_plain(stream)  # a second command of the same process
    print("\x1b[31m", end="", file=stream)
    print("\x1b[32m", end="", file=drawing_on(stream))
    stream.write("\x1b[0m")  # as colorama at the end
    assert drawing_on(stream).encoding == "utf-8"
    assert stream.buffer.getvalue() == b"\\u001b[31m\x1b[32m\x1b[0m"  # type: ignore[attr-defined]


@pytest.mark.parametrize("command", ["estimate", "doctor", "bag info"])
def test_the_name_of_a_file_does_not_reach_the_terminal_as_it_is(
    command: str, tmp_path, capsys
) -> None:
    """Regression: a file's, topic's or type's name could wipe lines and set title or clipboard."""
    path = tmp_path / "evil\x1b]0;owned\x07.csv"
    path.write_text("this,is,no,recording\n")
    assert cli.main([*command.split(), str(path)]) > 0
    said = capsys.readouterr()
    assert "\x1b" not in said.out + said.err
    assert "\x07" not in said.out + said.err
    assert "evil\\u001b]0;owned\\u0007.csv" in said.err
    assert "write" in vars(sys.stderr)
