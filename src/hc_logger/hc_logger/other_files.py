"""Files that hold a recording in a form that is not read: what they are, what makes them one."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from hc_logger.compressions import BY_SUFFIX, COMPRESSIONS, compression_of
from hc_logger.errors import BagError

_AS_TABLE: Final = "write its columns as a table with the header time_s,displacement_mm,force_N"
_BEGINNINGS: Final = (
    (
        b"#ROSBAG V",
        "is a bag of ROS 1: rosbags-convert --src OLD.bag --dst NEW (in .venv/bin; pip install "
        "rosbags) makes a folder of it that is read",
    ),
    (b"\xd0\xcf\x11\xe0", "is a workbook: save its sheet as CSV"),
    (b"MATLAB 5", f"holds variables of MATLAB: {_AS_TABLE} (writetable)"),
    (b"\x89HDF", f"is written as HDF5: {_AS_TABLE}"),
    (b"TDSm", "is written as TDMS: export it as .lvm or CSV"),
    (b"PAR1", f"is written as Parquet: {_AS_TABLE}"),
    (b"ARROW1", f"is written as Feather (Arrow): {_AS_TABLE}"),
    (b"\x93NUMPY", f"is an array of NumPy: {_AS_TABLE} (numpy.savetxt)"),
    (b"SQLite format 3", "is a database: of a bag give the folder, with its metadata.yaml"),
)
LONGEST_BEGINNING: Final = max(
    *(len(beginning) for beginning, _ in _BEGINNINGS), *(len(one.begins) for one in COMPRESSIONS)
)
_ARCHIVE: Final = b"PK\x03\x04"
_WORKBOOKS: Final = (".xlsx", ".xlsm", ".ods")
JSON: Final = (
    "is JSON, in which every logger calls its channels otherwise: write a table with the "
    "header time_s,displacement_mm,force_N"
)
_JSON_SUFFIXES: Final = (".json", ".jsonl", ".ndjson")


def check_there(path: Path) -> None:
    """See that there is a file or a folder, which may be read more than once.

    Raises:
        BagError: if there is nothing, a pipe or a device, or it cannot be got at.
    """
    if str(path) == "-" or (path.exists() and not (path.is_file() or path.is_dir())):
        raise BagError(
            f"{path} is a pipe or a device, and a recording is read more than once: write it to a "
            "file first (... > press.csv)"
        )
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        raise BagError(f"{path} does not exist") from None
    except OSError as error:  # links that lead to each other, say
        raise BagError(f"{path} cannot be read: {error.strerror}") from error


def what_it_is(path: str | os.PathLike[str]) -> str:
    """Say by its first bytes what a file is that is no recording; nothing if that is not known.

    Args:
        path: a file that can be read.
    """
    path = Path(path)
    if path.suffix.lower() in _JSON_SUFFIXES:
        return JSON
    with path.open("rb") as file:
        return what_begins_with(file.read(LONGEST_BEGINNING), path.suffix.lower())


def what_begins_with(first: bytes, suffix: str = "") -> str:
    """Say the same of first bytes, `LONGEST_BEGINNING` or all.

    Args:
        first: of the file.
        suffix: in small letters, of its name if it has one.
    """
    packed = compression_of(first)
    if packed is not None:
        or_name = f", or name it as a table, .csv{packed.suffix}" if packed.opener else ""
        return f"is compressed: unpack it first ({packed.unpack}){or_name}"
    if first.startswith(_ARCHIVE):
        if suffix in _WORKBOOKS:
            return "is a workbook: save its sheet as CSV"
        if suffix == ".npz":
            return f"holds arrays of NumPy: {_AS_TABLE} (numpy.savetxt)"
        return "is an archive: unpack it first (unzip)"
    said = next((said for beginning, said in _BEGINNINGS if first.startswith(beginning)), "")
    if not said and suffix in BY_SUFFIX:
        return f"is not compressed, as {suffix} says: name it as what it is, .csv for a table"
    return said
