"""Times as spreadsheets and clocks write them: days, and minutes with seconds."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from table_text import DEPTH, FORCE, TIME, rows, write

from hc_logger.csv_clock import Calendar
from hc_logger.csv_file import CsvReader
from hc_logger.csv_number import time_of_day
from hc_logger.csv_options import CsvOptions
from hc_logger.csv_vocabulary import split_name, unit_of
from hc_logger.errors import BagError
from hc_logger.recording import read_recording

DAY_S = 86_400.0
HEAD = "time,displacement_mm,force_N\n"


def read(path: Path, options: CsvOptions | None = None) -> np.ndarray:
    columns = read_recording(path, csv_options=options)
    return np.asarray(columns.time_s) - columns.time_s[0]


def test_the_days_of_a_spreadsheet_are_known_by_their_size(tmp_path: Path) -> None:
    """Regression: they were seconds, and the advice was to say that they are."""
    table = HEAD + rows("{:.11f},{:.4f},{:.5f}", 45992.35 + TIME / DAY_S, DEPTH, FORCE)
    path = write(tmp_path / "table.csv", table)
    np.testing.assert_allclose(read(path), TIME - TIME[0], atol=2e-6)
    notes = CsvReader(path).notes
    assert "time has no unit: taken for the days that a spreadsheet counts" in notes


@pytest.mark.parametrize("name", ["Time [d]", "time_d", "Time (days)", "time"])
def test_days_are_a_unit_of_time(tmp_path: Path, name: str) -> None:
    table = f"{name},Pos [mm],F [N]\n" + rows("{:.11f},{:.4f},{:.5f}", TIME / DAY_S, DEPTH, FORCE)
    path = write(tmp_path / "table.csv", table)
    options = CsvOptions(units={"time": "d"}) if name == "time" else None
    np.testing.assert_allclose(read(path, options), TIME - TIME[0], atol=2e-6)


def test_a_d_elsewhere_is_no_day() -> None:
    assert unit_of("d") is unit_of("D") is unit_of("d", "displacement") is None
    assert unit_of("d", "time") == unit_of("Days", "time") == "d"
    assert split_name("position_d", "time") == ("position d", None)


def clock(seconds: float, digits: int = 3) -> str:
    minutes, rest = divmod(round(seconds, digits), 60.0)
    return f"{int(minutes):02d}:{rest:0{3 + digits}.{digits}f}"


@pytest.mark.parametrize(
    ("start", "hour"), [(5.0, 3600.0), (3599.97, 3600.0), (3599.97, np.inf)], ids=str
)
def test_minutes_and_seconds_are_read(tmp_path: Path, start: float, hour: float) -> None:
    """A spreadsheet shows mm:ss.0 of a time of day: it begins anew each hour, a timer does not."""
    shown = [clock((start + t) % hour) for t in TIME]
    lines = [f"{t},{d:.4f},{f:.5f}" for t, d, f in zip(shown, DEPTH, FORCE, strict=True)]
    path = write(tmp_path / "table.csv", HEAD + "\n".join(lines) + "\n")
    np.testing.assert_allclose(read(path), TIME - TIME[0], atol=1e-9)


def test_a_clock_with_hours_does_not_begin_anew_at_each(tmp_path: Path) -> None:
    lines = [f"10:{clock(t)},{d:.4f},{f:.5f}" for t, d, f in zip(TIME, DEPTH, FORCE, strict=True)]
    lines.insert(0, "10:59:59.000,0,0")
    path = write(tmp_path / "table.csv", HEAD + "\n".join(lines) + "\n")
    assert read_recording(path).time_s[1] == pytest.approx(-3599.0 + TIME[0])


def test_hours_and_minutes_are_not_taken_for_minutes_and_seconds(tmp_path: Path) -> None:
    assert time_of_day("12:34") is None
    assert time_of_day("12:74.5") is None
    assert time_of_day("75:03,25") == 4503.25
    with pytest.raises(BagError):
        read_recording(write(tmp_path / "table.csv", HEAD + "12:34,1,2\n12:35,1,2\n"))


def test_summer_time_that_ends_is_no_step_where_the_zone_is_told(tmp_path: Path) -> None:
    """Regression: the clock was an hour back from there on (2026-10-25, three o'clock)."""
    assert time_of_day("2026-10-25T02:59:59.5+02:00") == 3599.5
    assert time_of_day("2026-10-25T02:00:00.5+01:00") == 3600.5
    assert time_of_day("00:30:00-0330") == 4.0 * 3600.0
    assert time_of_day("00:30:00 +01:00") == 23.5 * 3600.0
    assert time_of_day("12:00:01Z") == time_of_day("12:00:01") == 43201.0
    begun = datetime(2026, 10, 25, 0, 59, 58, tzinfo=timezone.utc)
    rows = []
    for k in range(400):
        now = begun + timedelta(milliseconds=10 * k)
        zone = timezone(timedelta(hours=2 if k < 200 else 1))
        rows.append(f"{now.astimezone(zone).isoformat(timespec='milliseconds')},{k / 100},1.5\n")
    path = tmp_path / "autumn.csv"
    path.write_text("timestamp,displacement_mm,force_N\n" + "".join(rows))
    time_s = read_recording(path).time_s
    np.testing.assert_allclose(np.diff(time_s), 0.01, atol=1e-6)


def night(path: Path, begun: datetime, offsets: tuple[int, int]) -> Path:
    """Write 400 rows of 10 ms whose local clock is put to another offset after 200 of them."""
    rows = []
    for k in range(400):
        local = begun + timedelta(milliseconds=10 * k, hours=offsets[k >= 200])
        rows.append(f"{local.isoformat(timespec='milliseconds')},{k / 100},1.5\n")
    path.write_text("timestamp,displacement_mm,force_N\n" + "".join(rows))
    return path


@pytest.mark.parametrize(
    ("begun", "offsets", "said"),
    [
        (
            datetime(2026, 10, 25, 0, 59, 58),
            (2, 1),
            "goes back by an hour, as summer time ends (02:59:59.990, then 02:00:00)",
        ),
        (
            datetime(2026, 3, 29, 0, 59, 58),
            (1, 2),
            "leaves an hour out, as summer time begins (01:59:59.990, then 03:00:00)",
        ),
    ],
)
def test_a_local_clock_that_is_put_back_or_forward_goes_on(
    tmp_path: Path, begun: datetime, offsets: tuple[int, int], said: str
) -> None:
    """Regression: 200 rows had "a time before that of the row before", an hour of them."""
    recording = read_recording(night(tmp_path / "night.csv", begun, offsets))
    np.testing.assert_allclose(np.diff(recording.time_s), 0.01, atol=1e-6)
    assert recording.findings.backward == 0
    assert any(said in note for note in recording.findings.notes)


@pytest.mark.parametrize(
    ("hour", "offsets"),
    [(12, (2, 1)), (0, (2, 0)), (12, (1, 2))],
    ids=["at noon", "two hours", "at noon, forward"],
)
def test_a_clock_that_steps_otherwise_is_taken_at_its_word(
    tmp_path: Path, hour: int, offsets: tuple[int, int]
) -> None:
    begun = datetime(2026, 10, 25, hour, 59, 58)
    time_s = read_recording(night(tmp_path / "night.csv", begun, offsets)).time_s
    hours = offsets[1] - offsets[0]
    assert time_s[200] - time_s[199] == pytest.approx(0.01 + 3600.0 * hours, abs=1e-6)


def test_an_hour_that_is_not_full_is_a_pause_or_a_step(tmp_path: Path) -> None:
    begun = datetime(2026, 10, 25, 0, 30, 0)
    time_s = read_recording(night(tmp_path / "night.csv", begun, (2, 1))).time_s
    assert time_s[200] - time_s[199] == pytest.approx(-3599.99, abs=1e-6)


@pytest.mark.parametrize(
    "form",
    [
        "%Y-%m-%d %H:%M:%S.%f",
        "%Y-%m-%dT%H:%M:%S.%f+02:00",
        "%d.%m.%Y %H:%M:%S.%f",
        "%m/%d/%Y %I:%M:%S.%f %p",
        "%d/%m/%Y %H:%M:%S.%f",
        "%d-%b-%Y %H:%M:%S.%f",
        "%y-%m-%d %H:%M:%S.%f",
    ],
)
@pytest.mark.parametrize(
    "pause", [timedelta(hours=17), timedelta(hours=24), timedelta(days=2, hours=3)]
)
def test_a_table_that_goes_on_another_day_has_a_pause_of_that_length(
    tmp_path: Path, form: str, pause: timedelta
) -> None:
    """Regression: dates were passed over; the next morning was seven hours before the evening."""
    begun = datetime(2026, 1, 31, 16, 0, 0)
    moments = [begun + timedelta(milliseconds=10 * k) + pause * (k >= 200) for k in range(400)]
    rows = [f"{moment.strftime(form)},{k / 100},1.5\n" for k, moment in enumerate(moments)]
    path = tmp_path / "days.csv"
    path.write_text("timestamp,displacement_mm,force_N\n" + "".join(rows))
    recording = read_recording(path)
    expected = [(moment - begun).total_seconds() for moment in moments]
    np.testing.assert_allclose(recording.time_s, expected, atol=1e-6)
    assert recording.findings.backward == 0


@pytest.mark.parametrize(
    ("before", "after", "days"),
    [
        ("2026-02-28", "2026-03-01", 1),
        ("28.02.2028", "01.03.2028", 2),
        ("01/02/2026", "02/02/2026", 1),
        ("01/02/2026", "01/03/2026", 1),
        ("31/01/2026", "01/02/2026", 1),
        ("31-Dez-2026", "01-Jan-2027", 1),
        ("2026-10-25", "2026-10-24", -1),
        ("99-99-99", "2026-01-01", None),
        ("2026-13-45", "2026-13-46", None),
        ("10-Foo-2026", "11-Foo-2026", None),
    ],
)
def test_days_are_counted_in_whichever_order_dates_are_written(
    before: str, after: str, days: int | None
) -> None:
    assert Calendar().days(before, after) == days


def test_what_one_pair_of_dates_rules_out_stays_so() -> None:
    calendar = Calendar()
    assert calendar.days("30/01/2026", "31/01/2026") == 1
    assert calendar.days("01/02/2026", "01/03/2026") == 28


def test_midnight_is_counted_where_the_date_is_that_of_the_start(tmp_path: Path) -> None:
    """As some programs write it: the date of the beginning stands beside every time."""
    rows = [f"2026-05-01 23:59:59.{k:03d},1,1.5\n" for k in range(0, 1000, 10)]
    rows += [f"2026-05-01 00:00:00.{k:03d},1,1.5\n" for k in range(0, 1000, 10)]
    path = tmp_path / "night.csv"
    path.write_text("timestamp,displacement_mm,force_N\n" + "".join(rows))
    np.testing.assert_allclose(np.diff(read_recording(path).time_s), 0.01, atol=1e-6)


@pytest.mark.parametrize("order", ["before", "behind"])
def test_a_date_in_a_cell_beside_the_time_counts_too(tmp_path: Path, order: str) -> None:
    begun = datetime(2026, 10, 12, 16, 0, 0)
    moments = [
        begun + timedelta(milliseconds=10 * k) + timedelta(hours=17) * (k >= 200)
        for k in range(400)
    ]
    names = ["Date", "Time"] if order == "before" else ["Time", "Date"]
    rows = []
    for k, moment in enumerate(moments):
        cells = [f"{moment:%d.%m.%Y}", f"{moment:%H:%M:%S.%f}"]
        rows.append(",".join([*(cells if order == "before" else cells[::-1]), f"{k / 100},1.5\n"]))
    path = tmp_path / "days.csv"
    path.write_text(",".join([*names, "displacement_mm,force_N\n"]) + "".join(rows))
    expected = [(moment - begun).total_seconds() for moment in moments]
    np.testing.assert_allclose(read_recording(path).time_s, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("first", "who"),
    [(740000.58, "MATLAB's datenum counts"), (2461338.5, "days of the Julian date")],
)
def test_other_counts_of_days_are_known_by_their_size(
    tmp_path: Path, first: float, who: str
) -> None:
    """Regression: they were "taken for seconds", 86,400 times too short, without a word."""
    table = HEAD + rows("{:.11f},{:.4f},{:.5f}", first + TIME / DAY_S, DEPTH, FORCE)
    recording = read_recording(write(tmp_path / "table.csv", table))
    np.testing.assert_allclose(recording.time_s - recording.time_s[0], TIME - TIME[0], atol=1e-4)
    assert any(who in note for note in recording.findings.notes)


@pytest.mark.parametrize(
    "form",
    ["%Y%m%dT%H%M%S.%f", "%Y%m%dT%H%M%S.%fZ", "%Y%m%dT%H%M%S.%f+0200", "%Y-%m-%dT%H:%M:%S.%f+02"],
)
def test_other_ways_of_iso_8601_are_read(tmp_path: Path, form: str) -> None:
    """Regression: "it has two columns of numbers, and three are needed"."""
    begun = datetime(2026, 10, 12, 13, 59, 59)
    shown = [(begun + timedelta(seconds=float(t))).strftime(form) for t in TIME]
    table = HEAD + "".join(
        f"{t},{d:.4f},{f:.5f}\n" for t, d, f in zip(shown, DEPTH, FORCE, strict=True)
    )
    recording = read_recording(write(tmp_path / "table.csv", table))
    np.testing.assert_allclose(recording.time_s, TIME - TIME[0], atol=1e-5)


def test_a_date_that_changes_a_row_after_midnight_counts_once(tmp_path: Path) -> None:
    begun = datetime(2026, 10, 12, 23, 59, 59)
    moments = [begun + timedelta(milliseconds=10 * k) for k in range(200)]
    rows = [
        f"{moments[max(k - 1, 0)]:%Y-%m-%d},{moment:%H:%M:%S.%f},{k / 100},1.5\n"
        for k, moment in enumerate(moments)
    ]
    path = tmp_path / "night.csv"
    path.write_text("date,time,displacement_mm,force_N\n" + "".join(rows))
    np.testing.assert_allclose(np.diff(read_recording(path).time_s), 0.01, atol=1e-6)
