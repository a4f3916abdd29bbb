"""The page of `hc batch`: where what is said of a recording stands, and that names are text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from hc_bringup.cli import main

MakeRecordings = Callable[..., Path]


def batch(*words: object) -> int:
    return main(["batch", *map(str, words), "--filter", "ukf", "-j", "1"])


def test_a_reason_stands_below_its_recording(
    make_recordings: MakeRecordings, break_some: Callable[[Path], int], tmp_path: Path
) -> None:
    """Regression: in the last column it was out of sight, and its row looked empty."""
    folder, target = make_recordings(1), tmp_path / "out"
    break_some(folder)
    assert batch(folder, "-o", target) == 0
    table = (target / "overview.html").read_text().partition("<h2>Recordings")[2]
    lines = table.partition("</tbody>")[0].split("<tr")[1:]
    assert lines[0].count("<th>") == 9
    assert "notes" not in lines[0]
    below = lines[next(i for i, line in enumerate(lines) if "cut.csv" in line) + 1]
    assert below.startswith(' class="note"><td colspan="9"><div>')
    assert "complete the line or delete it" in below
    good = next(i for i, line in enumerate(lines) if "r0000.csv" in line)
    assert 'class="note"' not in lines[good + 1]  # nothing is to be said of it


def test_the_length_is_that_of_what_was_read(
    make_recordings: MakeRecordings, tmp_path: Path
) -> None:
    """Regression: a table whose time is in a wrong unit made 16.8 hours of a minute."""
    folder, target = make_recordings(1), tmp_path / "out"
    lines = (folder / "r0000.csv").read_text().splitlines()
    seconds = float(lines[-1].split(",")[0]) - float(lines[1].split(",")[0])
    rows = [line.split(",") for line in lines[1:]]
    slow = [",".join([str(3600.0 * float(row[0])), *row[1:]]) for row in rows]
    (folder / "slow.csv").write_text("\n".join([lines[0], *slow]) + "\n")
    assert batch(folder, "-o", target) == 0
    page = (target / "overview.html").read_text()
    assert (
        f"2 recordings, 1 with a result: {len(rows):,} samples, {seconds / 60.0:.1f} minutes"
        in page
    )
    assert "1 without a result, see below" in page


def test_names_in_the_page_are_text(make_recordings: MakeRecordings, tmp_path: Path) -> None:
    folder, target = make_recordings(1), tmp_path / "out"
    (folder / "r0000.csv").rename(folder / "<img src=x onerror=alert(1)>.csv")
    (folder / "b.csv").write_text("</script><script>alert(1)</script>\n")
    assert batch(folder, "-o", target) == 0
    page = (target / "overview.html").read_text()
    assert "<img src=x" not in page
    assert "<script>alert(1)" not in page
    assert "&lt;img src=x onerror=alert(1)&gt;.csv" in page
