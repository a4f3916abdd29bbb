"""The table of hc estimate -o is what its name says."""

from __future__ import annotations

import bz2
import gzip
import importlib.util
import lzma
from pathlib import Path

import numpy as np
import pytest

from hc_bringup import estimate_table
from hc_bringup.cli import main


@pytest.fixture
def press(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    time = np.arange(600) / 500.0
    depth = 3.0 + np.sin(9.0 * time)
    rows = np.column_stack([time, depth, 0.4 * depth**1.6 * (1.0 + 0.3 * np.cos(9.0 * time))])
    header = "time_s,displacement_mm,force_N"
    np.savetxt("press.csv", rows, delimiter=",", header=header, comments="")
    return "press.csv"


@pytest.mark.parametrize(
    ("suffix", "opened"), [(".gz", gzip.open), (".bz2", bz2.open), (".XZ", lzma.open)]
)
def test_a_compressed_name_gets_a_compressed_file(press: str, suffix: str, opened) -> None:
    """Regression: plain CSV under the name x.csv.gz, which nothing would open."""
    name = f"out.csv{suffix}"
    assert main(["estimate", press, "--filter", "ekf", "-o", "out.csv"]) == 0
    assert main(["estimate", press, "--filter", "ekf", "-o", name]) == 0
    with opened(name) as file:
        assert file.read() == Path("out.csv").read_bytes()
    assert sorted(p.name for p in Path().iterdir()) == ["out.csv", name, "press.csv"]


def test_parquet_is_written_with_the_same_columns_and_numbers(press: str) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    assert main(["estimate", press, "--filter", "ekf", "-o", "out.csv"]) == 0
    assert main(["estimate", press, "--filter", "ekf", "-o", "out.parquet"]) == 0
    table = parquet.read_table("out.parquet")
    assert ",".join(table.column_names) == estimate_table.COLUMNS
    stiffness = np.genfromtxt("out.csv", delimiter=",", skip_header=1, usecols=3)
    np.testing.assert_array_equal(table.column(3).to_numpy(), stiffness)


@pytest.mark.parametrize("name", ["out.xlsx", "out", "out.gz", "out.csv.zip"])
def test_what_is_not_written_is_refused_before_anything_is_computed(
    press: str, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    assert main(["estimate", press, "-o", name]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"{name} must end in .csv, .csv.gz" in said
    assert not Path(name).exists()


def test_parquet_without_its_library_says_how_to_install_it(
    press: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    assert main(["estimate", press, "-o", "out.parquet"]) == 1
    assert "needs pyarrow: pip install hc-suite[parquet]" in capsys.readouterr().err
