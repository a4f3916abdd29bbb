"""Lines at a terminal break between words; in files and pipes they stay whole."""

import os
import pty
import subprocess
import sys

from hc_bringup.wrapping import wrapped

TEXT = "  K = 0.5003 ± 0.00056  100 % known from the data  (stiffness)\nshort\n\n" + "word " * 30


def test_every_word_stays_in_one_piece_and_no_line_is_wider_than_the_terminal() -> None:
    for width in (30, 60, 110):
        lines = wrapped(TEXT, width).split("\n")
        assert max(map(len, lines)) < width
        assert " ".join(lines).split() == TEXT.split()
    assert wrapped("  " + "a " * 40, 60).split("\n")[1].startswith("    a")


def test_a_word_that_is_too_long_and_lines_that_fit_are_left_alone() -> None:
    topic = "/" + "a_very_long_namespace/" * 5
    assert topic in wrapped(f"no force topic {topic}", 40)
    assert wrapped("spaced   as   a   table", 40) == "spaced   as   a   table"


def test_nothing_is_broken_where_no_terminal_is() -> None:
    assert wrapped(TEXT) == TEXT  # pytest captures: no terminal


def test_a_terminal_has_its_own_width() -> None:
    master, slave = pty.openpty()
    code = "from hc_bringup.wrapping import say; say('word ' * 30)"
    subprocess.run(
        [sys.executable, "-c", code],
        stdout=slave,
        env=os.environ | {"COLUMNS": "40"},
        check=True,
        timeout=60,
    )
    os.close(slave)
    lines = os.read(master, 4096).decode().split("\r\n")
    os.close(master)
    assert len(lines) > 3
    assert max(map(len, lines)) < 40
