"""Files of other people's machines: read right and said, or refused with the option to type."""

from __future__ import annotations

from pathlib import Path

import machine_files as files
import numpy as np
import pytest
from machine_files import DEPTH, FORCE, TIME

from hc_bringup.cli import main
from hc_logger.csv_options import CsvOptions
from hc_logger.errors import BagError
from hc_logger.recorded import Recording
from hc_logger.recording import read_recording

READ_RIGHT: dict[str, tuple[files.Maker, list[str]]] = {
    "Texture Exponent": (files.texture_exponent, ["'Force' in gf", "the force of a mass"]),
    "Bluehill, thousands": (
        files.bluehill_with_thousands,
        ["'Displacement' in um", "Force has signs between thousands (1,"],
    ),
    "testXpert, thousands": (
        files.test_expert_with_thousands,
        ["'Prüfzeit' in s", "decimal comma, encoding cp1252", "between thousands (1.0"],
    ),
    "Swiss thousands": (files.swiss_thousands, ["between thousands (1'0"]),
    "MTS": (files.mts, ["'Running Time' in s", "'Axial Displacement' in mm", "by tab"]),
    "MTS in blocks": (files.mts_in_blocks, ["the header comes again within the rows (line 607)"]),
    "MTS, German": (files.mts_german, ["'Laufzeit' in s", "'Kraft' in kN", "decimal comma"]),
    "Mach-1": (
        files.mach_1,
        ["'Fz, gf' in gf", "the one along z", "line 1210 is below the readings ('<END DATA>')"],
    ),
    "nanoindenter": (files.nano_indenter, ["'Load (uN)' in uN", "'Indentation (nm)' in nm"]),
    "LabVIEW in segments": (files.labview_in_segments, ["'Time' in s", "comes again"]),
    "Excel": (files.excel, ["by semicolon"]),
    "Excel, comma": (lambda: files.excel(","), ["by comma"]),
    "UTF-16": (files.utf_16, ["in ms", "in um", "in mN", "encoding utf-16"]),
    "Latin-1": (files.latin_1, ["'Depth (µm)' in um", "encoding cp1252"]),
    "German words": (files.german_words, ["'Kraft in N' in N", "Zeit has no unit: taken for sec"]),
    "quotation marks": (files.quotation_marks, ["by comma, decimal comma"]),
    "header twice": (files.header_twice, ["'Extension (mm)' in mm"]),
    "header on each page": (files.header_on_each_page, ["comes again 23 times within the rows"]),
    "results below": (files.results_below, ["lines 1203 to 1208 are below the readings ('Maximum"]),
    "clock": (files.clock_alone, ["Timestamp is written as on a clock: taken for seconds"]),
    "clock with half days": (
        lambda: files.clock_alone("3/5/2024 11:59:{:06.3f} PM", "3/6/2024 12:00:{:06.3f} AM"),
        ["written as on a clock"],
    ),
    "clock beside a time": (files.clock_beside_a_time, ["'Time (s)' in s"]),
    "date and clock": (files.date_and_clock_german, ["Uhrzeit is written as on a clock"]),
    "setpoint and reading": (files.setpoint_and_reading, ["'Position actual (mm)' in mm"]),
}

REFUSED: dict[str, tuple[files.Maker, str]] = {
    "Mach-1 in sections": (
        files.mach_1_in_sections,
        "another table begins in line 45; say which one is to be read with --header-lines 9 or "
        "--header-lines 44",
    ),
    "ATI without a position": (files.ati_force_torque, "no column is known to be the displacement"),
    "ATI with a tracker": (files.ati_with_tracker, "several columns could be the displacement"),
    "LabVIEW without a time": (files.labview_without_time, "a second: --rate 200"),
    "MATLAB": (files.matlab, "say it with --columns time=...,displacement=...,force=... (names"),
    "no units": (files.without_units, "say it with --units displacement=...,force=..."),
    "target alone": (files.setpoint_alone, "no column is known to be the displacement"),
    "two specimens": (files.two_specimens, "several columns could be the time: 'Time', 'Time'"),
    "whole thousands": (files.whole_thousands, "say with --decimal , that the sign stands between"),
    "whole thousands, English": (
        lambda: files.whole_thousands(sign=","),
        "say with --decimal . that the sign stands between",
    ),
    "comma in a number": (files.comma_in_a_number, "does a number hold the sign that separates"),
    "coarse clock": (files.coarse_clock, "too coarse"),
}

