"""What is said of how a CSV file is written and cannot be is wrong use, whatever the command."""

from pathlib import Path

import pytest

from hc_bringup.cli import main

WRONG = (
    (["--units", "time=x"], "'x' is no unit of time: give s, ms, us, ns, min, d"),
    (["--units", "force=mm"], "'mm' is no unit of force"),
    (["--columns", "force=nope"], "no column is called 'nope'; it has 'time_s', "),
    (["--columns", "force=9"], "no column is called '9'"),
    (["--separator", "abc"], "'abc' is no separator: give one of comma, "),
    (["--encoding", "nope"], "'nope' is no encoding"),
    (["--rate", "100", "--units", "time=s"], "a rate is for a file that tells no time"),
)
COMMANDS = {
    "estimate": [],
    "doctor": [],
    "report": ["-o", "page.html"],
    "compare": ["--filter", "ukf", "--filter", "ekf", "-o", "page.html"],
    "contacts": ["-o", "contacts.csv"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_value_that_cannot_be_is_wrong_use(
    press_table, tmp_path: Path, monkeypatch, capsys, command: str
) -> None:
    """Regression: status 1, and 2 only where the form was wrong."""
    path = press_table("table.csv", lambda t, d, f: (t, d, f))
    monkeypatch.chdir(tmp_path)
    for words, expected in WRONG:
        assert main([command, str(path), *COMMANDS[command], *words]) == 2, words
        (line,) = capsys.readouterr().err.splitlines()
        assert expected in line


@pytest.mark.parametrize(("words", "expected"), WRONG)
def test_so_it_is_for_what_is_converted(
    press_table, tmp_path: Path, capsys, words: list[str], expected: str
) -> None:
    path = press_table("table.csv", lambda t, d, f: (t, d, f))
    assert main(["bag", "convert", str(path), str(tmp_path / "bag"), *words]) == 2
    assert expected in capsys.readouterr().err
    assert not (tmp_path / "bag").exists()


def test_a_batch_refuses_a_unit_that_is_none_before_it_begins(
    press_table, tmp_path: Path, capsys
) -> None:
    path = press_table("table.csv", lambda t, d, f: (t, d, f))
    assert main(["batch", str(path), "-o", str(tmp_path / "b"), "--units", "time=x"]) == 2
    assert "'x' is no unit of time" in capsys.readouterr().err
    assert not (tmp_path / "b").exists()
