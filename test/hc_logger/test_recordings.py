"""CSV files and bags as recordings: values, bad rows, errors of one line, conversion both ways."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hc_logger.convert import CSV_EPOCH_NS, bag_to_csv, csv_to_bag
from hc_logger.errors import BagError, BagExistsError
from hc_logger.recording import read_recording

DATA = Path(os.environ.get("HC_SHARED_DATA", Path(__file__).parents[3] / "shared" / "data"))
HEADER = "time_s,displacement_mm,force_N\n"


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "has no rows"),
        ("0.0,1.0,2.0\n", "the columns have no names; say it with --columns"),
        ("time_s,displacement_mm,torque_Nm\n0,1,2\n", "no column is known to be the force"),
        (HEADER, "has no rows"),
        (HEADER + "\n\n", "has no rows"),
        (
            HEADER + "0,1,2\n0.1,one,2\n",
            "line 3: displacement_mm is 'one' instead of a number: where a reading is missing",
        ),
        (HEADER + "1.5D-3,1,2\n2.5D-3,1,2\n", "line 2: time_s is '1.5D-3' instead of a number"),
        (HEADER + "0,1,2\n0.1,1\n", "line 3: 2 columns, force_N is number 3"),
    ],
)
def test_a_bad_csv_file_is_one_clear_line(tmp_path: Path, text: str, expected: str) -> None:
    path = write(tmp_path / "bad.csv", text)
    with pytest.raises(BagError) as caught:
        read_recording(path)
    assert expected in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    with pytest.raises(BagError):
        csv_to_bag(path, tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


def test_an_error_far_into_the_file_leaves_no_bag_behind(tmp_path: Path) -> None:
    rows = "".join(f"{i * 1e-3:.3f},1.0,2.0\n" for i in range(70_000))
    path = write(tmp_path / "late.csv", HEADER + rows + "70.0,1.0,oops\n")
    with pytest.raises(BagError, match="line 70002: force_N is 'oops'"):
        csv_to_bag(path, tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


def test_what_is_not_there_or_neither_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "loop.csv").symlink_to("loop.csv")
    with pytest.raises(BagError, match=r"loop\.csv cannot be read: Too many levels of symbolic"):
        read_recording(tmp_path / "loop.csv")
    with pytest.raises(BagError, match="does not exist"):
        read_recording(tmp_path / "none.csv")
    with pytest.raises(BagError, match="neither a CSV file"):
        read_recording(write(tmp_path / "data.pdf", HEADER))
    (tmp_path / "binary.csv").write_bytes(bytes(range(256)))
    with pytest.raises(BagError, match="not a text file"):
        read_recording(tmp_path / "binary.csv")


def test_bad_rows_are_kept_and_counted(tmp_path: Path) -> None:
    path = write(
        tmp_path / "rows.csv",
        "force_N,note,time_s,displacement_mm\n"
        "1.0,a,0.000,0.1\nnan,b,0.001,0.2\n,c,0.002,0.3\n4.0,d,0.002,0.4\n5.0,e,0.001,0.5\n"
        "6.0,f,nan,0.6\ninf,g,0.004,0.7\n",
    )
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.displacement_mm, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7])
    np.testing.assert_array_equal(recording.force_n, [1.0, np.nan, np.nan, 4.0, 5.0, 6.0, np.inf])
    assert recording.findings[:3] == (2, 1, 1)
    assert recording.findings.displacement_alone == 2
    assert len(recording.findings.lines()) == 4
    # through a bag the same rows come out; a time that was NaN repeats the one before
    csv_to_bag(path, tmp_path / "bag")
    again = read_recording(tmp_path / "bag")
    np.testing.assert_array_equal((again.stamps - CSV_EPOCH_NS) // 1_000_000, [0, 1, 2, 2, 1, 1, 4])
    np.testing.assert_array_equal(again.force_n, recording.force_n)
    assert again.findings[:3] == (1, 2, 1)


def test_a_bag_without_samples_says_what_it_has(make_bag: Callable[..., Path]) -> None:
    path = make_bag(count=50)
    with pytest.raises(BagError, match="no topic /nothing; it has /header, /indenter/sample"):
        read_recording(path, topic="nothing")
    empty = make_bag("empty", count=0)
    with pytest.raises(BagError, match="no sample on /indenter/sample"):
        read_recording(empty)


@pytest.mark.parametrize("name", ["palpation_sine_soft.csv", "tissue_ramp_hold_1.csv"])
def test_a_real_recording_survives_both_ways(tmp_path: Path, name: str) -> None:
    source = DATA / name
    if not source.is_file():
        pytest.skip(f"{source} is not there (set HC_SHARED_DATA)")
    shares: list[float] = []
    count = csv_to_bag(source, tmp_path / "bag", progress=shares.append)
    assert bag_to_csv(tmp_path / "bag", tmp_path / "back.csv") == (count, [])
    first, bag, back = (
        read_recording(p) for p in (source, tmp_path / "bag", tmp_path / "back.csv")
    )
    assert count == len(first.time_s) == len(bag.time_s)
    np.testing.assert_allclose(back.time_s, first.time_s, atol=5e-10)
    np.testing.assert_allclose(bag.time_s, first.time_s - first.time_s[0], atol=1e-9)
    for one in (bag, back):
        # metres and back: the last bit may differ
        np.testing.assert_allclose(one.displacement_mm, first.displacement_mm, rtol=3e-16)
        np.testing.assert_array_equal(one.force_n, first.force_n)
    assert shares == sorted(shares)
    assert shares[-1] <= 1.0
    for again in (
        lambda: csv_to_bag(source, tmp_path / "bag"),
        lambda: bag_to_csv(tmp_path / "bag", tmp_path / "back.csv"),
    ):
        with pytest.raises(BagExistsError):
            again()


def test_the_same_file_gives_the_same_bag(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", HEADER + "".join(f"{i / 500},{i},{-i}\n" for i in range(900)))
    csv_to_bag(path, tmp_path / "one" / "bag")
    csv_to_bag(path, tmp_path / "two" / "bag")
    assert (tmp_path / "one/bag/bag_0.mcap").read_bytes() == (
        tmp_path / "two/bag/bag_0.mcap"
    ).read_bytes()


def test_readings_of_both_channels_at_one_time_in_rows_of_their_own_are_no_repeat(
    tmp_path: Path,
) -> None:
    """Regression: that the estimator rejects them was said, and it uses them."""
    path = tmp_path / "own_rows.csv"
    rows = [
        "0,1,",
        "0,,2",
        "0.001,1,2",
        "0.001,,2",
        "0.002,,2",
        "0.002,1,",
        "0.002,1,",
        "0.003,1,2",
    ]
    path.write_text("time_s,displacement_mm,force_N\n" + "\n".join(rows) + "\n")
    findings = read_recording(path).findings
    assert findings.repeated == 2
    assert (findings.force_alone, findings.displacement_alone) == (3, 3)