WITH_OPTIONS: dict[str, tuple[files.Maker, str]] = {
    "Mach-1, second section": (files.mach_1_in_sections, "--header-lines 44"),
    "ATI with a tracker": (files.ati_with_tracker, "--columns displacement=7"),
    "LabVIEW without a time": (files.labview_without_time, "--rate 200"),
    "MATLAB": (
        files.matlab,
        "--columns time=1,displacement=2,force=3 --units time=s,displacement=mm,force=N",
    ),
    "no units": (files.without_units, "--units displacement=mm,force=N"),
    "target after all": (files.setpoint_alone, "--columns displacement=2"),
    "two specimens": (files.two_specimens, "--columns time=3,displacement=2,force=1"),
    "whole thousands": (files.whole_thousands, "--decimal ,"),
    "whole thousands, English": (lambda: files.whole_thousands(sign=","), "--decimal ."),
    "coarse clock": (files.coarse_clock, "--rate 200"),
}


def check(recording: Recording) -> None:
    np.testing.assert_allclose(recording.time_s - recording.time_s[0], TIME, atol=1e-6)
    np.testing.assert_allclose(recording.displacement_mm, DEPTH, atol=6e-4)
    np.testing.assert_allclose(recording.force_n, FORCE, atol=6e-4)


@pytest.mark.parametrize("name", READ_RIGHT)
def test_what_is_clear_is_read_right_and_said(tmp_path: Path, name: str) -> None:
    make, said = READ_RIGHT[name]
    path = tmp_path / "export.csv"
    path.write_bytes(make())
    recording = read_recording(path)
    check(recording)
    told = "\n".join(recording.findings.lines())
    assert all(text in told for text in said), told


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_clear_is_refused_with_the_option_to_type(tmp_path: Path, name: str) -> None:
    make, expected = REFUSED[name]
    path = tmp_path / "export.csv"
    path.write_bytes(make())
    with pytest.raises(BagError, match=r"^[^\n]*$") as caught:
        read_recording(path)
    assert expected in str(caught.value)


@pytest.mark.parametrize("name", WITH_OPTIONS)
def test_the_option_is_all_that_is_needed(tmp_path: Path, name: str, capsys) -> None:
    make, options = WITH_OPTIONS[name]
    path, bag = tmp_path / "export.csv", tmp_path / "bag"
    path.write_bytes(make())
    assert main(["bag", "convert", str(path), str(bag), *options.split()]) == 0
    assert "mind signs and zeros" in capsys.readouterr().out
    check(read_recording(bag))


COMMANDS = ("estimate", "bag convert", "doctor")
EACH_BY_EACH = [
    pytest.param(name, command, marks=[] if (i + j) % len(COMMANDS) == 0 else [pytest.mark.slow])
    for i, name in enumerate((*READ_RIGHT, *REFUSED))
    for j, command in enumerate(COMMANDS)
]
"""Each kind of file through one of the commands in turn; they have one reader. The others: slow."""


@pytest.mark.parametrize(("name", "command"), EACH_BY_EACH)
def test_the_commands_say_the_same(tmp_path: Path, name: str, command: str, capsys) -> None:
    make, said = READ_RIGHT.get(name) or REFUSED[name]
    path = tmp_path / "export.csv"
    path.write_bytes(make())
    target = [str(tmp_path / "bag")] if command == "bag convert" else []
    status = main([*command.split(), str(path), *target])
    told = capsys.readouterr()
    if name in REFUSED:
        assert (status, told.out, told.err.count("\n")) == (1, "", 1)
        assert isinstance(said, str)
        assert said in told.err
        assert not (tmp_path / "bag").exists()
    else:
        assert status == 0, told
        assert all(text in told.out + told.err for text in said)


def test_thousands_far_down_are_not_taken_for_decimals(tmp_path: Path) -> None:
    """The first rows, by which a file is judged, have whole numbers below a thousand."""
    path = tmp_path / "late.csv"
    lines = "".join(f"{k % 1000};{k % 500};{k // 3}\n" for k in range(3000))
    text = f"t [ms];z [µm];F [mN]\n{lines}3.000;400;1.000\n"
    path.write_text(text)
    with pytest.raises(BagError, match=r"'t \[ms\]' has \d+ and 3.000: say with --decimal ,"):
        read_recording(path)
    for decimal, factor in ((",", 1000.0), (".", 1.0)):
        recording = read_recording(path, csv_options=CsvOptions(decimal=decimal))
        assert recording.force_n[-1] == pytest.approx(1e-3 * factor)


def test_a_comma_in_a_number_far_down_does_not_shift_the_columns(tmp_path: Path) -> None:
    path = tmp_path / "shift.csv"
    lines = "".join(f"{k / 100},0.5,0.25\n" for k in range(3000))
    path.write_text(f"time_s,displacement_mm,force_N\n{lines}30,1,234.5,2\n")
    with pytest.raises(BagError, match="line 3002 has 4 cells and the others 3: does a number"):
        read_recording(path)


