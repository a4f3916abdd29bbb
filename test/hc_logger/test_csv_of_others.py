"""CSV files of testing machines and data loggers: found out and said, or refused."""

from __future__ import annotations

import codecs
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from table_text import DEPTH, FORCE, TIME, rows, write

from hc_logger.csv_file import CsvReader
from hc_logger.csv_options import CsvOptions
from hc_logger.errors import BagError
from hc_logger.recording import read_recording

G = 9.80665e-3


def texture_analyser() -> bytes:
    head = "Force,Distance,Time\n(g),(mm),(sec)\n"
    return (head + rows("{:.6f},{:.4f},{:.3f}", FORCE / G, DEPTH, TIME)).encode()


def german_machine() -> bytes:
    head = "Prüfung 12;;\n\nPrüfzeit;Standardweg;Standardkraft\ns;µm;N\n"
    table = rows("{:.3f};{:.1f};{:.5f}", TIME, DEPTH * 1e3, FORCE, decimal=",")
    return (head + table).encode("cp1252")


def unicode_export() -> bytes:
    head = "Sample: liver 3\r\nOperator: x, y\r\nTime [ms]\tPosition [m]\tLoad [mN]\tNote\r\n"
    table = rows("{:.1f}\t{:.7f}\t{:.2f}\tok", TIME * 1e3, DEPTH * 1e-3, FORCE * 1e3)
    return codecs.BOM_UTF16_LE + (head + table).encode("utf-16-le")


def logger_with_spaces() -> bytes:
    head = "t[s]  Fz[kgf]  z[um]\n"
    return (head + rows("{:8.3f} {:12.8f} {:10.2f}", TIME, FORCE / (1e3 * G), DEPTH * 1e3)).encode()


def universal_tester() -> bytes:
    head = "Specimen: liver 3\nTime,Extension,Load\n(s),(um),(mN)\n"
    return (head + rows("{:.3f},{:.1f},{:.2f}", TIME, DEPTH * 1e3, FORCE * 1e3)).encode()


def quoted() -> bytes:
    head = '"Time, s";"Indentation depth, mm";"Force, N"\n'
    return (head + rows('"{:.3f}";"{:.4f}";"{:.5f}"', TIME, DEPTH, FORCE, decimal=",")).encode()


def bluehill() -> bytes:
    """Instron: the results of the test stand above its readings, as rows of numbers too."""
    head = (
        '"Results Table 1"\n,"Maximum Load","Compressive extension at Maximum Load"\n'
        ',"(N)","(mm)"\n1,3.29,3.00\n\n"Time","Extension","Load"\n"(sec)","(cm)","(kgf)"\n'
    )
    return (head + rows('"{:.3f}","{:.5f}","{:.8f}"', TIME, DEPTH / 10, FORCE / (1e3 * G))).encode()


def american() -> bytes:
    head = "Time,Compressive extension,Extension,Load\n(s),(in),(in),(lbf)\n"
    table = rows(
        "{:.3f},{:.7f},{:.7f},{:.8f}", TIME, DEPTH / 25.4, -DEPTH / 25.4, FORCE / 4.4482216152605
    )
    return (head + table).encode()


def exponent_without_brackets() -> bytes:
    head = "Load [kgf]\tExtension cm\tTime sec\r\n"
    return (head + rows("{:.8f}\t{:.6f}\t{:.3f}", FORCE / (1e3 * G), DEPTH / 10, TIME)).encode()


def force_gauge() -> bytes:
    head = "Emperor Force Data\nSample Rate,500,Hz\n\nReading,Load (gf),Travel (mm),Time (s)\n"
    return (head + rows("{},{:.5f},{:.4f},{:.3f}", range(1, 61), FORCE / G, DEPTH, TIME)).encode()


def test_expert() -> bytes:
    head = '"Prüfung"\t"Leber 3"\r\n\r\n"Prüfzeit"\t"Standardweg"\t"Standardkraft"\r\n'
    table = rows("{:.4f}\t{:.5f}\t{:.5f}", TIME, DEPTH, FORCE, decimal=",")
    return (head + '"s"\t"mm"\t"N"\r\n' + table).encode("cp1252")


test_expert.__test__ = False  # type: ignore[attr-defined]  # its name is the program's


LABVIEW_HEAD = """LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Date\t2024/03/05
Time\t10:11:12.3450000
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t60\t60\t
Time\t10:11:12.345\t10:11:12.345\t
Y_Unit_Label\tum\tmN\t
X_Dimension\tTime\tTime\t
X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t
Delta_X\t0.002000\t0.002000\t
***End_of_Header***\t\t\t
X_Value\tDisplacement\tForce\tComment
"""


