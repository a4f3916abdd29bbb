"""Tables that are compressed, come through a pipe, or hold stress and strain."""

from __future__ import annotations

import bz2
import gzip
import lzma
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from hc_logger.convert import csv_to_bag
from hc_logger.csv_file import CsvReader
from hc_logger.errors import BagError
from hc_logger.foreign import open_bag
from hc_logger.recording import has_samples, read_recording

COMPRESS: dict[str, Callable[[bytes], bytes]] = {
    ".gz": gzip.compress,
    ".bz2": bz2.compress,
    ".xz": lzma.compress,
}
TABLE = "".join(f"{k * 1e-3:.3f},{np.sin(k * 0.01):.17g},0.5\n" for k in range(2000)).encode()
HEADER = b"time_s,displacement_mm,force_N\n"


@pytest.mark.parametrize("suffix", COMPRESS)
def test_a_compressed_table_is_read_as_what_is_in_it(tmp_path: Path, suffix: str) -> None:
    """Regression: press.csv.gz had to be unpacked first, which no other reader asks for."""
    plain, packed = tmp_path / "press.csv", tmp_path / f"PRESS.CSV{suffix.upper()}"
    plain.write_bytes(HEADER + TABLE)
    packed.write_bytes(COMPRESS[suffix](HEADER + TABLE))
    expected, read = read_recording(plain), read_recording(packed)
    np.testing.assert_array_equal(read.displacement_mm, expected.displacement_mm)
    np.testing.assert_array_equal(read.time_s, expected.time_s)
    assert csv_to_bag(packed, tmp_path / "bag") == 2000
    for path in (plain, packed):
        with pytest.raises(BagError, match="table in text: make a bag of it"):
            open_bag(path)


@pytest.mark.parametrize("suffix", COMPRESS)
def test_a_compressed_table_that_was_cut_off_is_refused(tmp_path: Path, suffix: str) -> None:
    content = COMPRESS[suffix](HEADER + TABLE)
    path = tmp_path / f"press.csv{suffix}"
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(BagError, match=r"(damaged, cut off|cannot read)"):
        read_recording(path)


@pytest.mark.parametrize("suffix", COMPRESS)
def test_compressed_under_the_name_of_a_plain_table_it_is_read(tmp_path: Path, suffix: str) -> None:
    """Regression: "is not a text file; if it is one in UTF-16, say so"."""
    path = tmp_path / "press.csv"
    path.write_bytes(COMPRESS[suffix](HEADER + TABLE))
    assert len(read_recording(path).time_s) == 2000


def test_what_else_has_the_name_of_a_table_is_called_what_it_is(tmp_path: Path) -> None:
    path = tmp_path / "press.csv"
    for first, said in ((b"\x28\xb5\x2f\xfd", "unzstd"), (b"PK\x03\x04", "archive")):
        path.write_bytes(first + bytes(range(256)))
        with pytest.raises(BagError, match=said):
            read_recording(path)
    path.write_text("BZh,t\n" + HEADER.decode() + TABLE.decode())  # some text
    assert len(read_recording(path).time_s) == 2000


@pytest.mark.parametrize("name", ["press.gz", "press.csv.gz", "press.txt.XZ"])
def test_a_plain_text_named_as_compressed_says_so(tmp_path: Path, name: str) -> None:
    """Regression: "is not an MCAP file"."""
    path = tmp_path / name
    path.write_bytes(HEADER + TABLE)
    said = rf"is not compressed, as {path.suffix.lower()} says: name it as what it is, \.csv"
    with pytest.raises(BagError, match=said):
        read_recording(path)


@pytest.mark.timeout(30)
def test_a_pipe_is_no_recording_and_nobody_waits_for_it(tmp_path: Path) -> None:
    """Regression: a pipe that ends in .csv hung for ever; /dev/stdin and - "did not exist"."""
    pipe = tmp_path / "press.csv"
    os.mkfifo(pipe)
    for path in (pipe, Path("-"), Path("/dev/null")):
        for read in (read_recording, has_samples, CsvReader):
            with pytest.raises(BagError, match=r"pipe or a device.*write it to a file first"):
                read(path)
    with pytest.raises(BagError, match="pipe or a device"):
        open_bag("/dev/null")


def test_bags_of_ros_1_in_mcap_say_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "old.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros1")
        schema = writer.register_schema("std_msgs/Float64", "ros1msg", b"float64 data")
        channel = writer.register_channel("/force", "ros1", schema)
        writer.add_message(channel, 1, bytes(8), 1)
        writer.finish()
    with pytest.raises(BagError, match="as of ROS 1: export them as a CSV"):
        read_recording(path)


def test_files_of_numpy_arrow_and_json_are_called_what_they_are(tmp_path: Path) -> None:
    """Regression: an .npz was "an archive", the others "not an MCAP file"."""
    np.savez(tmp_path / "a.npz", d=np.zeros(3))
    np.save(tmp_path / "a.npy", np.zeros(3))
    (tmp_path / "a.feather").write_bytes(b"ARROW1\0\0" + bytes(300))
    (tmp_path / "a.json").write_text("[]")
    said = {"npz": "arrays of NumPy", "npy": "array of NumPy", "feather": "Arrow", "json": "JSON"}
    for suffix, what in said.items():
        for read in (read_recording, open_bag):
            with pytest.raises(BagError, match=what):
                read(tmp_path / f"a.{suffix}")


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("time_s,displacement_mm,stress_kPa", r"force=3 --units force=mN --input force\.scale="),
        ("Time (s),Extension (mm),Compressive stress (MPa)", r"force=3 --units force=N "),
        ("Zeit;Weg;Druckspannung\ns;mm;Pa", r"force=3 --units force=uN "),
        ("Time (s),Strain (%),Load (N)", r"displacement=2 .*a hundredth of it for %"),
        ("Time (s),Compressive strain (mm/mm),Load (N)", r"position\.scale=HEIGHT, .*in mm$"),
    ],
)
def test_stress_and_strain_say_what_makes_readings_of_them(
    tmp_path: Path, header: str, said: str
) -> None:
    """Regression: it was only said that no column is known to be the force."""
    path = tmp_path / "press.csv"
    table = TABLE.decode().replace(",", ";") if ";" in header else TABLE.decode()
    path.write_text(f"{header}\n{table}")
    with pytest.raises(BagError, match=said):
        read_recording(path)


def test_how_far_a_conversion_is_goes_on_to_its_end(tmp_path: Path) -> None:
    """Regression: after the first block of 65,536 rows everything seemed to be done."""
    path = tmp_path / "press.csv"
    path.write_bytes(HEADER + b"".join(b"%.3f,0.25,0.5\n" % (k * 1e-3) for k in range(200_000)))
    shares: list[float] = []
    csv_to_bag(path, tmp_path / "bag", progress=shares.append)
    assert shares == pytest.approx([0.33, 0.66, 0.98, 1.0], abs=0.02)
