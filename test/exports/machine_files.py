"""Files as machines and data loggers write them, of one press of known force and depth."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from table_text import rows

from hc_estimator.contact.arrays import hunt_crossley_force

G = 9.80665e-3
"""N of a gram."""
STEP_S = 0.005
TIME = np.round(np.arange(0.0, 6.0, STEP_S), 6)
DEPTH = -1.0 + 2.0 * (1.0 - np.cos(2.1 * TIME)) + 0.2 * np.sin(13.0 * TIME)
_SPEED = 4.2 * np.sin(2.1 * TIME) + 2.6 * np.cos(13.0 * TIME)
FORCE = hunt_crossley_force(DEPTH, _SPEED, np.array([0.5, 0.05, 1.5, 1.0]))
HALF = len(TIME) // 2
INDEX = np.arange(len(TIME))

Columns = tuple[Any, ...]
ALL = (TIME, DEPTH, FORCE)


def grouped(values: Iterable[float], form: str, thousands: str, decimal: str = ".") -> list[str]:
    """Return numbers with a sign between their thousands."""
    signs = str.maketrans({",": thousands, ".": decimal})
    return [format(value, f",{form}").translate(signs) for value in values]


def part(columns: Columns, first: int, last: int) -> Columns:
    return tuple(column[first:last] for column in columns)


PLAIN = "{:.3f},{:.5f},{:.5f}"
TABS = "{:.4f}\t{:.5f}\t{:.5f}"
SEMICOLONS = "{:.3f};{:.5f};{:.5f}"


def texture_exponent() -> bytes:
    head = "Start Batch A,,\nA1,,\nForce,Distance,Time\n(g),(mm),(sec)\n"
    return (head + rows("{:.4f},{:.5f},{:.3f}", FORCE / G, DEPTH, TIME)).encode()


def bluehill_with_thousands() -> bytes:
    head = '"Sample : liver"\n\n"Raw Data"\nTime,Displacement,Force\n(s),(um),(mN)\n'
    micrometres, millinewtons = (grouped(1e3 * v, ".2f", ",") for v in (DEPTH, FORCE))
    return (head + rows('{:.3f},"{}","{}"', TIME, micrometres, millinewtons)).encode()


def test_expert_with_thousands() -> bytes:
    head = "Prüfzeit;Standardweg;Standardkraft;Traverse abs.\ns;µm;mN;mm\n"
    seconds = grouped(TIME, ".3f", ".", ",")
    micrometres, millinewtons = (grouped(1e3 * v, ".1f", ".", ",") for v in (DEPTH, FORCE))
    table = rows("{};{};{};212,5", seconds, micrometres, millinewtons)
    return (head + table).encode("cp1252")


def swiss_thousands() -> bytes:
    micrometres, millinewtons = (grouped(1e3 * v, ".1f", "'") for v in (DEPTH, FORCE))
    head = "Zeit [s];Weg [µm];Kraft [mN]\n"
    return (head + rows("{:.3f};{};{}", TIME, micrometres, millinewtons)).encode()


MTS_BLOCK = (
    "Data Acquisition\t\tTime:\t10.0\tSec\t3/29/2016 1:54:32 PM\n"
    "Running Time\tAxial Displacement\tAxial Force\tAxial Count\nSec\tmm\tN\tsegments\n"
)
MTS_MARK = "MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A\n\n"


def mts() -> bytes:
    return (MTS_MARK + MTS_BLOCK + rows(TABS + "\t1", *ALL)).encode()


def mts_in_blocks() -> bytes:
    first, second = part(ALL, 0, HALF), part(ALL, HALF, len(TIME))
    blocks = (MTS_BLOCK + rows(TABS + "\t1", *columns) for columns in (first, second))
    return (MTS_MARK + "\n".join(blocks)).encode()


def mts_german() -> bytes:
    head = (
        "MTS793|MPT|DEU|1|2|,|.|:|49|1|1|A\r\n\r\nDatenerfassung: Zyklisch\t\tZeit:\t10,0\tSec\r\n"
        "Laufzeit\tWeg\tKraft\r\ns\tmm\tkN\r\n"
    )
    return (head + rows("{:.4f}\t{:.6f}\t{:.9f}", TIME, DEPTH, 1e-3 * FORCE, decimal=",")).encode()


MACH_1 = "<Mach-1 File>\n<INFO>\nTime:\t10:12:00\nDate:\t3/4/2024\n<END INFO>\n\n"
MACH_1_NAMES = "Time, s\tPosition (z), mm\tPosition (x), mm\tPosition (y), mm\tFz, gf\n"
MACH_1_ROW = "{:.4f}\t{:.5f}\t12.00000\t10.00000\t{:.4f}"


def mach_1() -> bytes:
    head = f"{MACH_1}<Sinusoid>\n<DATA>\n{MACH_1_NAMES}"
    return (head + rows(MACH_1_ROW, TIME, DEPTH, FORCE / G) + "<END DATA>\n").encode()


def mach_1_in_sections() -> bytes:
    table = (TIME, DEPTH, FORCE / G)
    contact = rows(MACH_1_ROW, *part(table, 0, 30))
    text = f"{MACH_1}<Find Contact>\n<DATA>\n{MACH_1_NAMES}{contact}<END DATA>\n\n"
    text += f"<Sinusoid>\n<DATA>\n{MACH_1_NAMES}{rows(MACH_1_ROW, *table)}<END DATA>\n"
    return text.encode()


def nano_indenter() -> bytes:
    head = "Tip radius (um)\t50.5\nk (N/m)\t0.49\n\nTime (s)\tLoad (uN)\tIndentation (nm)\n"
    table = rows("{:.4f}\t{:.3f}\t{:.2f}", TIME, 1e6 * FORCE, 1e6 * DEPTH)
    return (head + table).encode()


def ati_force_torque() -> bytes:
    """The readings of an ATI Net F/T: no displacement, the time as on a clock."""
    head = (
        "Start Time: 3/4/2024 10:11:12 AM\nRDT Sample Rate: 200\n"
        '"Force Units: N","Counts per Unit Force: 1000000"\n'
        "Status (hex),RDT Sequence,F/T Sequence,Fx,Fy,Fz,Tx,Ty,Tz,Time\n"
    )
    row = "0x0,{0},{0},0.01,0.02,{1:.5f},0.1,0.2,0.3,10:11:{2:06.3f} AM"
    return (head + rows(row, INDEX, FORCE, TIME)).encode()


def ati_with_tracker() -> bytes:
    head = "Time (s),Fx (N),Fy (N),Fz (N),Tracker X (mm),Tracker Y (mm),Tracker Z (mm)\n"
    return (head + rows("{:.3f},0.01,0.02,{:.5f},1.5,2.5,{:.5f}", TIME, FORCE, DEPTH)).encode()


LABVIEW_HEAD = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
    "Multi_Headings\tYes\nX_Columns\t{columns}\nDate\t2024/03/05\nTime\t10:11:12.345\n"
    "***End_of_Header***\t\n\t\n"
)
LABVIEW_SEGMENT = (
    "Channels\t2\t\t\nSamples\t{samples}\t{samples}\t\nDate\t2024/03/05\t2024/03/05\t\n"
    "Time\t10:11:12.345\t10:11:12.345\t\nY_Unit_Label\tMillimeter\tNewton\t\n"
    "X_Dimension\tTime\tTime\t\nX0\t0.0E+0\t0.0E+0\t\nDelta_X\t0.005000\t0.005000\t\n"
    "***End_of_Header***\t\t\t\nX_Value\tDisplacement\tForce\tComment\n"
)


def labview_in_segments() -> bytes:
    segments = (part(ALL, 0, HALF), part(ALL, HALF, len(TIME)))
    text = LABVIEW_HEAD.format(columns="One") + "\n".join(
        LABVIEW_SEGMENT.format(samples=HALF) + rows(TABS + "\t", *columns) for columns in segments
    )
    return text.encode()


def labview_without_time() -> bytes:
    head = LABVIEW_HEAD.format(columns="No") + LABVIEW_SEGMENT.format(samples=len(TIME))
    return (head + rows("\t{:.5f}\t{:.5f}\t", DEPTH, FORCE)).encode()


def matlab() -> bytes:
    return rows("{:.15g},{:.15g},{:.15g}", *ALL).encode()


def excel(separator: str = ";") -> bytes:
    form = SEMICOLONS.replace(";", separator)
    names = separator.join(("Time (s)", "Displacement (mm)", "Force (N)"))
    return (f"sep={separator}\r\n{names}\r\n" + rows(form, *ALL)).encode()


def utf_16() -> bytes:
    head = "Zeit [ms]\tWeg [µm]\tKraft [mN]\r\n"
    table = rows("{:.0f}\t{:.2f}\t{:.2f}", *(1e3 * column for column in ALL), decimal=",")
    return (head + table).encode("utf-16")


def latin_1() -> bytes:
    head = "Time (ms);Depth (µm);Load (mN)\n"
    return (head + rows("{:.0f};{:.2f};{:.2f}", *(1e3 * c for c in ALL))).encode("latin-1")


def german_words() -> bytes:
    return ("Zeit;Weg mm;Kraft in N\n" + rows(SEMICOLONS, *ALL, decimal=",")).encode()


def quotation_marks() -> bytes:
    head = '"Zeit [s]","Weg [mm]","Kraft [N]"\n'
    return (head + rows('"{:.3f}","{:.5f}","{:.5f}"', *ALL, decimal=",")).encode()


PLAIN_HEAD = "Time (s),Extension (mm),Load (N)\n"


def header_twice() -> bytes:
    return (2 * PLAIN_HEAD + rows(PLAIN, *ALL)).encode()


def header_on_each_page() -> bytes:
    pages = (part(ALL, first, first + 50) for first in range(0, len(TIME), 50))
    return "\n".join(PLAIN_HEAD + rows(PLAIN, *page) for page in pages).encode()


def results_below() -> bytes:
    end = "\nMaximum,3.2,7.5\nMean,1.0,2.2\n\nMax,Min,Mean\n7.5,0.0,2.2\nEnd of test\n"
    return (PLAIN_HEAD + rows(PLAIN, *ALL) + end).encode()


def clock_alone(
    before: str = "2024-03-05 23:59:{:06.3f}", after: str = "2024-03-06 00:00:{:06.3f}"
) -> bytes:
    """The seconds begin at 56, so that midnight comes after four of them."""
    midnight = [(after if t >= 4.0 else before).format((t + 56.0) % 60.0) for t in TIME]
    head = "Timestamp,Index,Displacement (mm),Force (N),Temperature (C)\n"
    return (head + rows("{},{},{:.5f},{:.5f},22.5", midnight, INDEX, DEPTH, FORCE)).encode()


def clock_beside_a_time() -> bytes:
    head = "Timestamp,Time (s),Displacement (mm),Force (N)\n"
    table = rows("2024-03-05T10:11:{:06.3f}Z,{:.3f},{:.5f},{:.5f}", TIME, *ALL)
    return (head + table).encode()


def date_and_clock_german() -> bytes:
    head = "Datum;Uhrzeit;Weg [mm];Kraft [N]\n"
    seconds = rows("10:11:{:06.3f};{:.5f};{:.5f}", *ALL, decimal=",")
    return (head + "".join(f"05.03.2024;{line}\n" for line in seconds.splitlines())).encode()


def coarse_clock() -> bytes:
    head = "Time,Displacement (mm),Force (N)\n"
    return (head + rows("10:11:{:02.0f},{:.5f},{:.5f}", np.floor(TIME), DEPTH, FORCE)).encode()


def setpoint_and_reading() -> bytes:
    head = "Time (s),Position setpoint (mm),Position actual (mm),Load (N),Load rate (N/s)\n"
    return (head + rows("{:.3f},{:.5f},{:.5f},{:.5f},1.5", TIME, DEPTH + 1, DEPTH, FORCE)).encode()


def setpoint_alone() -> bytes:
    return ("Time (s),Target position (mm),Load (N)\n" + rows(PLAIN, *ALL)).encode()


def two_specimens() -> bytes:
    head = "A1,,,A2,,\nForce,Distance,Time,Force,Distance,Time\n(N),(mm),(s),(N),(mm),(s)\n"
    row = "{:.5f},{:.5f},{:.3f},{:.5f},{:.5f},{:.3f}"
    return (head + rows(row, FORCE, DEPTH, TIME, 2 * FORCE, DEPTH, TIME)).encode()


def whole_thousands(bias_mn: float = 0.0, sign: str = ".") -> bytes:
    """Whole numbers with points between their thousands, and nothing that shows a decimal sign."""
    micrometres, millinewtons = (
        grouped(np.rint(values), ".0f", sign) for values in (1e3 * DEPTH, 1e3 * FORCE + bias_mn)
    )
    milliseconds = grouped(np.rint(1e3 * TIME), ".0f", sign)
    head = "Zeit [ms];Weg [µm];Kraft [mN]\n"
    return (head + rows("{};{};{}", milliseconds, micrometres, millinewtons)).encode()


def without_units() -> bytes:
    return ("time,displacement,force\n" + rows(PLAIN, *ALL)).encode()


def comma_in_a_number() -> bytes:
    """Thousands in a file that is separated by commas, not in quotation marks."""
    lines = rows("{:.3f},{:.5f},{}", TIME, DEPTH, grouped(330.0 * FORCE, ".2f", ",")).encode()
    return b"Time (s),Extension (mm),Load (gf)\n" + lines


Maker = Callable[[], bytes]