def labview() -> bytes:
    table = rows("{:.6f}\t{:.6f}\t{:.6f}\t", TIME, DEPTH * 1e3, FORCE * 1e3)
    return (LABVIEW_HEAD + table).encode()


def with_byte_order_mark() -> bytes:
    head = "time_s,displacement_mm,force_N\n"
    return codecs.BOM_UTF8 + (head + rows("{:.3f},{:.4f},{:.5f}", TIME, DEPTH, FORCE)).encode()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (bluehill(), ["'Time' in s", "'Extension' in cm", "'Load' in kgf"]),
        (american(), ["'Compressive extension' in in", "'Load' in lbf", "the one of compression"]),
        (exponent_without_brackets(), ["'Extension cm' in cm", "'Load [kgf]' in kgf"]),
        (force_gauge(), ["'Load (gf)' in gf", "'Travel (mm)' in mm"]),
        (test_expert(), ["'Prüfzeit' in s", "'Standardkraft' in N", "by tab, decimal comma"]),
        (labview(), ["'Time' in s", "'Displacement' in um", "'Force' in mN"]),
        (texture_analyser(), ["'Force' in gf", "the force of a mass", "by comma"]),
        (german_machine(), ["'Standardweg' in um", "decimal comma", "encoding cp1252"]),
        (unicode_export(), ["'Load [mN]' in mN", "by tab", "encoding utf-16"]),
        (logger_with_spaces(), ["'Fz[kgf]' in kgf", "by space"]),
        (quoted(), ["'Indentation depth, mm' in mm", "by semicolon", "decimal comma"]),
        (universal_tester(), ["'Extension' in um", "'Load' in mN"]),
        (with_byte_order_mark(), []),
    ],
)
def test_what_machines_write_is_read_and_said(
    tmp_path: Path, content: bytes, said: list[str]
) -> None:
    path = tmp_path / "export.csv"
    path.write_bytes(content)
    recording = read_recording(path)
    np.testing.assert_allclose(recording.time_s, TIME, atol=1e-9)
    np.testing.assert_allclose(recording.displacement_mm, DEPTH, atol=1e-4)
    np.testing.assert_allclose(recording.force_n, FORCE, atol=1e-5)
    told = "\n".join(recording.findings.lines())
    assert all(text in told for text in said), told
    assert bool(told) == bool(said)


def missing_at_first() -> bytes:
    cells = [f"{t:.3f},{d:.4f},{f:.5f}\n" for t, d, f in zip(TIME, DEPTH, FORCE, strict=True)]
    first = f"{TIME[0]:.3f},{DEPTH[0]:.4f},N/A\n{TIME[1]:.3f},{DEPTH[1]:.4f},-\n"
    return ("Time (s),Distance (mm),Force (N)\n" + first + "".join(cells[2:])).encode()


def test_what_stands_for_a_missing_reading_is_one_and_no_header(tmp_path: Path) -> None:
    """Regression: a first row without a force passed for the names of the columns."""
    path = tmp_path / "missing.csv"
    path.write_bytes(missing_at_first())
    recording = read_recording(path)
    assert np.isnan(recording.force_n[:2]).all()
    np.testing.assert_allclose(recording.force_n[2:], FORCE[2:], atol=1e-5)
    assert len(recording.time_s) == len(TIME)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf_16_without_a_mark_is_found(tmp_path: Path, encoding: str) -> None:
    head = "Zeit [s]\tWeg [µm]\tKraft [N]\n"
    text = head + rows("{:.3f}\t{:.1f}\t{:.5f}", TIME, DEPTH * 1e3, FORCE)
    recording = read_recording(write(tmp_path / "bare.txt", text, encoding))
    np.testing.assert_allclose(recording.displacement_mm, DEPTH, atol=1e-4)
    assert f"encoding {encoding}" in recording.findings.lines()[0]


@pytest.mark.parametrize("separator", [",", " "])
def test_the_comment_sign_of_numpy_is_no_name(tmp_path: Path, separator: str) -> None:
    path = tmp_path / "saved.txt"
    names = separator.join(("time_s", "displacement_mm", "force_N"))
    np.savetxt(path, np.column_stack([TIME, DEPTH, FORCE]), delimiter=separator, header=names)
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.force_n, FORCE)
    assert "#" not in "".join(recording.findings.lines())


