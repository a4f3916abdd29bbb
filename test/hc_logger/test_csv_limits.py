"""CSV files that are too large to be read, or that no memory holds: refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from hc_logger.errors import BagError
from hc_logger.recording import read_recording


def test_a_line_without_end_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "endless.csv"
    with open(path, "wb") as file:
        file.write(b"time_s,displacement_mm,force_N\n0,1,2\n")
        file.write(b"9" * 3_000_000)
        file.truncate(10**11)  # a sparse file of 100 GB
    with pytest.raises(BagError, match=r"has more than 1048576 characters|is not a text file"):
        read_recording(path)


def test_a_cell_that_is_too_long_for_the_csv_module(tmp_path: Path) -> None:
    text = 'time_s,displacement_mm,force_N\n0,1,2\n0.1,"' + "9" * 200_000 + '",3\n'
    path = tmp_path / "long.csv"
    path.write_text(text)
    with pytest.raises(BagError, match="line 3 cannot be read: field larger than field limit"):
        read_recording(path)


def test_the_limit_of_memory_is_a_setting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "rows.csv"
    path.write_text("time_s,displacement_mm,force_N\n" + "0,1,2\n" * 50_000)
    assert len(read_recording(path).time_s) == 50_000
    monkeypatch.setenv("HC_LARGEST_RECORDING_MIB", "1")
    with pytest.raises(BagError, match="more than 1 MiB: set HC_LARGEST_RECORDING_MIB"):
        read_recording(path)
    monkeypatch.setenv("HC_LARGEST_RECORDING_MIB", "much")
    with pytest.raises(BagError, match="is no size"):
        read_recording(path)
