"""A CSV file in any layout becomes a bag and a CSV file again: the same numbers, or one line."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from hc_logger.convert import bag_to_csv, csv_to_bag
from hc_logger.csv_file import CsvReader
from hc_logger.csv_rows import BLOCK_ROWS
from hc_logger.errors import BagError
from hc_logger.info import bag_info
from hc_logger.recording import read_recording

NAN = math.nan
UNITS = (
    [("s", 1.0), ("ms", 1e-3), ("us", 1e-6)],
    [("mm", 1.0), ("m", 1e3), ("µm", 1e-3), ("cm", 10.0)],
    [("N", 1.0), ("mN", 1e-3), ("kN", 1e3)],
)
NAMES = (["Time", "Zeit", "t"], ["Displacement", "Weg", "Depth"], ["Force", "Kraft", "Load"])
MISSING = ["", "-", "n/a", "nan"]


class Drawn(NamedTuple):
    """A file, what stands in it (s, mm, N), and whether all of it is written plainly."""

    content: bytes
    rows: np.ndarray
    plain: bool


@st.composite
def drawn_file(draw: st.DrawFn) -> Drawn:
    """A file as some machine, program or person might write it."""
    separator = draw(st.sampled_from([",", ";", "\t", "|", " "]))
    decimal = "." if separator == "," else draw(st.sampled_from([".", ","]))
    ours = draw(st.booleans()) and separator in ",;\t"
    units = [("s", 1.0), ("mm", 1.0), ("N", 1.0)]
    heads = ["time_s", "displacement_mm", "force_N"]
    if not ours:
        units = [draw(st.sampled_from(kinds)) for kinds in UNITS]
        heads = [draw(st.sampled_from(kinds)) for kinds in NAMES]
        mark = (
            "{}_{}" if separator == " " else draw(st.sampled_from(["{} [{}]", "{} ({})", "{}_{}"]))
        )
        heads = [mark.format(h, unit) for h, (unit, _) in zip(heads, units, strict=True)]
    count = draw(st.integers(30, 80))
    seed = draw(st.integers(0, 2**32 - 1))
    random = np.random.default_rng(seed)
    begin = draw(st.sampled_from([0.0, 0.0, 12.5, -3.0, 1.7e9]))
    rows = np.column_stack(
        [
            np.round(begin + np.cumsum(random.uniform(1e-3, 0.2, count)), 6),
            np.round(random.normal(0.0, 3.0, count), 5),
            np.round(random.normal(0.0, 2.0, count), 5),
        ]
    )
    words = draw(st.sampled_from(MISSING)) if separator != " " else "nan"
    for place in draw(st.sets(st.tuples(st.integers(1, count - 1), st.integers(1, 2)), max_size=4)):
        rows[place] = NAN
    others = draw(st.integers(0, 2))
    order = draw(st.permutations(range(3 + others)))
    cells = [*heads, *(f"note{k}" for k in range(others))]
    lines = [separator.join(cells[i] for i in order)]
    plain = True
    if draw(st.booleans()) and not ours:
        lines[:0] = draw(
            st.sampled_from([["# made by hand"], ["Machine 7: test", ""], ["%x", "%y"]])
        )
    for k, row in enumerate(rows.tolist()):
        texts = [
            words if math.isnan(v) else f"{v / factor:.12g}".replace(".", decimal)
            for v, (_, factor) in zip(row, units, strict=True)
        ]
        texts += [str(k % 7)] * others
        lines.append(separator.join(texts[i] for i in order))
    for at in draw(st.lists(st.integers(len(lines) - count + 1, len(lines)), max_size=3)):
        lines.insert(at, draw(st.sampled_from(["", "   "])))
    if draw(st.integers(0, 4)) == 0:
        plain = False
        at = draw(st.integers(len(lines) - count, len(lines)))
        lines.insert(at, draw(st.sampled_from(["# pause", "stopped by hand", '"'])))
    end = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "cp1252", "utf-16"]))
    text = end.join(lines) + draw(st.sampled_from([end, end * 3]))
    return Drawn(text.encode(encoding), rows, plain)


@settings(max_examples=150, deadline=None)
@given(drawn_file())
def test_the_same_numbers_come_back_or_one_line_says_why(drawn: Drawn) -> None:
    with tempfile.TemporaryDirectory() as name:
        source, bag, again = (Path(name) / part for part in ("in.csv", "bag", "out.csv"))
        source.write_bytes(drawn.content)
        refusal = ""
        try:
            reader = CsvReader(source)
            count = csv_to_bag(source, bag, reader=reader)
        except BagError as error:
            refusal = str(error)
        if refusal:
            event("refused")
            assert "\n" not in refusal
            assert not bag.exists()
            assert not drawn.plain or "say it with" in refusal, refusal
            return
        event("read")
        assert bag_to_csv(bag, again) == (count, [])
        first = read_recording(source)
        rows = np.column_stack([first.time_s, first.displacement_mm, first.force_n])
        if count != len(drawn.rows):  # of the last rows, below a line that is none
            assert not drawn.plain
            assert any("below the readings" in note for note in reader.notes)
        np.testing.assert_allclose(rows, drawn.rows[:count], rtol=1e-9, atol=1e-12)
        last = read_recording(again)
        assert last.findings.notes == ()
        # A bag has whole nanoseconds; a float64 of seconds since 1970 a quarter of a microsecond.
        np.testing.assert_allclose(last.time_s, rows[:, 0], rtol=2e-16, atol=1e-9)
        np.testing.assert_allclose(last.displacement_mm, rows[:, 1], rtol=4e-16, atol=0.0)
        np.testing.assert_array_equal(last.force_n, rows[:, 2])


def test_seconds_since_1970_are_the_stamps(tmp_path: Path) -> None:
    """Regression: a file of a logger with such times could not become a bag."""
    path = tmp_path / "unix.csv"
    text = "".join(f"{1_764_000_000 + k / 8:.3f},{k},{k}\n" for k in range(80))
    path.write_text(f"time_s,displacement_mm,force_N\n{text}")
    assert csv_to_bag(path, tmp_path / "bag") == 80
    assert bag_info(tmp_path / "bag").start_ns == 1_764_000_000 * 10**9
    bag_to_csv(tmp_path / "bag", tmp_path / "again.csv")
    np.testing.assert_array_equal(
        read_recording(tmp_path / "again.csv").time_s, read_recording(path).time_s
    )


@pytest.mark.parametrize("time", [-1.5e9, 2.2e9])
def test_a_time_that_no_bag_can_hold_is_one_line(tmp_path: Path, time: float) -> None:
    """Regression: before 1970 the bag said that it ended in the year 2554."""
    path = tmp_path / "far.csv"
    path.write_text(f"time_s,displacement_mm,force_N\n{time:.0f},1,2\n")
    with pytest.raises(BagError, match="its stamps are of 1970 to 2038"):
        csv_to_bag(path, tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


HEAD = "time_s,displacement_mm,force_N,note\n"


@pytest.mark.parametrize("count", [100, BLOCK_ROWS // 4])
def test_a_quotation_mark_that_nobody_closed_swallows_no_rows(tmp_path: Path, count: int) -> None:
    """Regression: with a cell missing elsewhere all rows behind it were gone, without a word."""
    path = tmp_path / "open.csv"
    notes = {20: '"see below', 22: '"', 60: '5" tip', 70: '"a, b"'}
    lines = [f"{k / 10},{k},{'' if k in (8, 80) else k},{notes.get(k, '')}\n" for k in range(count)]
    path.write_text(HEAD + "".join(lines))
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.displacement_mm, np.arange(count))
    assert np.flatnonzero(np.isnan(recording.force_n)).tolist() == [8, 80]


def test_a_cell_may_go_on_over_several_lines(tmp_path: Path) -> None:
    path = tmp_path / "note.csv"
    path.write_text(HEAD + '0,1,2,"begins,\nwith a note\n"\n1,2,,\n2,3,4,"x"\n')
    assert read_recording(path).displacement_mm.tolist() == [1.0, 2.0, 3.0]


def test_between_spaces_nobody_sees_which_cell_is_missing(tmp_path: Path) -> None:
    """Regression: the cells behind the missing one counted as those before them."""
    path = tmp_path / "spaces.txt"
    lines = [f"{k / 10} 21.5 {k} {2 * k} 7\n" for k in range(100)]
    lines[50] = "5.0 50 100 7\n"
    path.write_text("time_s temperature displacement_mm force_N valve\n" + "".join(lines))
    with pytest.raises(BagError, match=r"line 52 has 4 cells and the others 5: .* write nan for"):
        read_recording(path)
    lines[50] = "5.0 nan 50 100 7\n"
    path.write_text("time_s temperature displacement_mm force_N valve\n" + "".join(lines) + "10 2")
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.force_n, 2 * np.arange(100))
    assert recording.findings.notes[-1].startswith("the last line is cut off in its middle")