def test_a_minus_sign_of_typography_is_one(tmp_path: Path) -> None:
    table = rows("{:.3f};{:.4f};{:.5f}", TIME, DEPTH, -FORCE, decimal=",")
    text = "Tid (s);Weg (mm);Kraft (N)\n" + table.replace("-", "\N{MINUS SIGN}")
    recording = read_recording(
        write(tmp_path / "swedish.csv", text),
        csv_options=CsvOptions(columns={"time": "1"}),
    )
    np.testing.assert_allclose(recording.force_n, -FORCE, atol=1e-5)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Time [s],Force A [N],Force B [N],Pos [mm]\n0,1,2,3\n", "several columns could be the f"),
        ("Time [s],Pos,Force [N]\n0,1,2\n", "unit of 'Pos' is not known; say it with --units disp"),
        (
            "Time [s],Pos,F\n0,1,2\n",
            "'Pos' and 'F' are not known; say it with --units displacement=",
        ),
        ("Time,Pos [mm],Force [N]\n0,1,2\n1,1,2\n2,1,2\n", "the unit of 'Time' is not known"),
        ("Time [s],Pos [mm],Force [daN]\n0,1,2\n", "the unit of 'Force [daN]' is not known"),
        ("0,1,2\n0.1,1,2\n", "the columns have no names; say it with --columns"),
        ("a,b,c\n0,1,2\n", "no column is known to be the time"),
        ("Zeit,Weg,Kraft\n0,1, 2,5, 3,7\n0,2, 2,6, 3,8\n", "no names; say it with --columns"),
        ("time,d,f\n2024-03-01_12:00:00.1,1,2\n", "as on a clock (12:00:00), in a way that is not"),
        ("[t, pos, force]\n[0.0, 1, 2],\n", "written as JSON, with brackets"),
        (
            "Force (gf),Distance (mm)\n1.5,2\n1.6,3\n",
            "two columns of numbers, and three are needed: export time, displacement and force",
        ),
        ("time_s,displacement_mm\n0,1\n1,2\n", "three are needed: the force is missing"),
        ("Time [s],Pos [mm],Load [N]\n0,1,2\n1,2\n" + "2,1,2\n" * 30, "complete the line or del"),
        ("Time [s],Pos [mm],Load [tonf]\n0,1,2\n", "the unit of 'Load [tonf]' is not known"),
        (
            "Time,Pos,Load\n0.1 s,2.5 mm,1.2 N\n0.2 s,2.6 mm,1.3 N\n",
            "their unit behind them (s, mm, N): export them without it",
        ),
        ("Time [s],Pos [mm],Load [N]\n0,1,2\n\0\0\0\0", "in zero bytes from line 3 on"),
        ("nothing of numbers\nat all\n", "no rows of three numbers are to be seen"),
    ],
)
def test_a_doubt_is_refused_with_the_option_that_settles_it(
    tmp_path: Path, text: str, expected: str
) -> None:
    path = write(tmp_path / "doubt.csv", text)
    with pytest.raises(BagError) as caught:
        read_recording(path)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_second_table_in_a_file_is_named_and_not_left_out(tmp_path: Path) -> None:
    specimen = "Time,Extension,Load\n(s),(mm),(N)\n" + rows("{:.3f},{},{}", TIME, DEPTH, FORCE)
    with pytest.raises(BagError, match=r"another table begins in line 65; .* --header-lines 64"):
        read_recording(write(tmp_path / "two.csv", specimen + specimen))


@pytest.mark.parametrize("suffix", [".tab", ".tra", ".lvm", ".prn", ".TXT"])
def test_the_endings_of_machines_are_known(tmp_path: Path, suffix: str) -> None:
    path = write(tmp_path / f"export{suffix}", "t[s]\tz[mm]\tF[N]\n0\t1\t2\n0.1\t1\t2\n")
    assert read_recording(path).force_n.tolist() == [2.0, 2.0]
    sheet = write(tmp_path / "export.xlsx", "PK")
    with pytest.raises(BagError, match=r"a table in text ends in one of \.csv \.tsv \.tab"):
        read_recording(sheet)