@pytest.mark.parametrize("options", [CsvOptions(header_lines=9), CsvOptions(header_lines=44)])
def test_the_table_that_is_chosen_is_read_to_its_end(tmp_path: Path, options: CsvOptions) -> None:
    path = tmp_path / "sections.txt"
    path.write_bytes(files.mach_1_in_sections())
    recording = read_recording(path, csv_options=options)
    count = 30 if options.header_lines == 9 else len(TIME)
    assert len(recording.time_s) == count
    told = recording.findings.lines()[-1]
    assert ("the table ends at line 40" if count == 30 else "is below the readings") in told


def test_a_table_far_down_can_be_chosen(tmp_path: Path) -> None:
    path = tmp_path / "long.txt"
    long = files.rows("{:.3f},1.0,2.0", np.arange(5000) * 0.01)
    path.write_text(
        files.PLAIN_HEAD + long + files.PLAIN_HEAD + files.rows(files.PLAIN, *files.ALL)
    )
    with pytest.raises(BagError, match="--header-lines 1 or --header-lines 5002"):
        read_recording(path)
    check(read_recording(path, csv_options=CsvOptions(header_lines=5002)))


def test_text_within_the_rows_is_still_an_error_of_its_line(tmp_path: Path) -> None:
    path = tmp_path / "text.csv"
    lines = files.rows(files.PLAIN, *files.ALL).splitlines(keepends=True)
    lines[700] = "paused,,\n"
    path.write_text(files.PLAIN_HEAD + "".join(lines))
    with pytest.raises(BagError, match=r"line 702: Time \(s\) is 'paused' instead of a number"):
        read_recording(path)


def test_a_rate_is_not_said_beside_a_time(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(files.matlab())
    with pytest.raises(BagError, match="say the rate or the time"):
        read_recording(path, csv_options=CsvOptions(columns={"time": "1"}, rate_hz=200.0))


@pytest.mark.parametrize(
    ("head", "factor"),
    [("time_s,displacement_mm,force_N\n", 1.0), ("Time [ms],Position [mm],Load [N]\n", 1e3)],
)
def test_a_rate_that_contradicts_the_times_is_refused(tmp_path: Path, head, factor) -> None:
    """Regression: a rate of 50 replaced times of 1000 Hz, and B was twenty times too large."""
    path = tmp_path / "a.csv"
    path.write_text(head + files.rows("{:.6f},{:.4f},{:.5f}", TIME * factor, DEPTH, FORCE))
    true_hz = round(1.0 / float(np.median(np.diff(TIME))))
    with pytest.raises(BagError, match=rf"--rate 7 .*{true_hz} rows a second; leave --rate away"):
        read_recording(path, csv_options=CsvOptions(rate_hz=7.0))
    check(read_recording(path, csv_options=CsvOptions(rate_hz=float(true_hz))))


@pytest.mark.parametrize("clock", ["10:00:{:02d}", "{:d}"])
def test_a_rate_helps_where_times_are_too_coarse(tmp_path: Path, clock: str) -> None:
    path = tmp_path / "a.csv"
    pairs = zip(TIME, DEPTH, FORCE, strict=True)
    table = "".join(f"{clock.format(int(t))},{d:.4f},{f:.5f}\n" for t, d, f in pairs)
    path.write_text("Time (s),Position (mm),Force (N)\n" + table)
    true_hz = 1.0 / float(np.median(np.diff(TIME)))
    check(read_recording(path, csv_options=CsvOptions(rate_hz=true_hz)))


def test_a_preset_of_another_kind_of_value_is_one_line(tmp_path: Path, capsys) -> None:
    path, preset = tmp_path / "a.csv", tmp_path / "mine.yaml"
    path.write_bytes(files.matlab())
    for text in ("rate: fast", "header_lines: -1", "separator: 3"):
        preset.write_text(text)
        assert main(["estimate", str(path), "--preset", str(preset)]) == 2
        err = capsys.readouterr().err
        assert f"{text} is not a" in err
        assert err.count("\n") == 1


def test_a_folder_of_files_that_tell_no_time_is_read_by_batch(tmp_path: Path) -> None:
    folder, target = tmp_path / "lab", tmp_path / "out"
    folder.mkdir()
    for name in "ab":
        (folder / f"{name}.lvm").write_bytes(files.labview_without_time())
    words = ["batch", f"{folder}/*.lvm", "-o", str(target), "--filter", "ukf", "-j", "1"]
    assert main([*words, "--rate", "200"]) == 0
    table = (target / "recordings.csv").read_text()
    assert table.count(f",{len(TIME)},") == 2  # samples of each
    manifest = (target / "manifest.json").read_text()
    assert "--rate" in manifest
