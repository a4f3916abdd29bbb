"""What stands between the rows of a table: remarks, and bytes that a crash left."""

from pathlib import Path

import numpy as np
import pytest

from hc_logger.errors import BagError
from hc_logger.recording import read_recording

HEADER = "time_s,displacement_mm,force_N"
ROWS = [f"{0.002 * i:.3f},{0.1 * i:.2f},{0.05 * i:.3f}" for i in range(60)]
PAUSE = "# operator pressed pause"


def written(folder: Path, lines: list[str]) -> Path:
    path = folder / "press.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (
            [HEADER, *ROWS[:30], PAUSE, *ROWS[30:]],
            "remarks stand within the rows (line 32): passed over",
        ),
        (
            [HEADER, PAUSE, *ROWS[:30], PAUSE, "# and went on, after 3 minutes", *ROWS[30:]],
            "remarks stand 2 times within the rows (line 2): passed over",
        ),
    ],
)
def test_remarks_between_the_rows_are_passed_over_and_that_is_said(tmp_path, lines, said):
    """Regression: "line 2: time_s is '# operator pressed pause' instead of a number"."""
    recording = read_recording(written(tmp_path, lines))
    np.testing.assert_allclose(recording.time_s, 0.002 * np.arange(60))
    np.testing.assert_allclose(recording.force_n, 0.05 * np.arange(60))
    assert said in recording.findings.lines()


@pytest.mark.parametrize(
    ("lines", "line"),
    [
        ([HEADER, *ROWS[:30], PAUSE, *ROWS], 32),  # the time begins anew: another run
        ([HEADER, *ROWS[:30], PAUSE, "ERROR 17", *ROWS[30:]], 32),
        ([HEADER, *ROWS[:30], "ERROR 17", PAUSE, *ROWS[30:]], 32),
        ([HEADER, *ROWS[:30], "paused", *ROWS[30:]], 32),
    ],
)
def test_other_text_and_another_run_behind_a_remark_are_not(tmp_path, lines, line):
    with pytest.raises(BagError, match=f"line {line}: time_s is '.*' instead of a number"):
        read_recording(written(tmp_path, lines))


def test_a_header_behind_a_remark_is_a_header(tmp_path):
    lines = [HEADER, *ROWS[:30], "# page 2", HEADER, *ROWS[30:]]
    recording = read_recording(written(tmp_path, lines))
    assert len(recording.time_s) == 60
    assert any("the header comes again" in line for line in recording.findings.lines())
    with pytest.raises(BagError, match="another table begins in line 34"):
        read_recording(written(tmp_path, [HEADER, *ROWS[:30], "# run 2", HEADER, *ROWS]))


def test_zeros_that_a_crash_left_are_called_so(tmp_path):
    """Regression: "is not a text file; if it is one in UTF-16, say so"."""
    path = tmp_path / "press.csv"
    text = "\n".join([HEADER, *ROWS, ""]).encode()
    at = text.index(ROWS[20].encode())
    path.write_bytes(text[:at] + b"\0" * 200 + text[at + 200 :])
    with pytest.raises(BagError, match=r"has 200 zero bytes within its rows \(line 22\)"):
        read_recording(path)
    path.write_bytes(text[:at] + b"\0" * 200 + text[at + 200 : at + 400] + b"\0" + text[at + 400 :])
    with pytest.raises(BagError, match="is not a text file"):
        read_recording(path)
