"""Files of others that are no recordings: what they are is said, and what makes them one."""

from __future__ import annotations

import gzip
import zipfile
from pathlib import Path

import pytest

from hc_logger.errors import BagError
from hc_logger.foreign import open_bag
from hc_logger.recording import read_recording

BEGINNINGS = {
    "old.bag": (b"#ROSBAG V2.0\n", "rosbags-convert --src OLD.bag"),
    "sheet.xls": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "a workbook: save its sheet as CSV"),
    "press.mat": (b"MATLAB 5.0 MAT-file, Platform: GLNXA64", "writetable"),
    "press.h5": (b"\x89HDF\r\n\x1a\n", "HDF5"),
    "press.tdms": (b"TDSm\x0e\x00", "export it as .lvm or CSV"),
    "press.parquet": (b"PAR1", "Parquet"),
    "bag_0": (b"SQLite format 3\x00", "of a bag give the folder"),
    "plain": (b"something else", "is neither a CSV file"),
}


@pytest.mark.parametrize("name", BEGINNINGS)
def test_what_a_file_is_and_what_makes_it_a_recording_is_said(tmp_path: Path, name: str) -> None:
    """Regression: a bag of ROS 1, a workbook, an archive were "not an MCAP file"."""
    first, said = BEGINNINGS[name]
    path = tmp_path / name
    path.write_bytes(first + bytes(range(256)))
    with pytest.raises(BagError, match=said):
        read_recording(path)
    with pytest.raises(BagError, match=said if name != "plain" else "is not an MCAP file"):
        open_bag(path)


def test_archives_are_to_be_unpacked(tmp_path: Path) -> None:
    packed = tmp_path / "press.gz"
    packed.write_bytes(gzip.compress(b"time_s,displacement_mm,force_N\n0,0,0\n"))
    for name, said in (("press.zip", "unzip"), ("press.xlsx", "save its sheet")):
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            archive.writestr("press.csv", "0,0,0")
        with pytest.raises(BagError, match=said):
            read_recording(tmp_path / name)
    with pytest.raises(BagError, match="gunzip -k"):
        read_recording(packed)
