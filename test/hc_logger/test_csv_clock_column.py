"""Times as on a clock are read in blocks, to the bit as one by one."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest

from hc_logger import csv_rows
from hc_logger.csv_clock_column import ClockColumn
from hc_logger.csv_file import CsvReader
from hc_logger.csv_finder import find_layout
from hc_logger.csv_rows import RowReader
from hc_logger.errors import BagError
from hc_logger.recording import read_recording

BEGUN = datetime(2026, 10, 24, 9, 41, 58)
ZONE = timezone(timedelta(hours=-3, minutes=-30))


def table(
    path: Path, form: Callable[[datetime], str], step_ms: float = 7.0, begun: datetime = BEGUN
) -> Path:
    """Write 1,200 rows of a clock; the last two times are a second apart, one row has no force."""
    rows = []
    for k in range(1200):
        now = begun + timedelta(milliseconds=step_ms * k + (1000.0 if k == 1199 else 0.0))
        rows.append(f"{form(now)};{k % 100 / 10};{'nan' if k == 700 else k % 90 / 40}\n")
    dated = form(BEGUN).count(";")
    path.write_text("Date;" * dated + "Time;Pos [mm];F [N]\n" + "".join(rows))
    return path


FORMS: dict[str, Callable[[datetime], str]] = {
    "clock": lambda t: f"{t:%H:%M:%S.%f}",
    "whole_seconds_bare": lambda t: t.isoformat(sep=" "),  # no fraction where it is zero
    "zone": lambda t: t.replace(tzinfo=ZONE).isoformat(timespec="milliseconds"),
    "comma": lambda t: f"{t:%d.%m.%Y %H:%M:%S},{t.microsecond // 1000:03d}",
    "colon": lambda t: f"{t:%H:%M:%S}:{t.microsecond // 1000:03d}",
    "beside": lambda t: f"{t:%Y/%m/%d};{t:%H:%M:%S.%f}",
    "minutes": lambda t: f"{t:%M:%S.%f}",
    "half": lambda t: f"{t:%I:%M:%S.%f %p}",
    "spaces": lambda t: f"  {t:%H:%M:%S.%f}Z ",
}


def one_by_one(path: Path, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    with monkeypatch.context() as patch:
        patch.setattr(ClockColumn, "elapsed_of", lambda self, rows: None)
        return np.concatenate(list(RowReader(path, find_layout(path)).blocks()))


@pytest.mark.parametrize("rows", [1200, 100, 7], ids="{}_rows".format)
@pytest.mark.parametrize("form", FORMS)
def test_blocks_give_the_bits_of_single_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str, rows: int
) -> None:
    path = table(tmp_path / "table.csv", FORMS[form])
    expected = one_by_one(path, monkeypatch)
    assert len(expected) == 1200
    slow = []
    monkeypatch.setattr(csv_rows, "BLOCK_ROWS", rows)
    monkeypatch.setattr(RowReader, "_parse_slowly", lambda *given: slow.append(given))
    found = np.concatenate(list(RowReader(path, find_layout(path)).blocks()))
    np.testing.assert_array_equal(found, expected)
    assert not slow  # all of it was read in blocks


@pytest.mark.parametrize(
    ("begun", "step_s"),
    [
        (datetime(2026, 10, 24, 23, 59, 50), 0.1),  # midnight
        (datetime(2026, 10, 24, 12, 0, 0), 1000.0),  # days of them
        (datetime(2026, 3, 29, 0, 59, 55), 3600.0),  # steps of an hour are no summer time
        (datetime(2026, 3, 29, 0, 59, 55), 3602.0),
    ],
    ids=["midnight", "days", "hours", "beyond_an_hour"],
)
@pytest.mark.parametrize("form", ["clock", "beside", "whole_seconds_bare", "zone", "half"])
def test_midnights_and_pauses_are_those_of_single_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str, begun: datetime, step_s: float
) -> None:
    path = table(tmp_path / "table.csv", FORMS[form], 1000.0 * step_s, begun)
    expected = one_by_one(path, monkeypatch)
    for rows in (1200, 130, 11):
        monkeypatch.setattr(csv_rows, "BLOCK_ROWS", rows)
        found = np.concatenate(list(RowReader(path, find_layout(path)).blocks()))
        np.testing.assert_array_equal(found, expected)
    true_s = step_s * np.arange(1199.0)
    np.testing.assert_allclose(found[:1199, 0], true_s, atol=1e-6 * step_s)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("09:60:00.000;1;1", "'09:60:00.000' instead of a number"),
        ("24:00:00.000;1;1", "'24:00:00.000' instead of a number"),
        ("10:00x00.000;1;1", "'10:00x00.000' instead of a number"),
        ("10:00:0/.000;1;1", "'10:00:0/.000' instead of a number"),
        ("10:00:0:.000;1;1", "'10:00:0:.000' instead of a number"),
        ("10:00:05.000 xm;1;1", "'10:00:05.000 xm' instead of a number"),
        ("10:00:05.000;1;one", "F [N] is 'one' instead of a number"),
        ("10:00:05.000;1", "2 columns, F [N] is number 3"),
    ],
)
def test_a_row_that_is_none_is_named_by_its_line(tmp_path: Path, line: str, said: str) -> None:
    path = table(tmp_path / "table.csv", lambda t: f"{t:%H:%M:%S}.{t.microsecond // 1000:03d}")
    lines = path.read_text().splitlines()
    lines.insert(1100, line)
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(BagError) as raised:
        read_recording(path)
    assert "line 1101" in str(raised.value)
    assert said in str(raised.value)


def test_cells_of_another_kind_are_read_one_by_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Quotation marks, halves of the day, missing times, digits of other scripts, blank lines."""
    path = table(tmp_path / "table.csv", FORMS["clock"])
    lines = path.read_text().splitlines()
    for k, change in {
        200: lambda row: f'"{row.split(";")[0]}";1;1',
        300: lambda row: row.replace(";", " am;", 1),
        400: lambda row: "-;" + row.split(";", 1)[1],
        500: lambda row: row.replace(
            "09", "\N{ARABIC-INDIC DIGIT ZERO}\N{ARABIC-INDIC DIGIT NINE}"
        ),
        600: lambda row: row + "\n",
    }.items():
        lines[k] = change(lines[k])
    path.write_text("\n".join(lines) + "\n")
    expected = one_by_one(path, monkeypatch)
    monkeypatch.setattr(csv_rows, "BLOCK_ROWS", 50)
    found = np.concatenate(list(RowReader(path, find_layout(path)).blocks()))
    np.testing.assert_array_equal(found, expected)
    assert np.isnan(found[399, 0])
    assert np.isnan(found[:, 0]).sum() == 1
    np.testing.assert_allclose(
        np.delete(found[:1199, 0], 399), np.delete(0.007 * np.arange(1199), 399)
    )


def test_a_date_beside_a_time_that_has_its_own_is_left_alone(tmp_path: Path) -> None:
    """Regression: both were joined, of which nobody could read a date."""
    path = tmp_path / "table.csv"
    rows = ["23.10.2026;24.10.2026 16:00:00.0;1;1\n", "23.10.2026;25.10.2026 09:00:00.0;1;1\n"]
    rows += [f"23.10.2026;25.10.2026 09:00:0{k}.5;1;1\n" for k in range(9)]
    path.write_text("Delivered;Time;Pos [mm];F [N]\n" + "".join(rows))
    time_s = np.asarray(read_recording(path).time_s)
    assert time_s[1] - time_s[0] == 17.0 * 3600.0
    assert not any("Delivered" in note for note in CsvReader(path).notes)
