"""CSV files that others export from bags: fields of messages, and their stamps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from table_text import DEPTH, FORCE, TIME, rows, write

from hc_logger.csv_options import CsvOptions
from hc_logger.errors import BagError
from hc_logger.recording import read_recording

NANO = [divmod(1_700_000_000_000_000_000 + 2_000_000 * k, 10**9) for k in range(60)]


@pytest.mark.parametrize("join", [".", "_", "/"])
def test_fields_of_messages_are_known_with_their_unit_and_both_parts_of_the_stamp(
    tmp_path: Path, join: str
) -> None:
    """Regression: an export of a bag had no time that one could name."""
    names = "index,header.stamp.sec,header.stamp.nanosec,wrench.force.x,wrench.force.z,"
    names = (names + "pose.position.x,pose.position.z").replace(".", join)
    table = rows(
        "{},{},{},0.1,{:.5f},0.4,{:.8f}", range(60), *zip(*NANO, strict=True), FORCE, DEPTH * 1e-3
    )
    recording = read_recording(write(tmp_path / "bag.csv", f"{names}\n{table}"))
    np.testing.assert_allclose(recording.time_s - recording.time_s[0], TIME, atol=1e-6)
    np.testing.assert_allclose(recording.displacement_mm, DEPTH, atol=1e-4)
    np.testing.assert_allclose(recording.force_n, FORCE, atol=1e-5)
    assert f"header{join}stamp{join}nanosec together are the time" in str(recording.findings.notes)


def test_both_parts_of_a_stamp_can_be_named_and_missing_readings_stay_missing(
    tmp_path: Path,
) -> None:
    table = rows("{};{};{:.5f};{:.8f}", *zip(*NANO, strict=True), FORCE, DEPTH, decimal=",")
    table = table.replace(f"{DEPTH[7]:.8f}".replace(".", ","), "NaN")  # read cell by cell
    options = CsvOptions(
        columns={"time": "1+2", "force": "3", "displacement": "4"},
        units={"force": "N", "displacement": "mm"},
    )
    recording = read_recording(write(tmp_path / "bare.csv", table), csv_options=options)
    np.testing.assert_allclose(recording.time_s - recording.time_s[0], TIME, atol=1e-6)
    assert np.flatnonzero(np.isnan(recording.displacement_mm)).tolist() == [7]


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
@pytest.mark.parametrize("name", ["timestamp", "t_unix", "__time", "ros_time"])
def test_a_time_since_1970_says_its_unit_by_its_size(
    tmp_path: Path, name: str, unit: str, factor: float
) -> None:
    stamps = [
        f"{(1.7e9 + t):.6f}" if unit == "s" else f"{int(1.7e9 * factor) + round(t * factor)}"
        for t in TIME
    ]
    path = write(
        tmp_path / "epoch.csv",
        f"{name},z_mm,fz_N\n" + rows("{},{:.4f},{:.5f}", stamps, DEPTH, FORCE),
    )
    recording = read_recording(path)
    np.testing.assert_allclose(recording.time_s - recording.time_s[0], TIME, atol=1e-6)
    assert f"has no unit: taken for the time since 1970 in {unit}" in str(recording.findings.notes)


@pytest.mark.parametrize("missing", ["", "NaN", "-"])
def test_topics_that_were_joined_by_their_times_are_read(tmp_path: Path, missing: str) -> None:
    """Regression: of PlotJuggler's exports no row holds both, and "no rows of three numbers"."""
    names = "__time,/ft/wrench/force/z,/arm/pose/position/z\n"
    lines = [
        line
        for t, d, f in zip(TIME, DEPTH, FORCE, strict=True)
        for line in (
            f"{1.7e9 + t:.6f},{f:.5f},{missing}\n",
            f"{1.7e9 + t + 7e-4:.6f},{missing},{d * 1e-3:.8f}\n",
        )
    ]
    recording = read_recording(write(tmp_path / "joined.csv", names + "".join(lines)))
    force = np.isfinite(recording.force_n)
    np.testing.assert_allclose(recording.force_n[force], FORCE, atol=1e-5)
    np.testing.assert_allclose(recording.displacement_mm[~force], DEPTH, atol=1e-4)
    assert np.isnan(recording.displacement_mm[force]).all()


def test_a_column_that_is_always_empty_is_no_quantity(tmp_path: Path) -> None:
    lines = [f"{t:.4f},{f:.5f},\n" for t, f in zip(TIME, FORCE, strict=True)]
    path = write(tmp_path / "two.csv", "time_s,force_N,note\n" + "".join(lines))
    with pytest.raises(BagError, match="displacement is missing"):
        read_recording(path)