def test_options_settle_what_is_in_doubt(tmp_path: Path) -> None:
    text = "log 7\nTime,Pos,Force A,Force B\n" + "".join(
        f"{k},{k + 1},{k},{2 * k}\n" for k in range(9)
    )
    path = write(tmp_path / "doubt.txt", text)
    options = CsvOptions(
        columns={"displacement": "2", "force": "Force B"},
        units={"time": "ms", "displacement": "um", "force": "mN"},
    )
    recording = read_recording(path, csv_options=options)
    np.testing.assert_allclose(recording.time_s, np.arange(9) * 1e-3)
    np.testing.assert_allclose(recording.displacement_mm, np.arange(1, 10) * 1e-3)
    np.testing.assert_allclose(recording.force_n, np.arange(9) * 2e-3)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (CsvOptions(units={"force": "mm"}), "'mm' is no unit of force: give N, mN, uN, nN, kN, gf"),
        (CsvOptions(separator="x"), "is no separator: give one of comma, semicolon"),
        (CsvOptions(decimal="'"), "is no decimal sign"),
        (CsvOptions(separator=",", decimal=","), "cannot be both"),
        (CsvOptions(encoding="klingon"), "is no encoding"),
        (CsvOptions(encoding="zlib"), "is no encoding"),
        (CsvOptions(columns={"time": "Uhr"}), "no column is called 'Uhr'; it has 'Time [s]'"),
        (CsvOptions(columns={"time": "2", "displacement": "2"}), "two quantities are the same"),
        (CsvOptions(header_lines=90), "no rows of three numbers"),
    ],
)
def test_wrong_options_are_one_line(tmp_path: Path, options: CsvOptions, expected: str) -> None:
    path = write(
        tmp_path / "a.csv", "Time [s],Pos [mm],Force [N]\n" + rows("{},{},{}", TIME, DEPTH, FORCE)
    )
    with pytest.raises(BagError, match=r"^[^\n]*$") as caught:
        read_recording(path, csv_options=options)
    assert expected in str(caught.value)


@st.composite
def machine(draw: st.DrawFn) -> tuple[bytes, tuple[float, float, float]]:
    """A file as some machine might write it, and how precise its numbers are."""
    separator = draw(st.sampled_from([",", ";", "\t", "|"]))
    decimal = "." if separator == "," else draw(st.sampled_from([".", ","]))
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "cp1252", "utf-16"]))
    units = (
        draw(st.sampled_from([("s", 1.0), ("ms", 1e-3), ("min", 60.0)])),
        draw(st.sampled_from([("m", 1e3), ("mm", 1.0), ("µm", 1e-3), ("cm", 10.0)])),
        draw(st.sampled_from([("N", 1.0), ("mN", 1e-3), ("gf", G), ("kgf", 1e3 * G)])),
    )
    names = (
        draw(st.sampled_from(["Time", "time", "Zeit", "Elapsed time"])),
        draw(st.sampled_from(["Distance", "Depth", "Weg", "Indentation depth"])),
        draw(st.sampled_from(["Force", "Load", "Kraft", "Normal force"])),
    )
    columns = [TIME / units[0][1], DEPTH / units[1][1], FORCE / units[2][1], np.arange(60)]
    style = draw(st.sampled_from(["brackets", "parentheses", "line", "underscore"]))
    heads = {
        "brackets": [f"{n} [{u}]" for n, (u, _) in zip(names, units, strict=True)],
        "parentheses": [f"{n} ({u})" for n, (u, _) in zip(names, units, strict=True)],
        "underscore": [f"{n}_{u}" for n, (u, _) in zip(names, units, strict=True)],
        "line": list(names),
    }[style]
    order = draw(st.permutations(range(4)))
    cells = [*heads, "Row"]
    lines = [f"Machine {k}: header" for k in range(draw(st.integers(0, 3)))]
    lines.append(separator.join(cells[i] for i in order))
    if style == "line":
        below = [*(u for u, _ in units), ""]
        lines.append(separator.join(below[i] for i in order))
    for row in zip(*columns, strict=True):
        text = [f"{value:.12g}".replace(".", decimal) for value in row]
        lines.append(separator.join(text[i] for i in order))
    end = draw(st.sampled_from(["\n", "\r\n"]))
    return (end.join(lines) + end).encode(encoding), (units[0][1], units[1][1], units[2][1])


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(machine())
def test_any_way_of_writing_gives_the_same_numbers(
    tmp_path: Path, drawn: tuple[bytes, tuple[float, float, float]]
) -> None:
    path = tmp_path / "export.csv"
    path.write_bytes(drawn[0])
    table = np.concatenate(list(CsvReader(path).blocks()))
    np.testing.assert_allclose(table, np.column_stack([TIME, DEPTH, FORCE]), rtol=1e-9, atol=1e-12)
