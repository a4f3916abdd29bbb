"""The end of a CSV file whose logger was killed: what was cut is no row, what is whole is one."""

from __future__ import annotations

from pathlib import Path

import pytest
from table_text import write

from hc_logger.csv_rows import BLOCK_ROWS
from hc_logger.recording import read_recording


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-be"])
@pytest.mark.parametrize("rest", ["9", "9,1"])
@pytest.mark.parametrize("count", [60, 9000])
def test_a_last_line_that_was_cut_off_is_left_out_and_said(
    tmp_path: Path, encoding: str, rest: str, count: int
) -> None:
    table = "".join(f"{k / 1e3},1,2\n" for k in range(count))
    text = f"time_s,displacement_mm,force_N\n{table}{rest}"
    recording = read_recording(write(tmp_path / "cut.csv", text, encoding))
    assert len(recording.time_s) == count
    assert recording.findings.lines() == ["the last line is cut off in its middle: it is left out"]
    whole = read_recording(write(tmp_path / "whole.csv", f"{text},2"[: -len(rest) - 2], encoding))
    assert whole.findings.lines() == []


def four_decimals(k: int) -> str:
    return f"{12.0 + k / 7:.4f}"


@pytest.mark.parametrize(
    ("form", "cut"),
    [
        (four_decimals, "12."),
        (four_decimals, "12"),
        (four_decimals, "12.345"),
        (four_decimals, "-"),
        (four_decimals, ""),
        (lambda k: f"{(k + 1) / 700:.6e}", "1.23"),
        (lambda k: f"{(k + 1) / 700:.6e}", "1.234567e-"),
        (lambda k: repr(12.0 + (k + 0.5) / 7.31), "12.3"),
        (lambda k: "" if k % 5 == 4 else four_decimals(k), "12.3"),
    ],
)
@pytest.mark.parametrize("more", ["", ",7"])
def test_a_last_number_that_was_cut_is_no_reading(tmp_path: Path, form, cut, more) -> None:
    """Regression: "12." of "12.3456" was read as 12 where a logger had been killed."""
    table = "".join(f"{k / 1e3:.3f},{k / 50:.4f},{form(k)}{more}\n" for k in range(60))
    head = "time_s,displacement_mm,force_N" + (",valve" if more else "") + "\n"
    recording = read_recording(write(tmp_path / "cut.csv", f"{head}{table}0.060,1.2000,{cut}"))
    assert len(recording.time_s) == 60
    (line,) = [one for one in recording.findings.lines() if "alone" not in one]
    assert line == (
        f"the last line has no end, and its number {cut!r} less than the others in its column: "
        "it was cut off, and is left out"
    )


@pytest.mark.parametrize(
    ("form", "last", "end"),
    [
        (four_decimals, "12.", "\n"),
        (four_decimals, "12.3456", ""),
        (lambda k: f"{k:d}", "7", ""),
        (lambda k: f"{k / 4:g}", "12", ""),
        (lambda k: repr(k / 7), "12.34567890123456", ""),
    ],
)
def test_a_last_line_that_seems_complete_is_read(tmp_path: Path, form, last, end) -> None:
    table = "".join(f"{k / 1e3:.3f},{k / 50:.4f},{form(k)}\n" for k in range(60))
    text = f"time_s,displacement_mm,force_N\n{table}0.060,1.2000,{last}{end}"
    recording = read_recording(write(tmp_path / "whole.csv", text))
    assert recording.force_n[60] == float(last)
    assert recording.findings.lines() == []


@pytest.mark.parametrize("more", [0, 1, 5])
def test_a_number_that_was_cut_is_seen_where_a_block_begins(tmp_path: Path, more: int) -> None:
    """Regression: of the last block fewer than eight lines were there to compare with."""
    count = BLOCK_ROWS + more
    table = "".join(f"{k / 1e3:.3f},{k / 50:.4f},{four_decimals(k)}\n" for k in range(count))
    text = f"time_s,displacement_mm,force_N\n{table}{count / 1e3:.3f},1.2000,12."
    recording = read_recording(write(tmp_path / "cut.csv", text))
    assert len(recording.time_s) == count
    assert any("cut off" in line for line in recording.findings.lines())


def test_a_last_row_without_a_cell_that_others_lack_too_is_read(tmp_path: Path) -> None:
    """Regression: of a table with remarks here and there the last row was called cut off."""
    rows = [f"{k / 1e3:.3f},{k / 50:.4f},{four_decimals(k)}" for k in range(61)]
    remarks = [",touched" if k % 9 == 4 else "" for k in range(61)]
    table = "\n".join(row + remark for row, remark in zip(rows, remarks, strict=True))
    text = f"time_s,displacement_mm,force_N,remark\n{table}"
    recording = read_recording(write(tmp_path / "remarks.csv", text))
    assert len(recording.time_s) == 61
    assert not any("cut off" in line for line in recording.findings.lines())
