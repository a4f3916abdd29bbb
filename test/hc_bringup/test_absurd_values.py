"""Values of options that nobody can mean: one line that says what is wrong, and nothing written."""

from __future__ import annotations

from pathlib import Path

import pytest

from hc_bringup.cli import main


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        # Regression: "0 samples written", status 0.
        ("simulate multisine -o x.csv --duration 1e-9", "no sample is taken in it, at 1000 Hz"),
        # Regression: a folder of that name, with a bag in it.
        ("simulate multisine -o x.csv.gz", "give a name that ends in .csv"),
        # Regression: "is not seconds >= 0".
        ("contacts x.csv --minimum-depth -1 -o y.csv", "'-1' is not millimetres >= 0"),
        ("contacts x.csv --minimum-force nan -o y.csv", "'nan' is not newtons >= 0"),
    ],
)
def test_one_line_and_nothing_written(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    words: str,
    expected: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        status = main(words.split())
    except SystemExit as end:
        status = int(end.code or 0)
    told = capsys.readouterr()
    assert (status, told.out, told.err.count("\n")) == (2, "", 1)
    assert expected in told.err
    assert list(tmp_path.iterdir()) == []


def test_a_simulation_says_that_it_leaves_out_the_taxels(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Regression: a bag without a tactile sample, and not a word."""
    for scenario, said in (("taxels", "holds the tip alone"), ("multisine", "")):
        assert (
            main(["simulate", scenario, "-o", f"{tmp_path / scenario}", "--duration", "0.1"]) == 0
        )
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == bool(said)
